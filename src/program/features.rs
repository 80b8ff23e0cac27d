//! What a scene and its settings need. All else is neither compiled, allocated, launched nor uploaded.
//!
//! A feature says "the scene has X" and is a `#define`; numbers that change often stay uniforms.

use glam::DVec3;

use crate::kinds::ShapeKind;
use crate::records::{LIGHTS_IN_UNIFORMS, SHAPES_IN_UNIFORMS};
use crate::scene::{Plane, Scene, Sphere};
use crate::settings::{LightMode, Pass, Settings};

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
    /// Some object is a sphere.
    pub spheres: bool,
    /// Some object is a plane.
    pub planes: bool,
    /// Lights that reach a shaded surface.
    pub lights: Lights,
    /// A sphere may come between a visible point and a light.
    pub sphere_shadows: bool,
    /// A plane may come between a visible point and a light.
    pub plane_shadows: bool,
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
    /// How many spheres and planes there are, where they are few: at most [`FEW_SHAPES`] together.
    pub counts: Option<[u32; 2]>,
}

/// One line of `photile plan`: a feature, whether it is used, and why.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Reason {
    /// The `#define`, or the stage.
    pub feature: &'static str,
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
        let (spheres, planes) = (scene.spheres.len(), scene.planes.len());
        let used_materials = || {
            let of_spheres = scene.spheres.iter().map(|s| s.material);
            of_spheres.chain(scene.planes.iter().map(|p| p.material)).map(|m| &scene.materials[m])
        };
        let glossy = used_materials().filter(|m| m.specular > 0.0).count();
        let ambient = used_materials().filter(|m| m.ambient > 0.0 && m.color != DVec3::ZERO).count();
        // Where photons carry all light, nothing is lit by shadow rays.
        let photons_only = settings.light == LightMode::Photons;
        let lights = if spheres + planes == 0 || photons_only { 0 } else { scene.lights.len() };
        let separating = if lights == 0 { 0 } else { separating_planes(scene).count() };

        let two_sided = two_sided(scene, Some(scene.camera.position)).filter(|_| spheres + planes > 0);

        let features = Features {
            spheres: spheres > 0,
            planes: planes > 0,
            lights: match lights {
                0 => Lights::None,
                1 => Lights::One,
                _ => Lights::Many,
            },
            sphere_shadows: spheres > 0 && lights > 0,
            plane_shadows: separating > 0,
            two_sided: two_sided.is_some(),
            glossy: glossy > 0 && !scene.lights.is_empty(),
            ambient: ambient > 0,
            one_sample: settings.samples == 1,
            in_uniforms: spheres + planes <= SHAPES_IN_UNIFORMS && scene.lights.len() <= LIGHTS_IN_UNIFORMS,
            counts: (1..=FEW_SHAPES).contains(&(spheres + planes)).then_some([spheres, planes].map(|n| n as u32)),
        };
        let reason = |feature, used, why| Reason { feature, used, why };
        let reasons = vec![
            reason("HAS_SPHERES", features.spheres, format!("{spheres} spheres")),
            reason("HAS_PLANES", features.planes, format!("{planes} planes")),
            reason(
                "HAS_LIGHTS",
                lights > 0,
                match photons_only {
                    true => "photons carry all light".into(),
                    false => format!("{} lights, {} objects", scene.lights.len(), spheres + planes),
                },
            ),
            reason("ONE_LIGHT", lights == 1, format!("{lights} lights to loop over")),
            reason(
                "HAS_SPHERE_SHADOWS",
                features.sphere_shadows,
                format!("{spheres} spheres may block {lights} lights"),
            ),
            reason(
                "HAS_PLANE_SHADOWS",
                features.plane_shadows,
                format!("{separating} of {planes} planes lie between the camera and a light"),
            ),
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
                "SPHERE_COUNT",
                features.counts.is_some(),
                format!("loops over up to {FEW_SHAPES} objects are unrolled, but by OpenGL on GPUs"),
            ),
        ];
        (features, reasons)
    }

    /// Whether shapes of a kind may come between a visible point and a light.
    pub fn casts_shadows(&self, kind: ShapeKind) -> bool {
        match kind {
            ShapeKind::Sphere => self.sphere_shadows,
            ShapeKind::Plane => self.plane_shadows,
        }
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
        let flags = [
            (self.spheres, "HAS_SPHERES"),
            (self.planes, "HAS_PLANES"),
            (self.spheres || self.planes, "HAS_SHAPES"),
            (self.lights != Lights::None, "HAS_LIGHTS"),
            (self.lights == Lights::One, "ONE_LIGHT"),
            (self.sphere_shadows, "HAS_SPHERE_SHADOWS"),
            (self.plane_shadows, "HAS_PLANE_SHADOWS"),
            (self.sphere_shadows || self.plane_shadows, "HAS_SHADOWS"),
            (self.two_sided, "HAS_TWO_SIDED"),
            (self.glossy, "HAS_GLOSSY"),
            (self.ambient, "HAS_AMBIENT"),
            (self.one_sample, "ONE_SAMPLE"),
            (self.in_uniforms, "SCENE_IN_UNIFORMS"),
        ];
        let flags = flags.into_iter().filter(|(is_on, _)| *is_on).map(|(_, name)| name.to_string());
        let counts =
            self.counts.map(|[spheres, planes]| [format!("SPHERE_COUNT {spheres}"), format!("PLANE_COUNT {planes}")]);
        flags.chain(counts.into_iter().flatten()).collect()
    }

    /// Every permutation that some scene and settings lead to, but that two spheres, and two planes, stand for any few of
    /// them; a test compiles them all.
    pub fn reachable() -> Vec<Features> {
        const GEOMETRIES: [(bool, bool); 4] = [(false, false), (true, false), (false, true), (true, true)];
        let mut reachable = Vec::new();
        for (spheres, planes) in GEOMETRIES {
            for lights in [Lights::None, Lights::One, Lights::Many] {
                // The seven flags that are left, as the bits of a number.
                for bits in 0..1 << 7 {
                    let flag = |bit: u32| bits >> bit & 1 == 1;
                    let lit = lights != Lights::None;
                    let features = Features {
                        spheres,
                        planes,
                        lights,
                        sphere_shadows: spheres && lit,
                        plane_shadows: flag(0),
                        glossy: flag(1),
                        ambient: flag(2),
                        one_sample: flag(3),
                        in_uniforms: flag(4),
                        two_sided: flag(5),
                        counts: flag(6).then_some([spheres, planes].map(|there_are| 2 * u32::from(there_are))),
                    };
                    let empty = !spheres && !planes;
                    // Without objects there still may be more lights than uniforms hold.
                    let needs_objects =
                        lit || features.ambient || features.glossy || features.two_sided || features.counts.is_some();
                    let impossible =
                        empty && needs_objects || features.plane_shadows && !(planes && lit && features.two_sided);
                    if !impossible {
                        reachable.push(features);
                    }
                }
            }
        }
        reachable
    }
}

/// Whether some plane keeps camera and lights apart, so that photons may lie on both sides of it.
pub fn is_divided(scene: &Scene) -> bool {
    separating_planes(scene).next().is_some()
}

/// Planes that have the camera on one side and some light on the other, or either of them within rounding of the
/// plane. Any other plane has every visible point and every light in one closed half-space, which is convex: the
/// segment between them cannot cross it.
fn separating_planes(scene: &Scene) -> impl Iterator<Item = &Plane> {
    let near = scene.camera.position;
    scene.planes.iter().filter(move |plane| {
        let camera = side_of_plane(plane, near, near);
        scene.lights.iter().any(|light| side_of_plane(plane, light.position, near) * camera <= 0.0)
    })
}

/// −1, +1, or 0 within rounding of the plane. Packed coordinates are small near `near`.
fn side_of_plane(plane: &Plane, p: DVec3, near: DVec3) -> f64 {
    let distance = plane.normal.dot(p) - plane.offset;
    let offset = plane.offset - plane.normal.dot(near);
    // 1e-5 of the numbers that cancel: float32 resolves them to 1e-7, so this is safely on one side.
    let rounding = 1e-5 * ((p - near).abs().dot(plane.normal.abs()) + offset.abs());
    if distance.abs() <= rounding { 0.0 } else { distance.signum() }
}

/// Whether a point lies outside of a sphere by more than rounding.
fn is_outside(sphere: &Sphere, p: DVec3, near: DVec3) -> bool {
    let sizes = (p - near).length() + (sphere.center - near).length() + sphere.radius;
    // 16 times what float32 makes of it; spheres of 1e5 m, as walls, may be a metre off.
    p.distance(sphere.center) - sphere.radius > 1e-6 * sizes
}

/// Why some rays may meet an object from its other side: all rays begin at the camera or a light, and none passes
/// through a surface. None where camera and lights are outside of every sphere and on one side of every plane. Without
/// a camera this tells of photons alone.
fn two_sided(scene: &Scene, camera: Option<DVec3>) -> Option<String> {
    // Normals are packed towards the first light.
    let Some(first) = scene.lights.first() else { return Some("no light to tell the planes' sides".into()) };
    let near = camera.unwrap_or(first.position);
    let sources = || scene.lights.iter().map(|light| light.position).chain(camera);
    let planes = scene.planes.iter().filter(|plane| {
        let side = side_of_plane(plane, first.position, near);
        sources().any(|p| side_of_plane(plane, p, near) * side <= 0.0)
    });
    let spheres = scene.spheres.iter().filter(|sphere| !sources().all(|p| is_outside(sphere, p, near)));
    let (planes, spheres) = (planes.count(), spheres.count());
    let who = if camera.is_some() { "camera and lights" } else { "lights" };
    let why = format!("{who} on both sides of {planes} planes, or on them; in or on {spheres} spheres");
    (planes + spheres > 0).then_some(why)
}
