//! Irradiance texels: packed scene in, irradiance by photons of at least one bounce out; on OpenCL
//! (`kernels/irradiance.cl`) or by the twin.

use std::rc::Rc;

use super::map::MapCounts;
use super::paths::{Paths, Range};
use crate::cpu;
use crate::cpu::photons::stream_of;
use crate::device::cl::{Arguments, Buffer, Context, Kernel};
use crate::error::{Error, Result};
use crate::packing::packed_scene::PackedScene;
use crate::plan::charts::Charts;
use crate::program::features::Features;
use crate::program::source::{Options, assemble};
use crate::rays::emission::{Amount, Emission, EmissionPlan, Quanta, Sampler};
use crate::records::{Chart, Texel};

/// Makes irradiance texels on one machine and holds the last ones.
pub struct IrradianceStage {
    /// What charts, paths and kernels were made from.
    made_from: Option<MadeFrom>,
    machine: Machine,
}

/// See [`IrradianceStage::upload`].
#[derive(Clone, Copy, Debug, PartialEq)]
struct MadeFrom {
    /// Of the packed scene.
    generation: u64,
    features: Features,
    store_direct: bool,
    sampler: Sampler,
    budget: u32,
}

enum Machine {
    /// By OpenCL's kernels.
    Device(Box<DeviceIrradiance>),
    /// By the twin in Rust.
    Host(Box<HostIrradiance>),
}

struct DeviceIrradiance {
    context: Rc<Context>,
    scene: Option<DeviceScene>,
    /// Splat, resolve and clear, and what the first was built for.
    kernels: Option<(Vec<String>, [Kernel; 3])>,
}

struct DeviceScene {
    paths: Paths,
    charts: Buffer<Chart>,
    inverse_areas: Buffer<f32>,
    neighbourhoods: Buffer<u32>,
    sums: Buffer<[u32; 3]>,
    texels: Buffer<Texel>,
}

struct HostIrradiance {
    pool: Rc<rayon::ThreadPool>,
    scene: Option<(PackedScene, Features, EmissionPlan, Charts)>,
    texels: Vec<Texel>,
}

/// Finished texels, as the trace stage takes them.
#[derive(Clone, Copy)]
pub enum IrradianceView<'a> {
    /// In device memory.
    Device {
        /// What the buffers belong to.
        context: &'a Context,
        /// The charts of each object, in the order of objects.
        charts: &'a Buffer<Chart>,
        /// In the order of charts.
        texels: &'a Buffer<Texel>,
    },
    /// In host memory.
    Host {
        /// The charts of each object, in the order of objects.
        charts: &'a [Chart],
        /// In the order of charts.
        texels: &'a [Texel],
    },
}

impl IrradianceStage {
    /// On an open device.
    pub fn on_device(context: Rc<Context>) -> IrradianceStage {
        let machine = Machine::Device(Box::new(DeviceIrradiance { context, scene: None, kernels: None }));
        IrradianceStage { made_from: None, machine }
    }

    /// On a pool of threads.
    pub fn on_host(pool: Rc<rayon::ThreadPool>) -> IrradianceStage {
        let machine = Machine::Host(Box::new(HostIrradiance { pool, scene: None, texels: Vec::new() }));
        IrradianceStage { made_from: None, machine }
    }

    /// Takes over a scene and builds what its paths need; about `budget` texels for one side each of all objects. Passes
    /// of one scene find it done.
    ///
    /// # Errors
    /// [`Error::Build`] and [`Error::Device`] from the device; [`Error::Usage`] for too many lights.
    pub fn upload(
        &mut self,
        packed: &PackedScene,
        features: &Features,
        emission: &Emission,
        budget: u32,
    ) -> Result<()> {
        let Emission { store_direct, sampler, .. } = *emission;
        let made_from =
            MadeFrom { generation: packed.generation(), features: *features, store_direct, sampler, budget };
        if self.made_from == Some(made_from) {
            return Ok(());
        }
        self.made_from = None; // until all of it is there
        let charts = Charts::new(packed, budget);
        let plan = EmissionPlan::of(packed, emission.store_direct)?;
        match &mut self.machine {
            Machine::Device(stage) => {
                let context = &stage.context;
                let paths = Paths::new(context, packed, plan)?;
                let mut defines = vec!["HAS_CHARTS".to_string()];
                defines.extend(paths.defines(emission));
                let lanes = context.device.lanes;
                let made_for: Vec<String> = defines.iter().cloned().chain([format!("{features:?}")]).collect();
                if stage.kernels.as_ref().is_none_or(|(known, _)| *known != made_for) {
                    let options = Options { lanes, defines, ..Options::default() };
                    let source = assemble("irradiance.cl", Some(features), &options);
                    let kernel = |name| context.kernel(&source, name);
                    let kernels =
                        [kernel("irradiance_splat")?, kernel("irradiance_resolve")?, kernel("irradiance_clear")?];
                    stage.kernels = Some((made_for, kernels));
                }
                let neighbourhoods: Vec<u32> = charts.neighbourhoods.iter().map(|around| around.packed()).collect();
                stage.scene = Some(DeviceScene {
                    paths,
                    neighbourhoods: Buffer::from_slice(context, &neighbourhoods)?,
                    charts: Buffer::from_slice(context, &charts.records)?,
                    inverse_areas: Buffer::from_slice(context, &charts.inverse_areas)?,
                    sums: Buffer::new(context, charts.texels())?,
                    texels: Buffer::new(context, charts.texels())?,
                });
            }
            Machine::Host(stage) => {
                stage.scene = Some((packed.clone(), *features, plan, charts));
            }
        }
        self.made_from = Some(made_from);
        Ok(())
    }

    /// Emits one pass and waits for it.
    ///
    /// # Errors
    /// [`Error::Device`] from the device; [`Error::Usage`] where a number of stored photons is asked for: none is.
    pub fn emit(&mut self, emission: &Emission) -> Result<MapCounts> {
        let Amount::Paths(paths) = emission.amount else {
            return Err(Error::Usage("--stored: final gathering stores no photons; give --photons".into()));
        };
        match &mut self.machine {
            Machine::Device(stage) => {
                let (Some(scene), Some((_, [splat, resolve, clear]))) = (&stage.scene, &stage.kernels) else {
                    return Err(no_scene());
                };
                let context = &stage.context;
                let emitters = scene.paths.plan.emitters(paths);
                let quanta = Quanta::of(&emitters, paths);
                let emitters = scene.paths.emitters(context, paths)?;
                let count = scene.texels.len();
                let sums = Arguments::new().with("sums", &scene.sums);
                let args = sums.clone().with("count", 3 * count as u32);
                context.launch(clear, &args, &[3 * count], None)?;
                if !scene.paths.plan.is_empty() {
                    let range = Range::new(context, 0, paths);
                    let stream = stream_of(emission.seed, emission.pass);
                    let args = scene.paths.arguments(&emitters, &range, stream).table(&scene.charts).and(&sums);
                    let args = args.with("runs", range.runs()).with("quanta_per_watt", quanta.per_watt);
                    scene.paths.launch(context, splat, &args, &range)?;
                }
                let args =
                    sums.with("inverse_areas", &scene.inverse_areas).with("neighbourhoods", &scene.neighbourhoods);
                let args = args.with("watts_per_quantum", quanta.watts).table(&scene.texels);
                let args = args.with("count", count as u32);
                context.launch(resolve, &args, &[count], None)?;
                context.finish()?;
            }
            Machine::Host(stage) => {
                let Some((packed, features, plan, charts)) = &stage.scene else { return Err(no_scene()) };
                let scene = crate::rays::scene::SceneTables::new(packed, features);
                stage.texels = stage.pool.install(|| cpu::texels::irradiance(&scene, plan, charts, emission, paths));
            }
        }
        Ok(MapCounts { emitted: paths.into(), stored: 0 })
    }

    /// The last texels.
    pub fn view(&self) -> Option<IrradianceView<'_>> {
        match &self.machine {
            Machine::Device(stage) => {
                let scene = stage.scene.as_ref()?;
                Some(IrradianceView::Device { context: &stage.context, charts: &scene.charts, texels: &scene.texels })
            }
            Machine::Host(stage) => {
                let (.., charts) = stage.scene.as_ref()?;
                Some(IrradianceView::Host { charts: &charts.records, texels: &stage.texels })
            }
        }
    }

    /// How the lights share the paths.
    pub fn plan(&self) -> Option<&EmissionPlan> {
        match &self.machine {
            Machine::Device(stage) => stage.scene.as_ref().map(|scene| &scene.paths.plan),
            Machine::Host(stage) => stage.scene.as_ref().map(|(_, _, plan, _)| plan),
        }
    }

    /// Bytes held on the device.
    pub fn bytes(&self) -> usize {
        match &self.machine {
            Machine::Device(_) => 0, // the context counts its buffers
            Machine::Host(stage) => size_of_val(&stage.texels[..]),
        }
    }
}

impl IrradianceView<'_> {
    /// Charts and texels in host memory, for OpenGL and for tests.
    ///
    /// # Errors
    /// [`Error::Device`] when the transfer fails.
    pub fn read(&self) -> Result<(Vec<Chart>, Vec<Texel>)> {
        match self {
            IrradianceView::Device { context, charts, texels } => {
                Ok((charts.to_vec(context)?, texels.to_vec(context)?))
            }
            IrradianceView::Host { charts, texels } => Ok((charts.to_vec(), texels.to_vec())),
        }
    }
}

fn no_scene() -> Error {
    Error::Device("irradiance texels: asked for before there was a scene".into())
}
