//! The longest cell of a grid or of tiles: a bound on how long a query can be, which tells whether a GPU's picture has to
//! be cut within pixels.

use super::sort::share;
use crate::device::cl::{Arguments, Buffer, Context, Kernel};
use crate::error::Result;
use crate::program::source::{Options, assemble};

/// The kernel, and where it answers.
pub struct LongestCell {
    kernel: Kernel,
    answer: Buffer<u32>,
}

impl LongestCell {
    /// Builds it.
    ///
    /// # Errors
    /// [`crate::error::Error::Build`] when the driver refuses the kernel.
    pub fn new(context: &Context) -> Result<LongestCell> {
        let source = assemble("grid.cl", None, &Options::default());
        Ok(LongestCell { kernel: context.kernel(&source, "grid_fullest")?, answer: Buffer::new(context, 1)? })
    }

    /// Most photons of any of the first `cells` cells. Waits for all that was launched before.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the launch fails.
    pub fn of(&mut self, context: &Context, cell_starts: &Buffer<f32>, cells: usize) -> Result<u64> {
        self.answer.write(context, &[0])?;
        let (items, per_item) = share(context, cells);
        let args = Arguments::new().with("cell_starts", cell_starts).with("fullest", &self.answer);
        let args = args.with("cells", cells as i32).with("per_item", per_item as i32);
        context.launch(&self.kernel, &args, &[items], None)?;
        Ok(self.answer.get(context, 0)?.into())
    }
}
