//! Pictures into the window: exposure, tone map, split, heat map (`glsl/present.frag`).

use glow::HasContext;

use super::{Functions, Program, Texture};
use crate::device::live_objects::{Api, Counted};
use crate::error::{Error, Result};
use crate::program::source::{Options, assemble};

/// From radiance to what a display shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ToneMap {
    /// Cut off at white, as PNGs are written.
    #[default]
    Clamp,
    /// x / (1 + x) (Reinhard et al. 2002).
    Reinhard,
    /// The film curve of ACES as fitted by Narkowicz (2015).
    Aces,
}

impl ToneMap {
    /// All of them, as the shader counts them.
    pub const ALL: [ToneMap; 3] = [ToneMap::Clamp, ToneMap::Reinhard, ToneMap::Aces];

    /// As users read it.
    pub fn name(self) -> &'static str {
        match self {
            ToneMap::Clamp => "clamp",
            ToneMap::Reinhard => "Reinhard",
            ToneMap::Aces => "ACES",
        }
    }
}

/// What the window shows.
#[derive(Clone, Copy, Debug)]
pub struct Shown {
    /// The picture, or the left one of two.
    pub left: Texture,
    /// The right picture of a split view.
    pub right: Option<Texture>,
    /// The difference of both in false colours.
    pub heat: bool,
    /// Column of the divider, pixels from the picture's left.
    pub divider: f32,
    /// Left, bottom, width and height of the picture in the window, pixels.
    pub area: [i32; 4],
    /// Exposure value: radiance is scaled by 2^EV.
    pub exposure: f32,
    /// How radiance becomes display values.
    pub tone_map: ToneMap,
}

/// The program that shows pictures.
pub struct Present {
    gl: Functions,
    program: Program,
    triangle: glow::NativeVertexArray,
    _counted: Counted,
}

impl Present {
    /// On the window's context.
    ///
    /// # Errors
    /// [`Error::Build`] and [`Error::Device`] from the driver.
    pub fn new(gl: &Functions) -> Result<Present> {
        let program = Program::new(gl, &assemble("present.frag", None, &Options::default()))?;
        // SAFETY: the context is current; the array is owned by the result.
        let triangle = unsafe { gl.create_vertex_array() }.map_err(|e| Error::Device(format!("OpenGL: {e}")))?;
        Ok(Present { gl: gl.clone(), program, triangle, _counted: Counted::new(Api::OpenGl) })
    }

    /// Fills the window with a dark grey, before a picture covers its part.
    pub fn clear(&self, width: u32, height: u32) {
        let gl = &self.gl;
        // SAFETY: the context is current.
        unsafe {
            gl.bind_framebuffer(glow::FRAMEBUFFER, None);
            gl.disable(glow::SCISSOR_TEST);
            gl.viewport(0, 0, width as i32, height as i32);
            gl.clear_color(0.08, 0.08, 0.08, 1.0);
            gl.clear(glow::COLOR_BUFFER_BIT);
        }
    }

    /// Draws into the window.
    pub fn draw(&self, shown: &Shown) {
        let gl = &self.gl;
        let [x, y, width, height] = shown.area;
        self.program.activate();
        let mode = match (shown.right, shown.heat) {
            (None, _) => 0.0,
            (Some(_), false) => 1.0,
            (Some(_), true) => 2.0,
        };
        self.program.set_texels("corner", &[x as f32, y as f32, shown.divider]);
        self.program.set_texels("size", &[width as f32, height as f32, shown.exposure.exp2()]);
        self.program.set_texels("options", &[mode, shown.tone_map as i32 as f32, 0.0]);
        // Binding them here is what makes another context's drawing visible (OpenGL 3.3, appendix D).
        self.program.bind("left", glow::TEXTURE_2D, shown.left);
        self.program.bind("right", glow::TEXTURE_2D, shown.right.unwrap_or(shown.left));
        // SAFETY: the context is current, and so is the program.
        unsafe {
            gl.bind_framebuffer(glow::FRAMEBUFFER, None);
            gl.bind_vertex_array(Some(self.triangle));
            gl.disable(glow::BLEND);
            gl.disable(glow::DEPTH_TEST);
            gl.disable(glow::SCISSOR_TEST);
            gl.viewport(x, y, width, height);
            gl.draw_arrays(glow::TRIANGLES, 0, 3);
            gl.bind_vertex_array(None);
        }
    }
}

impl Drop for Present {
    fn drop(&mut self) {
        // SAFETY: the context outlives its objects: whoever owns both drops it last.
        unsafe { self.gl.delete_vertex_array(self.triangle) }
    }
}
