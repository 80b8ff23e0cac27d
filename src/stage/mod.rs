//! Stages on their devices: arguments, sizes, launches. Each has a twin of the same name in `cpu`.

pub mod photons;
pub mod scan;
pub mod trace;
