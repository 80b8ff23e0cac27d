//! Hashed cells: how many buckets there are, and where in the table each face's rows begin.

use super::Form;
use crate::error::{Error, Result};
use crate::program::gathering::GATHER_SPREAD;
use crate::records::{Face, MAX_EXACT_INDEX};

/// The entries of a grid's table.
pub(super) struct Table {
    /// Cells, or buckets of all tables.
    pub cells: usize,
    /// Buckets of one table less 1, a mask since they are a power of two; 0 where cells are not hashed.
    pub mask: usize,
}

/// Most cells of a hashed row that photons within a query's reach may lie in. Rows of the same v, w on different faces
/// begin at least so many buckets apart: a query's buckets then hold no photon near by of another face. Faces whose u and
/// v are exchanged have a table of their own.
pub(super) fn hash_reach(radius: f32, cell: [f32; 3]) -> usize {
    // Either axis may run along rows.
    let cells = (GATHER_SPREAD + 2.01) * radius / cell[0].min(cell[1]);
    // What `gather.glsl` adds for rounded coordinates comes to 8 cells on each side before cells have no end any more; two
    // more are cut by the ends, and two lie beside them.
    cells.ceil() as usize + 16 + 4
}

/// Gives each face its place in a table of buckets, or in one of two: faces whose u and v are exchanged have their own.
///
/// # Errors
/// [`Error::Usage`] when there are more faces than buckets can keep apart.
///
/// # Panics
/// When the number of buckets is no power of two.
pub(super) fn hash(faces: &mut [Face], form: Form, affordable: usize, reach: usize) -> Result<Table> {
    let wanted = match form {
        Form::Hashed(Some(buckets)) => {
            assert!(buckets.is_power_of_two(), "{buckets} buckets are no power of two");
            buckets as usize
        }
        // The largest power of two that is affordable.
        _ => ((affordable + 1).next_power_of_two() / 2).clamp(64, 1 << 23),
    };
    let is_flipped = |face: &Face| face.flipped != 0.0;
    let tables = if faces.iter().any(is_flipped) && !faces.iter().all(is_flipped) { 2 } else { 1 };
    let cells = wanted.max((tables * faces.len() * reach).next_power_of_two());
    if cells as u64 >= MAX_EXACT_INDEX {
        return Err(Error::Usage(format!(
            "{} objects: the hashed grid takes at most {} with cells of this size",
            faces.len() / 2,
            MAX_EXACT_INDEX as usize / 2 / (2 * tables * reach)
        )));
    }
    let table = cells / tables;
    let apart = table / faces.len().max(1);
    for (number, face) in faces.iter_mut().enumerate() {
        let first = if tables == 2 && is_flipped(face) { table } else { 0 };
        let base = (number * apart) as f32;
        *face = Face { flipped: face.flipped, base, table: first as f32, ..Face::default() };
    }
    Ok(Table { cells, mask: table - 1 })
}
