//! `photile render` in passes: until a limit is reached or Ctrl-C, with a checkpoint, and how wrong the picture still is.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::ProgressBar;

use super::options::{RenderOptions, choice, parse_seconds};
use super::{notice, output, rescue, stop_on_signal};
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
    /// What the last pass made, and by which means; none where the checkpoint's were enough.
    pub last: Option<Rendering>,
    /// Times of this run's passes together.
    pub times: Times,
    /// Passes in the picture.
    pub passes: u64,
    /// Milliseconds of this run's passes, compilation apart.
    pub seconds: f64,
    /// How wrong it is, where there are enough passes to tell.
    pub estimate: Option<Estimate>,
    /// Why it ended before its limit, if it did.
    pub unfinished: Option<Unfinished>,
    /// What it can go on from.
    pub checkpoint: Option<PathBuf>,
}

/// Why passes ended early.
pub enum Unfinished {
    /// A signal, such as Ctrl-C.
    Interrupted,
    /// The renderer failed after a pass or more.
    Failed(Error),
    /// All passes are there, but the checkpoint could not be written.
    Unsaved(Error),
}

impl Passes {
    /// A picture of a single pass.
    pub fn one(mut rendering: Rendering) -> Passes {
        let image = std::mem::replace(&mut rendering.image, Image::new(0, 0));
        let (times, seconds) = (rendering.times, (rendering.times.total - rendering.times.compile) / 1e3);
        let (estimate, unfinished, checkpoint) = (None, None, None);
        Passes { image, last: Some(rendering), times, passes: 1, seconds, estimate, unfinished, checkpoint }
    }
}

/// Renders passes until a limit or Ctrl-C; what is done by then is kept, and so it is when the renderer fails, or the
/// checkpoint's disk.
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
        (None, None) => Some(1), // a checkpoint alone: one pass
        _ => None,
    });
    let mut watch = Watch::new(options, target);
    let (mut times, mut last, mut failed) = (Times::default(), None, None);
    // A checkpoint that has what is asked for is written as it is: another pass would make another picture.
    if progressive.passes() > 0 && watch.is_done(&mut progressive) {
        notice("all passes asked for are there: writing the picture");
    } else {
        notice("rendering in passes; Ctrl-C saves what is done");
        times.compile += progressive.warm_up(pipeline, scene)?.times.total;
        while progressive.passes() == 0 || !watch.is_done(&mut progressive) {
            let started = Instant::now();
            let rendering = match progressive.step(pipeline, scene) {
                Ok(rendering) => rendering,
                Err(error) if progressive.passes() == 0 => return Err(error),
                Err(error) => {
                    failed = Some(error);
                    break;
                }
            };
            times.add(&rendering.times);
            watch.spent += started.elapsed() - Duration::from_secs_f64(rendering.times.compile.max(0.0) / 1e3);
            last = Some(rendering);
            watch.tell(&progressive);
            if let Err(error) = watch.save(&progressive, false) {
                // The next minute may find room.
                watch.bar.suspend(|| notice(&format!("warning: {error}")));
            }
        }
    }
    watch.bar.finish_and_clear();
    let saved = if last.is_some() || failed.is_some() { watch.save(&progressive, true) } else { Ok(()) };
    let unfinished = match (failed, saved) {
        (Some(error), saved) => {
            saved.unwrap_or_else(|unsaved| notice(&unsaved.to_string()));
            Some(Unfinished::Failed(error))
        }
        (None, Err(unsaved)) => Some(Unfinished::Unsaved(unsaved)),
        (None, Ok(())) => watch.was_stopped.then_some(Unfinished::Interrupted),
    };
    Ok(Passes {
        image: progressive.image()?,
        last,
        times,
        passes: progressive.passes(),
        seconds: watch.spent.as_secs_f64(),
        estimate: progressive.estimate(),
        unfinished,
        checkpoint: options.checkpoint.clone(),
    })
}

/// With an end in sight.
const BAR: &str = "{bar:40} {elapsed} (left {left}), {msg}";
/// Before anything tells how many passes an error takes.
const NO_BAR: &str = "{spinner} {elapsed}, {msg}";

/// What goes on beside the passes: limits, progress, checkpoints, Ctrl-C.
struct Watch<'a> {
    options: &'a PassOptions,
    target: Option<u64>,
    bar: ProgressBar,
    interrupted: Arc<AtomicBool>,
    /// That is why it is over.
    was_stopped: bool,
    /// On passes, compilation apart.
    spent: Duration,
    saved: Instant,
    /// The last estimate of the error, and after how many passes.
    error: (u64, f64),
    /// Passes that the wanted error will take, as far as the estimates tell.
    expected: Option<u64>,
}

impl<'a> Watch<'a> {
    fn new(options: &'a PassOptions, target: Option<u64>) -> Self {
        let length = target.or(options.time.map(|time| time.as_millis() as u64));
        let bar = output::bar(length, if length.is_some() { BAR } else { NO_BAR });
        Watch {
            options,
            target,
            bar,
            interrupted: stop_on_signal("pass"),
            was_stopped: false,
            spent: Duration::ZERO,
            saved: Instant::now(),
            error: (0, f64::INFINITY),
            expected: None,
        }
    }

    fn is_done(&mut self, progressive: &mut Progressive) -> bool {
        let passes = progressive.passes();
        let over = self.options.time.is_some_and(|time| self.spent >= time);
        let counted = self.target.is_some_and(|target| passes >= target);
        if over || counted {
            return true;
        }
        if self.reaches(progressive) {
            return true;
        }
        self.was_stopped = self.interrupted.load(Ordering::Relaxed);
        self.was_stopped
    }

    /// Whether the error is as small as wanted.
    fn reaches(&mut self, progressive: &mut Progressive) -> bool {
        let passes = progressive.passes();
        let Some(wanted) = self.options.until_error else { return false };
        // Estimates cost as much as a small pass: at whole rounds of replicates, a tenth further on each time.
        if passes % REPLICATES as u64 == 0 && passes >= self.error.0 + self.error.0 / 10 {
            let error = progressive.estimate().map_or(f64::INFINITY, |estimate| estimate.relative);
            self.expected = expected((passes, error), self.error, wanted);
            self.error = (passes, error);
        }
        self.error.1 <= wanted
    }

    fn tell(&self, progressive: &Progressive) {
        let passes = progressive.passes();
        let timed = self.target.is_none() && self.options.time.is_some();
        if let (None, None, Some(expected)) = (self.target, self.options.time, self.expected) {
            if self.bar.length() != Some(expected) {
                output::set_template(&self.bar, BAR);
                self.bar.set_length(expected);
            }
        }
        self.bar.set_position(if timed { self.spent.as_millis() as u64 } else { passes });
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
        match now {
            true => rescue::written_somewhere(path, |path| progressive.sums().save(path)),
            false => progressive.sums().save(path),
        }
    }
}

/// How many passes an error takes, of two estimates: errors fall as a power of the passes, ½ if they were independent,
/// up to 1 where they go on in one sequence.
fn expected(now: (u64, f64), before: (u64, f64), wanted: f64) -> Option<u64> {
    let ((passes, error), (earlier, larger)) = (now, before);
    if !error.is_finite() || error <= 0.0 {
        return None;
    }
    let measured = (larger / error).ln() / (passes as f64 / earlier as f64).ln();
    let power = if measured.is_finite() { measured.clamp(0.3, 1.0) } else { 0.5 };
    let more = (error / wanted).max(1.0).powf(1.0 / power);
    Some((passes as f64 * more).ceil() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_that_an_error_takes_are_told_by_the_estimates() {
        assert_eq!(expected((8, 0.2), (0, f64::INFINITY), 0.1), Some(32), "twice as good: four times as many");
        assert_eq!(expected((16, 0.1), (8, 0.2), 0.05), Some(32), "they fall as 1/N");
        assert_eq!(expected((16, 0.1), (8, 0.1), 0.2), Some(16), "it is there");
        assert_eq!(expected((8, f64::INFINITY), (0, f64::INFINITY), 0.1), None);
    }
}
