//! Techniques: how a pass's light becomes radiance. Each has a file of its own, which says its stages in their order, the
//! tables it needs, which code (and so which `#define`s), what its passes take by default, what the next of them takes,
//! and how its error is estimated; and a row in [`TABLE`]. Nobody else branches on them.

pub mod density;
pub mod direct;
pub mod final_gather;
mod wish;

use std::rc::Rc;

use glam::DVec3;

use crate::cpu::photons::fruitless;
use crate::device::cl;
use crate::error::Result;
use crate::film::Image;
use crate::packing::packed_scene::PackedScene;
use crate::plan::choice::Class;
use crate::program::features::{Features, is_divided};
use crate::records::Frame;
use crate::records::table_sets::TableSet;
use crate::scene::Scene;
use crate::settings::{Amount, GridForm, LightMode, Method, Pass, Settings, Technique};
use crate::stage::Stage;
use crate::stage::map::{MapCounts, MapView};
use crate::stage::times::{Stopwatch, Times};
use crate::stage::trace::{Permutation, Trace};

pub use final_gather::Usual;
pub use wish::{Wish, default_technique};

/// What a technique says of itself.
pub struct Row {
    /// As users write it and reports name it.
    pub name: &'static str,
    /// In the order in which they run.
    pub stages: &'static [Stage],
    /// What it reads beside the scene's own tables.
    pub tables: &'static [&'static TableSet],
    /// Settles what the user left open about its passes.
    pub settle: fn(&Wish, &Scene, &mut Settings) -> Result<()>,
    /// What pass `index` takes otherwise than all of them; the sums are those of its [`Bias`].
    pub of_pass: fn(&mut Settings, index: u64, sums: &[f64]),
    /// How wrong the mean of its passes is beyond their noise, which their spread tells; none: not at all.
    pub bias: Option<Bias>,
    /// What it holds on a machine.
    pub open: fn(&Place) -> Result<Box<dyn Stages>>,
}

/// Every technique there is.
pub static TABLE: [&Row; 3] = [&direct::ROW, &density::ROW, &final_gather::ROW];

/// The technique that the settings ask for.
pub fn asked(settings: &Settings) -> &'static Row {
    match settings.technique {
        Technique::Map => &density::ROW,
        Technique::FinalGather(_) => &final_gather::ROW,
    }
}

/// The technique that makes a picture: without photons there is direct light only.
///
/// # Errors
/// [`crate::error::Error::Usage`] where a number of stored photons is asked for and nothing can store any.
pub fn of(scene: &Scene, settings: &Settings) -> Result<&'static Row> {
    match settings.photons.amount {
        _ if wants_photons(scene, settings) => Ok(asked(settings)),
        Amount::Stored(wanted) if settings.light != LightMode::Direct => Err(fruitless(wanted, 0, 0)),
        _ => Ok(&direct::ROW),
    }
}

/// Whether a picture has photons at all.
pub fn wants_photons(scene: &Scene, settings: &Settings) -> bool {
    settings.light != LightMode::Direct && !scene.lights.is_empty() && !scene.shapes.is_empty()
}

/// How the bias of a mean of passes is estimated, from sums that are kept beside the passes' own.
pub struct Bias {
    /// How many sums a picture of so many pixels takes.
    pub sums: fn(pixels: usize) -> usize,
    /// Adds pass `index`, made with this gather radius.
    pub add: fn(&mut [f64], index: u64, radius: f32, image: &Image),
    /// Of each pixel of a mean; empty where it cannot be told.
    pub estimate: fn(&[f64], &Mean) -> Vec<DVec3>,
}

/// A mean of passes.
pub struct Mean<'a> {
    /// Radiance, rows from the top.
    pub pixels: &'a [DVec3],
    /// How many there are in it.
    pub passes: u64,
    /// Pixels: width, height.
    pub size: (u32, u32),
}

/// A machine for stages that run in OpenCL or by the twins.
pub enum Place {
    /// An OpenCL device.
    Device(Rc<cl::Context>),
    /// Threads of the CPU.
    Host(Rc<rayon::ThreadPool>),
}

/// A picture in the making: what it is of, and what it took so far.
pub struct Task<'a> {
    /// What is seen.
    pub scene: &'a Scene,
    /// As the user asked for it.
    pub settings: &'a Settings,
    /// Which of many it is.
    pub pass: &'a Pass,
    /// What scene and settings ask of the code.
    pub features: Features,
    /// Some plane keeps camera and lights apart.
    pub is_divided: bool,
    /// The scene as the machine has it.
    pub packed: PackedScene,
    /// The picture's own numbers.
    pub frame: Frame,
    /// What gathering costs here.
    pub class: Class,
    /// What stages took.
    pub times: Times,
    /// Since the last of them.
    pub stopwatch: Stopwatch,
    /// Tables that were moved for this picture.
    pub uploads: u64,
}

impl<'a> Task<'a> {
    /// A picture of a scene that is packed already.
    pub fn new(scene: &'a Scene, settings: &'a Settings, pass: &'a Pass, packed: PackedScene, class: Class) -> Self {
        Task {
            scene,
            settings,
            pass,
            features: Features::of(scene, settings).of_pass(pass),
            is_divided: is_divided(scene),
            frame: packed.frame(&scene.camera, settings, pass),
            packed,
            class,
            times: Times::default(),
            stopwatch: Stopwatch::start(),
            uploads: 0,
        }
    }
}

/// What a technique holds on a machine, and what its stages do there.
pub trait Stages {
    /// Does what is this technique's own of a stage: all but packing the scene, building programs and tracing. Whether
    /// there was anything to do.
    ///
    /// # Errors
    /// [`crate::error::Error::Build`] and [`crate::error::Error::Device`] from the device.
    fn run(&mut self, stage: Stage, task: &mut Task, tracer: &mut dyn Trace) -> Result<bool>;

    /// Which code traces the picture. Known once the stages before [`Stage::Compile`] are done.
    fn permutation(&self, task: &Task) -> Permutation;

    /// Traces the picture with what the stages made.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] from the device.
    fn trace(&self, task: &Task, tracer: &mut dyn Trace) -> Result<()>;

    /// What the stages made, in numbers.
    fn made(&self) -> Made {
        Made::default()
    }

    /// The photon map, where there is one.
    fn map(&self) -> Option<MapView<'_>> {
        None
    }

    /// Bytes held, the tracer's apart.
    fn bytes(&self) -> usize {
        0
    }
}

/// What the stages of a picture made, in numbers; none: there is no such thing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Made {
    /// Photons, emitted and stored.
    pub photons: Option<MapCounts>,
    /// How they were gathered.
    pub method: Option<Method>,
    /// Size of the tiles, pixels.
    pub tile: Option<[u32; 2]>,
    /// Gather radius, metres.
    pub radius: Option<f32>,
    /// The grid's form.
    pub form: Option<GridForm>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_names_of_their_own_and_all_that_a_picture_takes() {
        for (number, row) in TABLE.iter().enumerate() {
            assert!(TABLE[..number].iter().all(|other| other.name != row.name), "{} is there twice", row.name);
            let place = |stage| row.stages.iter().position(|one| *one == stage);
            for stage in [Stage::Upload, Stage::Compile, Stage::Trace] {
                assert!(place(stage).is_some(), "{}: no {stage:?}", row.name);
            }
            // The scene comes first, and the form of the grid decides which code is needed.
            assert_eq!(place(Stage::Upload), Some(0), "{}", row.name);
            assert!(place(Stage::Grid) <= place(Stage::Compile), "{}", row.name);
            assert_eq!(row.stages.last(), Some(&Stage::Trace), "{}", row.name);
            // Who emits photons reads them from tables, and nobody else does.
            assert_eq!(place(Stage::Photons).is_some(), !row.tables.is_empty(), "{}", row.name);
        }
    }

    #[test]
    fn a_picture_without_photons_is_direct_light_whatever_is_asked_for() {
        let scene = crate::scene::load(std::path::Path::new("scenes/gi_ref.toml")).unwrap();
        let name = |scene: &Scene, settings: &Settings| of(scene, settings).map(|row| row.name);
        let mut settings = Settings::default();
        assert_eq!(name(&scene, &settings).unwrap(), "map");
        settings.technique = Technique::FinalGather(Default::default());
        assert_eq!(name(&scene, &settings).unwrap(), "final-gather");
        let mut dark = scene.clone();
        dark.lights.points.clear();
        assert_eq!(name(&dark, &settings).unwrap(), "direct");
        // A number of stored photons is then not to be had, unless none are wanted.
        settings.photons.amount = Amount::Stored(10);
        assert!(name(&dark, &settings).is_err());
        settings.light = LightMode::Direct;
        assert_eq!(name(&scene, &settings).unwrap(), "direct");
    }
}
