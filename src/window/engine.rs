//! Pictures on one GL context: a pipeline, the mean of its passes, and the picture that is shown meanwhile.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Instant;

use super::ladder::{Cost, Level};
use super::request::Request;
use super::turn::{Taken, Turn};
use crate::change::Stage;
use crate::error::Result;
use crate::film::Image;
use crate::gl::{Current, Mean, Picture};
use crate::pipeline::{Devices, Film, Machine, Pipeline, Times};
use crate::settings::{Backend, Method};
use crate::stage::map::MapCounts;

/// How a frame came about.
#[derive(Clone, Debug, Default)]
pub struct Made {
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
    /// Passes in the mean.
    pub passes: u32,
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

impl Made {
    /// For the ladder.
    pub fn cost(&self) -> Cost {
        let photons = self.times.emit + self.times.grid + self.times.tiles + self.times.upload;
        Cost { photons, pixels: (self.frame_ms - photons - self.times.compile).max(0.0) }
    }
}

/// Draws requests.
pub struct Engine {
    // GL objects go before the context, which the owner of the engine holds.
    pipeline: Option<Pipeline>,
    mean: Mean,
    current: Current,
    machine: Machine,
    turn: Arc<Turn>,
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
        turn: Arc<Turn>,
        wanted: Rc<dyn Fn() -> bool>,
        notice: Box<dyn FnMut(&str)>,
    ) -> Result<Engine> {
        let _first = turn.take();
        let mean = Mean::new(&current.gl)?;
        Ok(Engine { pipeline: None, mean, current, machine, turn, held: Rc::default(), wanted, notice })
    }

    /// Draws a pass and adds it to the mean; pass 0 begins a new one. Tells nothing where `stoppable` and the pass was
    /// not wanted any more before it was done.
    ///
    /// # Errors
    /// What the backend meets.
    pub fn pass(&mut self, request: &Request, level: Level, pass: u32, stoppable: bool) -> Result<Option<Made>> {
        // The twins use no driver.
        *self.held.borrow_mut() = (request.backend != Backend::Cpu).then(|| self.turn.take());
        let made = self.pass_in_turn(request, level, pass, stoppable);
        *self.held.borrow_mut() = None;
        made
    }

    /// Gives others their turn between two parts of a picture; whether the rest is wanted.
    fn pause(&self, stoppable: bool) -> Rc<dyn Fn() -> bool> {
        let (turn, held, wanted) = (Arc::clone(&self.turn), Rc::clone(&self.held), Rc::clone(&self.wanted));
        Rc::new(move || {
            let had = held.borrow_mut().take();
            if had.is_some() {
                drop(had);
                *held.borrow_mut() = Some(turn.take());
            }
            !stoppable || wanted()
        })
    }

    fn pass_in_turn(&mut self, request: &Request, level: Level, pass: u32, stoppable: bool) -> Result<Option<Made>> {
        let start = Instant::now();
        if self.pipeline.as_ref().is_none_or(|pipeline| pipeline.backend != request.backend) {
            self.pipeline = None; // its memory first
            self.pipeline =
                Some(Pipeline::open_within(request.backend, &self.machine, &self.current, &mut self.notice)?);
        }
        let pause = self.pause(stoppable);
        let Some(pipeline) = &mut self.pipeline else { unreachable!("opened above") };
        let settings = request.pass(level, pass);
        pipeline.set_pause(Some(pause));
        let drawn = pipeline.draw(&request.scene, &settings)?;
        if pipeline.was_stopped() {
            return Ok(None);
        }
        let film = pipeline.film()?;
        self.held.borrow_mut().get_or_insert_with(|| self.turn.take());
        if pass == 0 {
            self.mean.restart();
        }
        match film {
            Film::Texture(texture) => self.mean.add(texture, settings.width, settings.height)?,
            Film::Host(image) => self.mean.add_image(&image)?,
        }
        Ok(Some(Made {
            times: drawn.times,
            frame_ms: start.elapsed().as_secs_f64() * 1e3,
            skipped: drawn.skipped,
            photons: drawn.photons,
            method: drawn.method,
            radius: drawn.radius,
            level,
            passes: self.mean.passes(),
            size: [settings.width, settings.height],
            backend: Some(request.backend),
            host_photons: request.backend == Backend::OpenGl && pipeline.devices.opencl.is_none(),
            devices: pipeline.devices.clone(),
            bytes: pipeline.bytes(),
        }))
    }

    /// Copies the mean to where the window finds it.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses.
    pub fn copy_to(&self, picture: &mut Picture) -> Result<()> {
        let _held = self.turn.take();
        self.mean.copy_to(picture)
    }

    /// The mean on the host: linear radiance.
    ///
    /// # Errors
    /// [`crate::error::Error::Failed`] before the first pass.
    pub fn read(&self) -> Result<Image> {
        let _held = self.turn.take();
        self.mean.read()
    }

    /// The pipeline that drew the last pass.
    pub fn pipeline(&self) -> Option<&Pipeline> {
        self.pipeline.as_ref()
    }

    /// Lets go of all that belongs to the context, at its turn.
    pub fn close(self) {
        let turn = Arc::clone(&self.turn);
        let _held = turn.take();
        drop(self);
    }
}
