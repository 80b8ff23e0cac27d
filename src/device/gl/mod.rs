//! OpenGL 3.3 core: contexts, programs, textures, targets. All `unsafe` towards EGL and GL is in this folder.

mod current;
mod headless;
mod mean;
mod pixel_buffer;
mod present;
mod probe;
mod program;
mod target;
mod texture;
mod windowed;

pub use current::Current;
pub use headless::{Headless, contexts};
pub use mean::{Mean, Picture};
pub use pixel_buffer::PixelBuffer;
pub use present::{Present, Shown, ToneMap};
pub use probe::probe;
pub use program::Program;
pub use target::Target;
pub use texture::TableTexture;
pub use windowed::{Aside, Spare, Windowed, plain};

use std::rc::Rc;

use glow::HasContext;

use crate::error::{Error, Result};

/// What to install where no OpenGL is found.
pub const MISSING: &str = "OpenGL is not there: on Debian or Ubuntu, `apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri` \
                           brings it in software; GPUs bring theirs with their driver";

/// What the driver says to all that was asked of it since the last time.
///
/// # Errors
/// [`Error::Memory`] when memory is out, [`Error::Device`] for other errors, and when the context is gone.
fn checked(gl: &Functions, what: impl std::fmt::Display) -> Result<()> {
    // SAFETY: the context is current.
    let error = unsafe { gl.get_error() };
    match error {
        glow::NO_ERROR => Ok(()),
        glow::OUT_OF_MEMORY => Err(Error::Memory(format!("OpenGL: {what}"))),
        glow::CONTEXT_LOST => Err(lost(what)),
        error => Err(Error::Device(format!("OpenGL: {what}: error {error:#06x}"))),
    }
}

/// What is left to say once the context is gone.
fn lost(what: impl std::fmt::Display) -> Error {
    Error::Device(format!("OpenGL: {what}: the context was lost, or reset by its driver; start anew"))
}

/// A texture's name in its context, and in those that share with it.
pub type Texture = glow::NativeTexture;

/// The functions of the current context, shared by all that lives in it.
pub type Functions = Rc<glow::Context>;
