//! Stability, determinism and faults, from the suites of `photile stress` to what a user may do to a running program.

mod determinism;
mod faults;
mod fuzz;
mod rooms;
mod sides;
mod suites;

use crate::common::one_at_a_time;
