//! How many objects of GL and OpenCL are alive, so that a test can see that none is leaked.

use std::sync::atomic::{AtomicI64, Ordering};

/// Kinds of objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Api {
    /// Programs, textures, targets and the like.
    OpenGl,
    /// Buffers and devices in use.
    OpenCl,
}

static ALIVE: [AtomicI64; 2] = [AtomicI64::new(0), AtomicI64::new(0)];

/// Goes with an object: counts it as long as it lives.
#[derive(Debug)]
pub struct Counted(Api);

impl Counted {
    /// Counts one more object of this kind.
    pub fn new(kind: Api) -> Counted {
        ALIVE[kind as usize].fetch_add(1, Ordering::Relaxed);
        Counted(kind)
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        ALIVE[self.0 as usize].fetch_sub(1, Ordering::Relaxed);
    }
}

/// Objects of a kind that are alive in this process.
pub fn alive(kind: Api) -> i64 {
    ALIVE[kind as usize].load(Ordering::Relaxed)
}
