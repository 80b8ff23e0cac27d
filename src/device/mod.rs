//! Devices: OpenCL and OpenGL, what both have to heed (submissions cut by measured time, memory), and faults on purpose.

pub mod cl;
pub mod gl;
pub mod injected_faults;
pub mod live_objects;
pub mod memory;
pub mod submissions;
