//! Photile.
pub mod cli;
pub mod error;
pub mod reference;
pub mod scene;
