//! `photile reference SCENE`: an f64 reference image with its standard error, resumable.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::ProgressBar;

use super::options::{Size, parse_seconds};
use super::{notice, output, print_json, rescue, stop_on_signal};
use crate::error::{Error, Result};
use crate::film::{Format, check_directory, check_distinct, check_output};
use crate::reference::{self, Accumulator, Progress, Reference, ReferenceLight, ReferenceSettings};
use crate::scene::{self, Scene};

/// So that a power cut costs no more than a minute.
const SAVE_EVERY: Duration = Duration::from_secs(60);

/// Lines of progress where there is no terminal for a bar.
const LOG_EVERY: Duration = Duration::from_secs(30);

/// Render a reference image in double precision, with its standard error
#[derive(clap::Args)]
pub struct Args {
    /// Scene file (TOML)
    scene: PathBuf,
    /// Where to write: EXR with R, G, B and stderr.R, stderr.G, stderr.B [default: the scene's name, _reference.exr]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Image size in pixels, such as 640x480 [default: the scene's, else 320x240]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Which light the image holds
    #[arg(long, value_enum, default_value_t)]
    light: Light,
    /// Stop at so many samples per pixel, rounded up to a multiple of 8 [default: 256, none with --time]
    #[arg(long, value_name = "S", value_parser = clap::value_parser!(u64).range(1..=1 << 32))]
    spp: Option<u64>,
    /// Stop after so many seconds
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    time: Option<Duration>,
    /// Keys every random number; images of different seeds are independent
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// Threads; the image does not depend on them [default: all cores]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Go on from this file if it is there, and keep it up to date
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Print one JSON object on stdout
    #[arg(long)]
    json: bool,
}

/// Light, as on the command line.
#[derive(clap::ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Light {
    /// All of it
    #[default]
    Full,
    /// Light → first surface → camera
    Direct,
}

impl Light {
    fn name(self) -> &'static str {
        match self {
            Light::Full => "full",
            Light::Direct => "direct",
        }
    }
}

/// What `--json` prints.
#[derive(serde::Serialize)]
struct Report<'a> {
    scene: &'a str,
    light: &'static str,
    size: [u32; 2],
    seed: u64,
    spp: u64,
    /// Mean over pixels of standard error over luminance.
    relative_noise: f64,
    mean: [f64; 3],
    mean_standard_error: [f64; 3],
    seconds: f64,
    interrupted: bool,
    output: String,
    checkpoint: Option<String>,
}

/// Renders until a limit or Ctrl-C; what is done by then is saved.
pub fn run(args: &Args) -> Result<()> {
    let scene = scene::load(&args.scene)?;
    let output = args.output.clone().unwrap_or_else(|| PathBuf::from(format!("{}_reference.exr", scene.name)));
    if check_output(&output)? != Format::Exr {
        return Err(Error::Usage(format!("output {}: expected .exr, which has room for errors", output.display())));
    }
    if let Some(path) = &args.checkpoint {
        check_directory(path)?;
    }
    check_distinct(&[("-o", Some(&output)), ("--checkpoint", args.checkpoint.as_deref())])?;
    let settings = settings(args, &scene);
    let from = begin(args, &scene, &settings)?;
    let mut watch = Watch::new(args, &settings);
    let (width, height) = settings.size;
    notice(&format!("rendering {width}x{height} pixels of {}; Ctrl-C saves what is done", scene.name));
    let rendered = watch.render(&scene, &settings, from);
    let unfinished = watch.unfinished.take();

    // Sums first: they are what cannot be had again at once. Their disk may be full, and the image's not.
    let checkpoint = args.checkpoint.clone().or(unfinished.is_some().then(|| output.with_extension("checkpoint")));
    let sums = unfinished.as_ref().or(rendered.as_ref().ok().map(|image| &image.accumulator));
    let saved = match (&checkpoint, sums) {
        (Some(path), Some(sums)) if watch.added => rescue::written_somewhere(path, |path| sums.save(path)),
        _ => Ok(()),
    };
    let go_on = checkpoint.as_ref().map(|path| format!("go on with --checkpoint {}", path.display()));
    let image = match (&unfinished, rendered) {
        (Some(sums), Err(_)) => {
            return saved.and(Err(Error::Failed(format!(
                "interrupted after {} samples a pixel; an image needs {}; {}",
                sums.passes(),
                reference::REPLICATES,
                go_on.unwrap_or_default()
            ))));
        }
        (_, rendered) => rendered?,
    };
    let spp = image.accumulator.passes();
    let written = write(args, &scene, &image, &output);
    let (seconds, noise) = (watch.began.elapsed().as_secs_f64(), 100.0 * image.relative_noise());
    let what = if written.is_ok() { output.display().to_string() } else { "rendered".into() };
    notice(&format!("{what}: {spp} samples a pixel in {seconds:.1} s, noise {noise:.2}%"));
    if args.json {
        let interrupted = unfinished.is_some();
        print_json(&report(args, &scene, &image, Ending { seconds, interrupted, output, checkpoint }));
    }
    // Not what was asked for: a script must not take it for that.
    let ended = match (unfinished, go_on) {
        (Some(_), Some(go_on)) => Err(Error::Failed(format!("interrupted after {spp} samples a pixel; {go_on}"))),
        _ => Ok(()),
    };
    output::all([written, saved, ended])
}

/// The sums to go on from: those of the checkpoint, where there is one.
fn begin(args: &Args, scene: &Scene, settings: &ReferenceSettings) -> Result<Accumulator> {
    let new = reference::start(scene, settings)?;
    let Some(path) = args.checkpoint.as_deref().filter(|path| path.exists()) else { return Ok(new) };
    let found = Accumulator::load(path)?;
    if !found.continues(&new) {
        let ((width, height), spp) = (found.size(), found.passes());
        return Err(Error::Usage(format!(
            "{}: found {width}x{height} pixels after {spp} samples each, expected an image of the same scene, size, \
             light mode and seed",
            path.display()
        )));
    }
    notice(&format!("going on from {} after {} samples a pixel", path.display(), found.passes()));
    Ok(found)
}

/// Writes the image with its errors and its provenance, elsewhere if need be.
fn write(args: &Args, scene: &Scene, image: &Reference, output: &Path) -> Result<()> {
    let note = |name: &str, value: String| (name.to_string(), value);
    let provenance = [
        note("scene", scene.name.clone()),
        note("renderer", "reference".into()),
        note("light", args.light.name().into()),
        note("samples", image.accumulator.passes().to_string()),
        note("seed", args.seed.to_string()),
    ];
    rescue::written_somewhere(output, |path| image.write_exr(path, &provenance))
}

/// How a run ended.
struct Ending {
    seconds: f64,
    interrupted: bool,
    output: PathBuf,
    checkpoint: Option<PathBuf>,
}

fn report<'a>(args: &Args, scene: &'a Scene, image: &Reference, ending: Ending) -> Report<'a> {
    Report {
        scene: &scene.name,
        light: args.light.name(),
        size: [image.size.0, image.size.1],
        seed: args.seed,
        spp: image.accumulator.passes(),
        relative_noise: image.relative_noise(),
        mean: (image.mean.iter().sum::<glam::DVec3>() / image.mean.len() as f64).to_array(),
        mean_standard_error: image.overall_error.to_array(),
        seconds: ending.seconds,
        interrupted: ending.interrupted,
        output: ending.output.display().to_string(),
        checkpoint: ending.checkpoint.as_ref().map(|path| path.display().to_string()),
    }
}

/// The command line's word, else the scene's, else the default.
fn settings(args: &Args, scene: &Scene) -> ReferenceSettings {
    let default = ReferenceSettings::default();
    ReferenceSettings {
        size: args.size.map(|size| (size.width, size.height)).or(scene.render.size).unwrap_or(default.size),
        light: match args.light {
            Light::Full => ReferenceLight::Full,
            Light::Direct => ReferenceLight::Direct,
        },
        spp: args.spp.or(default.spp.filter(|_| args.time.is_none())),
        time: args.time,
        seed: args.seed,
        threads: args.threads.and_then(|threads| NonZeroUsize::new(threads.into())),
    }
}

/// What goes on beside the rendering: progress, checkpoints, Ctrl-C.
struct Watch<'a> {
    checkpoint: Option<&'a Path>,
    bar: ProgressBar,
    interrupted: Arc<AtomicBool>,
    began: Instant,
    saved: Instant,
    told: Instant,
    /// What was done when Ctrl-C stopped it.
    unfinished: Option<Accumulator>,
    /// There is more than the checkpoint has.
    added: bool,
}

impl<'a> Watch<'a> {
    fn new(args: &'a Args, settings: &ReferenceSettings) -> Self {
        let now = Instant::now();
        Self {
            checkpoint: args.checkpoint.as_deref(),
            bar: progress_bar(settings),
            interrupted: stop_on_signal("sample of all pixels"),
            began: now,
            saved: now,
            told: now,
            unfinished: None,
            added: false,
        }
    }

    /// The image. A checkpoint that cannot be written now may be in a minute, or at the end.
    fn render(&mut self, scene: &Scene, settings: &ReferenceSettings, from: Accumulator) -> Result<Reference> {
        let rendered = reference::resume(scene, settings, from, &mut |progress| {
            self.added = true;
            self.tell(settings, progress);
            if let Some(path) = self.checkpoint.filter(|_| self.saved.elapsed() >= SAVE_EVERY) {
                if let Err(error) = progress.accumulator.save(path) {
                    self.bar.suspend(|| notice(&format!("warning: {error}")));
                }
                self.saved = Instant::now();
            }
            let done = progress.target.is_some_and(|target| progress.accumulator.passes() >= target);
            if !done && self.interrupted.load(Ordering::Relaxed) {
                self.unfinished = Some(progress.accumulator.clone());
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
        self.bar.finish_and_clear();
        rendered
    }

    /// On a terminal the bar; elsewhere, as in a log, a line now and then.
    fn tell(&mut self, settings: &ReferenceSettings, progress: &Progress) {
        let passes = progress.accumulator.passes();
        self.bar.set_position(match settings.time {
            Some(_) => progress.elapsed.as_millis() as u64,
            None => passes,
        });
        let every = if self.bar.is_hidden() { LOG_EVERY } else { Duration::from_secs(1) };
        // The first ones at once: they say that it works.
        if passes > 8 && self.told.elapsed() < every {
            return;
        }
        let noise = 100.0 * progress.accumulator.relative_noise();
        let line = match passes < reference::REPLICATES as u64 {
            true => format!("{passes} samples a pixel"),
            false => format!("{passes} samples a pixel, noise {noise:.2}%"),
        };
        if self.bar.is_hidden() {
            if self.told.elapsed() >= every {
                notice(&format!("{line}, {:.0} s", progress.elapsed.as_secs_f64()));
                self.told = Instant::now();
            }
        } else {
            self.bar.set_message(line);
            self.told = Instant::now();
        }
    }
}

/// Samples or milliseconds on stderr, whichever limit was set; hidden where stderr is not a terminal.
fn progress_bar(settings: &ReferenceSettings) -> ProgressBar {
    let length = match (settings.time, settings.spp) {
        (Some(time), _) => time.as_millis() as u64,
        (None, spp) => spp.unwrap_or(0).next_multiple_of(reference::REPLICATES as u64),
    };
    output::bar(Some(length), "{bar:40} {percent}%, {elapsed} (left {left}), {msg}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;

    #[derive(clap::Parser)]
    struct Line {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn options_are_read_and_nonsense_is_refused() {
        let line = |text: &str| Line::try_parse_from(text.split(' ')).map(|l| l.args);
        let args = line("reference a.toml --size 64x48 --light direct --time 1.5 --threads 2").unwrap();
        assert_eq!((args.size, args.light), (Some(Size { width: 64, height: 48 }), Light::Direct));
        assert_eq!(args.time, Some(Duration::from_millis(1500)));
        for wrong in [
            "--size 64",
            "--size 0x4",
            "--time 0",
            "--time -1",
            "--time nan",
            "--light photons",
            "--threads 0",
            "--spp 0",
        ] {
            assert!(line(&format!("reference a.toml {wrong}")).is_err(), "{wrong}");
        }
    }
}
