//! What a picture is, and what is told of how it came about.

use crate::device::{cl, gl};
use crate::film::Image;
use crate::pipeline::change::Stage;
use crate::settings::{GridForm, Method};
use crate::stage::map::MapCounts;
use crate::stage::times::Times;
use crate::techniques::Made;

/// The devices behind a picture, by name.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Devices {
    /// The OpenCL device.
    pub opencl: Option<String>,
    /// Lanes of a work-item there.
    pub lanes: Option<u32>,
    /// The GL renderer and the way to it.
    pub opengl: Option<String>,
}

impl Devices {
    /// Notes an OpenCL device.
    pub(super) fn name_opencl(&mut self, opened: &cl::Context) {
        self.opencl = Some(opened.device.name.clone());
        self.lanes = Some(opened.device.lanes);
    }
}

/// A picture and how it came about.
pub struct Rendering {
    /// Linear radiance.
    pub image: Image,
    /// By stage.
    pub times: Times,
    /// Stages that had nothing to do.
    pub skipped: Vec<Stage>,
    /// The photon map, where there is one.
    pub photons: Option<MapCounts>,
    /// How photons were gathered, where there are any.
    pub method: Option<Method>,
    /// Size of the tiles, pixels, where photons were gathered by tiles.
    pub tile: Option<[u32; 2]>,
    /// Gather radius, metres, where there are photons.
    pub radius: Option<f32>,
    /// The grid's form, where photons were gathered by a grid.
    pub form: Option<GridForm>,
    /// Tables of the photon map that were moved for this picture.
    pub uploads: u64,
}

impl Rendering {
    /// With what a technique made; `photons` are its own, or those of a map that is still there.
    pub(super) fn new(
        image: Image,
        times: Times,
        skipped: Vec<Stage>,
        uploads: u64,
        photons: Option<MapCounts>,
        made: &Made,
    ) -> Rendering {
        let Made { method, tile, radius, form, .. } = *made;
        Rendering { image, times, skipped, photons, method, tile, radius, form, uploads }
    }
}

/// Where a film lies.
pub enum Film {
    /// RGBA32F, row 0 is the picture's top; the tracer's own, overwritten by its next picture.
    Texture(gl::Texture),
    /// Read back.
    Host(Image),
}
