//! Photons: packed scene in, photon map out, on OpenCL (`kernels/photons.cl`).

use std::rc::Rc;

use crate::cl::{Arg, Buffer, Context, Kernel};
use crate::cpu::photons::{FRUITLESS_PATHS, fruitless, stream_of};
use crate::emission::{Amount, COLUMNS_LOG2, Emission, PART_BITS, Plan, ROWS_LOG2, Sampler};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::layout::{Emitter, Frame, Light, MAX_EXACT_INDEX, Object};
use crate::pack::Packed;
use crate::source::{Options, assemble};
use crate::stage::photon_map::PhotonMap;
use crate::stage::recorder::Recorder;
use crate::stage::scan::Scan;

/// The scene as emission sees it, on the device.
struct Tables {
    frame: Buffer<Frame>,
    objects: Buffer<Object>,
    lights: Buffer<Light>,
    counts: Buffer<[u32; 3]>,
    slots: Buffer<u32>,
    cells: Buffer<u32>,
    plan: Plan,
}

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
    tables: Option<Tables>,
}

impl Photons {
    /// On an open device.
    pub fn new(context: Rc<Context>, scan: Rc<Scan>) -> Photons {
        Photons { context, scan, kernels: None, tables: None }
    }

    /// Takes over the scene's records, and how its lights share their paths.
    ///
    /// # Errors
    /// [`Error::Device`] when the device has no room.
    pub fn upload(&mut self, packed: &Packed, plan: Plan) -> Result<()> {
        let frame = Frame {
            sphere_count: packed.sphere_count as f32,
            plane_count: packed.plane_count() as f32,
            light_count: packed.lights.len() as f32,
            ..Frame::default()
        };
        let context = &self.context;
        self.tables = Some(Tables {
            frame: Buffer::from_slice(context, &[frame])?,
            objects: Buffer::from_slice(context, &packed.objects)?,
            lights: Buffer::from_slice(context, &packed.lights)?,
            counts: Buffer::from_slice(context, &plan.counts)?,
            slots: Buffer::from_slice(context, &plan.slots)?,
            cells: Buffer::from_slice(context, &plan.cells)?,
            plan,
        });
        Ok(())
    }

    /// How the lights of the scene uploaded last share their paths.
    pub fn plan(&self) -> Option<&Plan> {
        self.tables.as_ref().map(|tables| &tables.plan)
    }

    /// Builds what an emission needs; nothing when it was built before. Call after [`Photons::upload`].
    ///
    /// # Errors
    /// [`Error::Build`] with the driver's log.
    pub fn compile(&mut self, features: &Features, emission: &Emission) -> Result<()> {
        let Some(plan) = self.plan() else {
            return Err(Error::Device("OpenCL: photons compiled before a scene was uploaded".into()));
        };
        let mapped = !plan.cells.is_empty();
        let made_for =
            (*features, emission.store_direct, emission.sampler, plan.slots_log2, mapped, plan.counts.len() == 1);
        if plan.is_empty() || self.kernels.as_ref().is_some_and(|kernels| kernels.made_for == made_for) {
            return Ok(());
        }
        let mut defines = vec![
            format!("SLOTS_LOG2 {}u", plan.slots_log2),
            format!("EMISSION_ROWS_LOG2 {ROWS_LOG2}u"),
            format!("EMISSION_COLUMNS_LOG2 {COLUMNS_LOG2}u"),
            format!("EMISSION_PART_BITS {PART_BITS}u"),
        ];
        let mut add = |on: bool, name: &str| {
            if on {
                defines.push(name.into());
            }
        };
        // Not ONE_LIGHT: that is about shading, which has no lights where photons carry all.
        add(plan.counts.len() == 1, "ONE_EMITTER");
        add(mapped, "HAS_EMISSION_MAP");
        add(emission.store_direct, "STORE_DIRECT");
        add(emission.sampler == Sampler::Random, "SAMPLER_RANDOM");
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
        let Some(tables) = &self.tables else {
            return Err(Error::Device("OpenCL: photons emitted before a scene was uploaded".into()));
        };
        if tables.plan.is_empty() {
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
        let pass = Pass { context: &self.context, scan: &self.scan, count, last, tables, stream };
        let (paths, limit) = match emission.amount {
            Amount::Paths(paths) => (paths, u32::MAX),
            Amount::Stored(wanted) => (pass.paths_to_store(wanted)?, wanted),
        };
        let emitters = Buffer::from_slice(&self.context, &tables.plan.emitters(paths))?;
        match storing {
            Storing::Again(store) => {
                let runs = pass.count(&emitters, 0, paths)?;
                let stored = runs.stored.min(limit);
                check_stored(paths, stored.into())?;
                let map = PhotonMap::new(&self.context, old, glossy, stored as usize, paths)?;
                pass.store(store, &emitters, &runs, paths, &map)?;
                Ok(map)
            }
            Storing::Recorded(recorder) => {
                let args = |first, end, length| pass.walk_args(&emitters, first, end, length);
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
    tables: &'a Tables,
    stream: u32,
}

/// Counts by run, scanned: where each run's photons begin.
struct Runs {
    offsets: Buffer<u32>,
    /// Paths of a run.
    length: u32,
    runs: u32,
    stored: u32,
}

impl Pass<'_> {
    /// Arguments that all three kernels begin with.
    fn walk_args(&self, emitters: &Buffer<Emitter>, first: u32, end: u32, length: u32) -> Vec<Arg> {
        let t = self.tables;
        vec![
            (&t.frame).into(),
            (&t.objects).into(),
            (&t.lights).into(),
            emitters.into(),
            (&t.counts).into(),
            (&t.slots).into(),
            (&t.cells).into(),
            first.into(),
            end.into(),
            length.into(),
            self.stream.into(),
        ]
    }

    /// Long runs waste few lanes at their ends, but there must be enough of them to fill the device. What is stored,
    /// and in which order, does not depend on this.
    fn run_length(&self, paths: u32) -> u32 {
        let device = &self.context.device;
        // GPUs: twice the 2048 threads that a multiprocessor holds. CPUs: 16 work-items a core to share out evenly.
        let (wanted, longest) = if device.lanes == 1 { (4096, 4) } else { (16 * device.lanes, 256) };
        (paths / (device.compute_units.max(1) * wanted)).clamp(1, longest)
    }

    /// Launches one work-item for each `lanes` runs.
    fn launch(&self, kernel: &Kernel, args: &[Arg], runs: u32) -> Result<()> {
        let items = runs.div_ceil(self.context.device.lanes) as usize;
        let local = if self.context.device.lanes == 1 { 128 } else { 1 };
        self.context.launch_paced(kernel, args, &[items], Some(&[local]))
    }

    /// Counts what paths `[first, end)` store.
    fn count(&self, emitters: &Buffer<Emitter>, first: u32, end: u32) -> Result<Runs> {
        let length = self.run_length(end - first);
        let runs = (end - first).div_ceil(length);
        let padded = runs.next_multiple_of(self.context.device.lanes) as usize;
        let offsets = Buffer::new(self.context, padded + 1)?;
        if runs == 0 {
            return Ok(Runs { offsets, length, runs, stored: 0 });
        }
        let mut args = self.walk_args(emitters, first, end, length);
        args.extend([Arg::from(&offsets), runs.into()]);
        self.launch(self.count, &args, runs)?;
        self.scan.exclusive(self.context, &offsets, padded + 1)?;
        let stored = offsets.get(self.context, padded)?;
        Ok(Runs { offsets, length, runs, stored })
    }

    /// Writes what paths `[0, end)` store, as much of it as the map holds.
    fn store(&self, kernel: &Kernel, emitters: &Buffer<Emitter>, runs: &Runs, end: u32, map: &PhotonMap) -> Result<()> {
        let mut args = self.walk_args(emitters, 0, end, runs.length);
        args.extend([Arg::from(&runs.offsets), runs.runs.into(), Arg::Uint(map.stored as u32)]);
        args.extend([Arg::from(&map.positions), (&map.powers).into(), (&map.faces).into()]);
        args.extend(map.directions.as_ref().map(Arg::from));
        self.launch(kernel, &args, runs.runs)
    }

    /// How many paths it takes to store `wanted` photons: batch after batch until they are there; then the run, and
    /// in it the path, that stores the last one.
    fn paths_to_store(&self, wanted: u32) -> Result<u32> {
        // The walk does not depend on how much power a path has, only on the ratio of its channels.
        let batch = wanted.clamp(1 << 16, 1 << 22);
        let emitters = Buffer::from_slice(self.context, &self.tables.plan.emitters(batch))?;
        let (mut stored, mut first) = (0u64, 0u32);
        loop {
            let end = first.saturating_add(batch);
            let runs = self.count(&emitters, first, end)?;
            if stored + u64::from(runs.stored) >= u64::from(wanted) {
                let missing = (u64::from(wanted) - stored) as u32;
                let offsets = runs.offsets.to_vec(self.context)?;
                // The last run that begins before the missing photon.
                let run = offsets[..runs.runs as usize].partition_point(|offset| *offset < missing).saturating_sub(1);
                let from = first + run as u32 * runs.length;
                let last = Buffer::from_slice(self.context, &[0u32])?;
                let mut args = self.walk_args(&emitters, from, end.min(from + runs.length), runs.length);
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
