//! What is rendered: camera, materials, lights and shapes, in double precision as the file gave them.
//!
//! Right-handed, y up, metres. Colours are linear Rec. 709. Packing to float32 is `packing`'s task, not the scene's.

use glam::DVec3;

use crate::lights::Lights;
use crate::materials::Material;
use crate::settings::{LightMode, Method};
use crate::shapes::Shapes;

mod check;
mod parse;
mod sections;

pub use crate::reading::{Position, SceneError};
pub use parse::{MAX_FILE_BYTES, load, parse, parse_bytes};

/// The largest width or height of an image, pixels.
pub const MAX_IMAGE_SIDE: u32 = 65_536;

/// A pinhole camera; looks from `position` to `look_at`.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// World space, metres.
    pub position: DVec3,
    /// A point in the middle of the image, world space.
    pub look_at: DVec3,
    /// Any direction not parallel to the view; its projection points to the image's top.
    pub up: DVec3,
    /// Vertical field of view, degrees, in (0, 180).
    pub fov_y: f64,
}

/// Optional defaults for the command line, from the file's `[render]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderDefaults {
    /// Pixels: width, height.
    pub size: Option<(u32, u32)>,
    /// Paths emitted per pass.
    pub photons: Option<u64>,
    /// Gather radius, metres.
    pub radius: Option<f64>,
    /// How photons are found.
    pub gather: Option<Method>,
    /// Who carries direct light.
    pub light: Option<LightMode>,
    /// Number of passes.
    pub passes: Option<u32>,
    /// Exposure value: radiance is scaled by 2^EV before tone mapping.
    pub exposure: Option<f64>,
}

/// A whole scene as read from its file.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// File stem, for messages and output names.
    pub name: String,
    /// Where the picture is taken from.
    pub camera: Camera,
    /// In the file's order.
    pub materials: Vec<Material>,
    /// What light comes from, by kind.
    pub lights: Lights,
    /// What rays meet, by kind.
    pub shapes: Shapes,
    /// The file's `[render]` table.
    pub render: RenderDefaults,
}
