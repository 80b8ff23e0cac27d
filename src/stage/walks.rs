//! One pass of emission on a device: what every kernel that walks paths is given, and the search for the batch that
//! stores as many photons as are wanted.

use super::paths::{Paths, Range};
use super::scan::Scan;
use crate::cpu::photons::{FRUITLESS_PATHS, fruitless};
use crate::device::cl::{Arguments, Buffer, Context};
use crate::error::{Error, Result};
use crate::records::{Emitter, MAX_EXACT_INDEX};

/// Refuses more photons than indices in float values can tell apart.
pub fn check_stored(paths: u32, stored: u64) -> Result<()> {
    if stored < MAX_EXACT_INDEX {
        return Ok(());
    }
    Err(Error::Usage(format!(
        "{paths} paths store {stored} photons, a pass holds fewer than {MAX_EXACT_INDEX}: take more --passes of fewer \
         --photons"
    )))
}

/// One pass of emission on the device.
pub struct Walks<'a> {
    /// Where the kernels run.
    pub context: &'a Context,
    /// Prefix sums there.
    pub scan: &'a Scan,
    /// The scene, and how its lights share the paths.
    pub scene: &'a Paths,
    /// Of seed and pass.
    pub stream: u32,
}

impl Walks<'_> {
    /// What all kernels that walk take.
    pub fn arguments(&self, emitters: &Buffer<Emitter>, range: &Range) -> Arguments {
        self.scene.arguments(emitters, range, self.stream)
    }
}

/// Counts batch after batch, which `count` does for paths from the first number to the second, until `wanted` photons are
/// there. The batch's first path, and which of its photons, from 1 on, is the last one wanted.
pub fn batch_that_stores(
    walks: &Walks,
    wanted: u32,
    mut count: impl FnMut(&Buffer<Emitter>, u32, u32) -> Result<u32>,
) -> Result<(u32, u32)> {
    // The walk does not depend on how much power a path has, only on the ratio of its channels.
    let batch = wanted.clamp(1 << 16, 1 << 22);
    let emitters = walks.scene.emitters(walks.context, batch)?;
    let (mut stored, mut first) = (0u64, 0u32);
    loop {
        let end = first.saturating_add(batch);
        let here = count(&emitters, first, end)?;
        if stored + u64::from(here) >= u64::from(wanted) {
            return Ok((first, (u64::from(wanted) - stored) as u32));
        }
        (stored, first) = (stored + u64::from(here), end);
        if (stored == 0 && first >= FRUITLESS_PATHS) || first >= 1 << 31 {
            return Err(fruitless(wanted, stored, first));
        }
    }
}
