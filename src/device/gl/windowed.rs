//! OpenGL in a window: the context that shows, and contexts for other threads that share its textures.

use std::num::NonZeroU32;
use std::sync::Arc;

use glutin::config::{Config, ConfigTemplateBuilder, GlConfig};
use glutin::context::{
    AsRawContext, ContextApi, ContextAttributesBuilder, GlProfile, NotCurrentContext, NotCurrentGlContext,
    PossiblyCurrentContext, RawContext, Version,
};
use glutin::display::{Display, GetGlDisplay, GlDisplay};
use glutin::surface::{GlSurface, Surface, SwapInterval, WindowSurface};
use glutin_winit::{DisplayBuilder, GlWindow};
use winit::event_loop::ActiveEventLoop;
use winit::raw_window_handle::HasWindowHandle;
use winit::window::{Window, WindowAttributes};

use super::Current;
use crate::device::cl::aborts::Driver;
use crate::error::{Error, Result};

fn failed(what: &str, error: impl std::fmt::Display) -> Error {
    Error::Driver(format!("window: {what}: {}", plain(error)))
}

/// An error of the window library without the place in its source that it begins with: a path of whoever built this.
pub fn plain(error: impl std::fmt::Display) -> String {
    let text = error.to_string();
    let Some((_, rest)) = text.split_once("os error at ") else { return text };
    // `FILE:LINE: what happened`
    let mut parts = rest.splitn(3, ':');
    match (parts.next(), parts.next().map(|line| line.trim().parse::<u32>()), parts.next()) {
        (Some(_), Some(Ok(_)), Some(what)) => what.trim().to_string(),
        _ => text,
    }
}

/// A window's context, current on the thread that made it, and the surface that it shows on.
pub struct Windowed {
    // Fields go in this order: the surface before the context, the context before the window that it draws in.
    surface: Surface<WindowSurface>,
    context: PossiblyCurrentContext,
    config: Config,
    /// Functions and facts.
    pub current: Current,
    /// The window itself.
    pub window: Arc<Window>,
}

/// A context for another thread. It shares textures with the window's.
pub struct Spare(NotCurrentContext);

/// A [`Spare`] in use: current on this thread until dropped.
pub struct Aside {
    // Objects go before their context.
    current: Current,
    _context: PossiblyCurrentContext,
}

impl Windowed {
    /// Opens a window with an OpenGL 3.3 core context.
    ///
    /// # Errors
    /// [`Error::Driver`] with what the window system or the driver refused.
    pub fn new(events: &ActiveEventLoop, attributes: WindowAttributes) -> Result<Windowed> {
        Driver::OpenGl.begin()?;
        let template = ConfigTemplateBuilder::new().with_depth_size(0).with_stencil_size(0);
        let builder = DisplayBuilder::new().with_window_attributes(Some(attributes));
        // Multisampling would cost and show nothing: the picture is one quad.
        let pick = |configs: Box<dyn Iterator<Item = Config> + '_>| {
            configs.min_by_key(|config| (config.num_samples(), config.alpha_size())).expect("EGL lists a configuration")
        };
        let (window, config) = builder.build(events, template, pick).map_err(|e| failed("no OpenGL display", e))?;
        let window = Arc::new(window.ok_or_else(|| failed("no window", "none was made"))?);
        let handle = window.window_handle().map_err(|e| failed("no handle", e))?.as_raw();
        let attributes = attributes_3_3().build(Some(handle));
        let display = config.display();
        // SAFETY: the window's handle lives as long as the window, which outlives the context by the order of fields.
        let context = unsafe { display.create_context(&config, &attributes) }
            .map_err(|e| failed("no OpenGL 3.3 core context", e))?;
        let surface = window
            .build_surface_attributes(Default::default())
            .map_err(|e| failed("no surface", e))
            // SAFETY: as above.
            .and_then(|a| unsafe { display.create_window_surface(&config, &a) }.map_err(|e| failed("no surface", e)))?;
        let context = context.make_current(&surface).map_err(|e| failed("making the context current", e))?;
        // Waiting for the display's refresh would hold up input; software has none to wait for.
        let _ = surface.set_swap_interval(&context, SwapInterval::DontWait);
        let current = Current::new(|name| display.get_proc_address(name));
        Ok(Windowed { surface, context, config, current, window })
    }

    /// A context for another thread.
    ///
    /// # Errors
    /// [`Error::Driver`] when the driver gives no second one.
    pub fn spare(&self) -> Result<Spare> {
        let attributes = attributes_3_3().with_sharing(&self.context).build(None);
        // SAFETY: no window is named; the context that is shared with is alive.
        let made = unsafe { self.config.display().create_context(&self.config, &attributes) };
        made.map(Spare).map_err(|e| failed("no context that shares textures", e))
    }

    /// A second set of this context's functions, for a library that wants its own.
    pub fn functions(&self) -> Arc<glow::Context> {
        let display = self.config.display();
        // SAFETY: this context is current on the thread that made it, and never leaves it.
        Arc::new(unsafe { glow::Context::from_loader_function_cstr(|name| display.get_proc_address(name)) })
    }

    /// Fits the surface to the window; sizes of nothing are ignored.
    pub fn resize(&self, width: u32, height: u32) {
        if let (Some(width), Some(height)) = (NonZeroU32::new(width), NonZeroU32::new(height)) {
            self.surface.resize(&self.context, width, height);
        }
    }

    /// Shows what was drawn.
    ///
    /// # Errors
    /// [`Error::Driver`] when the surface is gone.
    pub fn swap(&self) -> Result<()> {
        self.surface.swap_buffers(&self.context).map_err(|e| failed("showing a frame", e))
    }

    /// `X11` or `Wayland`, by the kind of display.
    pub fn route(&self) -> &'static str {
        match self.context.raw_context() {
            RawContext::Egl(_) => "EGL",
        }
    }
}

impl Spare {
    /// Makes the context current on this thread, without a surface: it draws into textures.
    ///
    /// # Errors
    /// [`Error::Driver`] when the driver wants a surface.
    pub fn open(self) -> Result<Aside> {
        let NotCurrentContext::Egl(context) = self.0;
        let context = context.make_current_surfaceless().map_err(|e| failed("no surfaceless context", e))?;
        let context = PossiblyCurrentContext::Egl(context);
        let display: Display = context.display();
        Ok(Aside { current: Current::new(|name| display.get_proc_address(name)), _context: context })
    }
}

impl Aside {
    /// What others need that draw here.
    pub fn current(&self) -> Current {
        let Current { gl, renderer, version, is_software } = &self.current;
        Current { gl: gl.clone(), renderer: renderer.clone(), version: version.clone(), is_software: *is_software }
    }
}

fn attributes_3_3() -> ContextAttributesBuilder {
    ContextAttributesBuilder::new()
        .with_profile(GlProfile::Core)
        .with_context_api(ContextApi::OpenGl(Some(Version::new(3, 3))))
}

#[cfg(test)]
mod tests {
    use super::plain;

    #[test]
    fn places_in_others_sources_are_left_out() {
        assert_eq!(plain("os error at /home/x/.cargo/winit/src/mod.rs:765: no DISPLAY: none"), "no DISPLAY: none");
        assert_eq!(plain("the compositor said no"), "the compositor said no");
    }
}
