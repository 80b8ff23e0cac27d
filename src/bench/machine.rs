//! What a benchmark ran on: a figure without its machine says nothing.

use std::fs;

use super::table::wrapped;
use crate::device::cl;
use crate::device::gl::Headless;

/// The machine, its drivers, and how busy it was.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct MachineInfo {
    /// Of this program.
    pub version: &'static str,
    /// Operating system and architecture, such as `linux x86_64`.
    pub system: String,
    /// The processor's name, where the system tells it.
    pub cpu: Option<String>,
    /// Hardware threads that this process may use.
    pub threads: usize,
    /// Device, platform, driver's version.
    pub opencl: Option<String>,
    /// Renderer, version, way to it.
    pub opengl: Option<String>,
    /// Processes that ran or waited over the last minute when the benchmark began and when it ended: above 0 at the
    /// beginning means that others were there.
    pub load_average: [Option<f64>; 2],
}

impl MachineInfo {
    /// Asks system and drivers; `device` is part of the wanted OpenCL device's name. Opens and closes a GL context:
    /// call it before any other is made.
    pub fn here(device: Option<&str>) -> MachineInfo {
        let opencl = cl::devices(device).ok().and_then(|devices| devices.into_iter().next());
        let load = load_average();
        MachineInfo {
            version: env!("CARGO_PKG_VERSION"),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            cpu: cpu(),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            opencl: opencl.map(|d| format!("{}, {}, {}", d.name, d.platform, d.version)),
            opengl: Headless::new().ok().map(|gl| format!("{}, {}, {}", gl.renderer, gl.version, gl.route)),
            load_average: [load, load],
        }
    }

    /// Notes how busy the machine is now that the benchmark has ended.
    pub fn finish(&mut self) {
        self.load_average[1] = load_average();
    }

    /// A few lines for a terminal of so many columns.
    pub fn text_within(&self, columns: usize) -> String {
        let text = self.text();
        text.lines().map(|line| wrapped(line, columns).join("\n  ") + "\n").collect()
    }

    /// A few lines for a terminal.
    pub fn text(&self) -> String {
        let or_none = |text: &Option<String>| text.clone().unwrap_or_else(|| "none".into());
        let load = |load: Option<f64>| load.map_or("?".into(), |load| format!("{load:.1}"));
        format!(
            "photile {} on {}, {}, {} threads\nOpenCL: {}\nOpenGL: {}\nload average {} before, {} after\n",
            self.version,
            self.system,
            self.cpu.as_deref().unwrap_or("unknown processor"),
            self.threads,
            or_none(&self.opencl),
            or_none(&self.opengl),
            load(self.load_average[0]),
            load(self.load_average[1])
        )
    }
}

/// Linux tells it; elsewhere nothing is known.
fn load_average() -> Option<f64> {
    fs::read_to_string("/proc/loadavg").ok()?.split_whitespace().next()?.parse().ok()
}

/// As Linux names it.
fn cpu() -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_string())
}
