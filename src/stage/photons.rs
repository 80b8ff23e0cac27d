//! Photons: packed scene in, photon map out, on OpenCL (`kernels/photons.cl`).

use std::rc::Rc;

use crate::cl::{Arg, Buffer, Context, Kernel};
use crate::cpu::photons::{FRUITLESS_PATHS, fruitless, stream_of};
use crate::emission::{Amount, Emission, Plan, Sampler};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::layout::{Emitter, MAX_EXACT_INDEX};
use crate::memory::RECORDING_BYTES;
use crate::pack::Packed;
use crate::source::{Options, assemble};
use crate::stage::paths::{Paths, Range};
use crate::stage::photon_map::PhotonMap;
use crate::stage::recorder::Recorder;
use crate::stage::scan::Scan;

/// The kernels of one permutation.
struct Kernels {
    made_for: (Features, bool, Sampler, u32, bool, bool),
    count: Kernel,
    last: Kernel,
    storing: Storing,
}

/// How photons come into the map.
enum Storing {
    /// By a second walk.
    Again(Kernel),
    /// From records of the only walk.
    Recorded(Recorder),
}

/// The photon stage on a device.
pub struct Photons {
    context: Rc<Context>,
    scan: Rc<Scan>,
    kernels: Option<Kernels>,
    paths: Option<Paths>,
    /// Memory of the last pass's offsets, for the next one's: fresh memory costs a GPU's driver 0.1 ms and more.
    offsets: Option<Buffer<u32>>,
}

/// Bytes of offsets that are worth keeping: as much as CPUs record in.
const KEPT: usize = RECORDING_BYTES;

impl Photons {
    /// On an open device.
    pub fn new(context: Rc<Context>, scan: Rc<Scan>) -> Photons {
        Photons { context, scan, kernels: None, paths: None, offsets: None }
    }

    /// Takes over the scene's records, and how its lights share their paths.
    ///
    /// # Errors
    /// [`Error::Device`] when the device has no room.
    pub fn upload(&mut self, packed: &Packed, plan: Plan) -> Result<()> {
        self.paths = Some(Paths::new(&self.context, packed, plan)?);
        Ok(())
    }

    /// How the lights of the scene uploaded last share their paths.
    pub fn plan(&self) -> Option<&Plan> {
        self.paths.as_ref().map(|paths| &paths.plan)
    }

    /// Builds what an emission needs; nothing when it was built before. Call after [`Photons::upload`].
    ///
    /// # Errors
    /// [`Error::Build`] with the driver's log.
    pub fn compile(&mut self, features: &Features, emission: &Emission) -> Result<()> {
        let Some(scene) = &self.paths else {
            return Err(Error::Device("OpenCL: photons compiled before a scene was uploaded".into()));
        };
        let plan = &scene.plan;
        let mapped = !plan.cells.is_empty();
        let made_for =
            (*features, emission.store_direct, emission.sampler, plan.slots_log2, mapped, plan.counts.len() == 1);
        if plan.is_empty() || self.kernels.as_ref().is_some_and(|kernels| kernels.made_for == made_for) {
            return Ok(());
        }
        let defines = scene.defines(emission);
        let options = Options { lanes: self.context.device.lanes, defines, ..Options::default() };
        let source = assemble("photons.cl", Some(features), &options);
        let kernel = |name| self.context.kernel(&source, name);
        let storing = if options.lanes == 1 {
            Storing::Again(kernel("photons_store")?)
        } else {
            Storing::Recorded(Recorder::new(
                &self.context,
                features.glossy,
                kernel("photons_record")?,
                kernel("photons_place")?,
            )?)
        };
        self.kernels =
            Some(Kernels { made_for, count: kernel("photons_count")?, last: kernel("photons_last")?, storing });
        Ok(())
    }

    /// Emits one pass with the scene uploaded and the permutation compiled last. The same emission gives the same
    /// bytes, whatever the device's scheduling. `old` gives its memory to the new map where that is large enough:
    /// fresh memory costs as much as a third of the emission.
    ///
    /// # Errors
    /// [`Error::Usage`] when photons are to be stored where nothing can be hit, or when more are stored than indices
    /// in float values can tell apart; [`Error::Device`] when the device fails.
    pub fn emit(&mut self, emission: &Emission, old: Option<PhotonMap>) -> Result<PhotonMap> {
        let Some(scene) = &self.paths else {
            return Err(Error::Device("OpenCL: photons emitted before a scene was uploaded".into()));
        };
        if scene.plan.is_empty() {
            return match emission.amount {
                Amount::Paths(paths) => PhotonMap::new(&self.context, old, false, 0, paths),
                Amount::Stored(wanted) => Err(fruitless(wanted, 0, 0)),
            };
        }
        let Some(kernels) = &mut self.kernels else {
            return Err(Error::Device("OpenCL: photons emitted before anything was compiled".into()));
        };
        let stream = stream_of(emission.seed, emission.pass);
        let Kernels { made_for, count, last, storing } = kernels;
        let glossy = made_for.0.glossy;
        let pass = Pass { context: &self.context, scan: &self.scan, count, last, scene, stream };
        let (paths, limit) = match emission.amount {
            Amount::Paths(paths) => (paths, u32::MAX),
            Amount::Stored(wanted) => (pass.paths_to_store(wanted)?, wanted),
        };
        let emitters = scene.emitters(&self.context, paths)?;
        match storing {
            Storing::Again(store) => {
                let runs = pass.count(&emitters, 0, paths, self.offsets.take())?;
                let stored = runs.stored.min(limit);
                check_stored(paths, stored.into())?;
                let map = PhotonMap::new(&self.context, old, glossy, stored as usize, paths)?;
                pass.store(store, &emitters, &runs, &map)?;
                self.offsets = Some(runs.offsets).filter(|offsets| offsets.bytes() <= KEPT);
                Ok(map)
            }
            Storing::Recorded(recorder) => {
                let args = |first, end, length| scene.args(&[], &emitters, &Range { first, end, length }, stream);
                recorder.emit(&self.context, args, paths, limit, old)
            }
        }
    }
}

/// Refuses more photons than indices in float values can tell apart.
pub(super) fn check_stored(paths: u32, stored: u64) -> Result<()> {
    if stored < MAX_EXACT_INDEX {
        return Ok(());
    }
    Err(Error::Usage(format!(
        "{paths} paths store {stored} photons, a pass holds fewer than {MAX_EXACT_INDEX}: take more --passes of fewer \
         --photons"
    )))
}

/// One pass of emission on the device.
struct Pass<'a> {
    context: &'a Context,
    scan: &'a Scan,
    count: &'a Kernel,
    last: &'a Kernel,
    scene: &'a Paths,
    stream: u32,
}

/// Counts by run, scanned: where each run's photons begin.
struct Runs {
    offsets: Buffer<u32>,
    range: Range,
    stored: u32,
}

impl Pass<'_> {
    /// Counts what paths `[first, end)` store, in old memory where that is large enough.
    fn count(&self, emitters: &Buffer<Emitter>, first: u32, end: u32, old: Option<Buffer<u32>>) -> Result<Runs> {
        let range = Range::new(self.context, first, end);
        let runs = range.runs();
        let padded = runs.next_multiple_of(self.context.device.lanes) as usize;
        let offsets = match old {
            Some(old) if old.len() > padded => old,
            _ => Buffer::new(self.context, padded + 1)?,
        };
        if runs == 0 {
            return Ok(Runs { offsets, range, stored: 0 });
        }
        let mut args = self.scene.args(&[], emitters, &range, self.stream);
        args.extend([Arg::from(&offsets), runs.into()]);
        self.scene.launch(self.context, self.count, &args, &range)?;
        self.scan.exclusive(self.context, &offsets, padded + 1)?;
        let stored = offsets.get(self.context, padded)?;
        Ok(Runs { offsets, range, stored })
    }

    /// Writes what the paths counted store, as much of it as the map holds.
    fn store(&self, kernel: &Kernel, emitters: &Buffer<Emitter>, runs: &Runs, map: &PhotonMap) -> Result<()> {
        let mut args = self.scene.args(&[], emitters, &runs.range, self.stream);
        args.extend([Arg::from(&runs.offsets), runs.range.runs().into(), Arg::Uint(map.stored as u32)]);
        args.extend([Arg::from(&map.positions), (&map.powers).into(), (&map.faces).into()]);
        args.extend(map.directions.as_ref().map(Arg::from));
        self.scene.launch(self.context, kernel, &args, &runs.range)
    }

    /// How many paths it takes to store `wanted` photons: batch after batch until they are there; then the run, and
    /// in it the path, that stores the last one.
    fn paths_to_store(&self, wanted: u32) -> Result<u32> {
        // The walk does not depend on how much power a path has, only on the ratio of its channels.
        let batch = wanted.clamp(1 << 16, 1 << 22);
        let emitters = self.scene.emitters(self.context, batch)?;
        let (mut stored, mut first) = (0u64, 0u32);
        loop {
            let end = first.saturating_add(batch);
            let runs = self.count(&emitters, first, end, None)?;
            if stored + u64::from(runs.stored) >= u64::from(wanted) {
                let missing = (u64::from(wanted) - stored) as u32;
                let offsets = runs.offsets.to_vec(self.context)?;
                // The last run that begins before the missing photon.
                let run =
                    offsets[..runs.range.runs() as usize].partition_point(|offset| *offset < missing).saturating_sub(1);
                let from = first + run as u32 * runs.range.length;
                let last = Buffer::from_slice(self.context, &[0u32])?;
                let range = Range { first: from, end: end.min(from + runs.range.length), ..runs.range };
                let mut args = self.scene.args(&[], &emitters, &range, self.stream);
                args.extend([Arg::Uint(missing - offsets[run]), (&last).into()]);
                self.context.launch(self.last, &args, &[1], Some(&[1]))?;
                return Ok(last.get(self.context, 0)? + 1);
            }
            (stored, first) = (stored + u64::from(runs.stored), end);
            if (stored == 0 && first >= FRUITLESS_PATHS) || first >= 1 << 31 {
                return Err(fruitless(wanted, stored, first));
            }
        }
    }
}
