//! The order of the stages, on a backend: what changed is redone, what did not is kept.

use std::rc::Rc;
use std::time::Instant;

use crate::change::{Change, Stage, is_stale};
use crate::cl;
use crate::error::{Error, Result};
use crate::features::Features;
use crate::film::Image;
use crate::gl::Headless;
use crate::pack::Packed;
use crate::scene::Scene;
use crate::settings::{Backend, Settings};
use crate::stage::trace::{ClTrace, CpuTrace, GlTrace, Trace};

/// Where a picture shall be made.
#[derive(Clone, Debug)]
pub struct Machine {
    /// `None`: the first that works of [`Backend::ALL`].
    pub backend: Option<Backend>,
    /// Part of an OpenCL device's or platform's name.
    pub device: Option<String>,
    /// Threads of the CPU twins.
    pub threads: usize,
}

impl Default for Machine {
    fn default() -> Self {
        Machine { backend: None, device: None, threads: 1 }
    }
}

/// Milliseconds by stage; 0 for what was not run.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Times {
    /// Building programs.
    pub compile: f64,
    /// Scene records to the device.
    pub upload: f64,
    /// Rays, shading.
    pub trace: f64,
    /// Film to the host.
    pub readback: f64,
    /// All of it.
    pub total: f64,
}

/// The devices behind a picture, by name.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Devices {
    /// The OpenCL device.
    pub opencl: Option<String>,
    /// The GL renderer and the way to it.
    pub opengl: Option<String>,
}

/// A picture and how it came about.
pub struct Rendering {
    /// Linear radiance.
    pub image: Image,
    /// By stage.
    pub times: Times,
    /// Stages that had nothing to do.
    pub skipped: Vec<Stage>,
}

/// What the device holds, and what it was made from.
struct Last {
    scene: Scene,
    settings: Settings,
    features: Features,
    packed: Packed,
}

/// A backend with a scene on it.
pub struct Pipeline {
    // Declared before `context`, so that GL objects go before their context.
    tracer: Box<dyn Trace>,
    _context: Option<Headless>,
    /// What was chosen.
    pub backend: Backend,
    /// By name.
    pub devices: Devices,
    last: Option<Last>,
}

impl Pipeline {
    /// Opens a backend; without one asked for, OpenGL, else OpenCL, else the CPU, each fallback told to `notice`.
    ///
    /// # Errors
    /// [`Error::Driver`] when the backend that was asked for is not there.
    pub fn open(machine: &Machine, mut notice: impl FnMut(&str)) -> Result<Pipeline> {
        let Some(backend) = machine.backend else {
            for (backend, next) in [(Backend::OpenGl, "OpenCL"), (Backend::OpenCl, "the CPU")] {
                match Pipeline::open_on(backend, machine, &mut notice) {
                    Ok(pipeline) => return Ok(pipeline),
                    Err(error) => notice(&format!("falling back from {} to {next}: {error}", backend.name())),
                }
            }
            return Pipeline::open_on(Backend::Cpu, machine, &mut notice);
        };
        Pipeline::open_on(backend, machine, &mut notice)
    }

    fn open_on(backend: Backend, machine: &Machine, notice: &mut dyn FnMut(&str)) -> Result<Pipeline> {
        let mut devices = Devices::default();
        let mut context = None;
        let tracer: Box<dyn Trace> = match backend {
            Backend::OpenGl => {
                let headless = Headless::new()?;
                devices.opengl = Some(format!("{} ({})", headless.renderer, headless.route));
                let tracer = GlTrace::new(&headless.gl)?;
                context = Some(headless);
                Box::new(tracer)
            }
            Backend::OpenCl => {
                let opened = open_device(machine.device.as_deref(), notice)?;
                devices.opencl = Some(opened.device.name.clone());
                Box::new(ClTrace::new(Rc::new(opened))?)
            }
            Backend::Cpu => Box::new(CpuTrace::new(machine.threads)?),
        };
        Ok(Pipeline { tracer, _context: context, backend, devices, last: None })
    }

    /// Renders a picture, redoing only what changed since the last one.
    ///
    /// # Errors
    /// [`Error::Build`] and [`Error::Device`] from the backend.
    pub fn render(&mut self, scene: &Scene, settings: &Settings) -> Result<Rendering> {
        let start = Instant::now();
        let mut times = Times::default();
        let mut skipped = Vec::new();
        let change = self.change(scene, settings);

        // The first camera's place stays the origin: a moving camera must not repack the scene.
        let origin = self.last.as_ref().map_or(scene.camera.position, |last| last.packed.origin);
        let features = Features::of(scene, settings);

        let mut lap = Lap::new();
        if is_stale(Stage::Compile, change) {
            self.tracer.compile(&features)?;
            times.compile = lap.ms();
        } else {
            skipped.push(Stage::Compile);
        }
        let packed = match self.last.take() {
            Some(last) if !is_stale(Stage::Upload, change) => {
                skipped.push(Stage::Upload);
                last.packed
            }
            _ => {
                let packed = Packed::new(scene, origin);
                self.tracer.upload(&packed)?;
                times.upload = lap.ms();
                packed
            }
        };
        if is_stale(Stage::Trace, change) {
            self.tracer.trace(&packed.frame(&scene.camera, settings))?;
            times.trace = lap.ms();
        } else {
            skipped.push(Stage::Trace);
        }
        self.last = Some(Last { scene: scene.clone(), settings: settings.clone(), features, packed });
        let image = self.tracer.read()?;
        times.readback = lap.ms();
        times.total = start.elapsed().as_secs_f64() * 1e3;
        Ok(Rendering { image, times, skipped })
    }

    /// Traces the same picture again and tells the milliseconds it took: for timings, apart from all else.
    ///
    /// # Errors
    /// As [`Pipeline::render`].
    pub fn retrace(&mut self, scene: &Scene, settings: &Settings) -> Result<f64> {
        if self.change(scene, settings) != Change::NONE {
            self.render(scene, settings)?;
        }
        let Some(last) = &self.last else { return Ok(0.0) };
        let mut lap = Lap::new();
        self.tracer.trace(&last.packed.frame(&scene.camera, settings))?;
        Ok(lap.ms())
    }

    /// Bytes held on the device.
    pub fn bytes(&self) -> usize {
        self.tracer.bytes()
    }

    /// What changed since the last picture.
    fn change(&self, scene: &Scene, settings: &Settings) -> Change {
        let Some(last) = &self.last else { return Change::ALL };
        let before = &last.scene;
        Change::CAMERA
            .when(before.camera != scene.camera || last.settings != *settings)
            .and(Change::LIGHTS.when(before.lights != scene.lights))
            .and(Change::MATERIALS.when(before.materials != scene.materials))
            .and(Change::GEOMETRY.when(before.spheres != scene.spheres || before.planes != scene.planes))
            .and(Change::FEATURES.when(last.features != Features::of(scene, settings)))
    }
}

/// Milliseconds since the last call.
struct Lap(Instant);

impl Lap {
    fn new() -> Lap {
        Lap(Instant::now())
    }

    fn ms(&mut self) -> f64 {
        let now = Instant::now();
        let elapsed = now - std::mem::replace(&mut self.0, now);
        elapsed.as_secs_f64() * 1e3
    }
}

/// The first OpenCL device that builds a kernel; one that cannot is reported and passed over.
///
/// # Errors
/// [`Error::Driver`] when no device is there, or none builds.
pub fn open_device(wanted: Option<&str>, notice: &mut dyn FnMut(&str)) -> Result<cl::Context> {
    let mut last = None;
    for device in cl::devices(wanted)? {
        let name = device.name.clone();
        match cl::Context::new(device).and_then(|context| cl::probe(&context).map(|()| context)) {
            Ok(context) => return Ok(context),
            Err(error) => {
                notice(&format!("OpenCL device '{name}' passed over: {error}"));
                last = Some(error);
            }
        }
    }
    Err(last.unwrap_or_else(|| Error::Driver(cl::MISSING.into())))
}
