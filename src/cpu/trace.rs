//! Twin of `glsl/shared/pixel.glsl`: one pixel's radiance, and the film row by row.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use rayon::prelude::*;

use super::direct::direct_light;
use super::final_gather::{Gatherer, indirect_irradiance};
use super::gather::{PhotonMap, photon_radiance};
use super::tiles::tile_at;
use crate::program::features::Lights;
use crate::rays::camera::{camera_direction, sample_point};
use crate::rays::scene::SceneTables;
use crate::records::Frame;

/// Where indirect light comes from.
pub enum Indirect<'a> {
    /// There is none.
    None,
    /// Density estimates at visible points.
    Map(PhotonMap<'a>),
    /// A bounce of rays.
    Final(Gatherer<'a>),
}

/// What arrives along the camera's ray through (x, y) of the image plane; `key` and `tile` are the pixel's.
pub fn radiance_along(
    scene: &SceneTables,
    indirect: &Indirect,
    frame: &Frame,
    (x, y, key): (f32, f32, u32),
    tile: usize,
) -> Vec3 {
    let (origin, direction) = (frame.position.into(), camera_direction(frame, x, y));
    let Some(hit) = scene.closest_hit(origin, direction, None) else { return Vec3::ZERO };
    let surface = scene.surface_at(origin, direction, hit);
    let material = scene.material_of(hit.shape);
    let direct = match scene.features.lights {
        Lights::None => Vec3::ZERO,
        _ => direct_light(scene, &surface, -direction),
    };
    let reflected = match indirect {
        Indirect::None => Vec3::ZERO,
        Indirect::Map(map) => photon_radiance(scene, map, &surface, -direction, tile),
        Indirect::Final(gatherer) => {
            let diffuse = Vec3::from(material.color) * (material.diffuse * FRAC_1_PI);
            diffuse * indirect_irradiance(scene, gatherer, frame, &surface, x, y, key)
        }
    };
    direct + reflected + Vec3::from(material.color) * material.ambient
}

/// Mean over the pixel's samples.
pub fn pixel_radiance(scene: &SceneTables, indirect: &Indirect, frame: &Frame, column: u32, row: u32) -> Vec3 {
    let tile = match indirect {
        Indirect::Map(PhotonMap { tiles: Some((plan, _)), .. }) => tile_at(&plan.gather, column, row),
        _ => 0,
    };
    let one_sample = scene.features.one_sample;
    let sample =
        |number| radiance_along(scene, indirect, frame, sample_point(frame, one_sample, column, row, number), tile);
    if one_sample {
        return sample(0);
    }
    let samples = frame.samples as u32;
    (0..samples).map(sample).fold(Vec3::ZERO, |sum, radiance| sum + radiance) * (1.0 / samples as f32)
}

/// The whole film, row 0 = top, on the calling thread's rayon pool: a pool of one thread is plain serial code.
pub fn trace(scene: &SceneTables, indirect: &Indirect, frame: &Frame, film: &mut [[f32; 3]]) {
    let width = frame.width as usize;
    film.par_chunks_mut(width.max(1)).enumerate().for_each(|(row, pixels)| {
        for (column, pixel) in pixels.iter_mut().enumerate() {
            *pixel = pixel_radiance(scene, indirect, frame, column as u32, row as u32).to_array();
        }
    });
}
