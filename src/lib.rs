//! Photile.
pub mod error;
pub mod film;
pub mod metrics;
pub mod scene;
