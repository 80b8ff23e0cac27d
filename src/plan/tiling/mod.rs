//! Lays out the tiles: from the boxes of what each tile sees to its regions and their cells. The device and its twin
//! both start from this plan; `tile.glsl` says what tiles and regions are.

mod lines;

pub use lines::Lines;

use crate::error::{Error, Result};
use crate::plan::cells::{Bounds, CELLS_PER_RADIUS, flipped};
use crate::records::{Frame, Gather, MAX_EXACT_INDEX, Region, Shape, Tile};

/// Width and height of a tile where none are asked for, pixels.
pub const TILE: [u32; 2] = [32, 32];

/// How tiles are wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TileSettings {
    /// R, metres.
    pub radius: f32,
    /// Width and height, pixels; the last column and row of tiles may reach over the image. Larger ones than the image
    /// are as large as it is.
    pub tile: [u32; 2],
    /// A grid of cells in every tile: `tiled-grid`. Without, a tile's region is one cell.
    pub cells: bool,
}

/// What a tile sees of one face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Number of the tile, row by row.
    pub tile: u32,
    /// 2·object + (0 | 1).
    pub face: u32,
    /// Box of the visible points, scene space, metres.
    pub bounds: Bounds,
}

/// Laid-out tiles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TilePlan {
    /// Tiles across and down.
    pub size: [u32; 2],
    /// Radius and the tiles' size.
    pub gather: Gather,
    /// Row by row.
    pub tiles: Vec<Tile>,
    /// Tile after tile; within a tile by face.
    pub regions: Vec<Region>,
    /// Cells of all regions.
    pub cells: usize,
    /// The regions once more, as photons look for them.
    pub lines: Lines,
}

/// A tile as it is laid out: no larger than the image, so that what is made for a tile is bounded by what it can see.
pub fn within(frame: &Frame, tile: [u32; 2]) -> [u32; 2] {
    [tile[0].min(frame.width as u32), tile[1].min(frame.height as u32)]
}

/// Tiles across and down an image.
pub fn tiles_of(frame: &Frame, tile: [u32; 2]) -> [u32; 2] {
    [(frame.width as u32).div_ceil(tile[0]), (frame.height as u32).div_ceil(tile[1])]
}

/// Lays out tiles. `seen` may name a tile's face more than once, in any order: parts of tiles see parts of regions.
///
/// # Errors
/// [`Error::Usage`] when there are more photons, tiles or regions than a float can count.
pub fn plan(
    shapes: &[Shape],
    frame: &Frame,
    mut seen: Vec<Seen>,
    photons: usize,
    wanted: &TileSettings,
) -> Result<TilePlan> {
    let size = tiles_of(frame, wanted.tile);
    let tile = within(frame, wanted.tile);
    let tile_count = size[0] as usize * size[1] as usize;
    seen.sort_by_key(|s| (s.tile, s.face));
    seen.dedup_by(|next, first| {
        let same = (next.tile, next.face) == (first.tile, first.face);
        if same {
            first.bounds.add(next.bounds.low);
            first.bounds.add(next.bounds.high);
        }
        same
    });
    let most = photons.max(tile_count).max(seen.len());
    if most as u64 >= MAX_EXACT_INDEX {
        return Err(Error::Usage(format!(
            "{photons} photons in {tile_count} tiles with {} regions: indices travel as float values, which are exact \
             below {MAX_EXACT_INDEX} only",
            seen.len()
        )));
    }
    // The table of all cells takes no more than the grid's own may: four entries a photon. A region has at least one.
    let affordable = ((4 * photons).max(1 << 16) / seen.len().max(1)).clamp(1, MAX_CELLS);
    let mut tiles = vec![Tile::default(); tile_count];
    let mut cells = 0;
    let mut regions = Vec::with_capacity(seen.len());
    for Seen { tile, face, bounds } in seen {
        let tile = &mut tiles[tile as usize];
        if tile.count == 0.0 {
            tile.first = regions.len() as f32;
        }
        tile.count += 1.0;
        let Bounds { low, high } = bounds;
        let size = low.iter().chain(&high).map(|x| x.abs()).sum::<f32>();
        // Points up to 1e-3 R outside a box, along each axis, are served by it (`find_region`).
        let margin = wanted.radius * 1.0025 + 5e-6 * size;
        // Wider than that.
        let grow = wanted.radius * 1.0035 + 1e-5 * size;
        let extent = [0, 1, 2].map(|axis| high[axis] - low[axis] + 2.0 * grow);
        // An axis-aligned plane is flat, and so are its photons: cells across it would be empty rows.
        let flat = [0, 1, 2].map(|axis| high[axis] - low[axis] < FLAT * wanted.radius);
        let [cell, along] =
            if wanted.cells { cells_of(extent, flat, wanted.radius, affordable) } else { [extent, [1.0; 3]] };
        let flip = flipped(&shapes[face as usize / 2]);
        let axes = if flip { [1, 0, 2] } else { [0, 1, 2] };
        regions.push(Region {
            low,
            high,
            origin: axes.map(|axis| low[axis] - grow),
            counts: axes.map(|axis| along[axis]),
            cell,
            inverse_cell: cell.map(|c| 1.0 / c),
            face: face as f32,
            base: cells as f32,
            flipped: f32::from(u8::from(flip)),
            margin2: margin * margin,
            ..Region::default()
        });
        cells += along.iter().product::<f32>() as usize;
    }
    let gather = Gather {
        radius: wanted.radius,
        inverse_radius: 1.0 / wanted.radius,
        photon_count: photons as f32,
        tiles_across: size[0] as f32,
        tile_width: tile[0] as f32,
        tile_height: tile[1] as f32,
        ..Gather::default()
    };
    let lines = Lines::of(&tiles, &regions, size, 2 * shapes.len());
    Ok(TilePlan { size, gather, tiles, regions, cells, lines })
}

/// Cells of one region at most.
pub const MAX_CELLS: usize = 1 << 12;

/// A region thinner than this, in radii, is one cell thick.
const FLAT: f32 = 0.1;

/// Sizes and numbers of a region's cells along x, y, z: as the grid's, but never more than `affordable`, and one along
/// an axis across which the region is flat.
fn cells_of(extent: [f32; 3], flat: [bool; 3], radius: f32, affordable: usize) -> [[f32; 3]; 2] {
    let mut size = radius / CELLS_PER_RADIUS;
    loop {
        let along = [0, 1, 2].map(|axis| if flat[axis] { 1.0 } else { (extent[axis] / size).ceil().max(1.0) });
        if along.iter().product::<f32>() <= affordable as f32 {
            return [[0, 1, 2].map(|axis| if flat[axis] { extent[axis] } else { size }), along];
        }
        size *= 1.25;
    }
}

/// Refuses lists that no float could index.
///
/// # Errors
/// [`Error::Usage`] that says what would help.
pub fn check_pairs(pairs: u64, plan: &TilePlan) -> Result<()> {
    if pairs < MAX_EXACT_INDEX {
        return Ok(());
    }
    let Gather { tile_width, tile_height, radius, photon_count, .. } = plan.gather;
    Err(Error::Usage(format!(
        "found {pairs} entries for {photon_count} photons of radius {radius} in tiles of {tile_width}x{tile_height}, \
         expected fewer than {MAX_EXACT_INDEX}, since indices travel as float values; larger tiles, a smaller radius or \
         --gather grid would do"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::records::PLANE;

    fn seen(tile: u32, face: u32, low: [f32; 3], high: [f32; 3]) -> Seen {
        Seen { tile, face, bounds: Bounds { low, high } }
    }

    fn shapes() -> Vec<Shape> {
        vec![
            Shape { anchor: [0.0, 1.0, 0.0], kind: PLANE, ..Shape::default() },
            Shape { anchor: [1.0, 0.0, 0.0], kind: PLANE, ..Shape::default() },
        ]
    }

    #[test]
    fn parts_of_a_tile_become_one_region_a_face() {
        let frame = Frame { width: 70.0, height: 33.0, ..Frame::default() };
        let parts = vec![
            seen(2, 2, [0.0; 3], [0.0, 1.0, 1.0]),
            seen(0, 0, [0.0; 3], [1.0, 0.0, 1.0]),
            seen(2, 0, [0.0; 3], [1.0, 0.0, 1.0]),
            seen(2, 0, [-1.0, 0.0, 0.0], [0.5, 0.0, 3.0]),
        ];
        for cells in [false, true] {
            let wanted = TileSettings { radius: 0.5, tile: [32, 32], cells };
            let plan = plan(&shapes(), &frame, parts.clone(), 1000, &wanted).unwrap();
            assert_eq!(plan.size, [3, 2]);
            let tile = |i: usize| (plan.tiles[i].first, plan.tiles[i].count);
            assert_eq!((tile(0), tile(1).1, tile(2), tile(5).1), ((0.0, 1.0), 0.0, (1.0, 2.0), 0.0));
            let [_, floor, wall] = plan.regions[..] else { panic!("three regions") };
            assert_eq!((floor.face, floor.low, floor.high), (0.0, [-1.0, 0.0, 0.0], [1.0, 0.0, 3.0]));
            assert_eq!((wall.face, wall.flipped), (2.0, 1.0));
            if cells {
                assert_eq!(floor.counts, [13.0, 1.0, 17.0], "half a radius wide, the radius around");
            } else {
                assert_eq!(plan.cells, 3);
            }
        }
    }

    #[test]
    fn cells_are_bounded_whatever_the_extent() {
        let frame = Frame { width: 64.0, height: 64.0, ..Frame::default() };
        for far in [1e1, 1e4, 1e8, 1e14] {
            let wanted = TileSettings { radius: 0.1, tile: [32, 32], cells: true };
            let parts = (0..4).map(|tile| seen(tile, 0, [-far, 0.0, -far], [far, 0.0, far])).collect();
            let plan = plan(&shapes(), &frame, parts, 100_000, &wanted).unwrap();
            assert!(plan.cells <= 4 * MAX_CELLS, "{far}: {}", plan.cells);
            let region = plan.regions[0];
            assert!((0..3).all(|i| region.counts[i] * region.cell[i] >= region.high[i] - region.low[i]));
        }
    }

    #[test]
    fn a_tile_larger_than_the_image_is_laid_out_as_the_image() {
        let frame = Frame { width: 48.0, height: 36.0, ..Frame::default() };
        let of = |tile| {
            let wanted = TileSettings { radius: 0.5, tile, cells: true };
            plan(&shapes(), &frame, vec![seen(0, 0, [0.0; 3], [1.0, 0.0, 1.0])], 1000, &wanted).unwrap()
        };
        let image = of([48, 36]);
        for tile in [[32_768; 2], [48, 37], [49, 36], [u32::MAX; 2]] {
            assert_eq!(of(tile), image, "{tile:?}");
        }
        // Along one axis it may still be larger.
        assert_eq!((of([32_768, 9]).size, of([32_768, 9]).gather.tile_width), ([1, 4], 48.0));
        assert_ne!(of([47, 36]), image);
    }

    #[test]
    fn what_floats_cannot_count_is_refused() {
        assert!(check_pairs(MAX_EXACT_INDEX - 1, &TilePlan::default()).is_ok());
        let refused = check_pairs(MAX_EXACT_INDEX, &TilePlan::default());
        assert!(matches!(refused, Err(Error::Usage(text)) if text.contains("larger tiles")));
    }
}
