//! Faults of devices on purpose, for tests: `PHOTILE_FAULT` names one, and the borders to OpenCL and OpenGL ask here.
//!
//! | value | what happens |
//! |---|---|
//! | `opencl-lost=N` | the N-th launch answers CL_INVALID_COMMAND_QUEUE, as after a reset of the GPU |
//! | `opencl-resources=N` | the N-th launch answers CL_OUT_OF_RESOURCES, as after an illegal access |
//! | `opencl-memory=BYTES` | buffers hold so many bytes in all |
//! | `opengl-lost=N` | the N-th draw answers GL_CONTEXT_LOST |

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// CL_OUT_OF_RESOURCES.
const OUT_OF_RESOURCES: i32 = -5;
/// CL_INVALID_COMMAND_QUEUE.
const INVALID_COMMAND_QUEUE: i32 = -36;

/// What the environment asks for: name and number.
fn wanted() -> Option<(&'static str, u64)> {
    static WANTED: OnceLock<Option<(String, u64)>> = OnceLock::new();
    let wanted = WANTED.get_or_init(|| {
        let text = std::env::var("PHOTILE_FAULT").ok()?;
        let (name, number) = text.split_once('=')?;
        Some((name.to_string(), number.parse().ok()?))
    });
    wanted.as_ref().map(|(name, number)| (name.as_str(), *number))
}

/// Whether this is the call that fails.
fn comes(name: &str, calls: &AtomicU64) -> bool {
    matches!(wanted(), Some((wanted, number)) if wanted == name && calls.fetch_add(1, Ordering::Relaxed) + 1 == number)
}

/// The error that an OpenCL launch has to answer with.
pub fn of_launch() -> Option<i32> {
    static CALLS: [AtomicU64; 2] = [AtomicU64::new(0), AtomicU64::new(0)];
    match () {
        () if comes("opencl-lost", &CALLS[0]) => Some(INVALID_COMMAND_QUEUE),
        () if comes("opencl-resources", &CALLS[1]) => Some(OUT_OF_RESOURCES),
        () => None,
    }
}

/// Whether the OpenGL context is lost in this draw.
pub fn of_draw() -> bool {
    static CALLS: AtomicU64 = AtomicU64::new(0);
    comes("opengl-lost", &CALLS)
}

/// Whether an OpenCL device that holds so many bytes has no room for more.
pub fn of_memory(held: usize) -> bool {
    matches!(wanted(), Some(("opencl-memory", limit)) if held as u64 > limit)
}
