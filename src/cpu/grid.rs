//! Twin of `kernels/grid.cl`, `kernels/sort.cl` and `glsl/shared/cell.glsl`: photons sorted into cells.

use crate::plan::cells::{Bounds, GridPlan};
use crate::records::{Face, Gather, PhotonDirection, PhotonPosition, PhotonPower};

/// A photon map as it was stored, in path order.
#[derive(Clone, Copy, Debug, Default)]
pub struct PhotonTables<'a> {
    /// Where.
    pub positions: &'a [PhotonPosition],
    /// What.
    pub powers: &'a [PhotonPower],
    /// On what.
    pub surfaces: &'a [PhotonSurface],
    /// From where; empty unless a glossy surface asks.
    pub directions: &'a [PhotonDirection],
}

/// A photon map in the order of its grid's cells, with the table of where cells begin.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GridTables {
    /// Number that each sorted photon had before.
    pub order: Vec<u32>,
    /// First photon of each cell, and the number of photons at the end.
    pub cell_starts: Vec<f32>,
    /// Sorted.
    pub positions: Vec<PhotonPosition>,
    /// Sorted.
    pub powers: Vec<PhotonPower>,
    /// Sorted; empty unless given.
    pub directions: Vec<PhotonDirection>,
}

/// On what a photon landed. The device keeps only [`face_of`] it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PhotonSurface {
    /// Index into the object table.
    pub shape: f32,
    /// +1: it came from the side that the object's normal points to; −1: from the other.
    pub side: f32,
    /// Scattering events before it landed: 0 straight from the light.
    pub bounce: f32,
}

/// A photon's face: 2·object + (0 | 1).
pub fn face_of(surface: &PhotonSurface) -> usize {
    2 * surface.shape as usize + usize::from(surface.side < 0.0)
}

/// u, v, w from x, y, z.
pub fn grid_axes(p: [f32; 3], flipped: f32) -> [f32; 3] {
    if flipped != 0.0 { [p[1], p[0], p[2]] } else { p }
}

/// A cell's size, or its inverse, along u, v, w.
pub fn cell_axes(size: [f32; 3], flipped: f32, gather: &Gather) -> [f32; 3] {
    if gather.by_rows != 0.0 { size } else { grid_axes(size, flipped) }
}

/// Floats count to 2²⁴ exactly. What lies farther out shares the last cells: photons and queries alike.
const MAX_CELL: i32 = 8_000_000;

/// Number of the cell at a distance from the face's first one, along one axis.
pub fn cell_along(distance: f32, inverse_cell: f32) -> i32 {
    (distance * inverse_cell).floor().clamp(-MAX_CELL as f32, MAX_CELL as f32) as i32
}

/// Whether a cell is one of the last, which have no end.
pub fn is_endless(cell: i32) -> bool {
    cell.abs() >= MAX_CELL
}

/// Where in the hashed table a row has its cell u = 0, before wrapping.
pub fn hashed_row(face: &Face, v: i32, w: i32) -> i32 {
    let mut h = (v as u32).wrapping_mul(73_856_093) ^ (w as u32).wrapping_mul(19_349_663);
    h = (h ^ (h >> 16)).wrapping_mul(0x7feb_352d);
    h = (h ^ (h >> 15)).wrapping_mul(0x846c_a68b);
    face.base as i32 + ((h ^ (h >> 16)) >> 8) as i32
}

/// The same in the dense form.
pub fn dense_row(face: &Face, v: i32, w: i32) -> i32 {
    face.base as i32 + (w * face.counts[1] as i32 + v) * face.counts[0] as i32
}

/// Cell numbers along u, v, w of a photon on a face.
pub fn cells_of(position: &PhotonPosition, face: &Face, gather: &Gather) -> [i32; 3] {
    let inverse = cell_axes(gather.inverse_cell, face.flipped, gather);
    let p = grid_axes(position.position, face.flipped);
    [0, 1, 2].map(|axis| cell_along(p[axis] - face.origin[axis], inverse[axis]))
}

/// Box of each face's photons, for `faces` faces.
pub fn grid_bounds(photons: &PhotonTables, faces: usize) -> Vec<Bounds> {
    let mut bounds = vec![Bounds::EMPTY; faces];
    for (position, surface) in photons.positions.iter().zip(photons.surfaces) {
        bounds[face_of(surface)].add(position.position);
    }
    bounds
}

/// Number of each photon's cell in the table.
pub fn grid_keys(photons: &PhotonTables, plan: &GridPlan) -> Vec<u32> {
    let key = |(position, surface): (&PhotonPosition, &PhotonSurface)| {
        let face = &plan.faces[face_of(surface)];
        let [u, v, w] = cells_of(position, face, &plan.gather);
        if plan.hashed {
            face.table as u32 + (hashed_row(face, v, w).wrapping_add(u) & plan.gather.bucket_mask as i32) as u32
        } else {
            (dense_row(face, v, w) + u) as u32
        }
    };
    photons.positions.iter().zip(photons.surfaces).map(key).collect()
}

/// Sorts a photon map into a planned grid; within a cell photons keep the order of their numbers.
pub fn grid(photons: &PhotonTables, plan: &GridPlan) -> GridTables {
    let keys = grid_keys(photons, plan);
    let mut order: Vec<u32> = (0..keys.len() as u32).collect();
    order.sort_by_key(|i| keys[*i as usize]);
    let mut cell_starts = Vec::with_capacity(plan.cells + 1);
    for (place, photon) in order.iter().enumerate() {
        while cell_starts.len() <= keys[*photon as usize] as usize {
            cell_starts.push(place as f32);
        }
    }
    cell_starts.resize(plan.cells + 1, keys.len() as f32);
    GridTables {
        cell_starts,
        positions: reordered(photons.positions, &order),
        powers: reordered(photons.powers, &order),
        directions: if photons.directions.is_empty() { Vec::new() } else { reordered(photons.directions, &order) },
        order,
    }
}

fn reordered<T: Copy>(table: &[T], order: &[u32]) -> Vec<T> {
    order.iter().map(|i| table[*i as usize]).collect()
}
