//! Every program that some scene leads to compiles, and a broken one says where.

use std::collections::{BTreeSet, HashSet};

use glam::DVec3;
use photile::device::cl;
use photile::device::gl::{Headless, Program};
use photile::error::Error;
use photile::kinds::ShapeKind;
use photile::lights::{self, PointLight};
use photile::materials::Material;
use photile::program::features::{Features, Lights};
use photile::program::source::{Options, assemble, assemble_text};
use photile::scene::{Camera, RenderDefaults, Scene};
use photile::settings::{LightMode, Settings};
use photile::shapes::{Plane, Quad, Shapes, Sphere};
use proptest::prelude::*;
use proptest::strategy::ValueTree;

use crate::common::{direct, missing, one_at_a_time};

fn opengl() -> Option<Headless> {
    one_at_a_time();
    Headless::new().map_err(|error| missing("OpenGL", &error)).ok()
}

fn opencl() -> Option<cl::Context> {
    one_at_a_time();
    let device = cl::devices(None).and_then(|mut devices| cl::Context::new(devices.remove(0)));
    device.map_err(|error| missing("OpenCL", &error)).ok()
}

/// The choices of a permutation as small numbers.
fn choices(features: &Features) -> [u8; 9] {
    let lights = match features.lights {
        Lights::None => 0,
        Lights::One => 1,
        Lights::Many => 2,
    };
    let flags = [
        features.shapes.has(ShapeKind::Sphere),
        features.shapes.has(ShapeKind::Plane),
        features.shadows.has(ShapeKind::Plane),
        features.two_sided,
        features.glossy,
        features.ambient,
        features.one_sample,
        features.counts.is_some(),
    ];
    let [a, b, c, d, e, f, g, h] = flags.map(u8::from);
    [a, b, lights, c, d, e, f, g, h]
}

/// All combinations of `strength` of a permutation's choices: (which, what) each.
fn combinations(features: &Features, strength: u32) -> BTreeSet<Vec<(usize, u8)>> {
    let choices = choices(features);
    let subsets = (0u32..1 << choices.len()).filter(|subset| subset.count_ones() == strength);
    subsets
        .map(|subset| (0..choices.len()).filter(|i| subset >> i & 1 == 1).map(|i| (i, choices[i])).collect())
        .collect()
}

/// A few of the permutations that together have every reachable combination of `strength` choices: what breaks a
/// program is mostly two or three features that meet (Kuhn et al. 2004 found no fault of more than six).
fn covering(all: &[Features], strength: u32) -> Vec<Features> {
    let mut open: BTreeSet<_> = all.iter().flat_map(|features| combinations(features, strength)).collect();
    let mut chosen = Vec::new();
    while !open.is_empty() {
        let gain = |features: &&Features| combinations(features, strength).intersection(&open).count();
        let best = *all.iter().max_by_key(gain).expect("a combination comes from some permutation");
        combinations(&best, strength).iter().for_each(|combination| {
            open.remove(combination);
        });
        chosen.push(best);
    }
    chosen
}

#[test]
fn opengl_compiles_every_permutation() {
    let Some(context) = opengl() else { return };
    let all = Features::reachable();
    assert!(all.len() > 150 && all.iter().collect::<HashSet<_>>().len() == all.len());
    for features in &all {
        let source = assemble("trace.frag", Some(features), &Options::default());
        Program::new(&context.gl, &source).unwrap_or_else(|error| panic!("{error}"));
    }
}

#[test]
fn opencl_compiles_every_combination_of_features() {
    // All of them on both lane widths take PoCL minutes: at the device's own width every three features that can meet,
    // and for GPUs' one lane, which has only the vocabulary of `shim.cl` for itself, every two.
    let Some(context) = opencl() else { return };
    let all: Vec<Features> = Features::reachable().into_iter().filter(|features| features.in_uniforms).collect();
    for (lanes, strength) in [(context.device.lanes, 3), (1, 2)] {
        let chosen = covering(&all, strength);
        assert!(chosen.len() >= 6, "{}", chosen.len());
        for features in &chosen {
            let source = assemble("trace.cl", Some(features), &Options { lanes, ..Options::default() });
            context.kernel(&source, "trace").unwrap_or_else(|error| panic!("{error}"));
        }
        eprintln!("{} permutations of {lanes} lanes", chosen.len());
    }
}

#[test]
fn kernels_do_not_know_uniforms() {
    // So half of the permutations are the same kernel, and the test above may leave them out.
    for features in Features::reachable() {
        let text = assemble("trace.cl", Some(&features), &Options::default()).text;
        let uses = text.lines().filter(|line| line.contains("SCENE_IN_UNIFORMS") && !line.starts_with("#define"));
        assert_eq!(uses.count(), 0);
    }
}

/// A build error's words, which must name the unit.
#[track_caller]
fn refused(result: Result<(), Error>, unit: &str) -> String {
    let error = result.expect_err("a broken source must not build");
    assert!(matches!(&error, Error::Build { unit: found, .. } if found == unit), "{error}");
    assert_eq!(error.exit_code(), 1);
    error.to_string()
}

/// Where `text` stands in an embedded file, as `file:line:`.
fn place(folder: &str, file: &str, text: &str) -> String {
    let path = format!("{}/{folder}/{file}", env!("CARGO_MANIFEST_DIR"));
    let source = std::fs::read_to_string(path).unwrap();
    let line = source.lines().position(|line| line.contains(text)).unwrap_or_else(|| panic!("no {text} in {file}"));
    format!("{file}:{}:", line + 1)
}

#[test]
fn a_broken_source_is_named_with_its_line() {
    // Renaming a function to a number breaks the line that declares it, in a file that both languages include.
    let all = Features::reachable();
    let features = all
        .iter()
        .find(|features| !features.one_sample && features.glossy && features.shapes.has(ShapeKind::Plane))
        .unwrap();
    let options = Options { defines: vec!["owen_scramble 1".into()], ..Options::default() };
    let broken = place("glsl", "shared/random.glsl", "Uint owen_scramble(");
    let own = "#include \"shim.glsl\"\nout vec4 film;\nvoid main() { film = vec4(nope); }\n";
    let own_kernel = "#include \"shim.cl\"\n__kernel void broken(__global int *x) {\n    x[0] = nope;\n}\n";
    if let Some(context) = opengl() {
        let build = |source| Program::new(&context.gl, &source).map(|_| ());
        let error = refused(build(assemble("trace.frag", Some(features), &options)), "trace.frag");
        assert!(error.contains(&broken) && error.contains("HAS_GLOSSY"), "{error}");
        let error = refused(build(assemble_text("own.frag", own, &Options::default())), "own.frag");
        assert!(error.contains("own.frag:3:") && error.contains("nope"), "{error}");
    }
    if let Some(context) = opencl() {
        let build = |source, name| context.kernel(&source, name).map(|_| ());
        let error = refused(build(assemble("trace.cl", Some(features), &options), "trace"), "trace.cl");
        assert!(error.contains(&broken) && error.contains("HAS_GLOSSY"), "{error}");
        let error = refused(build(assemble_text("own.cl", own_kernel, &Options::default()), "broken"), "own.cl");
        assert!(error.contains("own.cl:3:") && error.contains("nope"), "{error}");
    }
}

fn vector() -> impl Strategy<Value = DVec3> {
    [-3.0..3.0f64, -3.0..3.0, -3.0..3.0].prop_map(DVec3::from)
}

prop_compose! {
    fn material()(specular in prop_oneof![Just(0.0), Just(0.5)], ambient in prop_oneof![Just(0.0), Just(0.1)],
                  color in prop_oneof![Just(DVec3::ZERO), Just(DVec3::ONE)]) -> Material {
        Material { name: "m".into(), color, diffuse: 0.5, specular, roughness: 0.3, transmission: 0.0, ior: 1.5, ambient }
    }
}

prop_compose! {
    fn any_scene()(materials in prop::collection::vec(material(), 1..4),
                   lights in prop_oneof![Just(0..3usize), Just(0..20)].prop_flat_map(|n| prop::collection::vec(vector(), n)),
                   spheres in prop_oneof![Just(0..3usize), Just(0..40)].prop_flat_map(|n| prop::collection::vec(vector(), n)),
                   planes in prop::collection::vec((vector(), -3.0..3.0), 0..4),
                   quads in prop_oneof![Just(0..1usize), Just(0..3), Just(0..20)].prop_flat_map(|n| prop::collection::vec(vector(), n)),
                   position in vector()) -> Scene {
        let count = materials.len();
        Scene {
            name: "random".into(),
            camera: Camera { position, look_at: position - DVec3::Z, up: DVec3::Y, fov_y: 45.0 },
            materials,
            lights: lights::Lights {
                points: lights.into_iter().map(|position| PointLight { position, intensity: DVec3::ONE }).collect(),
            },
            shapes: Shapes {
            spheres: spheres.into_iter().enumerate()
                .map(|(i, center)| Sphere { center, radius: 1.0, material: i % count }).collect(),
            planes: planes.into_iter().enumerate()
                .map(|(i, (normal, offset))| Plane { normal: (normal + DVec3::splat(1e-9)).normalize(), offset, material: i % count })
                .collect(),
            quads: quads.into_iter().map(|corner| Quad { corner, edges: [DVec3::X, DVec3::Y], material: 0 }).collect(),
            },
            render: RenderDefaults::default(),
        }
    }
}

/// What stands for these features in the list: any few objects count as two.
fn listed(features: Features) -> Features {
    Features { counts: features.counts.map(|counts| counts.map(|n| 2 * n.min(1))), ..features }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

    /// The list that the tests above compile has all that any scene leads to.
    #[test]
    fn every_scene_has_a_listed_permutation(scene in any_scene(), samples in 1..3u32, light in 0..3usize) {
        let light = [LightMode::Direct, LightMode::Hybrid, LightMode::Photons][light];
        let features = listed(Features::of(&scene, &Settings { light, ..direct(8, 8, samples) }));
        prop_assert!(Features::reachable().contains(&features), "{features:?}");
    }
}

#[test]
fn random_scenes_reach_most_permutations() {
    // Else the property above would hold for want of variety.
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let mut seen = HashSet::new();
    for i in 0..6000 {
        let scene = any_scene().new_tree(&mut runner).unwrap().current();
        seen.insert(listed(Features::of(&scene, &direct(8, 8, 1 + i % 2))));
    }
    // Some are rare: no spheres, 17 lights or more. With direct light only, glossy needs a light.
    assert!(seen.len() > 100, "{}", seen.len());
}
