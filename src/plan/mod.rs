//! What the host decides before a device runs: radius, cells, tiles, irradiance charts, the gather method, warnings.

pub mod cells;
pub mod charts;
pub mod choice;
pub mod photon_sample;
pub mod radius;
pub mod tiling;
pub mod warnings;
