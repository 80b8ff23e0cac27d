//! Emission on CPUs: batches of paths are walked once, what they leave is recorded, and records go to their places in
//! the map (`photons_record` and `photons_place` of `kernels/photons.cl`).

use super::paths::Range;
use super::photon_map::PhotonMap;
use super::walks::{Walks, batch_that_stores, check_stored};
use crate::device::cl::{Arguments, Buffer, Context, Kernel};
use crate::device::memory::{RECORDING_BYTES, recorded_floats};
use crate::error::{Error, Result};
use crate::program::source::Source;

/// Most paths of a lane.
const MAX_PATHS: u32 = 1024;

/// Kernels, and the memory that a batch is recorded in.
pub struct Recorder {
    record: Kernel,
    place: Kernel,
    /// Where so many photons are wanted: photons of each run of paths, and the path of a run that stores the last one.
    count: Kernel,
    last: Kernel,
    glossy: bool,
    /// Paths that a work-item walks side by side on this device.
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
    /// [`Error::Build`] with the driver's log, [`Error::Device`] when memory is short.
    pub fn new(context: &Context, glossy: bool, source: &Source) -> Result<Recorder> {
        // Long runs, since lanes wait for the longest of them; two items for each core, so that none waits long.
        let lanes = context.device.lanes;
        let items = 2 * context.device.compute_units.max(1);
        let step = recorded_floats(glossy) * lanes;
        let room = (RECORDING_BYTES as u32 / 4 / (step * items)).max(64);
        Ok(Recorder {
            record: context.kernel(source, "photons_record")?,
            place: context.kernel(source, "photons_place")?,
            count: context.kernel(source, "photons_count")?,
            last: context.kernel(source, "photons_last")?,
            glossy,
            lanes,
            items,
            room,
            records: Buffer::new(context, (items * room * step) as usize)?,
            totals: Buffer::new(context, (items * 2 * lanes) as usize)?,
            paths: (room / 8).clamp(1, MAX_PATHS),
        })
    }

    /// Emits paths `[0, paths)`. At most `limit` photons are kept.
    ///
    /// # Errors
    /// [`Error::Usage`] when more are stored than indices can tell apart, [`Error::Device`] from the device.
    pub fn emit(&mut self, walks: &Walks, paths: u32, limit: u32, old: Option<PhotonMap>) -> Result<PhotonMap> {
        let context = walks.context;
        let emitters = walks.scene.emitters(context, paths)?;
        let mut map = old;
        let (mut first, mut stored) = (0u32, 0u64);
        let mut totals = Vec::new();
        while first < paths {
            // Few paths are shared out evenly as well.
            let all = self.items * self.lanes;
            let length = self.paths.min(paths.div_ceil(all)).clamp(1, MAX_PATHS);
            let batch = (paths - first).min(all * length);
            let items = batch.div_ceil(length * self.lanes) as usize;
            let recorded = Arguments::new().with("room", self.room).with("records", &self.records);
            let recorded = recorded.with("totals", &self.totals);
            let args = walks.arguments(&emitters, &Range { first, end: first + batch, length }).and(&recorded);
            context.launch(&self.record, &args, &[items], Some(&[1]))?;
            totals.resize(items * 2 * self.lanes as usize, 0u32);
            self.totals.read(context, &mut totals)?;
            // Two vectors a work-item: photons by lane, and steps.
            let of_items = || totals.chunks(2 * self.lanes as usize).map(|both| both.split_at(self.lanes as usize));
            let longest_cell = of_items().map(|(_, steps)| steps[0]).max().unwrap_or(0);
            if longest_cell > self.room {
                if length == 1 {
                    return Err(Error::Device(format!("a path stores {longest_cell} photons")));
                }
                // Counts went on past the last record, so that the next try fits.
                self.paths =
                    (u64::from(length) * u64::from(self.room) * 3 / (u64::from(longest_cell) * 4)).max(1) as u32;
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
            let args = recorded.and(&own.arguments()).with("first_slot", stored as u32).with("limit", limit);
            context.launch(&self.place, &args, &[items], Some(&[1]))?;
            own.stored = total.min(limit.into()) as usize;
            map = Some(own);
            (first, stored) = (done, total);
            // The longest lane's steps differ little between batches: a tenth is room enough.
            let steps = f64::from(longest_cell) / f64::from(length);
            self.paths = ((f64::from(self.room) * 0.9 / steps.max(1e-3)) as u32).clamp(1, MAX_PATHS);
        }
        match map {
            Some(map) if paths > 0 => Ok(map),
            old => PhotonMap::new(context, old, self.glossy, 0, paths),
        }
    }

    /// How many paths it takes to store `wanted` photons: the batch that stores the last of them, in it the run, and in
    /// that the path.
    ///
    /// # Errors
    /// [`Error::Usage`] where nothing can be hit, [`Error::Device`] from the device.
    pub fn paths_to_store(&mut self, walks: &Walks, wanted: u32) -> Result<u32> {
        let context = walks.context;
        let mut counted = None;
        let (_, missing) = batch_that_stores(walks, wanted, |emitters, first, end| {
            let range = Range::new(context, first, end);
            let padded = range.runs().next_multiple_of(self.lanes) as usize;
            let offsets = Buffer::<u32>::new(context, padded + 1)?;
            let args = walks.arguments(emitters, &range).with("counts", &offsets).with("runs", range.runs());
            walks.scene.launch(context, &self.count, &args, &range)?;
            walks.scan.exclusive(context, &offsets, padded + 1)?;
            let stored = offsets.get(context, padded)?;
            counted = Some((range, offsets));
            Ok(stored)
        })?;
        let (range, offsets) = counted.expect("a batch was counted");
        let offsets = offsets.to_vec(context)?;
        // The last run that begins before the missing photon.
        let run = offsets[..range.runs() as usize].partition_point(|offset| *offset < missing).saturating_sub(1);
        let from = range.first + run as u32 * range.length;
        let own = Range { first: from, end: range.end.min(from + range.length), ..range };
        let last = Buffer::from_slice(context, &[0u32])?;
        let args = walks.arguments(&*walks.scene.emitters(context, range.end - range.first)?, &own);
        let args = args.with("wanted", missing - offsets[run]).with("last_path", &last);
        context.launch(&self.last, &args, &[1], Some(&[1]))?;
        Ok(last.get(context, 0)? + 1)
    }
}
