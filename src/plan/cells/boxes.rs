//! Boxes of photons, and how cells fill them.

use super::CellSize;
use crate::records::face::{shape_of_sheet, sheet_of};
use crate::records::{Face, Shape};
use crate::shapes::sheet_of as sheet_of_record;

/// The box of a face's photons, scene space, metres. Empty when low > high.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The corner of the lowest x, y, z.
    pub low: [f32; 3],
    /// The corner of the highest x, y, z.
    pub high: [f32; 3],
}

impl Bounds {
    /// The box of no photon at all.
    pub const EMPTY: Bounds = Bounds { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

    /// Whether there is no photon.
    pub fn is_empty(&self) -> bool {
        self.low[0] > self.high[0]
    }

    /// Widens the box so that it holds a point.
    pub fn add(&mut self, p: [f32; 3]) {
        for ((low, high), p) in self.low.iter_mut().zip(&mut self.high).zip(p) {
            *low = low.min(p);
            *high = high.max(p);
        }
    }
}

/// Photons within a query's disc, if all lay evenly on the faces' boxes.
pub(super) fn within_a_disc(bounds: &[Bounds], photons: usize, radius: f32) -> f32 {
    let area = |b: &Bounds| {
        let [x, y, z] = [0, 1, 2].map(|axis| b.high[axis] - b.low[axis]);
        (x * y).max(y * z).max(z * x)
    };
    let area: f32 = bounds.iter().filter(|b| !b.is_empty()).map(area).sum();
    photons as f32 * std::f32::consts::PI * radius * radius / area
}

/// Whether u and v are exchanged on a shape's faces: planes across x have one or two cells along x only, and rows
/// should be long.
pub(crate) fn flipped(shape: &Shape) -> bool {
    sheet_of_record(shape).is_across_x()
}

/// Number of a distance's cell, rounded as `cell_along` rounds.
fn cell_along(distance: f32, inverse_cell: f32) -> f32 {
    (distance * inverse_cell).floor()
}

/// Sides of cells.
pub(super) struct Sides {
    /// Metres: along x, y, z, or along rows and across them.
    pub cell: [f32; 3],
    /// 1 / cell.
    pub inverse: [f32; 3],
    /// Whether the first is along every face's rows, whatever axis these run along.
    pub by_rows: bool,
}

/// How large cells of this kind are where photons have these boxes.
pub(super) fn sides(size: CellSize, bounds: &[Bounds], radius: f32) -> Sides {
    let cell = match size {
        // Dense cells are laid out before these are asked for.
        CellSize::Auto | CellSize::Alone | CellSize::Fragments => [radius / super::CELLS_PER_RADIUS; 3],
        CellSize::PerRadius(cells) => [radius / cells; 3],
        CellSize::Rows(along, across) => [radius / along, radius / across, radius / across],
        CellSize::Metres(cell) | CellSize::Lattice { cell, .. } => cell,
        CellSize::Counts(counts) => counted(counts, bounds, radius),
    };
    Sides { cell, inverse: cell.map(|c| 1.0 / c), by_rows: matches!(size, CellSize::Rows(..)) }
}

/// So many cells along x, y, z of the box of all photons; a box without depth is one cell deep whatever its size.
fn counted(counts: [u32; 3], bounds: &[Bounds], radius: f32) -> [f32; 3] {
    let mut all = Bounds::EMPTY;
    for face in bounds.iter().filter(|b| !b.is_empty()) {
        all.add(face.low);
        all.add(face.high);
    }
    [0, 1, 2].map(|i| {
        let extent = (all.high[i] - all.low[i]).max(0.0);
        if extent > 0.0 { extent / counts[i].max(1) as f32 } else { radius }
    })
}

/// Every face's box filled with cells, one face's behind the other's; and how many cells that makes.
pub(super) fn fill_boxes(shapes: &[Shape], bounds: &[Bounds], size: CellSize, sides: &Sides) -> (Vec<Face>, f64) {
    let mut faces = vec![Face::default(); bounds.len()];
    let mut base = 0.0f64;
    for (face, (record, bounds)) in faces.iter_mut().zip(bounds).enumerate() {
        let flip = flipped(&shapes[shape_of_sheet(sheet_of(face))]);
        record.flipped = f32::from(u8::from(flip));
        if bounds.is_empty() {
            continue;
        }
        let axes = if flip { [1, 0, 2] } else { [0, 1, 2] };
        let origin = first_corner(size, bounds, sides);
        record.origin = axes.map(|axis| origin[axis]);
        for (k, axis) in axes.into_iter().enumerate() {
            let inverse_cell = sides.inverse[if sides.by_rows { k } else { axis }];
            record.counts[k] = cell_along(bounds.high[axis] - origin[axis], inverse_cell) + 1.0;
        }
        record.base = base as f32;
        base += record.counts.iter().map(|c| f64::from(*c)).product::<f64>();
    }
    (faces, base)
}

/// Where the first cell of a box begins: at its lowest corner, or at the lattice's border before that.
fn first_corner(size: CellSize, bounds: &Bounds, sides: &Sides) -> [f32; 3] {
    let CellSize::Lattice { corner, .. } = size else { return bounds.low };
    [0, 1, 2].map(|axis| {
        let cells = cell_along(bounds.low[axis] - corner[axis], sides.inverse[axis]);
        let border = corner[axis] + cells * sides.cell[axis];
        border.min(bounds.low[axis]) // rounding must not leave a photon before the first cell
    })
}
