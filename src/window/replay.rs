//! A script without a window: the same pictures by the same engine and the same ladder, in a context without a display.

use std::fmt::Write as _;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Instant;

use super::driver_lock::DriverLock;
use super::engine::{Engine, FrameReport, PIECE, Until};
use super::ladder::{Budget, Ladder};
use super::level::{COARSE, FEWER, Level};
use super::percentiles::{Percentiles, resident_bytes};
use super::request::Request;
use super::script::Script;
use crate::device::gl::{Headless, Picture};
use crate::device::live_objects::{Api, alive};
use crate::device::submissions;
use crate::error::Result;
use crate::pipeline::{Machine, Times};
use crate::scene::Scene;
use crate::settings::{Backend, Method, Settings};
use crate::techniques::Wish;

/// What a replay took.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Replayed {
    /// From the request for a picture to the picture, ms.
    pub frame_ms: Percentiles,
    /// Milliseconds a frame may take; none: full quality, however long it takes.
    pub budget_ms: Option<f64>,
    /// The slowest pictures, the slowest first.
    pub slowest: Vec<Slow>,
    /// How many pictures were made at which quality, the most frequent first.
    pub levels: Vec<(String, usize)>,
    /// Photons of the last picture.
    pub photons_stored: u64,
    /// Memory of the process after a quarter of the pictures, and after the last; bytes.
    pub memory_bytes: [u64; 2],
    /// The same after every eighth of the pictures.
    pub memory_curve_bytes: Vec<u64>,
    /// GL objects alive after a quarter of the pictures, and after the last.
    pub gl_objects: [i64; 2],
    /// OpenCL objects alive at the same moments.
    pub cl_objects: [i64; 2],
    /// A line of CSV a picture, where that was wanted.
    #[serde(skip)]
    pub table: Option<String>,
}

/// A picture that took long, and why.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Slow {
    /// Its number in the script.
    pub frame: usize,
    /// From the request to the picture, ms.
    pub ms: f64,
    /// The rung of the ladder of quality that it was made at.
    pub level: String,
    /// Stages of the picture.
    pub times: Times,
}

/// The slowest pictures that are told of: one in a hundred of a script of 300 and some more.
const SLOWEST: usize = 8;

/// Points of the memory's curve.
const EIGHTHS: usize = 8;

/// Counts along a replay.
#[derive(Clone, Debug, Default)]
pub struct Counting {
    times: Vec<f64>,
    slowest: Vec<Slow>,
    levels: Vec<(String, usize)>,
    photons: u64,
    quarter: Option<(u64, [i64; 2])>,
    memory: Vec<u64>,
    /// A line a picture, where that is wanted.
    table: Option<String>,
}

impl Counting {
    /// From the beginning; with a `table` of all pictures or without.
    pub fn new(table: bool) -> Counting {
        let head = "frame,ms,coarse,fewer,direct_only,width,height,compile,emit,grid,tiles,upload,trace,missed,patch\n";
        Counting { table: table.then(|| head.into()), ..Counting::default() }
    }

    /// A picture that took so long, of `frames` in all.
    pub fn add(&mut self, ms: f64, made: &FrameReport, frames: usize) {
        self.photons = made.photons.map_or(0, |photons| photons.stored);
        let name = made.level.describe();
        let rank = self.slowest.partition_point(|slow| slow.ms >= ms);
        if rank < SLOWEST {
            let slow = Slow { frame: self.times.len(), ms, level: name.clone(), times: made.times };
            self.slowest.insert(rank, slow);
            self.slowest.truncate(SLOWEST);
        }
        if let Some(table) = &mut self.table {
            let (level, t, [width, height]) = (made.level, &made.times, made.size);
            let _ = writeln!(
                table, // a string takes all
                "{},{ms:.3},{},{},{},{width},{height},{:.3},{:.3},{:.3},{:.3},{:.3},{:.3},{:.3},{:.3}",
                self.times.len(),
                COARSE[level.coarse],
                FEWER[level.fewer],
                level.no_gathering,
                t.compile,
                t.emit,
                t.grid,
                t.tiles,
                t.upload,
                t.trace,
                made.missed,
                made.patch_ms
            );
        }
        self.times.push(ms);
        match self.levels.iter_mut().find(|(known, _)| *known == name) {
            Some((_, count)) => *count += 1,
            None => self.levels.push((name, 1)),
        }
        if self.times.len() * EIGHTHS >= frames * (self.memory.len() + 1) {
            self.memory.push(resident_bytes());
        }
        if self.times.len() * 4 >= frames && self.quarter.is_none() {
            self.quarter = Some((resident_bytes(), [alive(Api::OpenGl), alive(Api::OpenCl)]));
        }
    }

    /// Pictures so far.
    pub fn frames(&self) -> usize {
        self.times.len()
    }

    /// What the replay amounts to, against a budget in ms.
    pub fn finish(mut self, budget_ms: Option<f64>) -> Replayed {
        let now = (resident_bytes(), [alive(Api::OpenGl), alive(Api::OpenCl)]);
        let then = self.quarter.unwrap_or(now);
        self.levels.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        Replayed {
            frame_ms: Percentiles::of(&self.times),
            budget_ms,
            slowest: self.slowest,
            levels: self.levels,
            photons_stored: self.photons,
            memory_bytes: [then.0, now.0],
            memory_curve_bytes: self.memory,
            table: self.table,
            gl_objects: [then.1[0], now.1[0]],
            cl_objects: [then.1[1], now.1[1]],
        }
    }
}

/// Replays a script. The first picture, which builds programs, is made before the clock runs.
///
/// # Errors
/// [`crate::error::Error::Driver`] without OpenGL; what the backend meets.
pub fn replay(
    scene: &Scene,
    settings: &Settings,
    machine: &Machine,
    budget: Budget,
    script: &Script,
    table: bool,
    notice: impl FnMut(&str) + 'static,
) -> Result<Replayed> {
    let headless = Headless::new()?;
    submissions::set_aim(PIECE); // as in the window
    let driver_lock = Arc::new(DriverLock::new(false)); // there is one thread
    let wanted = Rc::new(|| true);
    let mut engine = Engine::new(headless.current(), machine.clone(), driver_lock, wanted, Box::new(notice))?;
    let mut settings = settings.clone();
    if settings.gather.method == Method::Auto {
        settings.gather.method = Method::Grid; // as in the window
    }
    let backend = machine.backend.unwrap_or(Backend::OpenGl);
    let budget = budget.ms(headless.is_software);
    let mut ladder = budget.map(Ladder::new);
    let mut picture = Picture::empty();
    let mut counting = Counting::new(table);
    let frames = script.frames();
    let mut warm = false;
    while counting.frames() < frames {
        let mut seen = scene.clone();
        script.apply(counting.frames(), &mut seen);
        let request = Request::new(Arc::new(seen), settings.clone(), backend, &Wish::default());
        let level = ladder.as_ref().map_or(Level::FULL, Ladder::level);
        let start = Instant::now();
        // The first one builds programs, however long that takes.
        let until = match &ladder {
            Some(ladder) if warm => Until::Late(start + ladder.time()),
            _ => Until::Done,
        };
        let Some(made) = engine.draft(&request, level, until)? else { continue };
        engine.copy_to(&mut picture)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        if !warm {
            warm = true;
            continue;
        }
        if let Some(ladder) = &mut ladder {
            ladder.measured(made.cost());
        }
        counting.add(ms, &made, frames);
    }
    let replayed = counting.finish(budget);
    drop(picture);
    engine.close();
    headless.make_current()?;
    Ok(replayed)
}
