//! Stages on their devices: arguments, sizes, launches. Each has a twin of the same name in `cpu`.

mod counter;
pub mod grid;
pub mod irradiance;
pub mod longest_cell;
pub mod map;
pub mod paths;
pub mod photon_map;
pub mod photon_textures;
pub mod photons;
mod recorder;
pub mod scan;
pub mod scene_buffers;
pub mod sort;
pub mod table_textures;
pub mod tiles;
pub mod times;
pub mod trace;
mod walks;

/// A step on the way to a picture, which can be stale.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// Building programs for the permutation.
    Compile,
    /// Scene records to the device.
    Upload,
    /// Emission of photons.
    Photons,
    /// Photons into cells.
    Grid,
    /// Photons into screen-space tiles.
    Tiles,
    /// Photon map to where it is gathered.
    Textures,
    /// Primary rays, shading.
    Trace,
}

impl Stage {
    /// As reports list them.
    pub const ALL: [Stage; 7] =
        [Stage::Compile, Stage::Upload, Stage::Photons, Stage::Grid, Stage::Tiles, Stage::Textures, Stage::Trace];
}
