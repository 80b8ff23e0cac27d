//! Trace: packed scene, frame and photon map in, film out; on OpenGL, OpenCL or the CPU.

mod cl;
mod cpu;
pub mod draws;
mod gl;
mod gl_final;

pub use cl::ClTrace;
pub use cpu::CpuTrace;
pub use gl::GlTrace;
pub use gl_final::FinalTextures;

use super::irradiance::IrradianceView;
use super::map::MapView;
use crate::error::{Error, Result};
use crate::film::Image;
use crate::packing::Packed;
use crate::packing::packed_scene::PackedScene;
use crate::program::features::Features;
use crate::program::gathering::Gathering;
use crate::records::{Frame, LitPoint, MAX_EXACT_INDEX, SiteLattice};

/// What is compiled for a picture: the scene's features and, with photons, how they are gathered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Permutation {
    /// Of the scene and the settings.
    pub features: Features,
    /// `None`: no density estimates.
    pub gathering: Option<Gathering>,
    /// `None`: no final gathering; else whether pixels take irradiance from sites.
    pub final_gather: Option<bool>,
}

impl Permutation {
    /// Defines beyond the features' own.
    pub fn defines(&self) -> Vec<String> {
        let mut defines = self.gathering.map(|gathering| gathering.defines()).unwrap_or_default();
        if let Some(sites) = self.final_gather {
            defines.extend(["HAS_CHARTS".to_string(), "HAS_FINAL_GATHER".to_string()]);
            defines.extend(sites.then(|| "HAS_SITES".to_string()));
        }
        defines
    }

    /// Rounds of a loop over walls that a candidate of a query takes: none where walls are few enough to be unrolled.
    fn walls(&self, frame: &Frame, quads: usize) -> u64 {
        let loops = self.features.counts.is_none() && self.gathering.is_some_and(|gathering| gathering.both_sides);
        if loops { draws::Looped::of(frame, quads).walls } else { 0 }
    }
}

/// What final gathering takes along in one pass.
#[derive(Clone, Debug)]
pub struct FinalPass {
    /// Where its sites lie.
    pub lattice: SiteLattice,
    /// Points that the lights reach first, shared by all sites. At least one, since no table is empty: the lattice tells
    /// how many count.
    pub points: Vec<LitPoint>,
}

/// Where a picture's indirect light comes from.
#[derive(Clone, Copy)]
pub enum Indirect<'a> {
    /// No indirect light.
    None,
    /// Density estimates of the map uploaded last.
    Map(&'a MapView<'a>),
    /// Final gathering: the texels uploaded last, and what belongs to the pass.
    Final(&'a IrradianceView<'a>, &'a FinalPass),
}
/// Called between the parts of a picture; false: the rest is not wanted.
pub type Pause = std::rc::Rc<dyn Fn() -> bool>;

/// The trace stage on one machine.
pub trait Trace {
    /// Makes the film for pictures of a size, which may be beyond what the device can hold.
    ///
    /// # Errors
    /// [`Error::Device`] and [`Error::Memory`] with its limit.
    fn make_film(&mut self, _size: [u32; 2]) -> Result<()> {
        Ok(())
    }

    /// Builds what this permutation needs; nothing when it was built before.
    ///
    /// # Errors
    /// [`Error::Build`] with the driver's log.
    fn compile(&mut self, permutation: &Permutation) -> Result<()>;

    /// Takes over the scene's records.
    ///
    /// # Errors
    /// [`Error::Device`] when the device has no room.
    fn upload(&mut self, packed: &PackedScene) -> Result<()>;

    /// Takes over a photon map, where it has to be moved. How many tables were moved.
    ///
    /// # Errors
    /// [`Error::Device`] when the device has no room.
    fn upload_map(&mut self, map: &MapView, gathering: &Gathering) -> Result<u64>;

    /// Takes over the tiles of a map that was taken over before, where they have to be moved.
    ///
    /// # Errors
    /// [`Error::Device`] when the device has no room.
    fn upload_tiles(&mut self, _map: &MapView) -> Result<u64> {
        Ok(0)
    }

    /// Takes over irradiance texels, where they have to be moved. How many tables were moved.
    ///
    /// # Errors
    /// [`Error::Device`] when the device has no room.
    fn upload_irradiance(&mut self, _irradiance: &IrradianceView) -> Result<u64> {
        Ok(0)
    }

    /// Traces a picture with the permutation compiled last, and waits for it.
    ///
    /// # Errors
    /// [`Error::Device`] when the device fails.
    fn trace(&mut self, frame: &Frame, indirect: Indirect) -> Result<()>;

    /// The film of the last [`Trace::trace`].
    ///
    /// # Errors
    /// [`Error::Device`] when the device fails.
    fn read(&mut self) -> Result<Image>;

    /// Lets pictures be drawn in parts, between which this is called.
    fn set_pause(&mut self, _pause: Option<Pause>) {}

    /// Of the next pictures only these rows are wanted, from and to; none: all of them. Who cannot leave the others out
    /// draws them, too.
    fn set_rows(&mut self, _rows: &[[u32; 2]]) {}

    /// Rows of the film, from and to, that the last [`Trace::trace`] left out, because its pause did not want the rest.
    fn missing(&self) -> &[[u32; 2]] {
        &[]
    }

    /// The film as a texture of the current context, where it is one.
    fn texture(&self) -> Option<crate::device::gl::Texture> {
        None
    }

    /// Bytes held on the device, apart from OpenCL's buffers, which their context counts.
    fn bytes(&self) -> usize;
}

fn check_count(packed: &Packed) -> Result<()> {
    match packed.shapes.len().max(packed.lights.len()) as u64 {
        count if count >= MAX_EXACT_INDEX => Err(Error::Usage(format!(
            "{count} objects: indices travel as float values, which are exact below {MAX_EXACT_INDEX} only"
        ))),
        _ => Ok(()),
    }
}

/// A stage was asked for out of order: the pipeline's fault, said rather than drawn wrong.
fn out_of_order(backend: &str) -> Error {
    Error::Device(format!("{backend}: traced before everything was compiled and uploaded"))
}
