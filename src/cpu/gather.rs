//! Twin of `glsl/shared/gather.glsl`: radiance from the photons around a point.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::density::{kernel_peak, kernel_shape, visible_part};
use super::grid::{
    GridTables, PhotonTables, cell_along, cell_axes, cells_of, dense_row, face_of, grid_axes, hashed_row, is_endless,
};
use super::tiles::{TileTables, find_region, scatters};
use crate::plan::cells::GridPlan;
use crate::plan::tiling;
use crate::program::gathering::{Gathering, Method};
use crate::rays::bsdf::ggx;
use crate::rays::scene::{SceneTables, Surface};
use crate::rays::shapes;
use crate::records::{Gather, Region};

/// A photon map as a picture sees it.
#[derive(Clone, Copy)]
pub struct PhotonMap<'a> {
    /// How it is gathered.
    pub gathering: &'a Gathering,
    /// Radius, cells, faces.
    pub plan: &'a GridPlan,
    /// In path order: what [`Method::Brute`] and methods with tiles read.
    pub stored: PhotonTables<'a>,
    /// In the order of cells: what the others read.
    pub grid: &'a GridTables,
    /// Lists of stored photons: what [`Method::Tiles`] and [`Method::TiledGrid`] read.
    pub tiles: Option<(&'a tiling::TilePlan, &'a TileTables)>,
}

/// What the photons around a point sum up to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gathered {
    /// Σ ΔΦ·K/K(0), watts.
    pub flux: Vec3,
    /// Σ ΔΦ·K/K(0)·(GGX lobe), W/sr.
    pub glint: Vec3,
}

/// A photon that lies within a query's disc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Near {
    /// Squared distance, m².
    pub d2: f32,
    /// Index into the tables that the method reads.
    pub photon: usize,
}

/// Calls `visit` for each candidate photon (an index into the sorted tables) of a face around a point.
pub fn for_each_candidate(map: &PhotonMap, face: usize, point: Vec3, mut visit: impl FnMut(usize)) {
    let Gather { radius, cell, inverse_cell, bucket_mask, .. } = map.plan.gather;
    let record = &map.plan.faces[face];
    let origin = record.origin;
    let [cell, inverse] = [cell, inverse_cell].map(|size| cell_axes(size, record.flipped, &map.plan.gather));
    let size = 2.0 * point.abs().element_sum();
    let reach = radius * 1.0005 + 5e-7 * (size + Vec3::from(origin).abs().element_sum());
    let at = grid_axes(point.to_array(), record.flipped);
    let at = [0, 1, 2].map(|axis| at[axis] - origin[axis]);
    // Along rows by that coordinate alone: the hash counts on it.
    let along = if map.plan.hashed { radius * 1.0005 + 5e-7 * 2.0 * at[0].abs() } else { f32::INFINITY };
    let range = |axis: usize| {
        let first = cell_along(at[axis] - reach, inverse[axis]);
        let last = cell_along(at[axis] + reach, inverse[axis]);
        if map.plan.hashed { first..=last } else { first.max(0)..=last.min(record.counts[axis] as i32 - 1) }
    };
    let gap = |number: i32, axis: usize| {
        if map.plan.hashed && is_endless(number) {
            return 0.0;
        }
        let low = number as f32 * cell[axis];
        (low - at[axis]).max(at[axis] - (low + cell[axis])).max(0.0)
    };
    for w in range(2) {
        let w_left = reach * reach - gap(w, 2) * gap(w, 2);
        for v in range(1) {
            let chord = (w_left - gap(v, 1) * gap(v, 1)).max(0.0).sqrt().min(along);
            let mut u_first = cell_along(at[0] - chord, inverse[0]);
            let mut u_last = cell_along(at[0] + chord, inverse[0]);
            let mut run = |bucket: i32, length: i32| {
                let start = |c: i32| map.grid.cell_starts[c as usize] as usize;
                (start(bucket)..start(bucket + length)).for_each(&mut visit);
            };
            if map.plan.hashed {
                let mask = bucket_mask as i32;
                u_last = u_last.min(u_first + mask);
                let row = hashed_row(record, v, w);
                // Rows that share a bucket are told apart by where their photons are.
                let mut visit_own = |i: usize| {
                    if cells_of(&map.grid.positions[i], record, &map.plan.gather)[1..] == [v, w] {
                        visit(i);
                    }
                };
                while u_first <= u_last {
                    let bucket = row.wrapping_add(u_first) & mask;
                    let length = (u_last - u_first + 1).min(mask + 1 - bucket);
                    let start = |c: i32| map.grid.cell_starts[record.table as usize + c as usize] as usize;
                    (start(bucket)..start(bucket + length)).for_each(&mut visit_own);
                    u_first += length;
                }
            } else {
                u_first = u_first.max(0);
                u_last = u_last.min(record.counts[0] as i32 - 1);
                if u_first <= u_last {
                    run(dense_row(record, v, w) + u_first, u_last - u_first + 1);
                }
            }
        }
    }
}

/// The same for a region of a tile; candidates are stored photons.
pub fn for_each_listed(tables: &TileTables, region: &Region, radius: f32, point: Vec3, mut visit: impl FnMut(usize)) {
    let size = 2.0 * point.abs().element_sum();
    let reach = radius * 1.0005 + 5e-7 * (size + Vec3::from(region.origin).abs().element_sum());
    let [cell, inverse, at] =
        [region.cell, region.inverse_cell, point.to_array()].map(|axes| grid_axes(axes, region.flipped));
    let at = [0, 1, 2].map(|axis| at[axis] - region.origin[axis]);
    let range = |axis: usize, reach: f32| {
        let first = cell_along(at[axis] - reach, inverse[axis]).max(0);
        first..=cell_along(at[axis] + reach, inverse[axis]).min(region.counts[axis] as i32 - 1)
    };
    let gap = |number: i32, axis: usize| {
        let low = number as f32 * cell[axis];
        (low - at[axis]).max(at[axis] - (low + cell[axis])).max(0.0)
    };
    let start = |c: i32| tables.cell_starts[region.base as usize + c as usize] as usize;
    for w in range(2, reach) {
        for v in range(1, reach) {
            let chord = (reach * reach - gap(w, 2).powi(2) - gap(v, 1).powi(2)).max(0.0).sqrt();
            let along = range(0, chord);
            if !along.is_empty() {
                let row = (w * region.counts[1] as i32 + v) * region.counts[0] as i32;
                let run = start(row + along.start())..start(row + along.end() + 1);
                tables.tile_photons[run].iter().for_each(|photon| visit(*photon as usize));
            }
        }
    }
}

/// The photons of a face within R of a point, in the order in which the tables hold them. `tile` is the point's.
pub fn near(map: &PhotonMap, face: usize, point: Vec3, tile: usize) -> Vec<Near> {
    let inverse_radius2 = map.plan.gather.inverse_radius * map.plan.gather.inverse_radius;
    let mut found = Vec::new();
    let mut weigh = |photon: usize, position: [f32; 3]| {
        let away = Vec3::from(position) - point;
        let d2 = away.dot(away);
        if d2 * inverse_radius2 < 1.0 {
            found.push(Near { d2, photon });
        }
    };
    // Without a region, the whole map: a point that no tile has seen.
    let region = map.tiles.and_then(|(plan, tables)| Some((find_region(plan, tile, face, point)?, tables)));
    if let Some((region, tables)) = region {
        let radius = map.plan.gather.radius;
        for_each_listed(tables, region, radius, point, |i| weigh(i, map.stored.positions[i].position));
    } else if map.gathering.method.reads_stored() {
        for (i, position) in map.stored.positions.iter().enumerate() {
            if face_of(&map.stored.surfaces[i]) == face {
                weigh(i, position.position);
            }
        }
    } else {
        for_each_candidate(map, face, point, |i| weigh(i, map.grid.positions[i].position));
    }
    found
}

/// Whether a wall lies between the point and a photon.
pub fn walled_off(scene: &SceneTables, surface: &Surface, photon: Vec3) -> bool {
    // Both lie on the surface itself: which side of it rounding puts them on says nothing.
    scene.all().any(|shape| shape.number != surface.shape && shapes::parts(&shape, surface.position, photon))
}

/// Photons that are summed at a time.
const SUM_BLOCK: usize = 256;

/// Radiance that the photons around a visible point send towards the viewer, W·m⁻²·sr⁻¹.
/// `tile` is that of the pixel which sees the point; only methods with tiles ask for it.
pub fn photon_radiance(scene: &SceneTables, map: &PhotonMap, surface: &Surface, to_viewer: Vec3, tile: usize) -> Vec3 {
    let material = scene.material_of(surface.shape);
    if map.tiles.is_some() && !scatters(material) {
        return Vec3::ZERO;
    }
    let face = surface.face_left();
    let kernel = map.gathering.density_kernel;
    let mut inverse_radius = map.plan.gather.inverse_radius;
    let stored = map.gathering.method.reads_stored();

    let mut found = near(map, face, surface.position, tile);
    let position = |i: usize| if stored { map.stored.positions[i].position } else { map.grid.positions[i].position };
    if map.gathering.both_sides {
        found.retain(|n| !walled_off(scene, surface, position(n.photon).into()));
    }
    if map.gathering.method == Method::Knn {
        // The k nearest, and the next one's distance as their radius: an unbiased count over the disc it spans
        // (Moore & Yackel 1977), where the k-th own distance would count a photon that lies on the rim.
        let k = map.plan.gather.nearest as usize;
        found.sort_by(|a, b| a.d2.total_cmp(&b.d2));
        if let Some(next) = found.get(k) {
            inverse_radius = 1.0 / next.d2.sqrt().max(f32::MIN_POSITIVE);
            found.truncate(k);
        }
    }

    let mut sum = Gathered::default();
    // Sums stall where they outgrow their terms: photons are summed in blocks, and blocks then.
    for block in found.chunks(SUM_BLOCK) {
        let mut part = Gathered::default();
        for &Near { d2, photon } in block {
            let weight = kernel_shape(kernel, d2, inverse_radius * inverse_radius);
            let power =
                Vec3::from(if stored { map.stored.powers[photon].power } else { map.grid.powers[photon].power });
            part.flux += power * weight;
            if material.specular > 0.0 {
                let directions = if stored { map.stored.directions } else { &map.grid.directions[..] };
                let to_light = Vec3::from(directions[photon].direction);
                let cos_i = surface.normal.dot(to_light);
                if cos_i > 0.0 {
                    let cos_o = surface.normal.dot(to_viewer).max(0.0);
                    part.glint +=
                        power * (weight * ggx(surface.normal, to_viewer, to_light, cos_o, cos_i, material.roughness));
                }
            }
        }
        sum.flux += part.flux;
        sum.glint += part.glint;
    }
    let mut scale = kernel_peak(kernel) * inverse_radius * inverse_radius;
    if map.gathering.clip {
        scale /= visible_part(scene, map.gathering, surface, inverse_radius);
    }
    let diffuse = Vec3::from(material.color) * (material.diffuse * FRAC_1_PI);
    (diffuse * sum.flux + sum.glint * material.specular) * scale
}
