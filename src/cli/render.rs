//! `photile render`: a scene file in, an image out.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::batches;
use super::options::{RenderOptions, choice};
use super::passes::{self, PassOptions, Passes, Unfinished};
use super::{notice, print_json, rescue};
use crate::error::{Error, Result};
use crate::film::{SaveOptions, check_distinct, check_output};
use crate::pipeline::change::Stage;
use crate::pipeline::progressive;
use crate::pipeline::{Devices, Pipeline, Times};
use crate::scene::Scene;
use crate::settings::{Backend, GridForm, LightMode, Method, Settings, TechniqueKind};
use crate::stage::map::MapCounts;
use crate::techniques::Wish;

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
    technique: TechniqueKind,
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
    let asked = args.options.settings(&scene);
    let wish = args.passes.wish(&args.options, &scene);
    wish.settle(&scene, &mut asked.clone())?; // what contradicts itself is told before any driver is asked
    let output = args.output.clone().unwrap_or_else(|| PathBuf::from(format!("{}.png", scene.name)));
    check_output(&output)?;
    check_distinct(&[("-o", Some(&output)), ("--checkpoint", args.passes.checkpoint.as_deref())])?;
    let exposure = args.exposure.or(scene.render.exposure.map(|ev| ev as f32)).unwrap_or(0.0);
    if !exposure.is_finite() {
        return Err(Error::Usage(format!("found --exposure {exposure}, expected a finite number")));
    }

    let machine = args.options.machine(args.backend);
    let mut pipeline = Pipeline::open_for(&machine, [asked.width, asked.height], notice)?;
    let settings = settle(args, &scene, asked, wish, &pipeline)?;
    let picture = if args.passes.wanted(&scene) {
        passes::run(&mut pipeline, &scene, &settings, &args.passes)?
    } else {
        Passes::one(batches::render(&mut pipeline, &scene, &settings)?)
    };
    let done = Done { scene: &scene, settings: &settings, pipeline: &pipeline, picture: &picture, output: &output };
    let warnings = crate::plan::warnings::of(&scene, &settings, done.radius());
    for warning in &warnings {
        notice(&format!("warning: {warning}"));
    }
    let written = done.save(exposure);
    done.tell(written.is_ok());
    if args.json {
        print_json(&done.report(warnings));
    }
    written.and(ended(picture, &output))
}

/// What the user left open is settled for the backend that was opened, and told.
fn settle(args: &Args, scene: &Scene, asked: Settings, wish: Wish, pipeline: &Pipeline) -> Result<Settings> {
    let mut settings = asked;
    Wish { on_gpu: pipeline.is_on_gpu(), ..wish }.settle(scene, &mut settings)?;
    let chosen_paths = args.options.choose_paths(scene, &mut settings)?;
    let chosen = if args.backend.is_some() { "asked for" } else { "the first that works" };
    notice(&format!("rendering with {} ({chosen}){}", pipeline.backend.name(), on_devices(&pipeline.devices)));
    if let Some(chosen) = chosen_paths {
        notice(&chosen);
    }
    Ok(settings)
}

/// A picture, and what it was made from and with.
struct Done<'a> {
    scene: &'a Scene,
    settings: &'a Settings,
    pipeline: &'a Pipeline,
    picture: &'a Passes,
    output: &'a Path,
}

impl Done<'_> {
    /// The radius of the last pass, metres.
    fn radius(&self) -> Option<f32> {
        self.picture.last.as_ref().and_then(|last| last.radius)
    }

    /// Writes the image, with its provenance and the estimate's channels, elsewhere if need be.
    fn save(&self, exposure: f32) -> Result<()> {
        let note = |name: &str, value: String| (name.to_string(), value);
        let provenance = [
            note("scene", self.scene.name.clone()),
            note("backend", self.pipeline.backend.name().into()),
            note("samples", self.settings.samples.to_string()),
            note("passes", self.picture.passes.to_string()),
            note("seed", self.settings.seed.to_string()),
        ];
        let channels = self.picture.estimate.as_ref().map(progressive::channels).unwrap_or_default();
        let options = SaveOptions { exposure, settings: &provenance, channels: &channels };
        rescue::written_somewhere(self.output, |path| self.picture.image.save(path, &options))
    }

    /// The picture's estimated error, relative and as a mean over the image.
    fn error(&self) -> Option<f64> {
        self.picture.estimate.as_ref().map(|estimate| estimate.relative)
    }

    /// Says on stderr how it was made, and how long that took.
    fn tell(&self, is_written: bool) {
        let (picture, times) = (self.picture, &self.picture.times);
        let photons = picture.last.as_ref().and_then(|last| last.photons.map(|photons| (photons, last.method)));
        if let (Some((photons, method)), Some(radius)) = (photons, self.radius()) {
            notice(&format!(
                "{} paths emitted, {} photons stored, gathered by {} with radius {radius:.4} m",
                photons.emitted,
                photons.stored,
                method.map_or("nothing", Method::name)
            ));
        }
        if picture.passes > 1 {
            let error = self.error().map(|error| format!(", error about {:.3}%", 100.0 * error)).unwrap_or_default();
            notice(&format!("{} passes in {:.2} s{error}", picture.passes, picture.seconds));
        }
        let parts = [
            ("compile", times.compile),
            ("emit", times.emit),
            ("grid", times.grid),
            ("tiles", times.tiles),
            ("upload", times.upload),
            ("trace", times.trace),
            ("readback", times.readback),
        ];
        let parts = parts.map(|(stage, ms)| format!("{stage} {ms:.1}")).join(", ");
        let what = if is_written { self.output.display().to_string() } else { "rendered".into() };
        notice(&format!("{what} in {:.1} ms ({parts})", times.total));
    }

    /// What `--json` prints.
    fn report(&self, warnings: Vec<String>) -> Report<'_> {
        let (settings, picture, last) = (self.settings, self.picture, self.picture.last.as_ref());
        let longest = crate::device::submissions::longest();
        Report {
            scene: &self.scene.name,
            backend: self.pipeline.backend,
            gather: last.and_then(|last| last.method).unwrap_or(settings.gather.method),
            light: settings.light,
            radius: self.radius(),
            grid_form: last.and_then(|last| last.form),
            photons: last.and_then(|last| last.photons),
            uploads: last.map_or(0, |last| last.uploads),
            size: [settings.width, settings.height],
            samples: settings.samples,
            seed: settings.seed,
            time_ms: picture.times,
            skipped: last.map_or_else(|| Stage::ALL.to_vec(), |last| last.skipped.clone()),
            devices: &self.pipeline.devices,
            memory_bytes: self.pipeline.bytes(),
            memory_most_opencl_bytes: self.pipeline.most_bytes(),
            output: self.output.display().to_string(),
            passes: picture.passes,
            technique: settings.technique.kind(),
            render_seconds: picture.seconds,
            error: self.error(),
            interrupted: matches!(picture.unfinished, Some(Unfinished::Interrupted)),
            warnings,
            longest_submission_ms: longest.0,
            longest_submission: longest.1,
        }
    }
}

/// An unfinished picture is not what was asked for: a script must not take it for that.
fn ended(picture: Passes, output: &Path) -> Result<()> {
    let passes = picture.passes;
    let kept = match &picture.checkpoint {
        Some(path) => format!("go on with --checkpoint {}", path.display()),
        None => format!("{} holds what was done", output.display()),
    };
    match picture.unfinished {
        None => Ok(()),
        Some(Unfinished::Interrupted) => Err(Error::Failed(format!("interrupted after {passes} passes; {kept}"))),
        Some(Unfinished::Failed(error)) => Err(Error::Failed(format!("{error}; after {passes} passes: {kept}"))),
        Some(Unfinished::Unsaved(error)) => Err(error),
    }
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
