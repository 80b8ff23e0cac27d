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
pub mod trace;
mod walks;
