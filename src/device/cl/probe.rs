//! Whether a device really computes: a driver may be there and yet build nothing.

use super::{Arguments, Buffer, Context};
use crate::error::{Error, Result};
use crate::program::source::{Options, assemble};

/// Runs a tiny kernel and checks what it wrote.
///
/// # Errors
/// [`Error::Build`] with the build log, or [`Error::Device`] with the first wrong value.
pub fn probe(context: &Context) -> Result<()> {
    probe_with(context, Vec::new())
}

/// As [`probe`], with a kernel that is in no cache.
pub(super) fn probe_anew(context: &Context) -> Result<()> {
    let since = std::time::UNIX_EPOCH.elapsed().unwrap_or_default();
    probe_with(context, vec![format!("PROBE_{}_{}", std::process::id(), since.as_nanos())])
}

fn probe_with(context: &Context, defines: Vec<String>) -> Result<()> {
    let options = Options { defines, ..Options::default() };
    let kernel = context.kernel(&assemble("probe.cl", None, &options), "probe")?;
    let squares = Buffer::<u32>::new(context, 64)?;
    context.launch(&kernel, &Arguments::new().with("squares", &squares), &[64], None)?;
    for (i, found) in (0u32..).zip(squares.to_vec(context)?) {
        if found != i * i + 1 {
            return Err(Error::Device(format!("{}: expected {}, found {found}", context.device.name, i * i + 1)));
        }
    }
    Ok(())
}
