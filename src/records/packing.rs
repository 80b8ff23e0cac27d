//! From a scene in double precision to float32 records, recentred so that float32's digits are spent near the camera.

use std::cell::Cell;

use glam::DVec3;

use crate::records::{Frame, Glass, LIGHTS_IN_UNIFORMS, Light, OBJECTS_IN_UNIFORMS, Object, PLANE, SPHERE};
use crate::scene::{Camera, Scene};
use crate::settings::{Pass, Settings};

thread_local! {
    static PACKINGS: Cell<u64> = const { Cell::new(0) };
}

/// How often this thread has packed a scene. That takes as long as the scene is large: tests hold that nobody does it to
/// learn that nothing changed.
pub fn packings() -> u64 {
    PACKINGS.get()
}

/// A scene as the devices hold it.
#[derive(Clone, Debug, PartialEq)]
pub struct Packed {
    /// World position of scene space's origin.
    pub origin: DVec3,
    /// Spheres first, then planes.
    pub objects: Vec<Object>,
    /// How many of the objects are spheres.
    pub sphere_count: usize,
    /// In the file's order.
    pub lights: Vec<Light>,
    /// One per object in a scene with glass, else empty.
    pub glasses: Vec<Glass>,
}

impl Packed {
    /// Packs a scene around an origin, which should lie where precision matters most: the camera's first position.
    ///
    /// Subtracting it in double precision means that a scene far from the world's origin loses nothing but what its
    /// own numbers had lost already.
    pub fn new(scene: &Scene, origin: DVec3) -> Packed {
        PACKINGS.set(PACKINGS.get() + 1);
        let object = |anchor: [f32; 3], extent: f64, kind: f32, material: usize| {
            let material = &scene.materials[material];
            Object {
                anchor,
                extent: extent as f32,
                kind,
                roughness: material.roughness as f32,
                color: material.color.as_vec3().to_array(),
                ambient: material.ambient as f32,
                diffuse: material.diffuse as f32,
                specular: material.specular as f32,
            }
        };
        let spheres = scene
            .spheres
            .iter()
            .map(|s| object((s.center - origin).as_vec3().to_array(), s.radius, SPHERE, s.material));
        // Normals towards the lights: nearly always all of them, and the camera, are on one side (see
        // `Features::two_sided`).
        let planes = scene.planes.iter().map(|p| {
            let away = scene.lights.first().is_some_and(|light| p.normal.dot(light.position) < p.offset);
            let facing = if away { -1.0 } else { 1.0 };
            let offset = facing * (p.offset - p.normal.dot(origin));
            object((p.normal * facing).as_vec3().to_array(), offset, PLANE, p.material)
        });
        let materials = scene.spheres.iter().map(|s| s.material).chain(scene.planes.iter().map(|p| p.material));
        let glass = |m: usize| {
            let material = &scene.materials[m];
            Glass { transmission: material.transmission as f32, ior: material.ior as f32, reserved: 0.0 }
        };
        let has_glass = materials.clone().any(|m| scene.materials[m].transmission > 0.0);
        Packed {
            origin,
            objects: spheres.chain(planes).collect(),
            sphere_count: scene.spheres.len(),
            lights: scene
                .lights
                .iter()
                .map(|light| Light {
                    position: (light.position - origin).as_vec3().to_array(),
                    intensity: light.intensity.as_vec3().to_array(),
                })
                .collect(),
            glasses: if has_glass { materials.map(glass).collect() } else { Vec::new() },
        }
    }

    /// Whether the records fit into GL's uniforms (see [`OBJECTS_IN_UNIFORMS`]).
    pub fn in_uniforms(&self) -> bool {
        self.objects.len() <= OBJECTS_IN_UNIFORMS && self.lights.len() <= LIGHTS_IN_UNIFORMS
    }

    /// How many of the objects are planes.
    pub fn plane_count(&self) -> usize {
        self.objects.len() - self.sphere_count
    }

    /// The picture's own numbers, for this scene, camera and pass.
    pub fn frame(&self, camera: &Camera, settings: &Settings, pass: &Pass) -> Frame {
        // An orthonormal basis in double precision, scaled so that (±1, ±1) are the image's corners.
        let forward = (camera.look_at - camera.position).normalize();
        let right = forward.cross(camera.up).normalize();
        let up = right.cross(forward);
        let half_height = (camera.fov_y.to_radians() / 2.0).tan();
        let half_width = half_height * f64::from(settings.width) / f64::from(settings.height);
        Frame {
            position: (camera.position - self.origin).as_vec3().to_array(),
            right: (right * half_width).as_vec3().to_array(),
            up: (up * half_height).as_vec3().to_array(),
            forward: forward.as_vec3().to_array(),
            width: settings.width as f32,
            height: settings.height as f32,
            samples: settings.samples as f32,
            sphere_count: self.sphere_count as f32,
            plane_count: self.plane_count() as f32,
            light_count: self.lights.len() as f32,
            seed_low: (pass.seed & 0xffff) as f32,
            seed_high: (pass.seed >> 16) as f32,
            first_sample: pass.first_sample as f32,
        }
    }
}
