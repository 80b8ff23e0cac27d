//! Emission on CPUs: batches of paths are walked once, what they leave is recorded, and records go to their places in
//! the map (`photons_record` and `photons_place` of `kernels/photons.cl`).

use super::photon_map::PhotonMap;
use super::photons::check_stored;
use crate::cl::{Arg, Buffer, Context, Kernel};
use crate::error::{Error, Result};
use crate::memory::{RECORDING_ITEMS, recorded_floats, recording_slots};

/// Most paths of a work-item: its counters stay in the L1 cache.
const MAX_PATHS: u32 = 1024;

/// Kernels, and the memory that a batch is recorded in.
pub struct Recorder {
    record: Kernel,
    place: Kernel,
    glossy: bool,
    /// Work-items of a batch.
    items: u32,
    /// Records that a work-item has room for.
    slots: u32,
    records: Buffer<f32>,
    path_counts: Buffer<u32>,
    totals: Buffer<u32>,
    /// Paths of a work-item: as many as its records have room for, by what was stored so far.
    paths: u32,
}

impl Recorder {
    /// With the kernels of a permutation.
    ///
    /// # Errors
    /// [`Error::Device`] when memory is short.
    pub fn new(context: &Context, glossy: bool, record: Kernel, place: Kernel) -> Result<Recorder> {
        // Several for each core, so that the last one does not keep the others waiting.
        let items = RECORDING_ITEMS.max(4 * context.device.compute_units);
        let slots = recording_slots(glossy);
        Ok(Recorder {
            record,
            place,
            glossy,
            items,
            slots,
            records: Buffer::new(context, (items * slots * recorded_floats(glossy)) as usize)?,
            path_counts: Buffer::new(context, (items * MAX_PATHS) as usize)?,
            totals: Buffer::new(context, items as usize)?,
            paths: slots / 4,
        })
    }

    /// Emits paths `[0, paths)`; `walk_args` gives the kernels' first arguments for paths from the first number to the
    /// second in work-items of the third. At most `limit` photons are kept.
    ///
    /// # Errors
    /// [`Error::Usage`] when more are stored than indices can tell apart, [`Error::Device`] from the device.
    pub fn emit(
        &mut self,
        context: &Context,
        walk_args: impl Fn(u32, u32, u32) -> Vec<Arg>,
        paths: u32,
        limit: u32,
        old: Option<PhotonMap>,
    ) -> Result<PhotonMap> {
        let mut map = old;
        let (mut first, mut stored) = (0u32, 0u64);
        while first < paths {
            // Few paths are shared out evenly as well.
            let length = self.paths.min(paths.div_ceil(self.items)).clamp(1, MAX_PATHS);
            let batch = (paths - first).min(self.items * length);
            let items = batch.div_ceil(length) as usize;
            let mut args = walk_args(first, first + batch, length);
            args.extend([Arg::Uint(self.slots), (&self.records).into()]);
            args.extend([Arg::from(&self.path_counts), (&self.totals).into()]);
            context.launch(&self.record, &args, &[items], Some(&[1]))?;
            let mut totals = vec![0u32; items];
            self.totals.read(context, &mut totals)?;
            let fullest = totals.iter().copied().max().unwrap_or(0);
            if fullest > self.slots {
                if length == 1 {
                    return Err(Error::Device(format!("a path stores {fullest} photons")));
                }
                // Counts went on past the last record, so that the next try fits.
                self.paths = (u64::from(length) * u64::from(self.slots) * 3 / (u64::from(fullest) * 4)).max(1) as u32;
                continue;
            }
            let here = totals.iter().map(|total| u64::from(*total)).sum::<u64>();
            let total = stored + here;
            check_stored(paths, total.min(limit.into()))?;
            let done = first + batch;
            // What all paths will store, going by those so far; a map has some room to spare.
            let expected = total as f64 * f64::from(paths) / f64::from(done);
            let room = if done == paths { total } else { expected as u64 }.min(limit.into());
            let mut own =
                PhotonMap::with_room(context, map, self.glossy, stored.min(limit.into()) as usize, room as usize)?;
            own.emitted = paths;
            let mut args = vec![Arg::from(&self.records), (&self.path_counts).into(), (&self.totals).into()];
            args.extend([Arg::Uint(self.slots), length.into(), (stored as u32).into(), limit.into()]);
            args.extend([Arg::from(&own.positions), (&own.powers).into(), (&own.faces).into()]);
            args.extend(own.directions.as_ref().map(Arg::from));
            context.launch(&self.place, &args, &[items], Some(&[1]))?;
            own.stored = total.min(limit.into()) as usize;
            map = Some(own);
            (first, stored) = (done, total);
            // Five deviations of a work-item's total are a quarter of it at 500 paths.
            let mean = here as f64 / f64::from(batch);
            self.paths = ((f64::from(self.slots) * 0.75 / mean.max(1e-3)) as u32).clamp(1, MAX_PATHS);
        }
        match map {
            Some(map) if paths > 0 => Ok(map),
            old => PhotonMap::new(context, old, self.glossy, 0, paths),
        }
    }
}
