//! Pictures on one GL context: a pipeline, the mean of its passes, and the picture that is shown meanwhile.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Instant;

use super::driver_lock::{DriverLock, Taken};
use super::ladder::Cost;
use super::level::Level;
use super::request::Request;
use crate::device::gl::{Current, Mean, Picture};
use crate::error::Result;
use crate::film::Image;
use crate::pipeline::change::Stage;
use crate::pipeline::progressive::Progressive;
use crate::pipeline::{Devices, Film, Machine, Pipeline, Rendering, Times};
use crate::settings::{Backend, Method, Pass, Settings, Technique};
use crate::stage::map::MapCounts;

/// How a frame came about.
#[derive(Clone, Debug, Default)]
pub struct FrameReport {
    /// Stages of the pass.
    pub times: Times,
    /// Milliseconds of all of it: the pass, and adding it to the mean.
    pub frame_ms: f64,
    /// Stages that had nothing to do.
    pub skipped: Vec<Stage>,
    /// The photon map.
    pub photons: Option<MapCounts>,
    /// How they were gathered.
    pub method: Option<Method>,
    /// R, metres.
    pub radius: Option<f32>,
    /// Quality.
    pub level: Level,
    /// Share of the picture that was not there when its time was over: there it is coarser.
    pub missed: f64,
    /// Milliseconds that this took.
    pub patch_ms: f64,
    /// Passes in the mean; 0: a single picture of what moves.
    pub passes: u64,
    /// Of what its indirect light was made.
    pub technique: Technique,
    /// Relative error as passes tell it, mean over the picture; where there are enough of them.
    pub error: Option<f64>,
    /// Pixels.
    pub size: [u32; 2],
    /// Who made it.
    pub backend: Option<Backend>,
    /// By name.
    pub devices: Devices,
    /// Photons came from the CPU though another machine traced.
    pub host_photons: bool,
    /// Bytes on devices.
    pub bytes: usize,
}

impl FrameReport {
    /// For the ladder.
    pub fn cost(&self) -> Cost {
        let photons = self.times.emit + self.times.grid + self.times.tiles + self.times.upload;
        // Of a picture that was cut short, what all of it would have taken.
        let whole = self.times.trace / (1.0 - self.missed).max(0.1) - self.times.trace;
        Cost { photons, pixels: (self.frame_ms - self.patch_ms - photons - self.times.compile + whole).max(0.0) }
    }
}

/// How long a picture is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Until {
    /// To its end.
    Done,
    /// As long as it is wanted.
    Unwanted,
    /// No longer than this: then the rest of it is drawn coarsely.
    Late(Instant),
}

/// What a piece of a picture should take, ms: less than a frame that waits for it, or ends with it.
pub const PIECE: f64 = 12.0;
/// So much of a picture may be missing to be filled in by what is there, which takes no time; of more, the rest is drawn
/// coarsely, which takes nearly as long as drawing it: a software rasteriser shares out blocks of 64 × 64 pixels.
const BRIDGED: f64 = 0.5;
/// Pixels of what is drawn coarsely are so many times as wide and high: a ninth of the cost.
const PATCH: u32 = 3;

/// Draws requests.
pub struct Engine {
    // GL objects go before the context, which the owner of the engine holds.
    pipeline: Option<Pipeline>,
    mean: Mean,
    current: Current,
    machine: Machine,
    driver_lock: Arc<DriverLock>,
    /// The turn that a pass has; it goes and comes between the parts of a picture.
    held: Rc<RefCell<Option<Taken>>>,
    /// Whether the pass is still wanted.
    wanted: Rc<dyn Fn() -> bool>,
    notice: Box<dyn FnMut(&str)>,
}

impl Engine {
    /// On the context that is current on this thread.
    ///
    /// # Errors
    /// [`crate::error::Error::Build`] and [`crate::error::Error::Device`] from the driver.
    pub fn new(
        current: Current,
        machine: Machine,
        driver_lock: Arc<DriverLock>,
        wanted: Rc<dyn Fn() -> bool>,
        notice: Box<dyn FnMut(&str)>,
    ) -> Result<Engine> {
        let _first = driver_lock.take();
        let mean = Mean::new(&current.gl)?;
        Ok(Engine { pipeline: None, mean, current, machine, driver_lock, held: Rc::default(), wanted, notice })
    }

    /// Draws a single picture at a level. Tells nothing where it was not wanted any more before it was done; so does
    /// [`Engine::pass`].
    ///
    /// # Errors
    /// What the backend meets.
    pub fn draft(&mut self, request: &Request, level: Level, until: Until) -> Result<Option<FrameReport>> {
        self.in_turn(request.backend, |engine| {
            let start = Instant::now();
            let settings = request.draft(level);
            let pass = Pass::single(&settings);
            let Some(drawn) = engine.draw(request, &settings, &pass, until)? else { return Ok(None) };
            engine.mean.restart();
            let image = engine.show(&settings)?;
            let mut made = FrameReport { level, ..engine.made(start, request, drawn, &settings) };
            let missing = engine.pipeline.as_ref().map(|pipeline| pipeline.missing().to_vec()).unwrap_or_default();
            if !missing.is_empty() {
                let rows: u32 = missing.iter().map(|[from, to]| to - from).sum();
                made.missed = f64::from(rows) / f64::from(settings.height);
                match made.missed <= BRIDGED {
                    true => engine.bridge(image.is_some(), &missing)?,
                    false => engine.patch(request, &settings, &missing)?,
                }
                made.patch_ms = start.elapsed().as_secs_f64() * 1e3 - made.frame_ms;
                made.frame_ms += made.patch_ms;
            }
            Ok(Some(made))
        })
    }

    /// Fills in what a picture lacks when its time is over, by the rows around it: they are from all over the picture.
    fn bridge(&mut self, is_host: bool, missing: &[[u32; 2]]) -> Result<()> {
        let pass = match &mut self.pipeline {
            Some(pipeline) if !is_host => match pipeline.film()? {
                Film::Texture(texture) => Some(texture),
                Film::Host(_) => None,
            },
            _ => None, // it is where the mean took it from
        };
        self.mean.bridge(pass, missing)
    }

    /// Draws what a picture lacks when its time is over: coarsely.
    fn patch(&mut self, request: &Request, settings: &Settings, missing: &[[u32; 2]]) -> Result<()> {
        let [width, height] = [settings.width, settings.height].map(|side| side.div_ceil(PATCH));
        // A row more on either side, to interpolate from.
        let rows =
            missing.iter().map(|[from, to]| [(from / PATCH).saturating_sub(1), (to.div_ceil(PATCH) + 1).min(height)]);
        let rows: Vec<[u32; 2]> = rows.collect();
        let settings = Settings { width, height, ..settings.clone() };
        let set_rows = |engine: &mut Engine, rows: &[[u32; 2]]| {
            engine.pipeline.iter_mut().for_each(|pipeline| pipeline.set_rows(rows));
        };
        set_rows(self, &rows);
        let drawn = self.draw(request, &settings, &Pass::single(&settings), Until::Done);
        set_rows(self, &[]);
        drawn?;
        let Some(pipeline) = &mut self.pipeline else { return Ok(()) };
        match pipeline.film()? {
            Film::Texture(texture) => self.mean.patch(texture, missing),
            Film::Host(image) => self.mean.patch_image(&image, missing),
        }
    }

    /// Draws one more pass, for the picture that is shown and, as `render --passes` does it, for the one that is kept.
    ///
    /// # Errors
    /// What the backend meets.
    pub fn pass(
        &mut self,
        request: &Request,
        passes: &mut Progressive,
        stoppable: bool,
    ) -> Result<Option<FrameReport>> {
        self.in_turn(request.backend, |engine| {
            let start = Instant::now();
            let (settings, pass) = passes.next_pass()?;
            let until = if stoppable { Until::Unwanted } else { Until::Done };
            let Some(mut drawn) = engine.draw(request, &settings, &pass, until)? else { return Ok(None) };
            if passes.passes() == 0 {
                engine.mean.restart();
            }
            drawn.image = match (engine.show(&settings)?, &mut engine.pipeline) {
                (None, Some(pipeline)) => pipeline.read()?,
                (image, _) => image.unwrap_or(Image::new(0, 0)),
            };
            *engine.held.borrow_mut() = None; // what follows is the host's
            passes.add(&drawn);
            Ok(Some(FrameReport { passes: passes.passes(), ..engine.made(start, request, drawn, &settings) }))
        })
    }

    fn in_turn(
        &mut self,
        backend: Backend,
        draw: impl FnOnce(&mut Engine) -> Result<Option<FrameReport>>,
    ) -> Result<Option<FrameReport>> {
        // The twins use no driver.
        *self.held.borrow_mut() = (backend != Backend::Cpu).then(|| self.driver_lock.take());
        let made = draw(self);
        *self.held.borrow_mut() = None;
        made
    }

    /// Gives others their turn between two parts of a picture; whether the rest is wanted.
    fn pause(&self, until: Until) -> Rc<dyn Fn() -> bool> {
        let (driver_lock, held, wanted) =
            (Arc::clone(&self.driver_lock), Rc::clone(&self.held), Rc::clone(&self.wanted));
        Rc::new(move || {
            let had = held.borrow_mut().take();
            if had.is_some() {
                drop(had);
                *held.borrow_mut() = Some(driver_lock.take());
            }
            match until {
                Until::Done => true,
                Until::Unwanted => wanted(),
                Until::Late(end) => Instant::now() < end,
            }
        })
    }

    fn draw(&mut self, request: &Request, settings: &Settings, pass: &Pass, until: Until) -> Result<Option<Rendering>> {
        if self.pipeline.as_ref().is_none_or(|pipeline| pipeline.backend != request.backend) {
            self.pipeline = None; // its memory first
            self.pipeline =
                Some(Pipeline::open_within(request.backend, &self.machine, &self.current, &mut self.notice)?);
        }
        let pause = self.pause(until);
        let Some(pipeline) = &mut self.pipeline else { unreachable!("opened above") };
        pipeline.set_pause(Some(pause));
        let drawn = pipeline.draw(&request.scene, settings, pass)?;
        if until == Until::Unwanted && !pipeline.missing().is_empty() {
            return Ok(None);
        }
        // What follows is the context's, even after the twins.
        self.held.borrow_mut().get_or_insert_with(|| self.driver_lock.take());
        Ok(Some(drawn))
    }

    /// Takes the film into the mean; tells it where it lies in host memory.
    fn show(&mut self, settings: &Settings) -> Result<Option<Image>> {
        let Some(pipeline) = &mut self.pipeline else { return Ok(None) };
        match pipeline.film()? {
            Film::Texture(texture) => self.mean.add(texture, settings.width, settings.height).map(|()| None),
            Film::Host(image) => self.mean.add_image(&image).map(|()| Some(image)),
        }
    }

    fn made(&self, start: Instant, request: &Request, drawn: Rendering, settings: &Settings) -> FrameReport {
        let devices = self.pipeline.as_ref().map(|pipeline| pipeline.devices.clone()).unwrap_or_default();
        FrameReport {
            times: drawn.times,
            frame_ms: start.elapsed().as_secs_f64() * 1e3,
            skipped: drawn.skipped,
            photons: drawn.photons,
            method: drawn.method,
            radius: drawn.radius,
            level: Level::FULL,
            missed: 0.0,
            patch_ms: 0.0,
            passes: 0,
            technique: settings.technique,
            error: None,
            size: [settings.width, settings.height],
            backend: Some(request.backend),
            host_photons: request.backend == Backend::OpenGl && devices.opencl.is_none(),
            devices,
            bytes: self.pipeline.as_ref().map_or(0, Pipeline::bytes),
        }
    }

    /// Copies the mean to where the window finds it.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses.
    pub fn copy_to(&self, picture: &mut Picture) -> Result<()> {
        let _held = self.driver_lock.take();
        self.mean.copy_to(picture)
    }

    /// The mean on the host: linear radiance.
    ///
    /// # Errors
    /// [`crate::error::Error::Failed`] before the first pass.
    pub fn read(&self) -> Result<Image> {
        let _held = self.driver_lock.take();
        self.mean.read()
    }

    /// The pipeline that drew the last pass.
    pub fn pipeline(&self) -> Option<&Pipeline> {
        self.pipeline.as_ref()
    }

    /// Lets go of all that belongs to the context, at its turn.
    pub fn close(self) {
        let driver_lock = Arc::clone(&self.driver_lock);
        let _held = driver_lock.take();
        drop(self);
    }
}
