//! Whose turn it is on software drivers.
//!
//! PoCL and llvmpipe share one LLVM and crash when both compile at once, and either may compile at any launch or draw.
//! There, one thread at a time works with a driver. GPUs need no turns.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Shared by all threads that use drivers.
pub struct DriverLock {
    needed: bool,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    taken: bool,
    /// The window wants to paint: workers wait until it has.
    window_waits: bool,
}

/// A turn; given back when dropped.
pub struct Taken(Option<Arc<DriverLock>>);

impl DriverLock {
    /// Turns that are taken in earnest only where `needed`.
    pub fn new(needed: bool) -> DriverLock {
        DriverLock { needed, state: Mutex::default(), changed: Condvar::new() }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a turn.
    pub fn take(self: &Arc<DriverLock>) -> Taken {
        if !self.needed {
            return Taken(None);
        }
        let mut state = self.state();
        while state.taken || state.window_waits {
            // A window that is hidden may never paint: its claim lapses.
            let (next, wait) =
                self.changed.wait_timeout(state, Duration::from_millis(50)).unwrap_or_else(PoisonError::into_inner);
            state = next;
            if wait.timed_out() {
                state.window_waits = false;
            }
        }
        state.taken = true;
        Taken(Some(Arc::clone(self)))
    }

    /// For the window, which must not wait: a turn if there is one; else the next one is the window's.
    pub fn try_take(self: &Arc<DriverLock>) -> Option<Taken> {
        if !self.needed {
            return Some(Taken(None));
        }
        let mut state = self.state();
        state.window_waits = state.taken;
        if state.taken {
            return None;
        }
        state.taken = true;
        Some(Taken(Some(Arc::clone(self))))
    }
}

impl Drop for Taken {
    fn drop(&mut self) {
        if let Some(driver_lock) = &self.0 {
            driver_lock.state().taken = false;
            driver_lock.changed.notify_all();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_never_waits_and_comes_next() {
        let driver_lock = Arc::new(DriverLock::new(true));
        let taken = driver_lock.take();
        assert!(driver_lock.try_take().is_none());
        drop(taken);
        std::thread::scope(|scope| {
            let worker = scope.spawn(|| drop(driver_lock.take()));
            let window = driver_lock.try_take();
            assert!(window.is_some());
            drop(window);
            worker.join().unwrap();
        });
    }

    #[test]
    fn where_none_are_needed_all_have_one() {
        let driver_lock = Arc::new(DriverLock::new(false));
        let (_a, _b) = (driver_lock.take(), driver_lock.try_take().unwrap());
    }
}
