//! Photile renders scenes with photon mapping.
//!
//! ```text
//! scene.toml ─parse→ Scene ─┬─ features: what this scene and these settings need; all else is neither compiled,
//!                           │            allocated, launched nor uploaded
//!                           ├─ records: RGB32F texels (the only place with an offset)
//!                           ▼
//!   photons (CL) ──► grid (CL) ──┐
//!               └──► tiles (CL) ─┴─► trace + gather (GL fragment shader | CL kernel | CPU) ─► film ─► PNG/EXR/window
//! ```
//!
//! Modules from the user's side down; each imports only what stands below it, or beside it on its own line
//! (`tests/house.rs` reads every `use` and holds it against this list).

#![warn(missing_docs)]

pub mod cli;

pub mod stress;
pub mod window;

pub mod bench;

pub mod pipeline;

pub mod techniques;

pub mod stage;

pub mod cpu;
pub mod reference;

pub mod plan;

pub mod rays;

pub mod device;

pub mod film;
pub mod program;

pub mod packing;

pub mod error;
pub mod scene;

pub mod lights;
pub mod materials;
pub mod shapes;

pub mod reading;

pub mod records;

pub mod settings;

pub mod kinds;
