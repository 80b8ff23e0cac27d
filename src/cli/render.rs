//! `photile render`: a scene file in, an image out.

use std::path::PathBuf;

use serde::Serialize;

use super::batches;
use super::options::{BackendArg, RenderOptions};
use super::passes::{self, PassOptions, Passes, Unfinished};
use super::{notice, print_json, rescue};
use crate::error::{Error, Result};
use crate::film::{SaveOptions, check_distinct, check_output};
use crate::pipeline::change::Stage;
use crate::pipeline::progressive;
use crate::pipeline::{Devices, Pipeline, Times};
use crate::settings::{Backend, GridForm, LightMode, Method};
use crate::stage::map::MapCounts;
use crate::techniques;

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
    #[arg(long, value_enum)]
    backend: Option<BackendArg>,
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
    check_distinct(&[("-o", Some(&output)), ("--checkpoint", args.passes.checkpoint.as_deref())])?;
    let exposure = args.exposure.or(scene.render.exposure.map(|ev| ev as f32)).unwrap_or(0.0);
    if !exposure.is_finite() {
        return Err(Error::Usage(format!("found --exposure {exposure}, expected a finite number")));
    }

    let machine = args.options.machine(args.backend.map(Backend::from));
    let mut pipeline = Pipeline::open_for(&machine, [settings.width, settings.height], notice)?;
    wish.on_gpu = pipeline.is_on_gpu();
    wish.settle(&scene, &mut settings)?;
    let chosen_paths = args.options.choose_paths(&scene, &mut settings)?;
    let chosen = if args.backend.is_some() { "asked for" } else { "the first that works" };
    notice(&format!("rendering with {} ({chosen}){}", pipeline.backend.name(), on_devices(&pipeline.devices)));

    if let Some(chosen) = chosen_paths {
        notice(&chosen);
    }

    let picture = if args.passes.wanted(&scene) {
        passes::run(&mut pipeline, &scene, &settings, &args.passes)?
    } else {
        Passes::one(batches::render(&mut pipeline, &scene, &settings)?)
    };
    let rendering = picture.last.as_ref();
    let radius = rendering.and_then(|rendering| rendering.radius);
    let photons = rendering.and_then(|rendering| rendering.photons);
    let method = rendering.and_then(|rendering| rendering.method);
    let warnings = crate::plan::warnings::of(&scene, &settings, radius);
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
    let options = SaveOptions { exposure, settings: &provenance, channels: &channels };
    let written = rescue::written_somewhere(&output, |path| picture.image.save(path, &options));

    let times = picture.times;
    if let (Some(photons), Some(radius)) = (photons, radius) {
        notice(&format!(
            "{} paths emitted, {} photons stored, gathered by {} with radius {radius:.4} m",
            photons.emitted,
            photons.stored,
            method.map_or("nothing", Method::name)
        ));
    }
    let error = picture.estimate.as_ref().map(|estimate| estimate.relative);
    if picture.passes > 1 {
        let error = error.map(|error| format!(", error about {:.3}%", 100.0 * error)).unwrap_or_default();
        notice(&format!("{} passes in {:.2} s{error}", picture.passes, picture.seconds));
    }
    notice(&format!(
        "{} in {:.1} ms (compile {:.1}, emit {:.1}, grid {:.1}, tiles {:.1}, upload {:.1}, trace {:.1}, readback {:.1})",
        if written.is_ok() { output.display().to_string() } else { "rendered".into() },
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
            gather: method.unwrap_or(settings.gather.method),
            light: settings.light,
            radius,
            grid_form: rendering.and_then(|rendering| rendering.form),
            photons,
            uploads: rendering.map_or(0, |rendering| rendering.uploads),
            size: [settings.width, settings.height],
            samples: settings.samples,
            seed: settings.seed,
            time_ms: times,
            skipped: rendering.map_or_else(|| Stage::ALL.to_vec(), |rendering| rendering.skipped.clone()),
            devices: &pipeline.devices,
            memory_bytes: pipeline.bytes(),
            memory_most_opencl_bytes: pipeline.most_bytes(),
            output: output.display().to_string(),
            passes: picture.passes,
            technique: techniques::asked(&settings).name,
            render_seconds: picture.seconds,
            error,
            interrupted: matches!(picture.unfinished, Some(Unfinished::Interrupted)),
            warnings,
            longest_submission_ms: longest.0,
            longest_submission: longest.1,
        });
    }
    // Not what was asked for: a script must not take it for that.
    let (passes, kept) = match (&picture.checkpoint, &picture.unfinished) {
        (Some(path), _) => (picture.passes, format!("go on with --checkpoint {}", path.display())),
        (None, _) => (picture.passes, format!("{} holds what was done", output.display())),
    };
    written.and(match picture.unfinished {
        None => Ok(()),
        Some(Unfinished::Interrupted) => Err(Error::Failed(format!("interrupted after {passes} passes; {kept}"))),
        Some(Unfinished::Failed(error)) => Err(Error::Failed(format!("{error}; after {passes} passes: {kept}"))),
        Some(Unfinished::Unsaved(error)) => Err(error),
    })
}

/// The devices at work, for a line: the one that traces first, and where another makes the photons, that too.
fn on_devices(devices: &Devices) -> String {
    match (&devices.opengl, &devices.opencl) {
        (Some(opengl), Some(opencl)) => format!(" on {opengl}, photons by OpenCL on {opencl}"),
        (Some(opengl), None) => format!(" on {opengl}, photons by the CPU"),
        (None, Some(opencl)) => format!(" on {opencl}"),
        (None, None) => String::new(),
    }
}
