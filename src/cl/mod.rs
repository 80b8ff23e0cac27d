//! OpenCL: devices, programs, buffers, launches. All `unsafe` towards OpenCL is in this folder.

mod buffer;
mod context;
mod device;
mod probe;

pub use buffer::{Buffer, Memory, PART_ALIGNMENT};
pub use context::{Arg, Context, Kernel};
pub use device::{Device, devices};
pub use probe::probe;

use crate::error::Error;

/// What to install where no OpenCL is found.
pub const MISSING: &str = "OpenCL is not there: on Debian or Ubuntu, `apt-get install pocl-opencl-icd ocl-icd-libopencl1` \
                           brings it for CPUs; GPUs bring theirs with their driver";

/// An OpenCL failure in words: what was attempted, and the error's name.
fn failed(what: &str, error: opencl3::error_codes::ClError) -> Error {
    Error::Device(format!("OpenCL: {what}: {error}"))
}
