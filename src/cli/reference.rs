//! `photile reference SCENE`: an f64 reference image with its standard error, resumable.

use std::io::IsTerminal as _;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::error::{Error, Result};
use crate::reference::{self, Accumulator, ReferenceLight, ReferenceSettings};
use crate::scene;

/// Samples a pixel if neither --spp nor --time is given.
const DEFAULT_SPP: u64 = 256;

/// So that a power cut costs no more than a minute.
const SAVE_EVERY: Duration = Duration::from_secs(60);

/// Arguments of `photile reference`.
#[derive(clap::Args, Clone, Debug)]
pub struct Args {
    /// Scene file
    pub scene: PathBuf,
    /// OpenEXR file to write: R, G, B and stderr.R, stderr.G, stderr.B [default: SCENE_reference.exr]
    #[arg(short, long, value_name = "OUT.exr")]
    pub output: Option<PathBuf>,
    /// Image size in pixels [default: the scene's, else 320x240]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<(u32, u32)>,
    /// All light, or light → surface → camera only
    #[arg(long, value_enum, default_value_t)]
    pub light: Light,
    /// Stop at this many samples a pixel, rounded up to a multiple of 8 [default: 256 without --time]
    #[arg(long)]
    pub spp: Option<u64>,
    /// Stop after this many seconds
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub time: Option<Duration>,
    /// Seed; images of different seeds are independent
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Threads [default: all cores]
    #[arg(long)]
    pub threads: Option<NonZeroUsize>,
    /// Go on from this file if it exists, and keep it up to date
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
    /// Print one JSON object on stdout
    #[arg(long)]
    pub json: bool,
}

/// `--light` of `photile reference`.
#[derive(clap::ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Light {
    /// All light
    #[default]
    Full,
    /// Light → first surface → camera
    Direct,
}

#[derive(serde::Serialize)]
struct Report<'a> {
    scene: &'a str,
    light: &'static str,
    size: (u32, u32),
    seed: u64,
    spp: u64,
    relative_noise: f64,
    mean: [f64; 3],
    seconds: f64,
    interrupted: bool,
    output: &'a Path,
    checkpoint: Option<&'a Path>,
}

/// Render the reference image; Ctrl-C stops it, and what is done is saved.
///
/// # Errors
/// A scene, option or checkpoint that is wrong (exit code 2), or a file that cannot be written (1).
pub fn run(args: &Args) -> Result<()> {
    let scene = scene::load(&args.scene)?;
    let output = args.output.clone().unwrap_or_else(|| PathBuf::from(format!("{}_reference.exr", scene.name)));
    if output.extension().is_none_or(|e| !e.eq_ignore_ascii_case("exr")) {
        return Err(Error::Usage(format!("{}: expected a name that ends in .exr", output.display())));
    }
    let settings = ReferenceSettings {
        size: args.size.or(scene.render.size).unwrap_or((320, 240)),
        light: match args.light {
            Light::Full => ReferenceLight::Full,
            Light::Direct => ReferenceLight::Direct,
        },
        spp: args.spp.or(args.time.is_none().then_some(DEFAULT_SPP)),
        time: args.time,
        seed: args.seed,
        threads: args.threads,
    };
    let from = match &args.checkpoint {
        Some(path) if path.exists() => {
            let from = Accumulator::load(path)?;
            tracing::info!("{}: going on after {} samples a pixel", path.display(), from.passes());
            from
        }
        _ => reference::start(&scene, &settings)?,
    };

    let interrupted = stop_on_interrupt();
    let bar = progress_bar(&settings);
    let began = Instant::now();
    let mut saved = Instant::now();
    let mut save_error = None;
    let mut unfinished = None;
    let rendered = reference::resume(&scene, &settings, from, &mut |progress| {
        match (progress.target, settings.time) {
            (Some(_), None) => bar.set_position(progress.accumulator.passes()),
            _ => bar.set_position(progress.elapsed.as_millis() as u64),
        }
        bar.set_message(format!("{} samples a pixel", progress.accumulator.passes()));
        if let Some(path) = args.checkpoint.as_deref().filter(|_| saved.elapsed() >= SAVE_EVERY) {
            if let Err(e) = progress.accumulator.save(path) {
                save_error = Some(e);
                return ControlFlow::Break(());
            }
            saved = Instant::now();
        }
        if interrupted.load(Ordering::Relaxed) {
            unfinished = Some(progress.accumulator.clone());
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    });
    bar.finish_and_clear();
    if let Some(e) = save_error {
        return Err(e);
    }

    // Sums first: they are what cannot be had again at once.
    let checkpoint = match (&args.checkpoint, &unfinished) {
        (Some(path), _) => Some(path.clone()),
        (None, Some(_)) => Some(output.with_extension("checkpoint")),
        (None, None) => None,
    };
    if let Some(path) = &checkpoint {
        match (&unfinished, &rendered) {
            (Some(sums), _) => sums.save(path)?,
            (None, Ok(image)) => image.accumulator.save(path)?,
            (None, Err(_)) => {}
        }
    }
    if let (Some(_), Some(path)) = (&unfinished, &checkpoint) {
        tracing::warn!("interrupted; go on with --checkpoint {}", path.display());
    }
    let image = rendered?;
    image.write_exr(&output)?;

    let pixels = image.mean.len() as f64;
    let report = Report {
        scene: &scene.name,
        light: match args.light {
            Light::Full => "full",
            Light::Direct => "direct",
        },
        size: image.size,
        seed: args.seed,
        spp: image.accumulator.passes(),
        relative_noise: image.relative_noise(),
        mean: (image.mean.iter().sum::<glam::DVec3>() / pixels).to_array(),
        seconds: began.elapsed().as_secs_f64(),
        interrupted: unfinished.is_some(),
        output: &output,
        checkpoint: checkpoint.as_deref(),
    };
    if args.json {
        let text = serde_json::to_string(&report).map_err(|e| Error::Failed(format!("JSON: {e}")))?;
        println!("{text}");
    } else {
        println!(
            "{}: {}x{}, {} samples a pixel in {:.1} s, mean relative noise {:.2}%",
            output.display(),
            image.size.0,
            image.size.1,
            report.spp,
            report.seconds,
            100.0 * report.relative_noise
        );
    }
    Ok(())
}

/// A flag that the first Ctrl-C sets; the second one ends the program as usual.
fn stop_on_interrupt() -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    let seen = flag.clone();
    let installed = ctrlc::set_handler(move || {
        if seen.swap(true, Ordering::Relaxed) {
            std::process::exit(130); // 128 + SIGINT, as a shell reports it
        }
    });
    if let Err(e) = installed {
        tracing::warn!("Ctrl-C will not save what is done: {e}");
    }
    flag
}

/// Samples or milliseconds on stderr, whichever limit was set; hidden where stderr is not a terminal.
fn progress_bar(settings: &ReferenceSettings) -> ProgressBar {
    let length = match (settings.time, settings.spp) {
        (Some(time), _) => time.as_millis() as u64,
        (None, spp) => spp.unwrap_or(0).next_multiple_of(reference::REPLICATES as u64),
    };
    let target =
        if std::io::stderr().is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let bar = ProgressBar::with_draw_target(Some(length), target);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {percent}% {msg}, {elapsed} (left {eta})") {
        bar.set_style(style);
    }
    bar
}

/// `320x240`.
fn parse_size(text: &str) -> std::result::Result<(u32, u32), String> {
    let number = |part: &str| part.parse::<u32>().ok().filter(|&n| n > 0);
    text.split_once(['x', 'X'])
        .and_then(|(width, height)| Some((number(width)?, number(height)?)))
        .ok_or_else(|| "expected WIDTHxHEIGHT in pixels, as in 320x240".into())
}

/// A positive, finite number of seconds.
fn parse_seconds(text: &str) -> std::result::Result<Duration, String> {
    let seconds = text.parse::<f64>().ok().filter(|&s| s > 0.0);
    seconds.and_then(|s| Duration::try_from_secs_f64(s).ok()).ok_or_else(|| "expected a number of seconds > 0".into())
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
        assert_eq!((args.size, args.light), (Some((64, 48)), Light::Direct));
        assert_eq!(args.time, Some(Duration::from_millis(1500)));
        for wrong in
            ["--size 64", "--size 0x4", "--time 0", "--time -1", "--time nan", "--light photons", "--threads 0"]
        {
            assert!(line(&format!("reference a.toml {wrong}")).is_err(), "{wrong}");
        }
    }
}
