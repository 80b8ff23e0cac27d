//! The stages' twins in Rust: the same names and the same order of operations as `glsl/shared/`, written a second time
//! so that each copy can catch the other's mistakes. One thread by default.

pub mod density;
pub mod direct;
pub mod edges;
pub mod final_gather;
pub mod gather;
pub mod grid;
pub mod photons;
pub mod scan;
pub mod texels;
pub mod tiles;
pub mod trace;
