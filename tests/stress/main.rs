//! Stability, determinism and faults, from the suites of `photile stress` to what a user may do to a running program.

#[path = "../common/mod.rs"]
mod common;

mod determinism;
mod faults;
mod fuzz;
mod rooms;
mod sides;
mod suites;

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Drivers that run on the CPU crash when several threads of a process use them at once.
fn one_at_a_time() -> MutexGuard<'static, ()> {
    static DEVICES: Mutex<()> = Mutex::new(());
    DEVICES.lock().unwrap_or_else(PoisonError::into_inner)
}
