//! Stages on their devices: arguments, sizes, launches. Each has a twin of the same name in `cpu`.

pub mod trace;
