//! Emission on CPUs: batches of paths are walked once, what they leave is recorded, and records go to their places in
//! the map (`photons_record` and `photons_place` of `kernels/photons.cl`).

use super::photon_map::PhotonMap;
use super::photons::check_stored;
use crate::cl::{Arg, Buffer, Context, Kernel};
use crate::error::{Error, Result};
use crate::memory::{RECORDING_BYTES, recorded_floats};

/// Most paths of a lane.
const MAX_PATHS: u32 = 1024;

/// Kernels, and the memory that a batch is recorded in.
pub struct Recorder {
    record: Kernel,
    place: Kernel,
    glossy: bool,
    /// Of the device.
    lanes: u32,
    /// Work-items of a batch.
    items: u32,
    /// Steps, of all its lanes, that a work-item has room for.
    room: u32,
    records: Buffer<f32>,
    totals: Buffer<u32>,
    /// Paths of a lane: as many as its work-item's records have room for, by what was stored so far.
    paths: u32,
}

impl Recorder {
    /// With the kernels of a permutation.
    ///
    /// # Errors
    /// [`Error::Device`] when memory is short.
    pub fn new(context: &Context, glossy: bool, record: Kernel, place: Kernel) -> Result<Recorder> {
        // Long runs, since lanes wait for the longest of them; two items for each core, so that none waits long.
        let lanes = context.device.lanes;
        let items = 2 * context.device.compute_units.max(1);
        let step = recorded_floats(glossy) * lanes;
        let room = (RECORDING_BYTES as u32 / 4 / (step * items)).max(64);
        Ok(Recorder {
            record,
            place,
            glossy,
            lanes,
            items,
            room,
            records: Buffer::new(context, (items * room * step) as usize)?,
            totals: Buffer::new(context, (items * 2 * lanes) as usize)?,
            paths: (room / 8).clamp(1, MAX_PATHS),
        })
    }

    /// Emits paths `[0, paths)`; `walk_args` gives the kernels' first arguments for paths from the first number to the
    /// second in runs of the third. At most `limit` photons are kept.
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
        let mut totals = Vec::new();
        while first < paths {
            // Few paths are shared out evenly as well.
            let all = self.items * self.lanes;
            let length = self.paths.min(paths.div_ceil(all)).clamp(1, MAX_PATHS);
            let batch = (paths - first).min(all * length);
            let items = batch.div_ceil(length * self.lanes) as usize;
            let mut args = walk_args(first, first + batch, length);
            args.extend([Arg::Uint(self.room), (&self.records).into(), (&self.totals).into()]);
            context.launch(&self.record, &args, &[items], Some(&[1]))?;
            totals.resize(items * 2 * self.lanes as usize, 0u32);
            self.totals.read(context, &mut totals)?;
            // Two vectors a work-item: photons by lane, and steps.
            let of_items = || totals.chunks(2 * self.lanes as usize).map(|both| both.split_at(self.lanes as usize));
            let fullest = of_items().map(|(_, steps)| steps[0]).max().unwrap_or(0);
            if fullest > self.room {
                if length == 1 {
                    return Err(Error::Device(format!("a path stores {fullest} photons")));
                }
                // Counts went on past the last record, so that the next try fits.
                self.paths = (u64::from(length) * u64::from(self.room) * 3 / (u64::from(fullest) * 4)).max(1) as u32;
                continue;
            }
            let here = of_items().flat_map(|(photons, _)| photons).map(|photons| u64::from(*photons)).sum::<u64>();
            let total = stored + here;
            check_stored(paths, total.min(limit.into()))?;
            let done = first + batch;
            // What all paths will store, going by those so far; a map has some room to spare.
            let expected = total as f64 * f64::from(paths) / f64::from(done);
            let room = if done == paths { total } else { expected as u64 }.min(limit.into());
            let mut own =
                PhotonMap::with_room(context, map, self.glossy, stored.min(limit.into()) as usize, room as usize)?;
            own.emitted = paths;
            let mut args = vec![Arg::from(&self.records), (&self.totals).into()];
            args.extend([Arg::Uint(self.room), (stored as u32).into(), limit.into()]);
            args.extend([Arg::from(&own.positions), (&own.powers).into(), (&own.faces).into()]);
            args.extend(own.directions.as_ref().map(Arg::from));
            context.launch(&self.place, &args, &[items], Some(&[1]))?;
            own.stored = total.min(limit.into()) as usize;
            map = Some(own);
            (first, stored) = (done, total);
            // The longest lane's steps differ little between batches: a tenth is room enough.
            let steps = f64::from(fullest) / f64::from(length);
            self.paths = ((f64::from(self.room) * 0.9 / steps.max(1e-3)) as u32).clamp(1, MAX_PATHS);
        }
        match map {
            Some(map) if paths > 0 => Ok(map),
            old => PhotonMap::new(context, old, self.glossy, 0, paths),
        }
    }
}
