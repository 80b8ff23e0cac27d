//! Scenes that are legal, and the numbers that come out of them.

use std::f64::consts::PI;
use std::fmt::Write as _;

use super::GOOD;
use glam::{DVec3, dvec3};
use photile::lights::PointLight;
use photile::materials::Material;
use photile::scene::{Scene, load, parse};
use photile::settings::{LightMode, Method};
use photile::shapes::{Plane, Sphere};
use proptest::prelude::*;

#[track_caller]
fn accepts(text: &str) -> Scene {
    parse(text, "scenes/x.toml").unwrap_or_else(|error| panic!("{error}\nin:\n{text}"))
}

#[test]
fn one_of_everything() {
    let scene = accepts(GOOD);
    assert_eq!(scene.name, "x");
    assert_eq!(scene.camera.position, dvec3(0.0, 1.0, 5.0));
    assert_eq!(scene.camera.look_at, DVec3::ZERO);
    assert_eq!(scene.camera.fov_y, 53.13);
    assert_eq!(
        scene.materials,
        [Material {
            name: "white".into(),
            color: dvec3(0.9, 0.9, 0.8),
            diffuse: 0.5,
            specular: 0.25,
            roughness: 0.2,
            transmission: 0.0,
            ior: 1.5,
            ambient: 0.0,
        }]
    );
    let light = PointLight { position: dvec3(0.0, 3.0, 0.0), intensity: dvec3(10.0, 20.0, 30.0) };
    assert_eq!(scene.lights.points, [light]);
    assert_eq!(scene.shapes.spheres, [Sphere { center: dvec3(0.0, 1.0, 0.0), radius: 1.0, material: 0 }]);
    // 2y = −1 is the plane y = −1/2.
    assert_eq!(scene.shapes.planes, [Plane { normal: DVec3::Y, offset: -0.5, material: 0 }]);
    let render = scene.render;
    assert_eq!(render.size, Some((640, 480)));
    assert_eq!((render.photons, render.passes), (Some(200_000), Some(4)));
    assert_eq!((render.radius, render.exposure), (Some(0.25), Some(-1.5)));
    assert_eq!((render.gather, render.light), (Some(Method::TiledGrid), Some(LightMode::Hybrid)));
}

#[test]
fn defaults() {
    let scene = accepts(
        "[camera]\nposition = [0, 0, 1]\nlook_at = [0, 0, 0]\n[materials.z]\ncolor = [1, 1, 1]\n\
         [materials.a]\ncolor = [0, 0, 0]\nspecular = 0.3\nroughness = 0.1\n",
    );
    assert_eq!(scene.camera.up, DVec3::Y);
    assert_eq!(scene.camera.fov_y, 45.0);
    let [z, a] = &scene.materials[..] else { panic!("two materials") };
    // The file's order, not the alphabet's.
    assert_eq!((z.name.as_str(), a.name.as_str()), ("z", "a"));
    assert_eq!((z.diffuse, z.specular, z.roughness, z.transmission), (1.0, 0.0, 0.0, 0.0));
    assert_eq!((z.ior, z.ambient), (1.5, 0.0));
    assert_eq!(a.diffuse, 0.7);
    assert_eq!(scene.render, Default::default());
}

#[test]
fn scenes_may_lack_lights_or_objects() {
    let without = |tables: &[&str]| {
        GOOD.split("\n\n")
            .filter(|block| !tables.iter().any(|table| block.starts_with(table)))
            .collect::<Vec<_>>()
            .join("\n\n")
    };
    assert!(accepts(&without(&["[[lights]]"])).lights.is_empty());
    assert!(accepts(&without(&["[[spheres]]"])).shapes.spheres.is_empty());
    assert!(accepts(&without(&["[[planes]]"])).shapes.planes.is_empty());
    let bare = accepts(&without(&["[[lights]]", "[[spheres]]", "[[planes]]", "[materials", "[render]"]));
    assert!(bare.shapes.spheres.is_empty() && bare.shapes.planes.is_empty() && bare.materials.is_empty());
    assert!(accepts(&format!("lights = []\n{}", without(&["[[lights]]"]))).lights.is_empty());
}

#[test]
fn extremes_that_are_legal() {
    let with = |from: &str, to: &str| {
        assert!(GOOD.contains(from));
        accepts(&GOOD.replace(from, to))
    };
    assert_eq!(with("10, 20, 30", "1e30, 1e-30, 0").lights.points[0].intensity, dvec3(1e30, 1e-30, 0.0));
    assert_eq!(with("[[lights]]\n", "[[lights]]\nkind = \"point\"\n").lights, accepts(GOOD).lights);
    assert_eq!(with("53.13", "0.01").camera.fov_y, 0.01);
    assert_eq!(with("53.13", "179.9").camera.fov_y, 179.9);
    assert_eq!(with("radius = 1.0", "radius = 1e15").shapes.spheres[0].radius, 1e15);
    assert_eq!(with("[0.9, 0.9, 0.8]", "[0, 1, 1.0]").materials[0].color, dvec3(0.0, 1.0, 1.0));
    // 0.1 + 0.2 + 0.7 and others exceed 1 by an ulp.
    with("diffuse = 0.5\nspecular = 0.25", "diffuse = 0.9000000000000001\nspecular = 0.1");
    // A normal whose squares vanish in f64, and one that is merely long.
    assert_eq!(with("[0, 2, 0]\noffset = -1", "[0, 0, 1e-300]\noffset = 0").shapes.planes[0].normal, DVec3::Z);
    let plane = &with("[0, 2, 0]\noffset = -1", "[3e9, 4e9, 0]\noffset = 5e9").shapes.planes[0];
    assert!((plane.normal - dvec3(0.6, 0.8, 0.0)).length() < 1e-15 && (plane.offset - 1.0).abs() < 1e-15);
    // Integers in other bases, a byte order mark, Windows line ends, inline and dotted tables.
    assert_eq!(with("size = [640, 480]", "size = [0x280, 480]").render.size, Some((640, 480)));
    assert_eq!(with("radius = 1.0", "radius = 0b11").shapes.spheres[0].radius, 3.0);
    assert_eq!(accepts(&format!("\u{feff}{GOOD}")), accepts(GOOD));
    assert_eq!(accepts(&GOOD.replace('\n', "\r\n")), accepts(GOOD));
    let inline = "camera.position = [0, 0, 1]\ncamera.look_at = [0, 0, 0]\nmaterials = { m = { color = [1, 0, 0] } }\n\
                  spheres = [{ center = [0, 0, 0], radius = 2, material = \"m\" }]";
    assert_eq!(accepts(inline).shapes.spheres[0].radius, 2.0);
}

fn shipped(name: &str) -> Scene {
    let path = format!("{}/scenes/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    load(path.as_ref()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn every_shipped_scene_loads() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            load(&path).unwrap_or_else(|error| panic!("{error}"));
            count += 1;
        }
    }
    assert!(count >= 7, "{count} scenes in {folder}");
}

#[test]
fn reference_room_has_the_reports_numbers() {
    let scene = shipped("gi_ref");
    assert_eq!((scene.shapes.spheres.len(), scene.shapes.planes.len(), scene.lights.points.len()), (2, 6, 1));
    assert_eq!(scene.camera.fov_y, 53.13);
    // The report states the light's flux: 600 W per channel.
    assert!((4.0 * PI * scene.lights.points[0].intensity.x - 600.0).abs() < 0.1);
    // Camera, light and spheres are inside: on the side of each wall where the others are.
    for plane in &scene.shapes.planes {
        let side = |p: DVec3| plane.normal.dot(p) - plane.offset;
        let inside = side(scene.lights.points[0].position).signum();
        assert_eq!(side(scene.camera.position).signum(), inside);
        for sphere in &scene.shapes.spheres {
            assert!(side(sphere.center) * inside >= sphere.radius - 1e-12);
        }
    }
    let red = &scene.materials[scene.shapes.planes[4].material];
    assert_eq!((red.name.as_str(), red.color, red.diffuse), ("red", dvec3(1.0, 0.2, 0.2), 1.0));
    assert_eq!(shipped("sphere_and_plane").materials[1].diffuse, 0.4);
    assert_eq!(shipped("gi_two_lights").lights.points[1].intensity, dvec3(24.0, 20.0, 6.0));
    assert_eq!(shipped("color_bleeding").shapes.planes.len(), 6);
    // The furnace's answer of 1 needs I = π at 1 m, and the camera off the centre to mean anything.
    let furnace = shipped("furnace");
    assert_eq!((furnace.shapes.spheres[0].radius, furnace.lights.points[0].intensity.x), (1.0, PI));
    assert!(furnace.camera.position.length() > 0.1 && furnace.camera.position.length() < 0.9);
}

/// Prints how long 100,000 spheres take: `cargo test --release -- --ignored --nocapture hundred_thousand`.
#[test]
#[ignore = "prints a time, tests none"]
fn hundred_thousand_spheres() {
    let mut tables = GOOD.to_owned();
    let mut inline = "spheres = [\n".to_owned();
    for i in 0..100_000 {
        let [x, y, z] = [0.123456, 0.654321, 0.314159].map(|k| (k * f64::from(i)).fract() * 100.0);
        let sphere =
            [format!("center = [{x:.6}, {y:.6}, {z:.6}]"), "radius = 0.05".into(), "material = \"white\"".into()];
        writeln!(tables, "[[spheres]]\n{}\n", sphere.join("\n")).unwrap();
        writeln!(inline, "  {{ {} }},", sphere.join(", ")).unwrap();
    }
    let inline = format!("{inline}]\n{}", GOOD.split("[[spheres]]").next().unwrap());
    for (form, text) in [("[[spheres]]", tables), ("inline", inline)] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("many.toml");
        std::fs::write(&path, &text).unwrap();
        let mut times: Vec<_> = (0..7)
            .map(|_| {
                let start = std::time::Instant::now();
                assert!(load(&path).unwrap().shapes.spheres.len() >= 100_000);
                start.elapsed()
            })
            .collect();
        times.sort();
        println!("{form}: {:.1} MB, median {:?}, slowest {:?}", text.len() as f64 / 1e6, times[3], times[6]);
    }
}

fn vector(range: std::ops::Range<f64>) -> impl Strategy<Value = DVec3> {
    [range.clone(), range.clone(), range].prop_map(DVec3::from)
}

fn written(v: DVec3) -> String {
    // `{:?}` prints the shortest text that reads back as the same f64.
    format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z)
}

proptest! {
    /// What is written comes back bit by bit, through any decimal notation of it.
    #[test]
    fn values_survive_the_file(
        lights in prop::collection::vec((vector(-1e15..1e15), vector(0.0..1e30)), 0..4),
        spheres in prop::collection::vec((vector(-1e3..1e3), 1e-15..1e15, 0..3usize), 0..6),
        color in vector(0.0..1.0),
        specular in 0.0..1.0,
    ) {
        let mut text = "[camera]\nposition = [0, 0, 1]\nlook_at = [0, 0, 0]\n".to_owned();
        for name in ["c", "a", "b"] {
            writeln!(text, "[materials.{name}]\ncolor = {}\nroughness = 0.5\nspecular = {specular:?}", written(color)).unwrap();
        }
        for (position, intensity) in &lights {
            writeln!(text, "[[lights]]\nposition = {}\nintensity = {}", written(*position), written(*intensity)).unwrap();
        }
        for (center, radius, material) in &spheres {
            let name = ["c", "a", "b"][*material];
            writeln!(text, "[[spheres]]\nmaterial = '{name}'\nradius = {radius:e}\ncenter = {}", written(*center)).unwrap();
        }
        let scene = parse(&text, "x").map_err(|error| TestCaseError::fail(error.to_string()))?;
        let read: Vec<_> = scene.lights.points.iter().map(|light| (light.position, light.intensity)).collect();
        prop_assert_eq!(read, lights);
        let read: Vec<_> = scene.shapes.spheres.iter().map(|s| (s.center, s.radius, s.material)).collect();
        prop_assert_eq!(read, spheres);
        prop_assert_eq!(scene.materials[1].color, color);
        prop_assert_eq!(scene.materials[1].diffuse, 1.0 - specular);
    }

    /// A plane contains the same points whatever length its normal was given.
    #[test]
    fn planes_keep_their_points(normal in vector(-1.0..1.0), scale in -12..12, offset in -10.0..10.0) {
        prop_assume!(normal.length() > 0.1);
        let normal: DVec3 = normal * 10f64.powi(scale);
        let offset: f64 = offset * 10f64.powi(scale);
        let text = format!(
            "[camera]\nposition = [0, 0, 1]\nlook_at = [0, 0, 0]\n[materials.m]\ncolor = [1, 1, 1]\n\
             [[planes]]\nnormal = {}\noffset = {offset:?}\nmaterial = 'm'", written(normal));
        let scene = parse(&text, "x").map_err(|error| TestCaseError::fail(error.to_string()))?;
        let plane = &scene.shapes.planes[0];
        prop_assert!((plane.normal.length() - 1.0).abs() < 1e-15);
        // The foot of the perpendicular from the origin solves the equation as written.
        let foot = plane.normal * plane.offset;
        prop_assert!((normal.dot(foot) - offset).abs() <= 1e-14 * (offset.abs() + normal.length()));
    }
}
