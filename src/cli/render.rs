//! `photile render`: a scene file in, an image out.

use std::path::PathBuf;

use serde::Serialize;

use super::batches;
use super::options::{RenderOptions, choice};
use super::passes::{self, PassOptions, Passes};
use super::{notice, print_json};
use crate::error::{Error, Result};
use crate::film::{SaveOptions, check_output};
use crate::pipeline::change::Stage;
use crate::pipeline::progressive;
use crate::pipeline::{Devices, Pipeline, Times};
use crate::settings::{Backend, GridForm, LightMode, Method};
use crate::stage::map::MapCounts;

/// Render a scene to a PNG or EXR file
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    options: RenderOptions,
    #[command(flatten)]
    passes: PassOptions,
    /// Where to write: .png (tone-mapped sRGB) or .exr (linear radiance) [default: the scene's name, .png]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Which machine renders [default: opengl, else opencl, else cpu]
    #[arg(long, value_parser = choice::<Backend>())]
    backend: Option<Backend>,
    /// Exposure value: PNGs show radiance scaled by 2^EV
    #[arg(long, value_name = "EV", allow_negative_numbers = true)]
    exposure: Option<f32>,
    /// Print one JSON object on stdout
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report<'a> {
    scene: &'a str,
    backend: Backend,
    gather: Method,
    light: LightMode,
    radius: Option<f32>,
    /// The grid's form, where there is a grid.
    grid_form: Option<GridForm>,
    photons: Option<MapCounts>,
    uploads: u64,
    size: [u32; 2],
    samples: u32,
    seed: u32,
    time_ms: Times,
    skipped: Vec<Stage>,
    devices: &'a Devices,
    memory_bytes: usize,
    /// Most that OpenCL's buffers ever held.
    memory_most_opencl_bytes: Option<usize>,
    output: String,
    /// Passes in the picture, those of a checkpoint included.
    passes: u64,
    technique: &'static str,
    /// Seconds of this run's passes, compilation apart.
    render_seconds: f64,
    /// Estimated: mean over the image of (standard error + bias) / radiance.
    error: Option<f64>,
    interrupted: bool,
    warnings: Vec<String>,
    longest_submission_ms: f64,
    /// Which kernel or shader that was.
    longest_submission: String,
}

pub fn run(args: &Args) -> Result<()> {
    let scene = args.options.load()?;
    let mut settings = args.options.settings(&scene);
    let mut wish = args.passes.wish(&args.options, &scene);
    wish.settle(&scene, &mut settings.clone())?; // what contradicts itself is told before any driver is asked
    let output = args.output.clone().unwrap_or_else(|| PathBuf::from(format!("{}.png", scene.name)));
    check_output(&output)?;
    let exposure = args.exposure.or(scene.render.exposure.map(|ev| ev as f32)).unwrap_or(0.0);
    if !exposure.is_finite() {
        return Err(Error::Usage(format!("found --exposure {exposure}, expected a finite number")));
    }

    let machine = args.options.machine(args.backend);
    let mut pipeline = Pipeline::open(&machine, notice)?;
    wish.on_gpu = pipeline.is_on_gpu();
    wish.settle(&scene, &mut settings)?;
    let chosen_paths = args.options.choose_paths(&scene, &mut settings)?;
    let chosen = if args.backend.is_some() { "asked for" } else { "the first that works" };
    let device = pipeline.devices.opengl.as_ref().or(pipeline.devices.opencl.as_ref());
    let device = device.map(|name| format!(" on {name}")).unwrap_or_default();
    notice(&format!("rendering with {} ({chosen}){device}", pipeline.backend.name()));

    if let Some(chosen) = chosen_paths {
        notice(&chosen);
    }

    let picture = if args.passes.wanted(&scene) {
        passes::run(&mut pipeline, &scene, &settings, &args.passes)?
    } else {
        Passes::one(batches::render(&mut pipeline, &scene, &settings)?)
    };
    let rendering = &picture.last;
    let warnings = crate::plan::warnings::of(&scene, &settings, rendering.radius);
    for warning in &warnings {
        notice(&format!("warning: {warning}"));
    }
    let note = |name: &str, value: String| (name.to_string(), value);
    let provenance = [
        note("scene", scene.name.clone()),
        note("backend", pipeline.backend.name().into()),
        note("samples", settings.samples.to_string()),
        note("passes", picture.passes.to_string()),
        note("seed", settings.seed.to_string()),
    ];
    let channels = picture.estimate.as_ref().map(progressive::channels).unwrap_or_default();
    picture.image.save(&output, &SaveOptions { exposure, settings: &provenance, channels: &channels })?;

    let times = picture.times;
    if let (Some(photons), Some(radius)) = (rendering.photons, rendering.radius) {
        notice(&format!(
            "{} paths emitted, {} photons stored, gathered by {} with radius {radius:.4} m",
            photons.emitted,
            photons.stored,
            rendering.method.map_or("nothing", Method::name)
        ));
    }
    let error = picture.estimate.as_ref().map(|estimate| estimate.relative);
    if picture.passes > 1 {
        let error = error.map(|error| format!(", error about {:.3}%", 100.0 * error)).unwrap_or_default();
        notice(&format!("{} passes in {:.2} s{error}", picture.passes, picture.seconds));
    }
    notice(&format!(
        "{} in {:.1} ms (compile {:.1}, emit {:.1}, grid {:.1}, tiles {:.1}, upload {:.1}, trace {:.1}, readback {:.1})",
        output.display(),
        times.total,
        times.compile,
        times.emit,
        times.grid,
        times.tiles,
        times.upload,
        times.trace,
        times.readback
    ));
    if args.json {
        let longest = crate::device::submissions::longest();
        print_json(&Report {
            scene: &scene.name,
            backend: pipeline.backend,
            gather: rendering.method.unwrap_or(settings.gather.method),
            light: settings.light,
            radius: rendering.radius,
            grid_form: rendering.form,
            photons: rendering.photons,
            uploads: rendering.uploads,
            size: [settings.width, settings.height],
            samples: settings.samples,
            seed: settings.seed,
            time_ms: times,
            skipped: rendering.skipped.clone(),
            devices: &pipeline.devices,
            memory_bytes: pipeline.bytes(),
            memory_most_opencl_bytes: pipeline.most_bytes(),
            output: output.display().to_string(),
            passes: picture.passes,
            technique: settings.technique.kind().name(),
            render_seconds: picture.seconds,
            error,
            interrupted: picture.interrupted,
            warnings,
            longest_submission_ms: longest.0,
            longest_submission: longest.1,
        });
    }
    // Not what was asked for: a script must not take it for that.
    match picture.interrupted {
        true => Err(Error::Failed(match &picture.checkpoint {
            Some(path) => {
                format!("interrupted after {} passes; go on with --checkpoint {}", picture.passes, path.display())
            }
            None => format!("interrupted after {} passes; {} holds what was done", picture.passes, output.display()),
        })),
        false => Ok(()),
    }
}
