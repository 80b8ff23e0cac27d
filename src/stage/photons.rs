//! Photons: packed scene in, photon map out, on OpenCL (`kernels/photons.cl`).

use std::rc::Rc;

use super::counter::Counter;
use super::paths::Paths;
use super::photon_map::PhotonMap;
use super::recorder::Recorder;
use super::scan::Scan;
use super::walks::Walks;
use crate::cpu::photons::{fruitless, stream_of};
use crate::device::cl::Context;
use crate::error::{Error, Result};
use crate::packing::Packed;
use crate::program::features::Features;
use crate::program::source::{Options, assemble};
use crate::rays::emission::{Amount, Emission, EmissionPlan, Sampler};

/// The kernels of one permutation.
struct Kernels {
    made_for: (Features, bool, Sampler, u32, bool, bool),
    storing: Storing,
}

/// How photons come into the map.
enum Storing {
    /// By a second walk, as on GPUs.
    Counted(Box<Counter>),
    /// From records of the only walk, as on CPUs.
    Recorded(Box<Recorder>),
}

/// The photon stage on a device.
pub struct Photons {
    context: Rc<Context>,
    scan: Rc<Scan>,
    kernels: Option<Kernels>,
    paths: Option<Paths>,
}

impl Photons {
    /// On an open device.
    pub fn new(context: Rc<Context>, scan: Rc<Scan>) -> Photons {
        Photons { context, scan, kernels: None, paths: None }
    }

    /// Takes over the scene's records, and how its lights share their paths.
    ///
    /// # Errors
    /// [`Error::Device`] when the device has no room.
    pub fn upload(&mut self, packed: &Packed, plan: EmissionPlan) -> Result<()> {
        self.paths = Some(Paths::new(&self.context, packed, plan)?);
        Ok(())
    }

    /// How the lights of the scene uploaded last share their paths.
    pub fn plan(&self) -> Option<&EmissionPlan> {
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
        let (context, glossy) = (&*self.context, features.glossy);
        let is_counted = context.device.lanes == 1;
        let mut defines = scene.defines(emission);
        if is_counted {
            defines.extend(Counter::defines(glossy));
        }
        let options = Options { lanes: context.device.lanes, defines, ..Options::default() };
        let source = assemble("photons.cl", Some(features), &options);
        let storing = if is_counted {
            Storing::Counted(Box::new(Counter::new(context, glossy, &source)?))
        } else {
            Storing::Recorded(Box::new(Recorder::new(context, glossy, &source)?))
        };
        self.kernels = Some(Kernels { made_for, storing });
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
        let walks = Walks { context: &self.context, scan: &self.scan, scene, stream };
        let storing = &mut kernels.storing;
        let (paths, limit) = match (emission.amount, &mut *storing) {
            (Amount::Paths(paths), _) => (paths, u32::MAX),
            (Amount::Stored(wanted), Storing::Counted(counter)) => (counter.paths_to_store(&walks, wanted)?, wanted),
            (Amount::Stored(wanted), Storing::Recorded(recorder)) => (recorder.paths_to_store(&walks, wanted)?, wanted),
        };
        match storing {
            Storing::Counted(counter) => counter.emit(&walks, paths, limit, old),
            Storing::Recorded(recorder) => recorder.emit(&walks, paths, limit, old),
        }
    }
}
