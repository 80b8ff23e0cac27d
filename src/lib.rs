//! Photile renders scenes with photon mapping.
//!
//! ```text
//! scene.toml ─parse→ Scene ─┬─ features: what this scene and these settings need; all else is neither compiled,
//!                           │            allocated, launched nor uploaded
//!                           ├─ pack: RGB32F texels (layout is the only place with an offset)
//!                           ▼
//!   photons (CL) ──► grid (CL) ──┐
//!               └──► tiles (CL) ─┴─► trace + gather (GL fragment shader | CL kernel | CPU) ─► film ─► PNG/EXR/window
//! ```
//!
//! Modules from the user's side down; each imports only what stands below it.

#![warn(missing_docs)]

pub mod cli;

pub mod bench;
pub mod stress;
pub mod window;

pub mod progressive;

pub mod pipeline;

pub mod choice;
pub mod lattice;
pub mod radius;
pub mod reference;
pub mod technique;
pub mod validate;
pub mod warnings;

pub mod stage;

pub mod cl;
pub mod cpu;
pub mod gl;

pub mod cells;
pub mod change;
pub mod charts;
pub mod emission;
pub mod features;
pub mod film;
pub mod gathering;
pub mod memory;
pub mod metrics;
pub mod pace;
pub mod pack;
pub mod source;
pub mod tiling;

pub mod scene;
pub mod settings;

pub mod census;
pub mod error;
pub mod layout;
