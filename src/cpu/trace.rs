//! Twin of `glsl/shared/direct.glsl` and `pixel.glsl`: one pixel's radiance, and the film row by row.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use rayon::prelude::*;

use super::bsdf::ggx;
use super::camera::{camera_direction, jitter_x, jitter_y};
use super::gather::{PhotonMap, photon_radiance};
use super::random::hash2_u;
use super::scene::{SceneTables, Surface};
use crate::features::{Features, Lights};
use crate::layout::Frame;

/// Radiance towards the viewer from point lights, W·m⁻²·sr⁻¹.
pub fn direct_light(scene: &SceneTables, surface: &Surface, to_viewer: Vec3) -> Vec3 {
    let object = &scene.objects[surface.object];
    let diffuse = Vec3::from(object.color) * (object.diffuse * FRAC_1_PI);
    let mut sum = Vec3::ZERO;
    for light in scene.lights {
        let towards = Vec3::from(light.position) - surface.position;
        let distance2 = towards.dot(towards);
        let distance = distance2.sqrt();
        let to_light = towards * (1.0 / distance);
        let cos_i = surface.normal.dot(to_light);
        if cos_i > 0.0 && !scene.occluded(surface.position, light.position.into(), to_light, distance, surface.object) {
            let mut bsdf = diffuse;
            if object.specular > 0.0 {
                let cos_o = surface.normal.dot(to_viewer).max(0.0);
                bsdf += object.specular * ggx(surface.normal, to_viewer, to_light, cos_o, cos_i, object.roughness);
            }
            sum += bsdf * (Vec3::from(light.intensity) * (cos_i / distance2));
        }
    }
    sum
}

/// What arrives at `origin` from `direction`, with the photon map where there is one.
pub fn radiance_along(scene: &SceneTables, map: Option<&PhotonMap>, origin: Vec3, direction: Vec3) -> Vec3 {
    let Some(hit) = scene.closest_hit(origin, direction, None) else { return Vec3::ZERO };
    let surface = scene.surface_at(origin, direction, hit);
    let object = &scene.objects[hit.object];
    let direct = match scene.features.lights {
        Lights::None => Vec3::ZERO,
        _ => direct_light(scene, &surface, -direction),
    };
    let indirect = map.map_or(Vec3::ZERO, |map| photon_radiance(scene, map, &surface, -direction));
    direct + indirect + Vec3::from(object.color) * object.ambient
}

/// Where a pixel's samples lie on the image plane, in pixels from the image's top left corner.
pub fn sample_points(features: &Features, frame: &Frame, column: u32, row: u32) -> impl Iterator<Item = (f32, f32)> {
    let (x, y) = (column as f32, row as f32);
    let seed = frame.seed_low as u32 | (frame.seed_high as u32) << 16;
    let pixel_key = hash2_u(column, row ^ seed);
    let one_sample = features.one_sample;
    let (first, count) = (frame.first_sample as u32, if one_sample { 1 } else { frame.samples as u32 });
    (first..first + count).map(move |index| match one_sample {
        true => (x + 0.5, y + 0.5),
        false => (x + jitter_x(index, pixel_key), y + jitter_y(index, pixel_key)),
    })
}

/// Mean over the pixel's samples.
pub fn pixel_radiance(scene: &SceneTables, map: Option<&PhotonMap>, frame: &Frame, column: u32, row: u32) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for (x, y) in sample_points(scene.features, frame, column, row) {
        sum += radiance_along(scene, map, frame.position.into(), camera_direction(frame, x, y));
    }
    if scene.features.one_sample { sum } else { sum * (1.0 / frame.samples) }
}

/// The whole film, row 0 = top, on the calling thread's rayon pool: a pool of one thread is plain serial code.
pub fn trace(scene: &SceneTables, map: Option<&PhotonMap>, frame: &Frame, film: &mut [[f32; 3]]) {
    let width = frame.width as usize;
    film.par_chunks_mut(width.max(1)).enumerate().for_each(|(row, pixels)| {
        for (column, pixel) in pixels.iter_mut().enumerate() {
            *pixel = pixel_radiance(scene, map, frame, column as u32, row as u32).to_array();
        }
    });
}
