//! Which OpenCL devices there are, and in which order they are tried.

use std::sync::{Mutex, PoisonError};

use opencl3::device::{CL_DEVICE_TYPE_ALL, CL_DEVICE_TYPE_CPU, CL_DEVICE_TYPE_GPU, Device as ClDevice};
use opencl3::platform::get_platforms;

use super::MISSING;
use crate::error::{Error, Result};

/// An OpenCL device.
#[derive(Clone, Debug)]
pub struct Device {
    pub(super) id: opencl3::types::cl_device_id,
    /// Its place among all devices, from 0.
    pub number: usize,
    /// As the driver names it.
    pub name: String,
    /// The driver's platform.
    pub platform: String,
    /// Version that the device claims, `OpenCL 3.0 …`.
    pub version: String,
    /// Work-items are lanes of the hardware: one lane each. Otherwise explicit vectors are used.
    pub is_gpu: bool,
    /// Lanes of a work-item: 1 on GPUs, the native vector width on CPUs (4, 8 or 16).
    pub lanes: u32,
    /// Compute units: multiprocessors or cores.
    pub compute_units: u32,
    /// Global memory, bytes.
    pub memory: u64,
}

// SAFETY: a device id is a handle of the OpenCL runtime, whose calls are thread-safe (OpenCL 1.2, appendix A.2).
unsafe impl Send for Device {}
// SAFETY: as above.
unsafe impl Sync for Device {}

/// All devices, asked for in this process.
pub(super) fn list() -> Result<Vec<Device>> {
    // PoCL makes its devices when it is first asked, and hands them to other threads that ask meanwhile half made, without a
    // name: reading that crashed.
    static ASKING: Mutex<()> = Mutex::new(());
    let _alone = ASKING.lock().unwrap_or_else(PoisonError::into_inner);
    let platforms = get_platforms().map_err(|_| Error::Driver(MISSING.into()))?;
    let mut found = Vec::new();
    for platform in &platforms {
        let platform_name = platform.name().unwrap_or_default();
        for id in platform.get_devices(CL_DEVICE_TYPE_ALL).unwrap_or_default() {
            found.push(describe(id, &platform_name));
        }
    }
    if found.is_empty() {
        return Err(Error::Driver(MISSING.into()));
    }
    found.sort_by_key(|(rank, _)| *rank);
    let numbered = found.into_iter().enumerate().map(|(number, (_, device))| Device { number, ..device });
    Ok(numbered.collect())
}

/// Whether `wanted` means this device of `all`: its number from 1 on, as `#2` or `2`, else a part of its name or its
/// platform's, case ignored. A number beyond the last device is a part of a name, too: `3080`.
pub(super) fn is_wanted(all: &[Device], device: &Device, wanted: &str) -> bool {
    let number = wanted.strip_prefix('#').unwrap_or(wanted).parse::<usize>();
    match number {
        Ok(number) if (1..=all.len()).contains(&number) => device.number + 1 == number,
        _ => format!("{} {}", device.name, device.platform).to_lowercase().contains(&wanted.to_lowercase()),
    }
}

/// The device with its rank: GPUs first.
fn describe(id: opencl3::types::cl_device_id, platform: &str) -> (u32, Device) {
    let device = ClDevice::new(id);
    let kind = device.dev_type().unwrap_or_default();
    let is_gpu = kind & CL_DEVICE_TYPE_GPU != 0;
    let is_cpu = kind & CL_DEVICE_TYPE_CPU != 0;
    let lanes = match device.native_vector_width_float().unwrap_or(1) {
        _ if !is_cpu => 1,
        0..4 => 4, // SSE and NEON have four lanes; a driver that reports less (Apple's reports 1) still gains
        4..8 => 4,
        8..16 => 8,
        16.. => 16,
    };
    let rank = if is_gpu { 0 } else { 1 + u32::from(!is_cpu) };
    let described = Device {
        id,
        number: 0, // until all are there
        name: device.name().unwrap_or_default().trim().to_string(),
        platform: platform.trim().to_string(),
        version: device.version().unwrap_or_default().trim().to_string(),
        is_gpu,
        lanes,
        compute_units: device.max_compute_units().unwrap_or(0),
        memory: device.global_mem_size().unwrap_or(0),
    };
    (rank, described)
}
