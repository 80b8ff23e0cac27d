//! OpenCL: devices, programs, buffers, launches. All `unsafe` towards OpenCL is in this folder.

pub mod aborts;
pub mod caches;
pub mod probing;

mod arguments;
mod buffer;
mod context;
mod device;
mod probe;

pub use arguments::{Arg, Arguments};
pub use buffer::{Buffer, Memory, PART_ALIGNMENT};
pub use context::{Context, Kernel};
pub use device::Device;
pub use probe::probe;
use probe::probe_anew;
pub use probing::devices;

use opencl3::error_codes::{
    CL_INVALID_BUFFER_SIZE, CL_INVALID_COMMAND_QUEUE, CL_MEM_OBJECT_ALLOCATION_FAILURE, CL_OUT_OF_RESOURCES,
};

use crate::error::Error;

/// What to install where no OpenCL is found.
pub const MISSING: &str = "OpenCL is not there: on Debian or Ubuntu, `apt-get install pocl-opencl-icd ocl-icd-libopencl1` \
                           brings it for CPUs; GPUs bring theirs with their driver";

/// An OpenCL failure in words: what was attempted, and the error's name.
fn failed(what: &str, error: opencl3::error_codes::ClError) -> Error {
    match error.0 {
        // Some drivers find out as late as the first launch that uses a buffer.
        CL_MEM_OBJECT_ALLOCATION_FAILURE | CL_INVALID_BUFFER_SIZE => Error::Memory(format!("OpenCL: {what}: {error}")),
        // What drivers answer after a reset, a watchdog or an illegal access, and to every call from then on.
        CL_OUT_OF_RESOURCES | CL_INVALID_COMMAND_QUEUE => {
            Error::Device(format!("OpenCL: {what}: {error}: the device was lost, or reset by its driver; start anew"))
        }
        _ => Error::Device(format!("OpenCL: {what}: {error}")),
    }
}
