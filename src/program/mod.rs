//! Programs: what a scene needs of them, and their assembled texts.

pub mod features;
pub mod gathering;
pub mod kinds;
pub mod parameters;
pub mod source;
