//! What is rendered: camera, materials, lights, spheres and planes, in double precision as the file gave them.
//!
//! Right-handed, y up, metres. Colours are linear Rec. 709. Packing to float32 is `pack`'s task, not the scene's.

use glam::DVec3;

use crate::settings::{LightMode, Method};

mod check;
mod error;
mod parse;
mod sections;
mod table;

pub use error::{Position, SceneError};
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

/// A BSDF by its shares: `diffuse + specular + transmission ≤ 1`.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The table's name in the file.
    pub name: String,
    /// Albedo of the diffuse part, linear Rec. 709, each in [0, 1].
    pub color: DVec3,
    /// kd, share of the Lambertian lobe.
    pub diffuse: f64,
    /// ks, share of the GGX lobe (or of a perfect mirror where `roughness` is 0).
    pub specular: f64,
    /// GGX α, in [0, 1].
    pub roughness: f64,
    /// kt, share of the smooth dielectric.
    pub transmission: f64,
    /// Index of refraction of the dielectric, ≥ 1.
    pub ior: f64,
    /// `ambient · color` is added to the outgoing radiance.
    pub ambient: f64,
}

/// An isotropic point light.
#[derive(Clone, Debug, PartialEq)]
pub struct PointLight {
    /// World space, metres.
    pub position: DVec3,
    /// Radiant intensity, W/sr per channel; the flux is 4π times this.
    pub intensity: DVec3,
}

/// A sphere; two-sided unless it transmits.
#[derive(Clone, Debug, PartialEq)]
pub struct Sphere {
    /// World space, metres.
    pub center: DVec3,
    /// From the centre to the surface: metres, more than 0.
    pub radius: f64,
    /// Index into [`Scene::materials`].
    pub material: usize,
}

/// An infinite plane: `dot(normal, p) = offset`; two-sided.
///
/// The file's normal may have any length: offset is divided by it together with the normal, so that the equation
/// holds as it was written. `normal = [0, 2, 0]`, `offset = 6` is the plane y = 3.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// Unit length (normalised when read).
    pub normal: DVec3,
    /// Metres from the world's origin along `normal`.
    pub offset: f64,
    /// Index into [`Scene::materials`].
    pub material: usize,
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
    /// In the file's order; may be empty.
    pub lights: Vec<PointLight>,
    /// In the file's order; may be empty.
    pub spheres: Vec<Sphere>,
    /// In the file's order; may be empty.
    pub planes: Vec<Plane>,
    /// The file's `[render]` table.
    pub render: RenderDefaults,
}
