//! What a scene and its settings need. All else is neither compiled, allocated, launched nor uploaded.
//!
//! A feature says "the scene has X" and is a `#define`; numbers that change often stay uniforms.

use glam::DVec3;

use crate::kinds::{KindName, SHAPE_KINDS, ShapeKind, ShapeSet};
use crate::records::{LIGHTS_IN_UNIFORMS, QUADS_IN_UNIFORMS, SHAPES_IN_UNIFORMS};
use crate::scene::Scene;
use crate::settings::{LightMode, Pass, Settings};
use crate::shapes::{Shape, Shapes};

/// So many objects are few enough to be counted in the program's text: loops over them are unrolled, and ask for records
/// at places known beforehand. On two cores direct light takes a sixth less in OpenCL, and 30 to 50% less in software OpenGL;
/// counting 1M paths of gi_ref on an H200 takes 0.12 ms instead of 0.17. OpenGL on GPUs keeps its counters: on an H100
/// rooms are gathered 7% faster without them, but sphere_and_plane 30 to 40% slower.
pub const FEW_SHAPES: usize = 12;

/// How many lights the code is made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Lights {
    /// No light: no shading code.
    None,
    /// One light: no loop.
    One,
    /// A loop over a uniform count.
    Many,
}

/// A permutation of the programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Features {
    /// Kinds of shapes that there are.
    pub shapes: ShapeSet,
    /// Lights that reach a shaded surface.
    pub lights: Lights,
    /// Kinds of shapes of which some may come between a visible point and a light.
    pub shadows: ShapeSet,
    /// Rays may meet a plane from behind or a sphere from within.
    pub two_sided: bool,
    /// Some material has a GGX lobe.
    pub glossy: bool,
    /// Some material adds ambient radiance.
    pub ambient: bool,
    /// One sample per pixel: no sampling pattern.
    pub one_sample: bool,
    /// The scene's records fit into GL's uniforms; OpenCL has no use for it.
    pub in_uniforms: bool,
    /// How many shapes of each kind there are, where they are few: at most [`FEW_SHAPES`] together.
    pub counts: Option<[u32; SHAPE_KINDS.len()]>,
}

/// One line of `photile plan`: a feature, whether it is used, and why.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Reason {
    /// The `#define`, or the stage.
    pub feature: String,
    /// Whether the program contains it.
    pub used: bool,
    /// In the scene's own numbers.
    pub why: String,
}

impl Features {
    /// What this scene needs at these settings.
    pub fn of(scene: &Scene, settings: &Settings) -> Features {
        Self::explain(scene, settings).0
    }

    /// The same, with a reason for each line.
    pub fn explain(scene: &Scene, settings: &Settings) -> (Features, Vec<Reason>) {
        let shapes = scene.shapes.len();
        let kinds = scene.shapes.kinds();
        let used_materials = || scene.shapes.iter().map(|shape| &scene.materials[shape.material()]);
        let glossy = used_materials().filter(|m| m.specular > 0.0).count();
        let ambient = used_materials().filter(|m| m.ambient > 0.0 && m.color != DVec3::ZERO).count();
        // Where photons carry all light, nothing is lit by shadow rays.
        let photons_only = settings.light == LightMode::Photons;
        let lights = if shapes == 0 || photons_only { 0 } else { scene.lights.len() };
        let (camera, origins) = (scene.camera.position, scene.lights.origins());
        let blocking = kinds.map(|kind| match lights {
            0 => 0,
            _ => kind.iter().filter(|shape| shape.may_shadow(camera, &origins)).count(),
        });
        let two_sided = two_sided(scene, Some(camera)).filter(|_| shapes > 0);

        let features = Features {
            shapes: ShapeSet::those(|kind| kinds[kind as usize].count() > 0),
            lights: match lights {
                0 => Lights::None,
                1 => Lights::One,
                _ => Lights::Many,
            },
            shadows: ShapeSet::those(|kind| blocking[kind as usize] > 0),
            two_sided: two_sided.is_some(),
            glossy: glossy > 0 && !scene.lights.is_empty(),
            ambient: ambient > 0,
            one_sample: settings.samples == 1,
            in_uniforms: shapes <= SHAPES_IN_UNIFORMS
                && scene.shapes.quads.len() <= QUADS_IN_UNIFORMS
                && scene.lights.len() <= LIGHTS_IN_UNIFORMS,
            counts: (1..=FEW_SHAPES).contains(&shapes).then_some(kinds.map(|kind| kind.count() as u32)),
        };
        let reason = |feature: &str, used, why| Reason { feature: feature.into(), used, why };
        let all = |kind: ShapeKind| format!("{} {}", kinds[kind as usize].count(), kind.name().plural);
        let of_kinds = |name: fn(&KindName) -> String, set: ShapeSet, why: &dyn Fn(ShapeKind) -> String| {
            ShapeKind::ALL.map(|kind| reason(&name(kind.name()), set.has(kind), why(kind)))
        };
        let shadows_said =
            |kind: ShapeKind| (kinds[kind as usize].shadows_said)(blocking[kind as usize], &all(kind), lights);
        let mut reasons = of_kinds(KindName::has, features.shapes, &all).to_vec();
        reasons.extend([
            reason(
                "HAS_LIGHTS",
                lights > 0,
                match photons_only {
                    true => "photons carry all light".into(),
                    false => format!("{} lights, {shapes} objects", scene.lights.len()),
                },
            ),
            reason("ONE_LIGHT", lights == 1, format!("{lights} lights to loop over")),
        ]);
        reasons.extend(of_kinds(KindName::shadows, features.shadows, &shadows_said));
        reasons.extend([
            reason(
                "HAS_TWO_SIDED",
                features.two_sided,
                two_sided.unwrap_or_else(|| "camera and lights are outside of all objects, on one side of each".into()),
            ),
            reason("HAS_GLOSSY", features.glossy, format!("{glossy} objects with specular > 0")),
            reason("HAS_AMBIENT", features.ambient, format!("{ambient} objects with ambient > 0")),
            reason("ONE_SAMPLE", features.one_sample, format!("{} samples per pixel", settings.samples)),
            reason(
                "SCENE_IN_UNIFORMS",
                features.in_uniforms,
                format!("up to {SHAPES_IN_UNIFORMS} objects and {LIGHTS_IN_UNIFORMS} lights need no texture in OpenGL"),
            ),
            reason(
                &SHAPE_KINDS[0].count(),
                features.counts.is_some(),
                format!("loops over up to {FEW_SHAPES} objects are unrolled, but by OpenGL on GPUs"),
            ),
        ]);
        (features, reasons)
    }

    /// Whether shapes of a kind may come between a visible point and a light.
    pub fn casts_shadows(&self, kind: ShapeKind) -> bool {
        self.shadows.has(kind)
    }

    /// The same for the photons' walks, which know nothing of the camera: a map must not depend on where it was when
    /// the map was made.
    pub fn of_photons(&self, scene: &Scene) -> Features {
        Features { two_sided: two_sided(scene, None).is_some(), ..*self }
    }

    /// The same for one of many passes, whose only sample is not the pixel's centre.
    pub fn of_pass(&self, pass: &Pass) -> Features {
        Features { one_sample: self.one_sample && !pass.jittered, ..*self }
    }

    /// The `#define`s of this permutation, in a fixed order.
    pub fn defines(&self) -> Vec<String> {
        let of_kinds = |set: ShapeSet, name: fn(&KindName) -> String| {
            ShapeKind::ALL.into_iter().filter(move |kind| set.has(*kind)).map(move |kind| name(kind.name()))
        };
        let flags = |flags: &[(bool, &str)]| {
            flags.iter().filter(|(is_on, _)| *is_on).map(|(_, name)| name.to_string()).collect::<Vec<_>>()
        };
        let counts = self.counts.iter().flat_map(|counts| counts.iter().zip(ShapeKind::ALL));
        let counts = counts.filter(|(_, kind)| self.shapes.has(*kind));
        of_kinds(self.shapes, KindName::has)
            .chain(flags(&[
                (!self.shapes.is_empty(), "HAS_SHAPES"),
                (self.lights != Lights::None, "HAS_LIGHTS"),
                (self.lights == Lights::One, "ONE_LIGHT"),
            ]))
            .chain(of_kinds(self.shadows, KindName::shadows))
            .chain(flags(&[
                (!self.shadows.is_empty(), "HAS_SHADOWS"),
                (self.two_sided, "HAS_TWO_SIDED"),
                (self.glossy, "HAS_GLOSSY"),
                (self.ambient, "HAS_AMBIENT"),
                (self.one_sample, "ONE_SAMPLE"),
                (self.in_uniforms, "SCENE_IN_UNIFORMS"),
            ]))
            .chain(counts.map(|(count, kind)| format!("{} {count}", kind.name().count())))
            .collect()
    }

    /// Every permutation that some scene and settings lead to, but that two spheres, and two planes, stand for any few of
    /// them; a test compiles them all.
    pub fn reachable() -> Vec<Features> {
        let kinds = Shapes::default();
        let kinds = kinds.kinds();
        let always = ShapeSet::those(|kind| kinds[kind as usize].always_shadows);
        let mut reachable = Vec::new();
        for shapes in ShapeSet::all() {
            for lights in [Lights::None, Lights::One, Lights::Many] {
                for shadows in ShapeSet::all() {
                    // The six flags that are left, as the bits of a number.
                    for bits in 0..1 << 6 {
                        let flag = |bit: u32| bits >> bit & 1 == 1;
                        let two_of_each = ShapeKind::ALL.map(|kind| 2 * u32::from(shapes.has(kind)));
                        let features = Features {
                            shapes,
                            lights,
                            shadows,
                            glossy: flag(0),
                            ambient: flag(1),
                            one_sample: flag(2),
                            in_uniforms: flag(3),
                            two_sided: flag(4),
                            counts: flag(5).then_some(two_of_each),
                        };
                        if features.is_possible(always) {
                            reachable.push(features);
                        }
                    }
                }
            }
        }
        reachable
    }

    /// Whether some scene needs just these; `always`: the kinds of which any shape may shadow.
    fn is_possible(&self, always: ShapeSet) -> bool {
        let lit = self.lights != Lights::None;
        // Without objects there still may be more lights than uniforms hold.
        let needs_objects = lit || self.ambient || self.glossy || self.two_sided || self.counts.is_some();
        let shadows_of = |kind: ShapeKind| {
            let possible = self.shapes.has(kind) && lit;
            match always.has(kind) {
                true => self.shadows.has(kind) == possible,
                // What may shadow by where it lies has camera and lights on both of its sides.
                false => !self.shadows.has(kind) || possible && self.two_sided,
            }
        };
        // Light goes round edges.
        let sides = self.two_sided || !self.shapes.has(ShapeKind::Quad);
        sides && !(self.shapes.is_empty() && needs_objects) && ShapeKind::ALL.into_iter().all(shadows_of)
    }
}

/// Whether some plane keeps camera and lights apart, so that photons may lie on both sides of it.
pub fn is_divided(scene: &Scene) -> bool {
    let (camera, lights) = (scene.camera.position, scene.lights.origins());
    // Light goes round what has an end.
    scene.shapes.iter().any(|shape| shape.bounds().is_none() && shape.may_shadow(camera, &lights))
}

/// Why some rays may meet an object from its other side: all rays begin at the camera or a light, and none passes
/// through a surface. None where camera and lights are on the side of every shape that its normal is packed to point
/// to. Without a camera this tells of photons alone.
fn two_sided(scene: &Scene, camera: Option<DVec3>) -> Option<String> {
    let lights = scene.lights.origins();
    let Some(first) = lights.first() else { return Some("no light to tell the planes' sides".into()) };
    let near = camera.unwrap_or(*first);
    let sources: Vec<DVec3> = lights.iter().copied().chain(camera).collect();
    let shows_its_back = |shape: &&dyn Shape| {
        let (sheet, facing) = (shape.sheet(), shape.facing(*first));
        shape.edges().is_some() || sources.iter().any(|p| sheet.side(*p, near) * facing <= 0.0)
    };
    let kinds = scene.shapes.kinds();
    let backs: Vec<usize> = kinds.iter().map(|kind| kind.iter().filter(shows_its_back).count()).collect();
    let who = if camera.is_some() { "camera and lights" } else { "lights" };
    let said = kinds.iter().zip(&backs).rev();
    let said: Vec<_> = said.map(|(kind, count)| (kind.backs_said)(&format!("{count} {}", kind.name.plural))).collect();
    backs.iter().any(|count| *count > 0).then(|| format!("{who} {}", said.join("; ")))
}
