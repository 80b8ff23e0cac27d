//! Opening a backend: its tracer, and where photons are made for it.

use std::rc::Rc;

use super::{Devices, Pipeline, Technique};
use crate::device::cl;
use crate::device::gl::{self, Headless};
use crate::error::{Error, Result};
use crate::plan::choice::Class;
use crate::settings::Backend;
use crate::stage::trace::{ClTrace, CpuTrace, GlTrace, Trace};
use crate::techniques::{Place, TABLE};

/// Where a picture shall be made.
#[derive(Clone, Debug)]
pub struct Machine {
    /// `None`: the first that works of [`Backend::ALL`].
    pub backend: Option<Backend>,
    /// An OpenCL device's number, such as `#2`, or part of its name or its platform's.
    pub device: Option<String>,
    /// Threads of the CPU twins.
    pub threads: usize,
    /// Lanes of an OpenCL work-item (1, 4, 8 or 16); `None`: what suits the device. 1 gives plain scalar kernels.
    pub lanes: Option<u32>,
}

impl Default for Machine {
    fn default() -> Self {
        Machine { backend: None, device: None, threads: 1, lanes: None }
    }
}

impl Pipeline {
    /// Opens a backend; without one asked for, OpenGL, else OpenCL, else the CPU, each fallback told to `notice`.
    ///
    /// # Errors
    /// [`Error::Driver`] when the backend that was asked for is not there.
    pub fn open(machine: &Machine, notice: impl FnMut(&str)) -> Result<Pipeline> {
        Pipeline::open_first(machine, None, notice)
    }

    /// Like [`Pipeline::open`], for pictures of a size: a backend that has no room for them is passed over, too.
    ///
    /// # Errors
    /// As [`Pipeline::open`]; what the backend that was asked for says to the size.
    pub fn open_for(machine: &Machine, size: [u32; 2], notice: impl FnMut(&str)) -> Result<Pipeline> {
        Pipeline::open_first(machine, Some(size), notice)
    }

    fn open_first(machine: &Machine, size: Option<[u32; 2]>, mut notice: impl FnMut(&str)) -> Result<Pipeline> {
        if machine.backend != Some(Backend::Cpu) {
            cl::probing::begin(machine.device.as_deref());
        }
        let open = |backend, notice: &mut dyn FnMut(&str)| {
            let mut pipeline = Pipeline::open_with(backend, machine, None, notice)?;
            size.map_or(Ok(()), |size| pipeline.tracer.make_film(size))?;
            Ok(pipeline)
        };
        if let Some(backend) = machine.backend {
            return open(backend, &mut notice);
        }
        for (backend, next) in [(Backend::OpenGl, "OpenCL"), (Backend::OpenCl, "the CPU")] {
            match open(backend, &mut notice) {
                Ok(pipeline) => return Ok(pipeline),
                Err(error @ Error::Usage(_)) => return Err(error), // a wrong option is no reason to ignore it
                Err(error) => notice(&format!("falling back from {} to {next}: {error}", backend.name())),
            }
        }
        open(Backend::Cpu, &mut notice)
    }

    /// Opens a backend; OpenGL draws in a context that the caller made current on this thread, and that outlives the
    /// pipeline: a window's own, or one that shares its textures.
    ///
    /// # Errors
    /// [`Error::Driver`] when the backend is not there.
    pub fn open_within(
        backend: Backend,
        machine: &Machine,
        current: &gl::Current,
        mut notice: impl FnMut(&str),
    ) -> Result<Pipeline> {
        Pipeline::open_with(backend, machine, Some(current), &mut notice)
    }

    fn open_with(
        backend: Backend,
        machine: &Machine,
        current: Option<&gl::Current>,
        notice: &mut dyn FnMut(&str),
    ) -> Result<Pipeline> {
        let mut devices = Devices::default();
        let mut context = None;
        let (tracer, place, class): (Box<dyn Trace>, Place, Class) = match backend {
            Backend::OpenGl => {
                let (gl, is_software) = match current {
                    Some(current) => {
                        devices.opengl = Some(current.renderer.clone());
                        (current.gl.clone(), current.is_software)
                    }
                    None => {
                        let headless = Headless::new()?;
                        // A driver may be there and yet draw nothing: then the next backend is tried.
                        gl::probe(&headless)?;
                        devices.opengl = Some(format!("{} ({})", headless.renderer, headless.route));
                        let Headless { gl, is_software, .. } = context.insert(headless);
                        (gl.clone(), *is_software)
                    }
                };
                let tracer = GlTrace::new(&gl, is_software)?;
                let place = place_beside_opengl(machine, &mut devices, notice)?;
                (Box::new(tracer), place, Class::of_opengl(is_software))
            }
            Backend::OpenCl => {
                let opened = Rc::new(open_lanes(machine, notice)?);
                devices.name_opencl(&opened);
                let class = Class::of_opencl(opened.device.lanes);
                (Box::new(ClTrace::new(Rc::clone(&opened))?), Place::Device(opened), class)
            }
            Backend::Cpu => {
                let pool = threads(machine)?;
                (Box::new(CpuTrace::new(Rc::clone(&pool))), Place::Host(pool), Class::Cpu)
            }
        };
        let techniques = TABLE.iter().map(|row| Ok(Technique { row, stages: (row.open)(&place)? }));
        let techniques = techniques.collect::<Result<_>>()?;
        Ok(Pipeline { tracer, techniques, place, context, backend, devices, class, last: None, partial: false })
    }
}

/// Photons for OpenGL come from OpenCL, and where that is not there, from the CPU.
fn place_beside_opengl(machine: &Machine, devices: &mut Devices, notice: &mut dyn FnMut(&str)) -> Result<Place> {
    match open_lanes(machine, notice) {
        Ok(opened) => {
            devices.name_opencl(&opened);
            Ok(Place::Device(Rc::new(opened)))
        }
        Err(error @ Error::Usage(_)) => Err(error),
        Err(error) => {
            notice(&format!("photons come from the CPU: {error}"));
            Ok(Place::Host(threads(machine)?))
        }
    }
}

/// The pool that the twins run on.
fn threads(machine: &Machine) -> Result<Rc<rayon::ThreadPool>> {
    let threads = machine.threads;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map(Rc::new).map_err(|error| Error::Device(format!("{threads} threads: {error}")))
}

/// The class of devices that a backend would render with here, told without building its kernels.
///
/// # Errors
/// [`Error::Driver`] when the backend is not there.
pub fn class_of(backend: Backend, machine: &Machine) -> Result<Class> {
    Ok(match backend {
        Backend::OpenGl => {
            let headless = Headless::new()?;
            gl::probe(&headless)?;
            Class::of_opengl(headless.is_software)
        }
        Backend::OpenCl => Class::of_opencl(open_lanes(machine, &mut |_| {})?.device.lanes),
        Backend::Cpu => Class::Cpu,
    })
}

/// The machine's OpenCL device, with the lanes asked for.
fn open_lanes(machine: &Machine, notice: &mut dyn FnMut(&str)) -> Result<cl::Context> {
    let mut opened = open_device(machine.device.as_deref(), notice)?;
    opened.device.lanes = machine.lanes.unwrap_or(opened.device.lanes);
    Ok(opened)
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
