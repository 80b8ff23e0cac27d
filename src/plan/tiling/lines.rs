//! The regions of each face, one row of tiles after the other: a photon asks only those of its own face, in the tiles
//! inside its disc's rectangle.

use crate::records::{Region, Tile};

/// Regions sorted by face, row of tiles, column of tiles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lines {
    /// By face (2·object + (0 | 1)): which of the seen faces it is, −1 where no pixel sees it.
    pub slots: Vec<i32>,
    /// By seen face and row of tiles: the first entry; and the number of entries at the end.
    pub starts: Vec<u32>,
    /// The column of each entry's tile, rising within a row.
    pub columns: Vec<u32>,
    /// Of each entry's region: lowest x, y, z, squared margin, highest x, y, z (metres), number.
    pub boxes: Vec<[f32; 8]>,
}

impl Lines {
    /// Sorts the regions of `size` tiles across and down; `faces` in all, seen or not.
    pub fn of(tiles: &[Tile], regions: &[Region], size: [u32; 2], faces: usize) -> Lines {
        let [across, down] = size.map(|side| side as usize);
        let mut slots = vec![-1; faces];
        let mut seen = 0;
        for region in regions {
            let slot = &mut slots[region.face as usize];
            if *slot < 0 {
                *slot = seen;
                seen += 1;
            }
        }
        let line = |tile: usize, region: &Region| slots[region.face as usize] as usize * down + tile / across;
        let each = || {
            tiles.iter().enumerate().flat_map(|(number, tile)| {
                let first = tile.first as usize;
                (first..first + tile.count as usize).map(move |region| (number, region))
            })
        };
        // A counting sort: tiles come row by row, so columns rise.
        let mut starts = vec![0; seen as usize * down + 1];
        for (tile, region) in each() {
            starts[line(tile, &regions[region]) + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut columns = vec![0; regions.len()];
        let mut boxes = vec![[0.0; 8]; regions.len()];
        for (tile, number) in each() {
            let region = &regions[number];
            let place = &mut next[line(tile, region)];
            let ([a, b, c], [d, e, f]) = (region.low, region.high);
            columns[*place as usize] = (tile % across) as u32;
            boxes[*place as usize] = [a, b, c, region.margin2, d, e, f, number as f32];
            *place += 1;
        }
        Lines { slots, starts, columns, boxes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_region_is_found_under_its_face_row_and_column() {
        // Two columns, two rows: faces 1 and 4; face 4; nothing; faces 1 and 4.
        let tile = |first: f32, count: f32| Tile { first, count, ..Tile::default() };
        let tiles = [tile(0.0, 2.0), tile(2.0, 1.0), tile(0.0, 0.0), tile(3.0, 2.0)];
        let region = |face: f32| Region { face, ..Region::default() };
        let regions = [1.0, 4.0, 4.0, 1.0, 4.0].map(region);
        let lines = Lines::of(&tiles, &regions, [2, 2], 6);
        assert_eq!(lines.slots, [-1, 0, -1, -1, 1, -1]);
        assert_eq!(lines.starts, [0, 1, 2, 4, 5], "face 1 above and below, face 4 above and below");
        assert_eq!(lines.columns, [0, 1, 0, 1, 1]);
        assert_eq!(lines.boxes.iter().map(|b| b[7]).collect::<Vec<_>>(), [0.0, 3.0, 1.0, 2.0, 4.0]);
    }
}
