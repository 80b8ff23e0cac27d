//! The photon grid and its gathering: device against twin, grid against brute force.

mod gathered;
mod launches;
mod memory;
mod permutations;
mod pictures;
mod queries;
mod tables;
mod tile_timings;
mod tile_views;
mod tiled_pictures;
mod tiles;
mod timings;

use photile::cpu::grid::{PhotonSurface, PhotonTables, face_of, grid_bounds};
use photile::device::cl::{Context, devices};
use photile::packing::Packed;
use photile::pipeline::open_device;
use photile::plan::cells::{CellSize, Form, GridPlan, plan};
use photile::rays::random::{hash2_u, unit_real};
use photile::records::{Material, PLANE, PhotonDirection, PhotonPosition, PhotonPower, SPHERE, Shape};
use photile::stage::photon_map::PhotonMap;

use crate::common::one_at_a_time;

/// A stream of uniform reals, the same everywhere.
pub struct Random {
    seed: u32,
    drawn: u32,
}

impl Random {
    pub fn new(seed: u32) -> Random {
        Random { seed, drawn: 0 }
    }

    /// In [low, high).
    pub fn uniform(&mut self, low: f32, high: f32) -> f32 {
        self.drawn += 1;
        low + unit_real(hash2_u(self.drawn, self.seed)) * (high - low)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.uniform(0.0, 1.0) * n as f32) as usize
    }

    /// A point of the unit sphere.
    pub fn direction(&mut self) -> [f32; 3] {
        let (z, phi) = (self.uniform(-1.0, 1.0), self.uniform(0.0, std::f32::consts::TAU));
        let r = (1.0 - z * z).sqrt();
        [r * phi.cos(), r * phi.sin(), z]
    }
}

/// Photons on the host.
#[derive(Clone, Default)]
pub struct Map {
    pub positions: Vec<PhotonPosition>,
    pub powers: Vec<PhotonPower>,
    pub surfaces: Vec<PhotonSurface>,
    pub directions: Vec<PhotonDirection>,
}

impl Map {
    pub fn push(&mut self, position: [f32; 3], shape: usize, side: f32, random: &mut Random) {
        self.positions.push(PhotonPosition { position });
        self.powers.push(PhotonPower { power: [0, 1, 2].map(|_| random.uniform(0.5, 1.5)) });
        self.surfaces.push(PhotonSurface { shape: shape as f32, side, bounce: 1.0 });
        self.directions.push(PhotonDirection { direction: random.direction() });
    }

    fn len(&self) -> usize {
        self.positions.len()
    }

    pub fn tables(&self) -> PhotonTables<'_> {
        PhotonTables {
            positions: &self.positions,
            powers: &self.powers,
            surfaces: &self.surfaces,
            directions: &self.directions,
        }
    }

    pub fn plan(&self, shapes: &[Shape], radius: f32, size: CellSize, form: Form) -> GridPlan {
        let bounds = grid_bounds(&self.tables(), 2 * shapes.len());
        plan(shapes, true, &bounds, self.len(), radius, size, form).unwrap()
    }
}

/// The same on the device.
pub fn upload(context: &Context, map: &Map) -> PhotonMap {
    let faces: Vec<f32> = map.surfaces.iter().map(|surface| face_of(surface) as f32).collect();
    PhotonMap::from_tables(context, &map.positions, &map.powers, &faces, &map.directions).unwrap()
}

/// A room of 6 × 4 × 6 m around the origin with an oblique wall, and spheres: one free, one cut by a wall.
pub fn room() -> Vec<Shape> {
    let shape = |anchor, extent, kind| Shape { anchor, extent, kind, ..Shape::default() };
    let slant = 0.5f32.sqrt();
    vec![
        shape([-1.0, -1.0, 0.0], 0.8, SPHERE),
        shape([3.0, 0.0, -1.0], 1.0, SPHERE),
        shape([1.0, 0.0, 0.0], -3.0, PLANE),
        shape([1.0, 0.0, 0.0], 3.0, PLANE),
        shape([0.0, 1.0, 0.0], -2.0, PLANE),
        shape([0.0, 1.0, 0.0], 2.0, PLANE),
        shape([0.0, 0.0, 1.0], -3.0, PLANE),
        shape([0.0, 0.0, 1.0], 3.0, PLANE),
        shape([slant, 0.0, slant], 3.2, PLANE),
    ]
}

pub const ROOM_SPHERES: usize = 2;

/// Of all of the room's surfaces.
pub fn room_material() -> Material {
    Material { roughness: 0.3, color: [0.8, 0.7, 0.6], diffuse: 0.75, specular: 0.25, ..Material::default() }
}

/// Shapes as a scene of theirs alone, each with a row of one and the same material.
pub fn packed_of(mut shapes: Vec<Shape>, sphere_count: usize, material: Material) -> Packed {
    (0..shapes.len()).for_each(|number| shapes[number].material = number as f32);
    let materials = vec![material; shapes.len()];
    Packed { shapes, materials, sphere_count, ..Packed::default() }
}

/// Uniform points on the room's surfaces, both sides of each.
pub fn room_photons(count: usize, seed: u32) -> Map {
    let (shapes, mut random, mut map) = (room(), Random::new(seed), Map::default());
    for _ in 0..count {
        let number = random.below(shapes.len());
        let side = if random.uniform(0.0, 1.0) < 0.8 { 1.0 } else { -1.0 };
        let position = surface_point(&shapes[number], &mut random);
        map.push(position, number, side, &mut random);
    }
    map
}

/// A point of an object, within the room's box where it is a plane.
pub fn surface_point(shape: &Shape, random: &mut Random) -> [f32; 3] {
    if shape.kind == SPHERE {
        let d = random.direction();
        return [0, 1, 2].map(|axis| shape.anchor[axis] + d[axis] * shape.extent);
    }
    let p = [random.uniform(-3.0, 3.0), random.uniform(-2.0, 2.0), random.uniform(-3.0, 3.0)];
    let off = shape.extent - (0..3).map(|axis| shape.anchor[axis] * p[axis]).sum::<f32>();
    [0, 1, 2].map(|axis| p[axis] + off * shape.anchor[axis])
}

/// The first OpenCL device: every machine that runs the tests has one, if only PoCL.
pub fn device() -> Context {
    one_at_a_time();
    open_device(None, &mut |_| {}).expect("an OpenCL device")
}

/// The same as GPUs are driven: one lane a work-item, and work-groups that share local memory.
pub fn like_a_gpu() -> Context {
    one_at_a_time();
    let mut device = devices(None).expect("OpenCL").remove(0);
    device.lanes = 1;
    Context::new(device).expect("an OpenCL device")
}
