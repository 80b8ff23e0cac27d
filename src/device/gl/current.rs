//! The context that is current on this thread, whoever made it so.

use std::ffi::c_void;
use std::rc::Rc;

use glow::HasContext;

use super::Functions;

/// Functions and facts of a current context.
pub struct Current {
    /// Functions of this context.
    pub gl: Functions,
    /// The device and driver, as GL_RENDERER names them.
    pub renderer: String,
    /// The version of OpenGL, as GL_VERSION says it.
    pub version: String,
    /// Rasterised by the CPU.
    pub is_software: bool,
}

impl Current {
    /// Asks the context that is current on this thread; `load` finds its functions by name.
    pub(super) fn new(mut load: impl FnMut(&std::ffi::CStr) -> *const c_void) -> Current {
        // SAFETY: the caller made a context current, and `load` returns its functions.
        let gl = unsafe { glow::Context::from_loader_function_cstr(&mut load) };
        // SAFETY: the context is current.
        let (renderer, version) =
            unsafe { (gl.get_parameter_string(glow::RENDERER), gl.get_parameter_string(glow::VERSION)) };
        Current { is_software: is_software(&renderer), gl: Rc::new(gl), renderer, version }
    }
}

/// Whether a renderer of this name runs on the CPU.
pub(super) fn is_software(renderer: &str) -> bool {
    let lower = renderer.to_lowercase();
    ["llvmpipe", "softpipe", "swrast", "software"].iter().any(|name| lower.contains(name))
}
