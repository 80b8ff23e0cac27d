//! A device in use: its context, its queue, the programs built so far.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::rc::Rc;
use std::time::{Duration, Instant};

use opencl3::command_queue::{CL_QUEUE_PROFILING_ENABLE, CommandQueue};
use opencl3::context::Context as ClContext;
use opencl3::device::Device as ClDevice;
use opencl3::error_codes::ClError;
use opencl3::event::Event;
use opencl3::kernel::{ExecuteKernel, Kernel as ClKernel};
use opencl3::program::Program;

use super::arguments::{Arg, Arguments, Places};
use super::buffer::Memory;
use super::{Device, aborts, failed, probing};
use crate::device::injected_faults;
use crate::device::submissions::{self, Pace};
use crate::error::{Error, Result};
use crate::program::parameters::{self, Parameter};
use crate::program::source::Source;

/// A device in use.
pub struct Context {
    /// What it runs on.
    pub device: Device,
    pub(super) context: ClContext,
    pub(super) queue: CommandQueue,
    programs: RefCell<HashMap<String, Rc<Built>>>,
    /// Launches that were not waited for: how long each took tells how long the next one will.
    unread: RefCell<Vec<(Event, Rc<Pace>, usize)>>,
    /// What its buffers hold.
    pub memory: Rc<Memory>,
    /// Names of the kernels that were launched.
    launched: RefCell<BTreeSet<String>>,
}

/// A program, and the parameters of its kernels.
struct Built {
    program: Program,
    kernels: BTreeMap<String, Rc<[Parameter]>>,
}

/// A kernel function of a built program.
pub struct Kernel {
    kernel: ClKernel,
    name: String,
    /// Where arguments of what names go, by the kernel's own text.
    places: Places,
    /// What a work-item takes, or where work-items have two numbers, a row of them.
    pub pace: Rc<Pace>,
}

impl Context {
    /// Opens a device.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver refuses, or did not live through being tried.
    pub fn new(device: Device) -> Result<Context> {
        probing::may_be_used(&device)?;
        Context::new_untried(device)
    }

    /// Opens a device that may end the program.
    pub(super) fn new_untried(device: Device) -> Result<Context> {
        let context = ClContext::from_device(&ClDevice::new(device.id)).map_err(|e| failed("opening the device", e))?;
        // OpenCL 1.2's call, deprecated since 2.0 but supported by every driver; its successor is not.
        #[allow(deprecated)]
        let queue = CommandQueue::create_default(&context, CL_QUEUE_PROFILING_ENABLE)
            .map_err(|e| failed("making a queue", e))?;
        Ok(Context {
            device,
            context,
            queue,
            programs: RefCell::default(),
            unread: RefCell::default(),
            memory: Rc::default(),
            launched: RefCell::default(),
        })
    }

    /// Builds a program, or finds it among those built before, and takes one of its kernels.
    ///
    /// # Errors
    /// [`Error::Build`] with the driver's log in terms of our files.
    pub fn kernel(&self, source: &Source, name: &str) -> Result<Kernel> {
        let known = self.programs.borrow().get(&source.text).cloned();
        let built = match known {
            Some(built) => built,
            None => {
                let built = Rc::new(self.build(source)?);
                aborts::outlive_still();
                self.programs.borrow_mut().insert(source.text.clone(), Rc::clone(&built));
                built
            }
        };
        let refused = |e| failed(&format!("kernel {name}"), e);
        let kernel = ClKernel::create(&built.program, name).map_err(refused)?;
        let parameters = built.kernels.get(name).cloned().unwrap_or_default();
        let count = kernel.num_args().map_err(refused)? as usize;
        if count != parameters.len() {
            return Err(Error::Device(format!(
                "kernel {name} of {}: {} parameters in its text, {count} for the driver",
                source.unit,
                parameters.len()
            )));
        }
        let places = Places::new(name, parameters);
        Ok(Kernel { kernel, name: name.into(), places, pace: Rc::new(Pace::new(name)) })
    }

    /// Names of the kernels that were launched so far.
    pub fn launched(&self) -> BTreeSet<String> {
        self.launched.borrow().clone()
    }

    fn build(&self, source: &Source) -> Result<Built> {
        let mut program = Program::create_from_source(&self.context, &source.text)
            .map_err(|e| failed(&format!("program {}", source.unit), e))?;
        // -w: what a driver's compiler warns of is for those who write kernels, and it writes that to the user's terminal.
        let options = if source.contracted { "-w -cl-std=CL1.2 -cl-mad-enable" } else { "-w -cl-std=CL1.2" };
        program.build(self.context.devices(), options).map_err(|error| {
            let log = program.get_build_log(self.device.id).unwrap_or_default();
            let log = if log.trim().is_empty() { error.to_string() } else { source.map_log(&log) };
            self.refused(source, log)
        })?;
        let kernels = parameters::kernels(&source.text).map_err(|what| self.refused(source, what))?;
        let kernels = kernels.into_iter().map(|(name, parameters)| (name, parameters.into())).collect();
        Ok(Built { program, kernels })
    }

    fn refused(&self, source: &Source, log: String) -> Error {
        Error::Build {
            unit: source.unit.clone(),
            permutation: source.permutation.clone(),
            device: self.device.name.clone(),
            log,
        }
    }

    /// Runs a kernel over `global` work-items, padded to whole work-groups of `local` where that is given: kernels
    /// drop the surplus themselves. The queue is in order. Returns at once, but where a GPU might take so long that the
    /// launch has to be cut: see [`Context::launch_paced`].
    ///
    /// # Errors
    /// [`Error::Device`] when the launch is refused.
    pub fn launch(&self, kernel: &Kernel, args: &Arguments, global: &[usize], local: Option<&[usize]>) -> Result<()> {
        if !submissions::cuts_all(self.device.is_gpu) {
            return self.enqueue(kernel, args, global, local, &[]).map(|_| ());
        }
        let units = global.last().copied().unwrap_or(0);
        if !kernel.pace.fits(units) {
            return self.launch_paced(kernel, args, global, local);
        }
        if let Some(event) = self.enqueue(kernel, args, global, local, &[])? {
            let mut unread = self.unread.borrow_mut();
            unread.push((event, Rc::clone(&kernel.pace), units));
            // So many events are few for a driver, and seldom read.
            if unread.len() > 256 {
                unread.retain(|launch| !read_time(launch));
            }
        }
        Ok(())
    }

    /// Like [`Context::launch`], but cut along the last dimension into pieces that no watchdog minds, and waited for.
    /// Kernels see the same `get_global_id` as uncut; `get_group_id` and `get_global_size` would differ.
    ///
    /// # Errors
    /// [`Error::Device`] when a launch is refused or fails.
    pub fn launch_paced(
        &self,
        kernel: &Kernel,
        args: &Arguments,
        global: &[usize],
        local: Option<&[usize]>,
    ) -> Result<()> {
        self.launch_while(kernel, args, global, local, &|| true).map(|_| ())
    }

    /// Like [`Context::launch_paced`], and asks between two pieces whether the rest is wanted. How much of the last
    /// dimension was done.
    ///
    /// # Errors
    /// As [`Context::launch_paced`].
    pub fn launch_while(
        &self,
        kernel: &Kernel,
        args: &Arguments,
        global: &[usize],
        local: Option<&[usize]>,
        wanted: &dyn Fn() -> bool,
    ) -> Result<usize> {
        let Some((all, across)) = global.split_last() else { return Ok(0) };
        // Without a size of their own, work-groups of GPUs are some warps.
        let usual = if self.device.is_gpu { 64 } else { 1 };
        let granule = local.and_then(|local| local.last()).copied().unwrap_or(usual);
        let (mut done, all) = (0, *all);
        kernel.pace.begin();
        while done < all {
            let units = kernel.pace.next(all - done, all, granule, across.iter().product());
            let piece: Vec<usize> = across.iter().copied().chain([units]).collect();
            let offset: Vec<usize> = across.iter().map(|_| 0).chain([done]).collect();
            let begin = Instant::now();
            let Some(event) = self.enqueue(kernel, args, &piece, local, &offset)? else { return Ok(all) };
            self.wait(&event, &kernel.name)?;
            // Some drivers do not tell; the host's clock then counts what stood in the queue too.
            kernel.pace.took(units, milliseconds(&event).unwrap_or(begin.elapsed().as_secs_f64() * 1e3));
            done += units;
            if done < all && !wanted() {
                break;
            }
        }
        Ok(done)
    }

    /// Like [`Context::launch`], then waits and tells the device's own time for it.
    ///
    /// # Errors
    /// [`Error::Device`] when the launch is refused or fails.
    pub fn run(
        &self,
        kernel: &Kernel,
        args: &Arguments,
        global: &[usize],
        local: Option<&[usize]>,
    ) -> Result<Duration> {
        let Some(event) = self.enqueue(kernel, args, global, local, &[])? else { return Ok(Duration::ZERO) };
        self.wait(&event, &kernel.name)?;
        let time = event.profiling_command_end().and_then(|end| Ok(end - event.profiling_command_start()?));
        Ok(Duration::from_nanos(time.unwrap_or(0)))
    }

    fn enqueue(
        &self,
        kernel: &Kernel,
        args: &Arguments,
        global: &[usize],
        local: Option<&[usize]>,
        offset: &[usize],
    ) -> Result<Option<Event>> {
        if global.contains(&0) {
            return Ok(None);
        }
        let mut launch = ExecuteKernel::new(&kernel.kernel);
        let is_new = kernel.places.in_order(args, |arg| {
            // SAFETY: each argument is of the type that the kernel's text declares for its name, as `Places` holds it
            // against; the driver refuses an argument of another size.
            unsafe {
                match arg {
                    Arg::Memory(memory) => launch.set_arg(&memory),
                    Arg::Int(value) => launch.set_arg(&value),
                    Arg::Uint(value) => launch.set_arg(&value),
                    Arg::Float(value) => launch.set_arg(&value),
                    Arg::Local(bytes) => launch.set_arg_local_buffer(bytes),
                }
            };
        })?;
        if is_new {
            self.launched.borrow_mut().insert(kernel.name.clone());
        }
        match local {
            Some(local) => {
                let padded: Vec<usize> = global.iter().zip(local).map(|(g, l)| g.next_multiple_of(*l)).collect();
                launch.set_global_work_sizes(&padded).set_local_work_sizes(local);
            }
            None => {
                launch.set_global_work_sizes(global);
                if let ([items], false) = (global, self.device.is_gpu) {
                    if let Some(size) = group_size(*items, self.device.compute_units as usize) {
                        launch.set_local_work_size(size);
                    }
                }
            }
        }
        if !offset.is_empty() {
            launch.set_global_work_offsets(offset);
        }
        if let Some(code) = injected_faults::of_launch() {
            return Err(failed(&format!("launching {}", kernel.name), ClError(code)));
        }
        // SAFETY: buffers handed over as arguments are reference-counted by OpenCL until the kernel has run.
        let launched = unsafe { launch.enqueue_nd_range(&self.queue) };
        aborts::outlive_still();
        launched.map(Some).map_err(|e| failed(&format!("launching {}", kernel.name), e))
    }

    /// Waits for a launch. What waiting returns is not enough: a launch that failed on the device is over, too.
    fn wait(&self, event: &Event, what: &str) -> Result<()> {
        event.wait().map_err(|e| failed(&format!("running {what}"), e))
    }

    /// Waits until all that was launched is done.
    ///
    /// # Errors
    /// [`Error::Device`] when something launched before has failed.
    pub fn finish(&self) -> Result<()> {
        self.queue.finish().map_err(|e| failed("waiting for the device", e))?;
        for launch in self.unread.borrow_mut().drain(..) {
            read_time(&launch);
        }
        Ok(())
    }
}

/// Learns from a launch that is over. Whether it is.
fn read_time((event, pace, units): &(Event, Rc<Pace>, usize)) -> bool {
    let time = milliseconds(event);
    if let Some(ms) = time {
        pace.took(*units, ms);
    }
    time.is_some()
}

/// The device's own time for a launch; none before its end, and from drivers that do not tell.
fn milliseconds(event: &Event) -> Option<f64> {
    let time = event.profiling_command_end().and_then(|end| Ok(end - event.profiling_command_start()?));
    time.ok().filter(|ns| *ns > 0).map(|ns| ns as f64 / 1e6)
}

/// The work-group size that gives every core of a CPU something to do, where the driver's own choice might not: PoCL
/// puts up to 4096 work-items into one group, which is one thread's, however long each of them takes. A power of two,
/// since drivers compile a kernel once more for each size.
fn group_size(items: usize, cores: usize) -> Option<usize> {
    let most = (items / (4 * cores.max(1))).clamp(1, 256);
    let fits = |power: &u32| items % (1 << power) == 0 && 1 << power <= most;
    (items <= 4096 * cores.max(1)).then(|| 1 << (0..=8).rev().find(fits).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::group_size;

    #[test]
    fn every_core_has_groups_to_run() {
        assert_eq!(group_size(8, 2), Some(1));
        assert_eq!(group_size(192, 2), Some(16));
        assert_eq!(group_size(4096, 2), Some(256));
        assert_eq!(group_size(4099, 2), Some(1), "a prime has no other");
        assert_eq!(group_size(1, 64), Some(1));
        assert_eq!(group_size(1 << 20, 2), None, "the driver's own");
    }
}
