//! Stable radix sort of (key, number) pairs on the device (`kernels/sort.cl`).

use super::scan::Scan;
use crate::cl::{Buffer, Context, Kernel};
use crate::error::Result;
use crate::source::{Options, assemble};

/// The sort's kernels and its memory, which grows with the largest sort and is kept.
pub struct Sort {
    count: Kernel,
    scatter: Kernel,
    scan: Scan,
    digit_bits: u32,
    /// Keys to sort go in here; which of the two holds them afterwards is told by [`Sort::sort`].
    pub keys: [Buffer<u32>; 2],
    /// Numbers of the pairs, in the order of their keys.
    pub values: [Buffer<u32>; 2],
    places: Buffer<u32>,
}

/// How `count` elements are shared out: work-items, and neighbouring elements for each.
///
/// A CPU's work-item is a long loop, a few for each core so that the last one does not keep the others waiting; a GPU
/// wants as many as it gets, but for each a run long enough to spread the cost of its counters.
pub fn share(context: &Context, count: usize) -> (usize, usize) {
    let per_item = if context.device.lanes == 1 {
        16
    } else {
        count.div_ceil(4 * context.device.compute_units.max(1) as usize).max(1024)
    };
    (count.div_ceil(per_item).max(1), per_item)
}

impl Sort {
    /// Builds the kernels for a device.
    ///
    /// # Errors
    /// [`crate::error::Error::Build`] when the driver refuses them.
    pub fn new(context: &Context) -> Result<Sort> {
        // Counters of a GPU's work-item: 16, in registers or nearly; of a CPU's: 8 KiB, inside its L1 cache, and two
        // passes for every table up to 2²² cells (measured at 6, 8, 9 and 11 bits).
        let digit_bits = if context.device.lanes == 1 { 4 } else { 11 };
        let defines = vec![format!("DIGIT_BITS {digit_bits}")];
        let source = assemble("sort.cl", None, &Options { defines, ..Options::default() });
        Ok(Sort {
            count: context.kernel(&source, "sort_count")?,
            scatter: context.kernel(&source, "sort_scatter")?,
            scan: Scan::new(context)?,
            digit_bits,
            keys: [Buffer::new(context, 0)?, Buffer::new(context, 0)?],
            values: [Buffer::new(context, 0)?, Buffer::new(context, 0)?],
            places: Buffer::new(context, 0)?,
        })
    }

    /// Makes room for `count` pairs.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when memory is short.
    pub fn reserve(&mut self, context: &Context, count: usize) -> Result<()> {
        if self.keys[0].len() < count {
            self.keys = [Buffer::new(context, count)?, Buffer::new(context, count)?];
            self.values = [Buffer::new(context, count)?, Buffer::new(context, count)?];
        }
        let places = share(context, count).0 << self.digit_bits;
        if self.places.len() < places {
            self.places = Buffer::new(context, places)?;
        }
        Ok(())
    }

    /// Sorts the first `count` of `keys[0]`, all below `limit`, and returns which of the two keys and values hold the
    /// result: `values[it][i]` is the number (from 0) that the i-th smallest key had. Equal keys keep their order.
    /// Returns at once; the queue is in order.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when a launch is refused.
    pub fn sort(&self, context: &Context, count: usize, limit: usize) -> Result<usize> {
        let (items, per_item) = share(context, count);
        let bits = usize::BITS - limit.saturating_sub(1).leading_zeros();
        let passes = bits.div_ceil(self.digit_bits).max(1);
        let mut from = 0;
        for pass in 0..passes {
            let (to, shift) = (1 - from, (pass * self.digit_bits) as i32);
            let (count_arg, per_item_arg) = ((count as i32).into(), (per_item as i32).into());
            let args = [(&self.keys[from]).into(), (&self.places).into(), count_arg, per_item_arg, shift.into()];
            context.launch(&self.count, &args, &[items], None)?;
            self.scan.exclusive(context, &self.places, items << self.digit_bits)?;
            let args = [
                (&self.keys[from]).into(),
                (&self.values[from]).into(),
                (&self.places).into(),
                (&self.keys[to]).into(),
                (&self.values[to]).into(),
                count_arg,
                per_item_arg,
                shift.into(),
                i32::from(pass == 0).into(),
            ];
            context.launch(&self.scatter, &args, &[items], None)?;
            from = to;
        }
        Ok(from)
    }

    /// Bytes held on the device.
    pub fn bytes(&self) -> usize {
        self.keys.iter().chain(&self.values).map(Buffer::bytes).sum::<usize>() + self.places.bytes()
    }
}
