//! Twin of `glsl/shared/final.glsl` and `site.glsl`: indirect light by one bounce of rays, at sites or at a pixel.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;
use rayon::prelude::*;

use super::direct::{Incident, incident_light};
use super::texels::texel_of;
use crate::rays::camera::camera_direction;
use crate::rays::random::{R2_STEPS, hash_u, hash2_u, sequence_u};
use crate::rays::scene::{SceneTables, Surface};
use crate::rays::shapes::{self, INFINITE};
use crate::rays::walk::sample_cosine;
use crate::records::{Chart, Frame, LitPoint, Site, SiteLattice, SiteSurface, Texel};

/// What final gathering reads.
#[derive(Clone, Copy)]
pub struct Gatherer<'a> {
    /// By object.
    pub charts: &'a [Chart],
    /// All further bounces.
    pub texels: &'a [Texel],
    /// Where the sites lie, and the rays of each.
    pub lattice: &'a SiteLattice,
    /// Where light arrives first.
    pub points: &'a [LitPoint],
    /// The sites, where pixels take their irradiance from these.
    pub sites: Option<(&'a [Site], &'a [SiteSurface])>,
}

/// Share of the rays in what a point that light falls on directly brings (balance heuristic: Veach & Guibas 1995).
fn share_of_rays(facing: f32, density: f32, distance2: f32) -> f32 {
    let facing = facing.max(0.0);
    facing / (facing + density * distance2).max(1e-30)
}

/// What the lit points bring, W/m². `fewer`: how many times fewer rays than a site's come to the same place.
fn from_lit_points(scene: &SceneTables, gatherer: &Gatherer, to: &Surface, fewer: f32) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for point in &gatherer.points[..gatherer.lattice.points as usize] {
        let (position, shape) = (Vec3::from(point.position), point.shape as usize);
        let towards = position - to.position;
        let distance2 = towards.dot(towards);
        let distance = distance2.sqrt();
        let direction = towards * (1.0 / distance);
        let cosine = to.normal.dot(direction);
        let cosine_there = 0.0 - Vec3::from(point.normal).dot(direction);
        let faces = cosine > 0.0 && cosine_there > 0.0 && (to.shape != shape || shapes::sees_itself(&scene.at(shape)));
        if faces && !scene.occluded(to.position, position, direction, distance, to.face_left(), Some(shape)) {
            let facing = cosine * cosine_there * FRAC_1_PI;
            let density = point.density * fewer;
            sum += Vec3::from(point.irradiance) * (share_of_rays(facing, density, distance2) * fewer);
        }
    }
    sum
}

/// Radiance that leaves a surface against a ray: direct light, as far as rays have a share in it, and photons' from
/// its texel.
fn radiance_seen(
    scene: &SceneTables,
    gatherer: &Gatherer,
    from: &Surface,
    direction: Vec3,
    distance: f32,
    seen: &Surface,
    fewer: f32,
) -> Vec3 {
    let material = scene.material_of(seen.shape);
    let mut irradiance = Vec3::from(gatherer.texels[texel_of(scene, gatherer.charts, seen)].irradiance);
    let facing = 0.0 - from.normal.dot(direction) * seen.normal.dot(direction) * FRAC_1_PI;
    for light in scene.lights {
        if let Some(Incident { irradiance: direct, .. }) = incident_light(scene, seen, light) {
            let density = gatherer.lattice.points_per_watt * fewer * (direct.x + direct.y + direct.z);
            irradiance += direct * share_of_rays(facing, density, distance * distance);
        }
    }
    Vec3::from(material.color) * (material.diffuse * FRAC_1_PI) * irradiance
}

/// Indirect irradiance at a point, W/m².
pub fn final_gather(scene: &SceneTables, gatherer: &Gatherer, from: &Surface, key: u32, rays: u32) -> Vec3 {
    let height_shift = hash_u(key);
    let turn_shift = hash_u(height_shift);
    let first = (gatherer.lattice.turn as u32).wrapping_mul(rays);
    let fewer = gatherer.lattice.rays / rays as f32;
    let mut sum = Vec3::ZERO;
    for index in (0..rays).map(|ray| first.wrapping_add(ray)) {
        let height = sequence_u(index, R2_STEPS[0], height_shift);
        let turn = sequence_u(index, R2_STEPS[1], turn_shift);
        let direction = sample_cosine(from.normal, height, turn);
        if let Some(hit) = scene.closest_hit(from.position, direction, Some(from.face_left())) {
            let seen = scene.surface_at(from.position, direction, hit);
            sum += radiance_seen(scene, gatherer, from, direction, hit.t, &seen, fewer);
        }
    }
    sum * (PI / rays as f32) + from_lit_points(scene, gatherer, from, fewer)
}

fn face_of(surface: &Surface) -> f32 {
    surface.face_left() as f32
}

/// Indirect irradiance at a visible point, seen through (x, y) of the image plane; `key` is the pixel's.
pub fn indirect_irradiance(
    scene: &SceneTables,
    gatherer: &Gatherer,
    frame: &Frame,
    surface: &Surface,
    x: f32,
    y: f32,
    key: u32,
) -> Vec3 {
    let lattice = gatherer.lattice;
    let own = || final_gather(scene, gatherer, surface, key, lattice.own_rays as u32);
    let Some((sites, surfaces)) = gatherer.sites else { return own() };
    let u = (x - lattice.offset_x) / lattice.spacing + 1.0;
    let v = (y - lattice.offset_y) / lattice.spacing + 1.0;
    let column = (u as i32).clamp(0, lattice.columns as i32 - 2);
    let row = (v as i32).clamp(0, lattice.rows as i32 - 2);
    let (u, v) = (u - column as f32, v - row as f32);
    let face = face_of(surface);
    let inverse_clearance = 1.0 / (clearance(scene, surface) * lattice.reach).max(1e-20);
    let (mut irradiance, mut total) = (Vec3::ZERO, 0.0);
    for (down, across, share) in
        [(0, 0, (1.0 - u) * (1.0 - v)), (0, 1, u * (1.0 - v)), (1, 0, (1.0 - u) * v), (1, 1, u * v)]
    {
        let (column, row) = ((column + across) as u32, (row + down) as u32);
        let site = row as usize * lattice.columns as usize + column as usize;
        let towards = camera_direction(
            frame,
            site_place(lattice, column, lattice.offset_x),
            site_place(lattice, row, lattice.offset_y),
        );
        let apart = Vec3::from(frame.position) + towards * surfaces[site].distance - surface.position;
        let mut weight = share * (1.0 - apart.dot(apart).sqrt() * inverse_clearance).max(0.0);
        weight *= shapes::likeness(&scene.at(surface.shape), apart, lattice.reach);
        if surfaces[site].face == face {
            irradiance += Vec3::from(sites[site].irradiance) * weight;
            total += weight;
        }
    }
    if total < LEAST_WEIGHT { own() } else { irradiance * (1.0 / total) }
}

/// A site's place on the image plane along one axis, pixels.
fn site_place(lattice: &SiteLattice, number: u32, offset: f32) -> f32 {
    (number as f32 - 1.0) * lattice.spacing + offset
}

/// Below, a pixel is alone.
const LEAST_WEIGHT: f32 = 0.02;

/// Distance from a point to the nearest surface but its own.
fn clearance(scene: &SceneTables, surface: &Surface) -> f32 {
    let others = scene.all().filter(|shape| shape.number != surface.shape);
    others.map(|shape| shapes::distance(&shape, surface.position)).fold(INFINITE, f32::min)
}

/// Of all rays of a pass.
fn key_of(lattice: &SiteLattice) -> u32 {
    lattice.key_low as u32 | (lattice.key_high as u32) << 16
}

/// All sites of a lattice, on the calling thread's rayon pool.
pub fn sites(scene: &SceneTables, gatherer: &Gatherer, frame: &Frame) -> (Vec<Site>, Vec<SiteSurface>) {
    let lattice = gatherer.lattice;
    let columns = lattice.columns as u32;
    let key = key_of(lattice);
    (0..columns * lattice.rows as u32)
        .into_par_iter()
        .map(|number| {
            let x = site_place(lattice, number % columns, lattice.offset_x);
            let y = site_place(lattice, number / columns, lattice.offset_y);
            let (origin, direction) = (frame.position.into(), camera_direction(frame, x, y));
            let Some(hit) = scene.closest_hit(origin, direction, None) else {
                return (Site::default(), SiteSurface { face: -1.0, ..SiteSurface::default() });
            };
            let surface = scene.surface_at(origin, direction, hit);
            let irradiance = match scene.material_of(hit.shape).diffuse > 0.0 {
                true => final_gather(scene, gatherer, &surface, hash2_u(number, key), lattice.rays as u32),
                false => Vec3::ZERO,
            };
            let seen = SiteSurface { face: face_of(&surface), distance: hit.t, reserved: 0.0 };
            (Site { irradiance: irradiance.to_array() }, seen)
        })
        .unzip()
}
