//! The order of the stages, on a backend: what changed is redone, what did not is kept.

pub mod change;
mod fingerprint;
mod open;
pub mod path_count;
pub mod progressive;
mod report;

use std::time::Instant;

use crate::device::gl::Headless;
use crate::error::Result;
use crate::film::Image;
use crate::packing::Packed;
use crate::packing::packed_scene::PackedScene;
use crate::pipeline::change::{Change, Stage, is_stale};
use crate::plan::choice::Class;
use crate::program::features::Features;
use crate::scene::Scene;
use crate::settings::{Backend, Pass, Settings};
use crate::stage::map::{MapCounts, MapView};
use crate::stage::times::Stopwatch;
use crate::stage::trace::{Pause, Permutation, Trace};
use crate::techniques::{self, Place, Row, Stages, Task};

pub use crate::stage::times::Times;
pub use open::{Machine, class_of, open_device};
pub use report::{Devices, Film, Rendering};

/// A backend with a scene on it.
pub struct Pipeline {
    // Declared before `context`, so that GL objects go before their context.
    tracer: Box<dyn Trace>,
    techniques: Vec<Technique>,
    place: Place,
    context: Option<Headless>,
    /// What was chosen.
    pub backend: Backend,
    /// By name.
    pub devices: Devices,
    class: Class,
    last: Option<Last>,
    /// Not all rows are wanted.
    partial: bool,
}

/// A technique, and what it holds here.
struct Technique {
    row: &'static Row,
    stages: Box<dyn Stages>,
}

/// The last picture: what the machine holds was made from it.
struct Last {
    scene: Scene,
    settings: Settings,
    pass: Pass,
    packed: PackedScene,
    features: Features,
    permutation: Permutation,
    photons: Option<MapCounts>,
    /// The film is unfinished: nobody wanted the rest.
    stopped: bool,
}

impl Pipeline {
    /// Renders a picture, redoing only what changed since the last one.
    ///
    /// # Errors
    /// [`crate::error::Error::Build`] and [`crate::error::Error::Device`] from the backend.
    pub fn render(&mut self, scene: &Scene, settings: &Settings) -> Result<Rendering> {
        self.render_pass(scene, settings, &Pass::single(settings))
    }

    /// The same for one of many passes.
    ///
    /// # Errors
    /// As [`Pipeline::render`].
    pub fn render_pass(&mut self, scene: &Scene, settings: &Settings, pass: &Pass) -> Result<Rendering> {
        let start = Instant::now();
        let mut rendering = self.draw(scene, settings, pass)?;
        let mut stopwatch = Stopwatch::start();
        rendering.image = self.tracer.read()?;
        rendering.times.readback = stopwatch.lap();
        rendering.times.total = start.elapsed().as_secs_f64() * 1e3;
        Ok(rendering)
    }

    /// Like [`Pipeline::render_pass`], but leaves the film where it was made: the image is empty, see
    /// [`Pipeline::film`].
    ///
    /// # Errors
    /// As [`Pipeline::render`].
    pub fn draw(&mut self, scene: &Scene, settings: &Settings, pass: &Pass) -> Result<Rendering> {
        let start = Instant::now();
        let row = techniques::of(scene, settings)?;
        self.make_current()?;
        let mut change = self.change(scene, settings, pass);
        // What fails on the way leaves nothing to build on.
        let last = self.last.take();
        let mut task = self.task(scene, settings, pass, last.as_ref().filter(|_| !is_stale(Stage::Upload, change)));
        let before = last.as_ref().map(|last| last.permutation);

        let place = self.place_of(row);
        let Pipeline { tracer, techniques, .. } = self;
        let (own, tracer) = (&mut techniques[place].stages, &mut **tracer);
        let mut done = Vec::new();
        for &stage in row.stages {
            if stage == Stage::Compile {
                change = change.and(Change::FEATURES.when(before != Some(own.permutation(&task))));
            }
            if is_stale(stage, change) && run(stage, &mut task, &mut **own, tracer)? {
                done.push(stage);
            }
        }

        let made = own.made();
        let permutation = own.permutation(&task);
        // Where nothing was repacked, a map stays good though this picture has no use for it.
        let kept = last.filter(|last| last.packed.generation() == task.packed.generation());
        let photons = made.photons.or(kept.as_ref().and_then(|last| last.photons));
        let Task { mut times, uploads, packed, features, .. } = task;
        times.total = start.elapsed().as_secs_f64() * 1e3;
        self.last = Some(Last {
            scene: kept.map_or_else(|| scene.clone(), |last| Scene { camera: scene.camera.clone(), ..last.scene }),
            settings: settings.clone(),
            pass: *pass,
            packed,
            features,
            permutation,
            photons,
            stopped: self.partial || !self.tracer.missing().is_empty(),
        });
        let skipped = Stage::ALL.into_iter().filter(|stage| !done.contains(stage)).collect();
        let image = Image { width: 0, height: 0, pixels: Vec::new() };
        Ok(Rendering::new(image, times, skipped, uploads, photons, &made))
    }

    /// A picture to make, of the last one's packed scene where it stands.
    fn task<'a>(&self, scene: &'a Scene, settings: &'a Settings, pass: &'a Pass, last: Option<&Last>) -> Task<'a> {
        let stopwatch = Stopwatch::start(); // packing counts as upload
        let packed = match last {
            // The origin stays where it was: a moving camera must not repack the scene.
            Some(last) => last.packed.clone(),
            // Another scene may lie far from the last one, so it gets an origin of its own.
            None => PackedScene::new(Packed::new(scene, scene.camera.position)),
        };
        Task { stopwatch, ..Task::new(scene, settings, pass, packed, self.class) }
    }

    fn place_of(&self, row: &Row) -> usize {
        let is_it = |technique: &Technique| std::ptr::eq(technique.row, row);
        self.techniques.iter().position(is_it).expect("every row was opened")
    }

    /// What changed since the last picture.
    fn change(&self, scene: &Scene, settings: &Settings, pass: &Pass) -> Change {
        let Some(last) = &self.last else { return Change::ALL };
        Change::between((&last.scene, &last.settings, &last.pass), (scene, settings, pass))
            .and(Change::CAMERA.when(last.stopped))
    }

    /// Traces the same picture again and tells the milliseconds it took: for timings, apart from all else.
    ///
    /// # Errors
    /// As [`Pipeline::render`].
    pub fn retrace(&mut self, scene: &Scene, settings: &Settings, pass: &Pass) -> Result<f64> {
        if self.change(scene, settings, pass) != Change::NONE {
            self.render_pass(scene, settings, pass)?;
        }
        self.make_current()?;
        let place = self.place_of(techniques::of(scene, settings)?);
        let task = self.task(scene, settings, pass, self.last.as_ref());
        let mut stopwatch = Stopwatch::start();
        self.techniques[place].stages.trace(&task, &mut *self.tracer)?;
        Ok(stopwatch.lap())
    }

    /// The film of the last picture: a texture of the current context where OpenGL drew it, else in host memory.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the device fails.
    pub fn film(&mut self) -> Result<Film> {
        match self.tracer.texture() {
            Some(texture) => Ok(Film::Texture(texture)),
            None => Ok(Film::Host(self.tracer.read()?)),
        }
    }

    /// The film of the last picture, read back.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the device fails.
    pub fn read(&mut self) -> Result<Image> {
        self.tracer.read()
    }

    /// Lets pictures be drawn in parts, between which `pause` is called; where it returns false, the rest of the
    /// picture is not wanted. OpenGL and OpenCL heed it.
    pub fn set_pause(&mut self, pause: Option<Pause>) {
        self.tracer.set_pause(pause);
    }

    /// Of the next picture only these rows are wanted, from and to; none: all of them. Others may be drawn or not.
    pub fn set_rows(&mut self, rows: &[[u32; 2]]) {
        self.tracer.set_rows(rows);
        self.partial = !rows.is_empty();
    }

    /// Rows of the last picture, from and to, that are not there because the rest was not wanted.
    pub fn missing(&self) -> &[[u32; 2]] {
        self.tracer.missing()
    }

    /// The last photon map, the scene that it belongs to, and what the last picture asks of that; for those who look at
    /// photons.
    pub fn map(&self) -> Option<(MapView<'_>, &Packed, &Features)> {
        let last = self.last.as_ref()?;
        last.photons?;
        let map = self.techniques.iter().find_map(|technique| technique.stages.map())?;
        Some((map, &last.packed, &last.features))
    }

    /// What gathering costs are known for on this backend.
    pub fn class(&self) -> Class {
        self.class
    }

    /// Whether a GPU makes the pictures.
    pub fn is_on_gpu(&self) -> bool {
        matches!(self.class(), Class::OpenClGpu | Class::OpenGlGpu)
    }

    /// Bytes held on the device.
    pub fn bytes(&self) -> usize {
        self.tracer.bytes() + self.techniques.iter().map(|technique| technique.stages.bytes()).sum::<usize>()
    }

    /// Most bytes that OpenCL's buffers ever held; none where there is no OpenCL.
    pub fn most_bytes(&self) -> Option<usize> {
        match &self.place {
            Place::Device(context) => Some(context.memory.most()),
            Place::Host(_) => None,
        }
    }

    /// Makes the GL context the thread's own again: another pipeline may have worked in between.
    fn make_current(&self) -> Result<()> {
        self.context.as_ref().map_or(Ok(()), Headless::make_current)
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // GL objects go next and belong to this context. An error means that it is gone already, and they with it.
        let _ = self.make_current();
    }
}

/// Does one stage: what all techniques share, or what is this one's own. Whether there was anything to do.
fn run(stage: Stage, task: &mut Task, own: &mut dyn Stages, tracer: &mut dyn Trace) -> Result<bool> {
    match stage {
        Stage::Upload => {
            tracer.upload(&task.packed)?;
            task.times.upload += task.stopwatch.lap();
        }
        Stage::Compile => {
            // What was built before is found again.
            tracer.compile(&own.permutation(task))?;
            task.times.compile += task.stopwatch.lap();
        }
        Stage::Trace => {
            own.trace(task, tracer)?;
            task.times.trace = task.stopwatch.lap();
        }
        Stage::Photons | Stage::Grid | Stage::Tiles | Stage::Textures => return own.run(stage, task, tracer),
    }
    Ok(true)
}
