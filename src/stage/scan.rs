//! Exclusive prefix sums on the device (`kernels/scan.cl`): the offsets behind count → scan → compact.

use std::cell::RefCell;

use crate::device::cl::{Arguments, Buffer, Context, Kernel};
use crate::error::Result;
use crate::program::source::{self, Options};

/// The scan's kernels, and the memory that its upper levels keep between calls.
pub struct Scan {
    tiles: Kernel,
    add: Kernel,
    /// Work-items that share a tile.
    group: usize,
    /// Values that a work-group scans.
    tile: usize,
    /// Totals of each level's tiles, from the lowest level up.
    levels: RefCell<Vec<Buffer<u32>>>,
}

impl Scan {
    /// Builds the kernels for a device.
    ///
    /// # Errors
    /// [`crate::error::Error::Build`] when the driver refuses them.
    pub fn new(context: &Context) -> Result<Scan> {
        // A GPU's work-group stages 2048 values in 8 KiB of local memory; a CPU's core loops over 4096 (16 KiB, half
        // of an L1 cache).
        let (group, per_item) = if context.device.lanes == 1 { (256, 8) } else { (1, 4096) };
        let defines = vec![format!("GROUP {group}u"), format!("PER_ITEM {per_item}u")];
        let source = source::assemble("scan.cl", None, &Options { defines, ..Options::default() });
        Ok(Scan {
            tiles: context.kernel(&source, "scan_tiles")?,
            add: context.kernel(&source, "scan_add")?,
            group,
            tile: group * per_item,
            levels: RefCell::default(),
        })
    }

    /// Replaces each of the first `count` values by the sum of all before it, modulo 2³². To learn the total, give
    /// one value more, a 0: it becomes the sum of all. Returns at once; the queue is in order.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when memory is short or a launch is refused.
    ///
    /// # Panics
    /// When `count` is more than the buffer holds.
    pub fn exclusive(&self, context: &Context, values: &Buffer<u32>, count: usize) -> Result<()> {
        assert!(count <= values.len(), "scan of {count} values in a buffer of {}", values.len());
        let mut levels = self.levels.borrow_mut();
        // Up: lengths of the levels until one tile holds all.
        let mut counts = vec![count];
        loop {
            let level = counts.len() - 1;
            let tiles = counts[level].div_ceil(self.tile).max(1);
            if levels.len() == level {
                levels.push(Buffer::new(context, tiles)?);
            } else if levels[level].len() < tiles {
                levels[level] = Buffer::new(context, tiles.next_power_of_two())?;
            }
            if tiles == 1 {
                break;
            }
            counts.push(tiles);
        }
        let at = |level: usize| if level == 0 { values } else { &levels[level - 1] };
        let arguments = |level: usize| {
            let args = Arguments::new().with("values", at(level)).with("totals", at(level + 1));
            args.with("count", counts[level] as u32)
        };
        for (level, &length) in counts.iter().enumerate() {
            let groups = length.div_ceil(self.tile);
            context.launch(&self.tiles, &arguments(level), &[groups * self.group], Some(&[self.group]))?;
        }
        // Down: what lies before each tile.
        for level in (0..counts.len() - 1).rev() {
            let groups = counts[level].div_ceil(self.tile).saturating_sub(1);
            context.launch(&self.add, &arguments(level), &[groups * self.group], Some(&[self.group]))?;
        }
        Ok(())
    }
}
