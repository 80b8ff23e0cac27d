//! The stages' twins in Rust: the same names and the same order of operations as `glsl/shared/`, written a second time
//! so that each copy can catch the other's mistakes. One thread by default.

pub mod bsdf;
pub mod camera;
pub mod density;
pub mod edges;
pub mod final_gather;
pub mod gather;
pub mod grid;
pub mod intersect;
pub mod photons;
pub mod random;
pub mod scan;
pub mod scene;
pub mod texels;
pub mod tiles;
pub mod trace;
pub mod walk;
