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
pub use windowed::{Aside, Spare, Windowed};

use std::rc::Rc;

/// What to install where no OpenGL is found.
pub const MISSING: &str = "OpenGL is not there: on Debian or Ubuntu, `apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri` \
                           brings it in software; GPUs bring theirs with their driver";

/// A texture's name in its context, and in those that share with it.
pub type Texture = glow::NativeTexture;

/// The functions of the current context, shared by all that lives in it.
pub type Functions = Rc<glow::Context>;
