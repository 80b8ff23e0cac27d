//! `photile doctor`: which drivers and devices there are, and whether they really work.

use serde::Serialize;

use super::print_json;
use crate::device::{cl, gl};
use crate::error::Result;

/// Show drivers and devices, and run a tiny kernel or shader on each
#[derive(clap::Args)]
pub struct Args {
    /// Print one JSON object on stdout
    #[arg(long)]
    json: bool,
}

/// One device, and whether it works.
#[derive(Serialize)]
struct Finding {
    api: &'static str,
    route: String,
    device: String,
    version: String,
    works: bool,
    detail: String,
}

#[derive(Serialize)]
struct Report {
    findings: Vec<Finding>,
}

pub fn run(args: &Args) -> Result<()> {
    let findings: Vec<Finding> = opengl().into_iter().chain(opencl()).collect();
    if args.json {
        print_json(&Report { findings });
        return Ok(());
    }
    for Finding { api, route, device, version, works, detail } in &findings {
        let verdict = if *works { "works" } else { "FAILS" };
        say!("{api:<7} {verdict}  {route}: {device} ({version})");
        for line in detail.lines() {
            say!("        {line}");
        }
    }
    Ok(())
}

fn opengl() -> Vec<Finding> {
    let finding = |(route, context)| match context {
        Ok(context) => {
            let context: gl::Headless = context;
            let drawn = gl::probe(&context);
            Finding {
                api: "OpenGL",
                route,
                device: context.renderer.clone(),
                version: context.version.clone(),
                works: drawn.is_ok(),
                detail: drawn.err().map_or_else(|| "a shader compiled and drew".into(), |e| e.to_string()),
            }
        }
        Err(error) => absent("OpenGL", route, &error),
    };
    gl::contexts().into_iter().map(finding).collect()
}

fn opencl() -> Vec<Finding> {
    let devices = match cl::devices(None) {
        Ok(devices) => devices,
        Err(error) => return vec![absent("OpenCL", "ICD loader".into(), &error)],
    };
    let finding = |device: cl::Device| {
        let ran = cl::Context::new(device.clone()).and_then(|context| cl::probe(&context));
        let gib = device.memory as f64 / f64::from(1 << 30);
        let is = format!(
            "{}, {} compute units, {gib:.1} GiB, {} lanes a work-item",
            if device.is_gpu { "GPU" } else { "CPU" },
            device.compute_units,
            device.lanes
        );
        Finding {
            api: "OpenCL",
            route: format!("#{} of {}", device.number + 1, device.platform),
            device: device.name,
            version: device.version,
            works: ran.is_ok(),
            detail: ran.err().map_or_else(|| format!("{is}; a kernel built and ran"), |e| format!("{is}; {e}")),
        }
    };
    devices.into_iter().map(finding).collect()
}

fn absent(api: &'static str, route: String, error: &crate::error::Error) -> Finding {
    Finding { api, route, device: "none".into(), version: "-".into(), works: false, detail: error.to_string() }
}
