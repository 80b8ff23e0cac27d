//! Rays on the host, shared by what is planned there and by the CPU twins: the same names and the same order of
//! operations as `glsl/shared/`, written a second time.

pub mod bsdf;
pub mod camera;
pub mod emission;
pub mod random;
pub mod scene;
pub mod shapes;
pub mod walk;
