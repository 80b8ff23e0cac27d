//! Whether a context really draws: a driver may be there and yet compile nothing.

use super::{Headless, Program, Target};
use crate::error::{Error, Result};
use crate::program::source::{Options, assemble};

/// Draws with a tiny shader and checks what it wrote.
///
/// # Errors
/// [`Error::Build`] with the build log, or [`Error::Device`] with the first wrong value.
pub fn probe(context: &Headless) -> Result<()> {
    context.make_current()?;
    let program = Program::new(&context.gl, &assemble("probe.frag", None, &Options::default()))?;
    let target = Target::new(&context.gl, 64, 1, true)?;
    program.activate();
    target.draw(&program)?;
    for (x, [found, ..]) in (0u32..).zip(target.read()) {
        if found != x * x + 1 {
            return Err(Error::Device(format!("{}: expected {}, found {found}", context.renderer, x * x + 1)));
        }
    }
    Ok(())
}
