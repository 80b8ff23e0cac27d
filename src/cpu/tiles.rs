//! Twin of `kernels/tiles.cl` and `glsl/shared/tile.glsl`: photons into screen-space tiles.

use std::collections::BTreeMap;

use glam::Vec3;
use rayon::prelude::*;

use super::grid::{PhotonTables, cell_along, face_of, grid_axes};
use crate::plan::cells::Bounds;
use crate::plan::tiling::{Seen, TilePlan, tiles_of};
use crate::rays::camera::sample_direction;
use crate::rays::scene::SceneTables;
use crate::records::{Frame, Gather, Material, Region};

/// The tiles' lists.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TileTables {
    /// First place of each cell in the list, and the list's length at the end.
    pub cell_starts: Vec<f32>,
    /// Numbers of photons in path order.
    pub tile_photons: Vec<f32>,
}

/// Whether a material scatters photons' light towards the viewer at all.
pub fn scatters(material: &Material) -> bool {
    Vec3::from(material.color).max_element() * material.diffuse > 0.0 || material.specular > 0.0
}

/// The tile that a pixel belongs to.
pub fn tile_at(gather: &Gather, column: u32, row: u32) -> usize {
    let (x, y) = (column as f32 / gather.tile_width, row as f32 / gather.tile_height);
    y as usize * gather.tiles_across as usize + x as usize
}

/// What each tile sees of each face.
pub fn tiles_seen(scene: &SceneTables, frame: &Frame, tile: [u32; 2]) -> Vec<Seen> {
    let [across, down] = tiles_of(frame, tile);
    let (width, height) = (frame.width as u32, frame.height as u32);
    let origin = Vec3::from(frame.position);
    let samples = if scene.features.one_sample { 1 } else { frame.samples as u32 };
    let one = |number: u32| {
        let (left, top) = (number % across * tile[0], number / across * tile[1]);
        let mut boxes = BTreeMap::<u32, Bounds>::new();
        for row in top..(top + tile[1]).min(height) {
            for column in left..(left + tile[0]).min(width) {
                for s in 0..samples {
                    let direction = sample_direction(frame, scene.features.one_sample, column, row, s);
                    let Some(hit) = scene.closest_hit(origin, direction, None) else { continue };
                    let surface = scene.surface_at(origin, direction, hit);
                    let p = surface.position;
                    if p.abs().element_sum() < 1e15 && scatters(scene.material_of(hit.shape)) {
                        let face = 2 * surface.shape as u32 + u32::from(surface.side < 0.0);
                        boxes.entry(face).or_insert(Bounds::EMPTY).add(p.to_array());
                    }
                }
            }
        }
        boxes.into_iter().map(|(face, bounds)| Seen { tile: number, face, bounds }).collect::<Vec<_>>()
    };
    (0..across * down).into_par_iter().flat_map_iter(one).collect()
}

/// Slopes, lowest and highest, of the rays that meet a disc in the plane of one image axis and the viewing direction.
pub fn slopes(across: f32, depth: f32, radius: f32) -> [f32; 2] {
    let mut slope = [-1e15, 1e15];
    let tangent2 = across * across + depth * depth - radius * radius;
    if tangent2 > 0.0 {
        let tangent = tangent2.sqrt();
        let (low, high) = (depth * tangent + across * radius, depth * tangent - across * radius);
        if low > 0.0 {
            slope[0] = (across * tangent - depth * radius) / low;
        }
        if high > 0.0 {
            slope[1] = (across * tangent + depth * radius) / high;
        }
    }
    [slope[0] - 4e-6 * (1.0 + slope[0].abs()), slope[1] + 4e-6 * (1.0 + slope[1].abs())]
}

/// Tiles along an image axis that pixels from low to high can touch.
fn tile_range(low: f32, high: f32, size: f32, tiles: u32) -> std::ops::RangeInclusive<i32> {
    let most = tiles as f32 * size;
    let last = ((high + 1.0).clamp(-1.0, most) / size) as i32;
    ((low - 1.0).clamp(0.0, most) / size) as i32..=last.min(tiles as i32 - 1) - i32::from(high < -1.0)
}

/// Cell of a photon in a region.
fn cell_of(p: Vec3, region: &Region) -> u32 {
    let inverse = grid_axes(region.inverse_cell, region.flipped);
    let q = grid_axes(p.to_array(), region.flipped);
    let along =
        |axis: usize| cell_along(q[axis] - region.origin[axis], inverse[axis]).clamp(0, region.counts[axis] as i32 - 1);
    let row = along(2) * region.counts[1] as i32 + along(1);
    (region.base as i32 + row * region.counts[0] as i32 + along(0)) as u32
}

/// Calls `visit` with the tile's number and the region for each region that a photon's disc can touch.
pub fn enter(plan: &TilePlan, frame: &Frame, p: Vec3, face: usize, mut visit: impl FnMut(usize, &Region)) {
    let Gather { radius, tile_width, tile_height, .. } = plan.gather;
    let [eye, right, up, forward] = [frame.position, frame.right, frame.up, frame.forward].map(Vec3::from);
    let away = p - eye;
    let sum = p.x.abs() + p.y.abs() + p.z.abs() + eye.x.abs() + eye.y.abs() + eye.z.abs();
    let reach = radius * 1.0005 + 4e-6 * sum;
    let depth = away.dot(forward);
    if depth + reach <= 0.0 {
        return;
    }
    let (half_width, half_height) = (right.dot(right).sqrt(), up.dot(up).sqrt());
    let across = slopes(away.dot(right) / half_width, depth, reach).map(|s| s / half_width);
    let upward = slopes(away.dot(up) / half_height, depth, reach).map(|s| s / half_height);
    let (pixels, rows) = (0.5 * frame.width, 0.5 * frame.height);
    let columns = tile_range((across[0] + 1.0) * pixels, (across[1] + 1.0) * pixels, tile_width, plan.size[0]);
    let lines = tile_range((1.0 - upward[1]) * rows, (1.0 - upward[0]) * rows, tile_height, plan.size[1]);
    for y in lines {
        for x in columns.clone() {
            let number = y as usize * plan.size[0] as usize + x as usize;
            let tile = &plan.tiles[number];
            let first = tile.first as usize;
            let regions = &plan.regions[first..first + tile.count as usize];
            let Some(region) = regions.iter().find(|r| r.face as usize == face) else { continue };
            let [low, high] = [region.low, region.high].map(Vec3::from);
            let gap = (low - p).max(p - high).max(Vec3::ZERO);
            if gap.dot(gap) <= region.margin2 {
                visit(number, region);
            }
        }
    }
}

/// Photons into laid-out tiles; within a cell they keep the order of their numbers.
///
/// # Errors
/// [`crate::error::Error::Usage`] when the lists are longer than a float can count.
pub fn tiles(photons: &PhotonTables, plan: &TilePlan, frame: &Frame) -> crate::error::Result<TileTables> {
    let mut pairs = Vec::<(u32, u32)>::new();
    for (i, (position, surface)) in photons.positions.iter().zip(photons.surfaces).enumerate() {
        let p = Vec3::from(position.position);
        enter(plan, frame, p, face_of(surface), |_, region| pairs.push((cell_of(p, region), i as u32)));
    }
    crate::plan::tiling::check_pairs(pairs.len() as u64, plan)?;
    pairs.sort_by_key(|(cell, _)| *cell);
    let mut cell_starts = Vec::with_capacity(plan.cells + 1);
    for (place, (cell, _)) in pairs.iter().enumerate() {
        while cell_starts.len() <= *cell as usize {
            cell_starts.push(place as f32);
        }
    }
    cell_starts.resize(plan.cells + 1, pairs.len() as f32);
    Ok(TileTables { cell_starts, tile_photons: pairs.iter().map(|(_, photon)| *photon as f32).collect() })
}

/// The region of a tile that holds a point of a face.
pub fn find_region(plan: &TilePlan, tile: usize, face: usize, point: Vec3) -> Option<&Region> {
    let tile = &plan.tiles[tile];
    let first = tile.first as usize;
    let region = plan.regions[first..first + tile.count as usize].iter().find(|r| r.face as usize == face)?;
    let slack = Vec3::splat(1e-3 * plan.gather.radius + 5e-7 * point.abs().element_sum());
    let inside = point.cmpge(Vec3::from(region.low) - slack) & point.cmple(Vec3::from(region.high) + slack);
    inside.all().then_some(region)
}
