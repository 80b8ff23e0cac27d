//! From a scene in double precision to float32 records, recentred so that float32's digits are spent near the camera.

pub mod packed_scene;

use std::cell::Cell;

use glam::DVec3;

use crate::lights::Light;
use crate::materials::Material;
use crate::records::{self, Frame, LIGHTS_IN_UNIFORMS, QUADS_IN_UNIFORMS, Record, SHAPES_IN_UNIFORMS};
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
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Packed {
    /// World position of scene space's origin.
    pub origin: DVec3,
    /// Spheres first, then planes, then quads.
    pub shapes: Vec<records::Shape>,
    /// One for each shape in their order, or, where shapes are many, each of the scene's once.
    pub materials: Vec<records::Material>,
    /// What quads have besides their planes, in their order.
    pub quads: Vec<records::Quad>,
    /// How many of the shapes are spheres.
    pub sphere_count: usize,
    /// In the file's order.
    pub lights: Vec<records::Light>,
}

/// Shapes from which on materials are shared: a row of its own for each of them would take more memory than an index
/// takes time.
pub const MANY_SHAPES: usize = 4096;

/// Whether shapes name the scene's materials by an index, rather than having a row each in their order.
pub fn shares_materials(scene: &Scene) -> bool {
    scene.shapes.len() > MANY_SHAPES
}

impl Packed {
    /// Packs a scene around an origin, which should lie where precision matters most: the camera's first position.
    ///
    /// Subtracting it in double precision means that a scene far from the world's origin loses nothing but what its
    /// own numbers had lost already.
    pub fn new(scene: &Scene, origin: DVec3) -> Packed {
        PACKINGS.set(PACKINGS.get() + 1);
        let shared = shares_materials(scene);
        // Normals towards the lights: nearly always all of them, and the camera, are on one side (see
        // `Features::two_sided`).
        let first = scene.lights.iter().next().map(Light::origin);
        let mut shapes: Vec<_> = scene
            .shapes
            .iter()
            .map(|shape| shape.pack(origin, first.map_or(1.0, |light| shape.facing(light))))
            .collect();
        // A row for each shape, in their order, as long as they are few: then nobody has to fetch an index.
        let materials = match shared {
            true => scene.materials.iter().map(Material::pack).collect(),
            false => scene.shapes.iter().map(|shape| scene.materials[shape.material()].pack()).collect(),
        };
        if !shared {
            shapes.iter_mut().enumerate().for_each(|(number, shape)| shape.material = number as f32);
        }
        let mut quads: Vec<_> = scene.shapes.iter().filter_map(|shape| shape.row(origin)).collect();
        let count = quads.len() as f32;
        quads.iter_mut().for_each(|quad| quad.count = count);
        Packed {
            origin,
            shapes,
            materials,
            quads,
            sphere_count: scene.shapes.spheres.len(),
            lights: scene.lights.iter().map(|light| light.pack(origin)).collect(),
        }
    }

    /// The material of a shape.
    pub fn material_of(&self, shape: usize) -> &records::Material {
        &self.materials[self.shapes[shape].material as usize]
    }

    /// The tables that programs read, by name: [`crate::records::table_sets::PACKED`].
    pub fn tables(&self) -> Vec<(&'static str, &[f32])> {
        let mut tables: Vec<(&'static str, &[f32])> = vec![
            (records::Shape::TABLE, bytemuck::cast_slice(&self.shapes)),
            (records::Material::TABLE, bytemuck::cast_slice(&self.materials)),
            (records::Light::TABLE, bytemuck::cast_slice(&self.lights)),
        ];
        if !self.quads.is_empty() {
            tables.push((records::Quad::TABLE, bytemuck::cast_slice(&self.quads)));
        }
        tables
    }

    /// Whether some material has a lobe.
    pub fn is_glossy(&self) -> bool {
        self.materials.iter().any(|material| material.specular > 0.0)
    }

    /// Whether the records fit into GL's uniforms (see [`SHAPES_IN_UNIFORMS`]).
    pub fn in_uniforms(&self) -> bool {
        self.shapes.len() <= SHAPES_IN_UNIFORMS
            && self.quads.len() <= QUADS_IN_UNIFORMS
            && self.lights.len() <= LIGHTS_IN_UNIFORMS
    }

    /// How many of the shapes are planes.
    pub fn plane_count(&self) -> usize {
        self.shapes.len() - self.sphere_count - self.quads.len()
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
