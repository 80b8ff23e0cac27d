//! `photile render` in passes: until a limit is reached or Ctrl-C, with a checkpoint, and how wrong the picture still is.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::options::{RenderOptions, choice, parse_seconds};
use super::{notice, stop_on_interrupt};
use crate::error::{Error, Result};
use crate::film::{Accumulator, Image, REPLICATES, check_directory};
use crate::pipeline::progressive::{Estimate, Progressive};
use crate::pipeline::{Pipeline, Rendering, Times};
use crate::scene::Scene;
use crate::settings::{Settings, TechniqueKind};
use crate::techniques::Wish;

/// So that a power cut costs no more than a minute.
const SAVE_EVERY: Duration = Duration::from_secs(60);

/// Passes, and when to stop.
#[derive(clap::Args, Clone, Debug)]
pub struct PassOptions {
    /// Sum up so many passes, each with photons and subpixel positions of its own
    #[arg(long, value_name = "P", value_parser = clap::value_parser!(u32).range(1..))]
    pub passes: Option<u32>,
    /// Go on with passes for so many seconds, programs' compilation apart
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub time: Option<Duration>,
    /// Go on with passes until the error, relative and as a mean over the image, is estimated below this
    #[arg(long, value_name = "E", value_parser = parse_error)]
    pub until_error: Option<f64>,
    /// Go on from this file if it is there, and keep it up to date
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
    #[command(flatten)]
    pub technique: TechniqueOptions,
}

/// How passes make radiance of photons.
#[derive(clap::Args, Clone, Debug)]
pub struct TechniqueOptions {
    /// How indirect light becomes radiance [default in passes: final-gather where no surface is glossy, else map]
    #[arg(long, value_parser = choice::<TechniqueKind>())]
    pub technique: Option<TechniqueKind>,
    /// Rays of a site of final gathering in one pass
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub rays: Option<u32>,
    /// Rays of a sample that gathers for itself, because no site is near enough
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub own_rays: Option<u32>,
    /// Points that light reaches first, a pass, which all sites take light from
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=4096))]
    pub points: Option<u32>,
    /// Pixels from site to site of final gathering; 1: every sample gathers for itself
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..=64))]
    pub spacing: Option<u32>,
}

fn parse_error(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(error) if error > 0.0 && error.is_finite() => Ok(error),
        _ => Err(format!("found '{text}', expected a relative error > 0, such as 0.01")),
    }
}

impl PassOptions {
    /// Whether pictures are summed up at all.
    pub fn wanted(&self, scene: &Scene) -> bool {
        self.passes(scene).is_some() || self.time.is_some() || self.until_error.is_some() || self.checkpoint.is_some()
    }

    fn passes(&self, scene: &Scene) -> Option<u64> {
        let others = self.time.is_some() || self.until_error.is_some();
        self.passes.or(scene.render.passes.filter(|_| !others)).map(u64::from)
    }

    /// What is asked for. A single picture is made of density estimates, unless told otherwise.
    pub fn wish(&self, options: &RenderOptions, scene: &Scene) -> Wish {
        let mut wish = self.technique.wish(options, scene);
        wish.estimates |= !self.wanted(scene);
        wish
    }
}

impl TechniqueOptions {
    /// What the command line and the scene ask for.
    pub fn wish(&self, options: &RenderOptions, scene: &Scene) -> Wish {
        let gathers = options.gather.is_some() || options.radius.is_some() || options.kernel.is_some();
        let grids = options.grid.is_some() || options.tile.is_some() || scene.render.radius.is_some();
        Wish {
            kind: self.technique,
            rays: self.rays,
            own_rays: self.own_rays,
            points: self.points,
            spacing: self.spacing,
            estimates: gathers || grids,
            samples: options.spp.is_some(),
            on_gpu: false,
            photons: options.photons.is_some() || scene.render.photons.is_some(),
        }
    }
}

/// What passes add to a picture.
pub struct Passes {
    /// The mean of all passes.
    pub image: Image,
    /// What the last pass made, and by which means.
    pub last: Rendering,
    /// Times of this run's passes together.
    pub times: Times,
    /// Passes in the picture.
    pub passes: u64,
    /// Milliseconds of this run's passes, compilation apart.
    pub seconds: f64,
    /// How wrong it is, where there are enough passes to tell.
    pub estimate: Option<Estimate>,
    /// Ctrl-C stopped it.
    pub interrupted: bool,
    /// What it can go on from.
    pub checkpoint: Option<PathBuf>,
}

impl Passes {
    /// A picture of a single pass.
    pub fn one(mut rendering: Rendering) -> Passes {
        let image = std::mem::replace(&mut rendering.image, Image::new(0, 0));
        let (times, seconds) = (rendering.times, (rendering.times.total - rendering.times.compile) / 1e3);
        let (estimate, checkpoint) = (None, None);
        Passes { image, last: rendering, times, passes: 1, seconds, estimate, interrupted: false, checkpoint }
    }
}

/// Renders passes until a limit or Ctrl-C; what is done by then is kept.
pub fn run(pipeline: &mut Pipeline, scene: &Scene, settings: &Settings, options: &PassOptions) -> Result<Passes> {
    if let Some(path) = &options.checkpoint {
        check_directory(path)?;
    }
    let mut progressive = match options.checkpoint.as_deref().filter(|path| path.exists()) {
        None => Progressive::new(scene, settings)?,
        Some(path) => {
            let resumed = Progressive::resume(scene, settings, Accumulator::load(path)?);
            let resumed = resumed.map_err(|error| Error::Usage(format!("{}: {error}", path.display())))?;
            notice(&format!("going on from {} after {} passes", path.display(), resumed.passes()));
            resumed
        }
    };
    let target = options.passes(scene).or(match (options.time, options.until_error) {
        (None, None) => Some(1), // a checkpoint alone: one more pass at least
        _ => None,
    });
    let mut watch = Watch::new(options, target);
    notice("rendering in passes; Ctrl-C saves what is done");
    let (mut times, mut last) = (Times::default(), None);
    times.compile += progressive.warm_up(pipeline, scene)?.times.total;
    while last.is_none() || !watch.is_done(&mut progressive) {
        let started = Instant::now();
        let rendering = progressive.step(pipeline, scene)?;
        times.add(&rendering.times);
        watch.spent += started.elapsed() - Duration::from_secs_f64(rendering.times.compile.max(0.0) / 1e3);
        last = Some(rendering);
        watch.tell(&progressive);
        watch.save(&progressive, false)?;
    }
    watch.bar.finish_and_clear();
    watch.save(&progressive, true)?;
    let Some(last) = last else { return Err(Error::Failed("no pass was rendered".into())) };
    Ok(Passes {
        image: progressive.image()?,
        last,
        times,
        passes: progressive.passes(),
        seconds: watch.spent.as_secs_f64(),
        estimate: progressive.estimate(),
        interrupted: watch.interrupted.load(Ordering::Relaxed),
        checkpoint: options.checkpoint.clone(),
    })
}

/// What goes on beside the passes: limits, progress, checkpoints, Ctrl-C.
struct Watch<'a> {
    options: &'a PassOptions,
    target: Option<u64>,
    bar: ProgressBar,
    interrupted: Arc<AtomicBool>,
    /// On passes, compilation apart.
    spent: Duration,
    saved: Instant,
    /// The last estimate of the error, and after how many passes.
    error: (u64, f64),
}

impl<'a> Watch<'a> {
    fn new(options: &'a PassOptions, target: Option<u64>) -> Self {
        let length = target.or(options.time.map(|time| time.as_millis() as u64));
        let hidden = !std::io::stderr().is_terminal();
        let drawn = if hidden { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(length, drawn);
        if let Ok(style) = ProgressStyle::with_template("{bar:40} {elapsed} (left {eta}), {msg}") {
            bar.set_style(style);
        }
        Watch {
            options,
            target,
            bar,
            interrupted: stop_on_interrupt("pass"),
            spent: Duration::ZERO,
            saved: Instant::now(),
            error: (0, f64::INFINITY),
        }
    }

    fn is_done(&mut self, progressive: &mut Progressive) -> bool {
        let passes = progressive.passes();
        let over = self.options.time.is_some_and(|time| self.spent >= time);
        let counted = self.target.is_some_and(|target| passes >= target);
        if self.interrupted.load(Ordering::Relaxed) || over || counted {
            return true;
        }
        let Some(wanted) = self.options.until_error else { return false };
        // Estimates cost as much as a small pass: at whole rounds of replicates, a tenth further on each time.
        if passes % REPLICATES as u64 == 0 && passes >= self.error.0 + self.error.0 / 10 {
            let error = progressive.estimate().map_or(f64::INFINITY, |estimate| estimate.relative);
            self.error = (passes, error);
        }
        self.error.1 <= wanted
    }

    fn tell(&self, progressive: &Progressive) {
        let passes = progressive.passes();
        self.bar.set_position(if self.target.is_some() { passes } else { self.spent.as_millis() as u64 });
        let error = match self.error.1.is_finite() {
            true => format!(", error {:.2}%", 100.0 * self.error.1),
            false => String::new(),
        };
        self.bar.set_message(format!("{passes} passes{error}"));
    }

    fn save(&mut self, progressive: &Progressive, now: bool) -> Result<()> {
        let path: &Path = match &self.options.checkpoint {
            Some(path) if now || self.saved.elapsed() >= SAVE_EVERY => path,
            _ => return Ok(()),
        };
        self.saved = Instant::now();
        progressive.sums().save(path)
    }
}
