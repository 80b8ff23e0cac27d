//! Lays out the photon grid: from the box of each face's photons and a radius to the faces' records, and the choice
//! between its two forms. The device and its twin both start from this plan; `cell.glsl` says what cells are.

mod boxes;
mod hashing;
pub mod photon_density;

pub use boxes::Bounds;
pub(crate) use boxes::flipped;
use boxes::{fill_boxes, sides, within_a_disc};
use hashing::{Table, hash, hash_reach};

use crate::device::memory::table_entries;
use crate::error::{Error, Result};
use crate::records::face::faces_of;
use crate::records::{Face, Gather, MAX_EXACT_INDEX, Shape};

/// Cells per radius, along each axis, where a work-item's lanes gather together. Measured on a closed room at 200k
/// photons: candidates per accepted photon are 1.22 at R/6, 1.34 at R/4, 1.70 at R/2, 2.55 at R, 4.6 at 2R for one
/// query, in 12.9, 8.9, 4.9, 3.0 and 2.0 runs; for 16 pixels together 1.6 to 1.9, 1.7 to 2.1, 2.1 to 2.5, 3.0 to 3.5.
/// Together candidates are cheap and runs are not.
pub const CELLS_PER_RADIUS: f32 = 2.0;

/// The same where every query walks alone, as fragments do: there a candidate costs two fetches.
pub const CELLS_PER_RADIUS_ALONE: f32 = 3.0;

/// Cells per radius along rows, and across them, in the order in which they are tried until a dense table holds them.
/// Along a row finer cells spare candidates and take no time: a query reads one run of them whatever their number.
const TOGETHER: [(f32, f32); 3] = [(8.0, CELLS_PER_RADIUS), (4.0, CELLS_PER_RADIUS), (2.0, CELLS_PER_RADIUS)];
/// The same for queries that walk alone.
const ALONE: [(f32, f32); 6] = [
    (8.0, CELLS_PER_RADIUS_ALONE),
    (4.0, CELLS_PER_RADIUS_ALONE),
    (CELLS_PER_RADIUS_ALONE, CELLS_PER_RADIUS_ALONE),
    (4.0, 2.0),
    (2.0, 2.0),
    (1.0, 1.0),
];
/// The same where fewer than [`FEW`] photons lie within a query's disc: a row costs as much as some ten candidates.
const SPARSE: [(f32, f32); 4] = [(8.0, 2.0), (4.0, 2.0), (2.0, 2.0), (1.0, 1.0)];
const FEW: f32 = 75.0;

/// How large cells are.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum CellSize {
    /// R divided by [`CELLS_PER_RADIUS`], along rows by more where that need not be hashed.
    #[default]
    Auto,
    /// R divided by this.
    PerRadius(f32),
    /// R divided by the first along the rows of every face, u, and by the second across them, along v and w.
    Rows(f32, f32),
    /// For queries that walk alone: R divided by [`CELLS_PER_RADIUS_ALONE`], or coarser cells where photons are few or
    /// where those would have to be hashed: in a fragment shader a hashed row costs five times a dense one. Hashed cells
    /// are R divided by [`CELLS_PER_RADIUS`]: sphere_and_plane takes a quarter less at R/2 than at R/3 (H200, R = 0.1 and
    /// 0.2 m).
    Alone,
    /// The same for fragments of a software driver, whose hashed cells are R wide where photons are few ([`plan_by_crowd`]).
    Fragments,
    /// Along x, y, z; metres.
    Metres([f32; 3]),
    /// So many cells along x, y, z of the box of all photons, as `--grid NXxNYxNZ` asks for.
    Counts([u32; 3]),
    /// Cells of this size whose borders go through `corner`, scene space, both in metres: a fixed box's own cells, which
    /// go on beyond the box as far as photons lie, so that none is lost.
    Lattice {
        /// A corner of some cell.
        corner: [f32; 3],
        /// Along x, y, z.
        cell: [f32; 3],
    },
}

/// Which of the two forms the grid takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Form {
    /// Dense where that takes no more memory than the photons themselves, else hashed.
    #[default]
    Auto,
    /// Every face's box filled with cells.
    Dense,
    /// A table of this many buckets, a power of two, or more where so many faces need them; `None`: as many as are
    /// affordable.
    Hashed(Option<u32>),
}

/// A laid-out grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GridPlan {
    /// Whether cells are hashed into buckets, rather than filling boxes.
    pub hashed: bool,
    /// Cells of the table, or buckets of both.
    pub cells: usize,
    /// Two a sheet.
    pub faces: Vec<Face>,
    /// Radius, cell size, bucket mask.
    pub gather: Gather,
}

/// Photons of a disc where they lie closest below which hashed cells are R wide: most rows are empty then, and each costs its
/// look at the table. sphere_and_plane, 200k photons, llvmpipe, at R and R/2: 86 and 127 ms for R = 0.1 m, 156 and 166 for
/// 0.2 m. (On an H200 2.6 and 3.0, 7.0 and 5.7: not worth half a millisecond of looking.)
const FEW_HASHED: f32 = 15.0;

/// [`plan`] where [`CellSize::Fragments`] goes by how close photons lie in the hashed form too; `crowd` tells, and is asked only
/// there (see [`photon_density::crowd`]).
///
/// # Errors
/// As [`plan`], and those of `crowd`.
pub fn plan_by_crowd(
    shapes: &[Shape],
    glossy: bool,
    bounds: &[Bounds],
    photons: usize,
    radius: f32,
    (size, form): (CellSize, Form),
    crowd: impl FnOnce() -> Result<f32>,
) -> Result<GridPlan> {
    let usual = plan(shapes, glossy, bounds, photons, radius, size, form)?;
    if !usual.hashed || (size, form) != (CellSize::Fragments, Form::Auto) || crowd()? >= FEW_HASHED {
        return Ok(usual);
    }
    plan(shapes, glossy, bounds, photons, radius, CellSize::PerRadius(1.0), Form::Hashed(None))
}

/// Lays out the grid for photons whose faces have these boxes (two a sheet, in the order of faces).
///
/// # Errors
/// [`Error::Usage`] when a dense grid was asked for that no table can hold, or there are more photons than a float
/// can count.
///
/// # Panics
/// When `bounds` has not an entry a face, or the number of buckets is no power of two.
pub fn plan(
    shapes: &[Shape],
    glossy: bool,
    bounds: &[Bounds],
    photons: usize,
    radius: f32,
    size: CellSize,
    form: Form,
) -> Result<GridPlan> {
    for (along, across) in dense_rows(bounds, photons, radius, size, form) {
        let dense = plan(shapes, glossy, bounds, photons, radius, CellSize::Rows(*along, *across), form)?;
        if !dense.hashed {
            return Ok(dense);
        }
    }
    assert_eq!(bounds.len(), faces_of(shapes.len()), "two faces a sheet");
    if photons as u64 >= MAX_EXACT_INDEX {
        return Err(Error::Usage(format!(
            "{photons} photons: indices travel as float values, which are exact below {MAX_EXACT_INDEX} only"
        )));
    }
    let sides = sides(size, bounds, radius);
    let (mut faces, dense_cells) = fill_boxes(shapes, bounds, size, &sides);
    let affordable = table_entries(glossy, photons);
    let hashed = is_hashed(form, dense_cells, affordable as f64)?;
    let Table { cells, mask } = match hashed {
        true => hash(&mut faces, form, affordable, hash_reach(radius, sides.cell))?,
        false => Table { cells: dense_cells as usize, mask: 0 },
    };
    let gather = Gather {
        slices: 1.0,
        radius,
        inverse_radius: 1.0 / radius,
        photon_count: photons as f32,
        cell: sides.cell,
        inverse_cell: sides.inverse,
        by_rows: f32::from(u8::from(sides.by_rows)),
        bucket_mask: mask as f32,
        ..Gather::default()
    };
    Ok(GridPlan { hashed, cells, faces, gather })
}

/// Sizes of cells, along rows and across them, that are tried until a dense table holds them; none where the user says one.
fn dense_rows(bounds: &[Bounds], photons: usize, radius: f32, size: CellSize, form: Form) -> &'static [(f32, f32)] {
    match (size, form) {
        (CellSize::Auto, Form::Auto) => &TOGETHER,
        (CellSize::Alone | CellSize::Fragments, Form::Auto) if within_a_disc(bounds, photons, radius) < FEW => &SPARSE,
        (CellSize::Alone | CellSize::Fragments, Form::Auto) => &ALONE,
        _ => &[],
    }
}

/// The form that so many dense cells get, where a table of `affordable` ones takes no more memory than the photons.
fn is_hashed(form: Form, dense_cells: f64, affordable: f64) -> Result<bool> {
    let countable = (MAX_EXACT_INDEX - 1) as f64;
    match form {
        Form::Auto => Ok(dense_cells > affordable.min(countable)),
        Form::Dense if dense_cells > countable => Err(Error::Usage(format!(
            "a dense grid of {dense_cells:.3e} cells: indices travel as float values, exact below {MAX_EXACT_INDEX} only; \
             larger cells or the hashed form would do"
        ))),
        Form::Dense => Ok(false),
        Form::Hashed(_) => Ok(true),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::records::PLANE;

    fn plane(normal: [f32; 3]) -> Shape {
        Shape { anchor: normal, kind: PLANE, ..Shape::default() }
    }

    fn room(scale: f32) -> (Vec<Shape>, Vec<Bounds>) {
        let shapes = vec![plane([0.0, 1.0, 0.0]), plane([1.0, 0.0, 0.0])];
        let floor = Bounds { low: [-3.0 * scale, -2.0, -3.0 * scale], high: [3.0 * scale, -2.0, 3.0 * scale] };
        let wall = Bounds { low: [3.0, -2.0, -3.0 * scale], high: [3.0, 2.0, 3.0 * scale] };
        (shapes, vec![floor, Bounds::EMPTY, Bounds::EMPTY, wall])
    }

    #[test]
    fn flat_faces_are_one_cell_thick_and_lie_behind_each_other() {
        let (shapes, bounds) = room(1.0);
        let plan = plan(&shapes, false, &bounds, 1000, 1.0, CellSize::Auto, Form::Auto).unwrap();
        assert!(!plan.hashed);
        assert_eq!(plan.faces[0].counts, [49.0, 1.0, 13.0]);
        assert_eq!(plan.faces[1].counts, [0.0; 3]);
        assert_eq!(plan.faces[3].counts, [33.0, 1.0, 13.0], "rows of a wall across x run along y");
        assert_eq!(plan.faces[3].base, 637.0);
        assert_eq!(plan.cells, 637 + 429);
    }

    #[test]
    fn hashed_faces_lie_farther_apart_than_queries_reach() {
        let normal = |i: usize| [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]][i % 2];
        let shapes: Vec<Shape> = (0..300).map(|i| plane(normal(i))).collect();
        let bounds = vec![Bounds { low: [0.0; 3], high: [1e6; 3] }; 600];
        for (size, reach) in [(CellSize::Auto, 33), (CellSize::Alone, 33), (CellSize::PerRadius(3.0), 39)] {
            let plan = plan(&shapes, false, &bounds, 1000, 0.1, size, Form::Hashed(Some(64))).unwrap();
            assert_eq!(hash_reach(0.1, plan.gather.cell), reach);
            let table = plan.gather.bucket_mask as usize + 1;
            assert!(2 * table == plan.cells && plan.cells < 8 * 600 * reach, "{} buckets", plan.cells);
            // The last face's rows come before the first one's again.
            let bases: Vec<usize> = plan.faces.iter().map(|face| face.base as usize).chain([table]).collect();
            assert!(bases.windows(2).all(|pair| pair[1] - pair[0] >= reach), "{size:?}");
            assert!(plan.faces.iter().all(|face| face.table == face.flipped * table as f32));
        }
        let many = vec![plane([0.0, 1.0, 0.0]); 300_000];
        let refused = plan(&many, false, &vec![bounds[0]; 600_000], 1000, 0.1, CellSize::Auto, Form::Auto);
        assert!(matches!(refused, Err(Error::Usage(why)) if why.contains("at most")));
    }

    #[test]
    fn hashed_cells_are_wide_where_photons_are_few() {
        let (shapes, bounds) = room(1e4);
        let cells = |size, crowd: f32| {
            let plan = plan_by_crowd(&shapes, false, &bounds, 1000, 0.3, (size, Form::Auto), || Ok(crowd)).unwrap();
            assert!(plan.hashed);
            (0.3 / plan.gather.cell[0]).round()
        };
        assert_eq!((cells(CellSize::Fragments, 5.0), cells(CellSize::Fragments, 500.0)), (1.0, 2.0));
        assert_eq!((cells(CellSize::Alone, 5.0), cells(CellSize::Auto, 5.0)), (2.0, 2.0));
    }

    #[test]
    fn fragments_walk_through_fewer_rows_where_photons_are_few() {
        let (shapes, bounds) = room(1.0);
        let across = |size, photons| {
            let plan = plan(&shapes, false, &bounds, photons, 0.5, size, Form::Auto).unwrap();
            (0.5 / plan.gather.cell[1]).round()
        };
        assert_eq!((across(CellSize::Alone, 5000), across(CellSize::Alone, 10_000)), (2.0, 3.0), "65 and 131 a disc");
    }

    #[test]
    fn memory_is_bounded_whatever_the_extent() {
        for scale in [1.0, 1e2, 1e4, 1e6, 1e9] {
            let (shapes, bounds) = room(scale);
            let plan = plan(&shapes, false, &bounds, 100_000, 0.1, CellSize::Auto, Form::Auto).unwrap();
            assert_eq!(plan.hashed, scale > 10.0);
            assert!(plan.cells <= 400_000, "scale {scale}: {} cells", plan.cells);
            assert!(plan.gather.cell.iter().all(|cell| *cell <= 0.05), "far photons make no cell larger");
        }
    }

    #[test]
    fn counts_divide_the_box_of_all_photons() {
        let (shapes, bounds) = room(1.0);
        let plan = plan(&shapes, false, &bounds, 1000, 1.0, CellSize::Counts([60, 40, 40]), Form::Auto).unwrap();
        let close = |a: f32, b: f32| (a - b).abs() < 1e-6;
        assert!(plan.gather.cell.iter().zip([0.1, 0.1, 0.15]).all(|(a, b)| close(*a, b)), "{:?}", plan.gather.cell);
    }

    #[test]
    fn a_lattice_has_the_fixed_boxs_borders_and_holds_what_lies_outside_it() {
        let (shapes, bounds) = room(1.0);
        let size = CellSize::Lattice { corner: [-10.2, -10.0, -20.0], cell: [0.5; 3] };
        let plan = plan(&shapes, false, &bounds, 1000, 1.0, size, Form::Auto).unwrap();
        let floor = &plan.faces[0];
        let close = |a: f32, b: f32| (a - b).abs() < 1e-5;
        assert!(close(floor.origin[0], -3.2) && close(floor.origin[1], -2.0) && close(floor.origin[2], -3.0));
        assert_eq!(floor.counts, [13.0, 1.0, 13.0]);
        // The box ends at x = −4; photons of a wider room have cells too.
        let (shapes, bounds) = room(2.0);
        let size = CellSize::Lattice { corner: [-4.0; 3], cell: [0.5; 3] };
        let plan = super::plan(&shapes, false, &bounds, 1000, 1.0, size, Form::Auto).unwrap();
        let floor = &plan.faces[0];
        assert_eq!((floor.origin[0], floor.counts[0]), (-6.0, 25.0));
    }

    #[test]
    fn what_floats_cannot_count_is_refused() {
        let (shapes, bounds) = room(1e3);
        let dense = plan(&shapes, false, &bounds, 1000, 0.1, CellSize::Auto, Form::Dense);
        assert!(matches!(dense, Err(Error::Usage(_))));
        let many = plan(&shapes, false, &bounds, 1 << 24, 0.1, CellSize::Auto, Form::Auto);
        assert!(matches!(many, Err(Error::Usage(_))));
        assert!(plan(&shapes, false, &bounds, (1 << 24) - 1, 0.1, CellSize::Auto, Form::Auto).is_ok());
    }
}
