//! Stable radix sort of (key, number) pairs on the device (`kernels/sort.cl`).

use super::scan::Scan;
use crate::device::cl::{Arguments, Buffer, Context, Kernel};
use crate::error::Result;
use crate::program::source::{Options, assemble};

/// The sort's kernels.
pub struct Sort {
    count: Kernel,
    scatter: Kernel,
    scan: Scan,
    digit_bits: u32,
    /// Work-items that sort a run together.
    group: usize,
}

/// Work-items of a GPU's work-group, and pairs of each of them: 27 KiB of local memory, of which OpenCL 1.2 promises 32.
const GROUP: (usize, usize) = (256, 8);

/// What a sort works in.
pub struct Scratch {
    /// Keys to sort go into the first; which of the two holds them afterwards is told by [`Sort::sort`].
    pub keys: [Buffer<u32>; 2],
    /// Numbers of the pairs, in the order of their keys.
    pub values: [Buffer<u32>; 2],
    /// At least [`Sort::places`].
    pub places: Buffer<u32>,
}

impl Scratch {
    /// Room for nothing.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when memory is short.
    pub fn empty(context: &Context) -> Result<Scratch> {
        let none = || Buffer::new(context, 0);
        Ok(Scratch { keys: [none()?, none()?], values: [none()?, none()?], places: none()? })
    }

    /// Bytes held on the device.
    pub fn bytes(&self) -> usize {
        let Scratch { keys, values, places } = self;
        keys.iter().chain(values).map(Buffer::bytes).sum::<usize>() + places.bytes()
    }
}

/// How `count` elements are shared out among work-items that count or add something up over theirs: work-items, and
/// neighbouring elements for each.
///
/// A CPU's work-item is a long loop, a few for each core so that the last one does not keep the others waiting; a GPU
/// wants as many as it gets, but for each a run long enough to spread the cost of its sums.
pub fn share(context: &Context, count: usize) -> (usize, usize) {
    if context.device.lanes == 1 { (count.div_ceil(16).max(1), 16) } else { each(context, count) }
}

/// The same where elements have nothing to do with each other: on a GPU one for each work-item, so that neighbours read
/// and write neighbouring memory (2 to 4 times as fast there).
pub fn each(context: &Context, count: usize) -> (usize, usize) {
    let per_item = if context.device.lanes == 1 {
        1
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
        // On a GPU two halves of 16 counters a work-item; on a CPU 8 KiB, inside its L1 cache, and two passes for every
        // table up to 2²² cells (measured at 6, 8, 9 and 11 bits).
        let (digit_bits, (group, per_item)) = if context.device.lanes == 1 { (8, GROUP) } else { (11, (1, 1)) };
        let defines =
            vec![format!("DIGIT_BITS {digit_bits}"), format!("GROUP {group}"), format!("PER_ITEM {per_item}")];
        let source = assemble("sort.cl", None, &Options { defines, ..Options::default() });
        Ok(Sort {
            count: context.kernel(&source, "sort_count")?,
            scatter: context.kernel(&source, "sort_scatter")?,
            scan: Scan::new(context)?,
            digit_bits,
            group,
        })
    }

    /// Who counts: work-items, or a GPU's work-groups; and how many neighbouring pairs each of them.
    fn owners(&self, context: &Context, count: usize) -> (usize, usize) {
        match self.group {
            1 => share(context, count),
            group => (count.div_ceil(group * GROUP.1).max(1), group * GROUP.1),
        }
    }

    /// Makes room for `count` pairs.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when memory is short.
    pub fn reserve(&self, context: &Context, scratch: &mut Scratch, count: usize) -> Result<()> {
        let [one, other] = &mut scratch.keys;
        let [first, second] = &mut scratch.values;
        for buffer in [one, other, first, second] {
            buffer.fit(context, count)?;
        }
        scratch.places.fit(context, self.places(context, count))?;
        Ok(())
    }

    /// Counters that a sort of `count` pairs takes.
    pub fn places(&self, context: &Context, count: usize) -> usize {
        self.owners(context, count).0 << self.digit_bits
    }

    /// Passes over keys below `limit`.
    fn passes(&self, limit: usize) -> u32 {
        let bits = usize::BITS - limit.saturating_sub(1).leading_zeros();
        bits.div_ceil(self.digit_bits).max(1)
    }

    /// Which of the two keys and values will hold the result of a sort of keys below `limit`.
    pub fn result(&self, limit: usize) -> usize {
        self.passes(limit) as usize % 2
    }

    /// Sorts the first `count` of `keys[0]`, all below `limit`, and returns which of the two keys and values hold the
    /// result: `values[it][i]` is the number (from 0) that the i-th smallest key had. Equal keys keep their order.
    /// Returns at once; the queue is in order.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when a launch is refused.
    pub fn sort(&self, context: &Context, scratch: &Scratch, count: usize, limit: usize) -> Result<usize> {
        let (owners, per_owner) = self.owners(context, count);
        let (global, local) = ([owners * self.group], [self.group]);
        let local = (self.group > 1).then_some(&local[..]);
        let passes = self.passes(limit);
        let mut from = 0;
        for pass in 0..passes {
            let (to, shift) = (1 - from, (pass * self.digit_bits) as i32);
            let shared = Arguments::new().with("keys", &scratch.keys[from]).with("count", count as i32);
            let shared = shared.with("per_item", per_owner as i32).with("shift", shift);
            let shared = shared.with("owners", owners as i32);
            context.launch(&self.count, &shared.clone().with("counts", &scratch.places), &global, local)?;
            self.scan.exclusive(context, &scratch.places, owners << self.digit_bits)?;
            let args = shared.with("values", &scratch.values[from]).with("places", &scratch.places);
            let args = args.with("sorted_keys", &scratch.keys[to]).with("sorted_values", &scratch.values[to]);
            let args = args.with("numbers", i32::from(pass == 0));
            context.launch(&self.scatter, &args, &global, local)?;
            from = to;
        }
        debug_assert_eq!(from, self.result(limit));
        Ok(from)
    }
}
