//! OpenGL 3.3 core: contexts, programs, textures, targets. All `unsafe` towards EGL and GL is in this folder.

mod headless;
mod pixel_buffer;
mod probe;
mod program;
mod target;
mod texture;

pub use headless::{Headless, contexts};
pub use pixel_buffer::PixelBuffer;
pub use probe::probe;
pub use program::Program;
pub use target::Target;
pub use texture::TableTexture;

use std::rc::Rc;

/// What to install where no OpenGL is found.
pub const MISSING: &str = "OpenGL is not there: on Debian or Ubuntu, `apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri` \
                           brings it in software; GPUs bring theirs with their driver";

/// The functions of the current context, shared by all that lives in it.
pub type Functions = Rc<glow::Context>;
