//! What a fragment shader draws into when there is no window.

use glow::HasContext;

use super::{Functions, Program, checked, lost};
use crate::device::injected_faults;
use crate::device::live_objects::{Api, Counted};
use crate::device::submissions::{Pace, stride};
use crate::error::{Error, Result};

/// Rows that a draw is cut into multiples of: drivers draw in blocks of pixels.
const BAND: usize = 8;

/// A framebuffer with one texture or more; deleted when dropped.
pub struct Target {
    gl: Functions,
    framebuffer: glow::NativeFramebuffer,
    /// By output of the fragment shader.
    textures: Vec<glow::NativeTexture>,
    /// Of the textures: `TEXTURE_2D`, or `TEXTURE_RECTANGLE` as tables have.
    kind: u32,
    triangle: glow::NativeVertexArray,
    width: u32,
    height: u32,
    integers: bool,
    _counted: Counted,
    /// What a band of rows takes.
    pub pace: Pace,
}

impl Target {
    /// A target of RGBA32F, or of RGBA32UI where bits matter (`integers`).
    ///
    /// # Errors
    /// [`Error::Device`] when the driver refuses the size or the format.
    pub fn new(gl: &Functions, width: u32, height: u32, integers: bool) -> Result<Target> {
        Target::with_outputs(gl, [width, height], integers, 1, glow::TEXTURE_2D)
    }

    /// A target of RGBA32F for a fragment shader that makes tables, one an output.
    ///
    /// # Errors
    /// As [`Target::new`].
    pub fn of_tables(gl: &Functions, width: u32, height: u32, outputs: u32) -> Result<Target> {
        Target::with_outputs(gl, [width, height], false, outputs, glow::TEXTURE_RECTANGLE)
    }

    fn with_outputs(
        gl: &Functions,
        [width, height]: [u32; 2],
        integers: bool,
        outputs: u32,
        kind: u32,
    ) -> Result<Target> {
        let refused = |what| Error::Device(format!("OpenGL: target of {width} × {height}: {what}"));
        let (internal, format, number) = if integers {
            (glow::RGBA32UI, glow::RGBA_INTEGER, glow::UNSIGNED_INT)
        } else {
            (glow::RGBA32F, glow::RGBA, glow::FLOAT)
        };
        // SAFETY: the context is current; every object made here is owned by the result.
        unsafe {
            let limit = gl.get_parameter_i32(glow::MAX_TEXTURE_SIZE) as u32;
            if width > limit || height > limit {
                return Err(refused(format!("the driver's limit is {limit}")));
            }
            let mut target = Target {
                gl: gl.clone(),
                framebuffer: gl.create_framebuffer().map_err(refused)?,
                textures: Vec::new(),
                kind,
                // Core profile draws nothing without a vertex array, though the quad has no attributes.
                triangle: gl.create_vertex_array().map_err(refused)?,
                width,
                height,
                integers,
                _counted: Counted::new(Api::OpenGl),
                pace: Pace::new("draw"),
            };
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(target.framebuffer));
            for output in 0..outputs {
                let texture = gl.create_texture().map_err(refused)?;
                target.textures.push(texture);
                gl.bind_texture(kind, Some(texture));
                gl.tex_image_2d(
                    kind,
                    0,
                    internal as i32,
                    width as i32,
                    height as i32,
                    0,
                    format,
                    number,
                    glow::PixelUnpackData::Slice(None),
                );
                gl.tex_parameter_i32(kind, glow::TEXTURE_MIN_FILTER, glow::NEAREST as i32);
                gl.tex_parameter_i32(kind, glow::TEXTURE_MAG_FILTER, glow::NEAREST as i32);
                let attachment = glow::COLOR_ATTACHMENT0 + output;
                gl.framebuffer_texture_2d(glow::FRAMEBUFFER, attachment, kind, Some(texture), 0);
            }
            let attachments: Vec<u32> = (0..outputs).map(|output| glow::COLOR_ATTACHMENT0 + output).collect();
            gl.draw_buffers(&attachments);
            match gl.check_framebuffer_status(glow::FRAMEBUFFER) {
                glow::FRAMEBUFFER_COMPLETE => {
                    checked(gl, format_args!("target of {width} × {height}"))?; // memory may be out
                    Ok(target)
                }
                status => Err(refused(format!("framebuffer status {status:#06x}"))),
            }
        }
    }

    /// Binds what an output was drawn into to a sampler of the active program, to be read as a table.
    pub fn bind(&self, output: usize, program: &Program, sampler: &str) {
        program.bind(sampler, self.kind, self.textures[output]);
    }

    /// Draws the quad with the active program and waits until it is done; cut into bands of rows that no watchdog
    /// minds.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver reports an error.
    pub fn draw(&self, active: &Program) -> Result<()> {
        self.draw_weighted(active, None)
    }

    /// Blackens the target, for [`Target::draw_weighted`] to add to.
    pub fn clear(&self) {
        // SAFETY: the context is current.
        unsafe {
            self.gl.bind_framebuffer(glow::FRAMEBUFFER, Some(self.framebuffer));
            self.gl.clear_color(0.0, 0.0, 0.0, 0.0);
            self.gl.clear(glow::COLOR_BUFFER_BIT);
        }
    }

    /// Draws like [`Target::draw`]; with a weight, adds so much of the picture to what is there.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver reports an error.
    pub fn draw_weighted(&self, active: &Program, weight: Option<f32>) -> Result<()> {
        self.draw_blended(active, weight, glow::ONE, None).map(|_| ())
    }

    /// Draws like [`Target::draw_weighted`], and asks between two pieces whether the rest is wanted; the rows that were
    /// not, from and to.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver reports an error.
    pub fn draw_while(
        &self,
        active: &Program,
        weight: Option<f32>,
        wanted: &dyn Fn() -> bool,
    ) -> Result<Vec<[u32; 2]>> {
        self.draw_blended(active, weight, glow::ONE, Some(wanted))
    }

    /// Draws like [`Target::draw`]; with a weight w, leaves (1 − w) of what is there and adds w of the picture.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver reports an error.
    pub fn draw_mixed(&self, active: &Program, weight: Option<f32>) -> Result<()> {
        self.draw_blended(active, weight, glow::ONE_MINUS_CONSTANT_ALPHA, None).map(|_| ())
    }

    fn draw_blended(
        &self,
        active: &Program,
        weight: Option<f32>,
        kept: u32,
        wanted: Option<&dyn Fn() -> bool>,
    ) -> Result<Vec<[u32; 2]>> {
        active.check()?;
        let gl = &self.gl;
        // SAFETY: the context is current and a linked program is active (the argument says so).
        unsafe {
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(self.framebuffer));
            gl.bind_vertex_array(Some(self.triangle));
            gl.viewport(0, 0, self.width as i32, self.height as i32);
            match weight {
                Some(weight) => {
                    gl.enable(glow::BLEND);
                    gl.blend_equation(glow::FUNC_ADD);
                    gl.blend_func(glow::CONSTANT_ALPHA, kept);
                    gl.blend_color(0.0, 0.0, 0.0, weight);
                }
                None => gl.disable(glow::BLEND),
            }
            gl.disable(glow::DEPTH_TEST);
            gl.enable(glow::SCISSOR_TEST);
            let (mut done, all) = (0, (self.height as usize).div_ceil(BAND));
            let stride = stride(all);
            self.pace.begin();
            while done < all {
                let bands = self.pace.next(all - done, all, 1, BAND * self.width as usize);
                let begin = std::time::Instant::now();
                if bands == all {
                    gl.scissor(0, 0, self.width as i32, self.height as i32);
                    gl.draw_arrays(glow::TRIANGLES, 0, 3);
                } else {
                    // From all over the picture: sky, where nothing takes any time, says nothing of what lies below.
                    for band in (done..done + bands).map(|band| band * stride % all) {
                        // Beyond the height there is nothing to draw.
                        gl.scissor(0, (band * BAND) as i32, self.width as i32, BAND as i32);
                        gl.draw_arrays(glow::TRIANGLES, 0, 3);
                    }
                }
                gl.finish();
                self.pace.took(bands, begin.elapsed().as_secs_f64() * 1e3);
                done += bands;
                if done < all && wanted.is_some_and(|wanted| !wanted()) {
                    break;
                }
            }
            gl.disable(glow::SCISSOR_TEST);
            if injected_faults::of_draw() {
                return Err(lost("drawing"));
            }
            checked(gl, "drawing")?;
            let rows = |band: usize| [band * BAND, ((band + 1) * BAND).min(self.height as usize)].map(|row| row as u32);
            Ok((done..all).map(|band| rows(band * stride % all)).collect())
        }
    }

    /// Draws some rows anew, from and to each, with the active program, and waits until they are done.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver reports an error.
    pub fn draw_rows(&self, active: &Program, rows: &[[u32; 2]]) -> Result<()> {
        active.check()?;
        let gl = &self.gl;
        // SAFETY: the context is current and a linked program is active (the argument says so).
        unsafe {
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(self.framebuffer));
            gl.bind_vertex_array(Some(self.triangle));
            gl.viewport(0, 0, self.width as i32, self.height as i32);
            gl.disable(glow::BLEND);
            gl.disable(glow::DEPTH_TEST);
            gl.enable(glow::SCISSOR_TEST);
            for [from, to] in rows {
                gl.scissor(0, *from as i32, self.width as i32, (to - from) as i32);
                gl.draw_arrays(glow::TRIANGLES, 0, 3);
            }
            gl.finish();
            gl.disable(glow::SCISSOR_TEST);
            checked(gl, "drawing rows")
        }
    }

    /// Copies all of this target into one of the same size and waits until it is done.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver reports an error.
    pub fn copy_to(&self, to: &Target) -> Result<()> {
        let gl = &self.gl;
        let (width, height) = (self.width as i32, self.height as i32);
        // SAFETY: the context is current, and both framebuffers are its own.
        unsafe {
            gl.bind_framebuffer(glow::READ_FRAMEBUFFER, Some(self.framebuffer));
            gl.bind_framebuffer(glow::DRAW_FRAMEBUFFER, Some(to.framebuffer));
            gl.blit_framebuffer(0, 0, width, height, 0, 0, width, height, glow::COLOR_BUFFER_BIT, glow::NEAREST);
            gl.finish();
            checked(gl, "copying")
        }
    }

    /// Lets the texture be interpolated where it is shown larger than it is.
    pub fn smooth(&self) {
        // SAFETY: the context is current.
        unsafe { self.gl.bind_texture(glow::TEXTURE_2D, Some(self.textures[0])) };
        smooth(&self.gl);
    }

    /// The target's pixels, four components each as raw 32-bit words, row 0 first.
    pub fn read(&self) -> Vec<[u32; 4]> {
        let mut pixels = vec![[0u32; 4]; self.width as usize * self.height as usize];
        let (format, kind) =
            if self.integers { (glow::RGBA_INTEGER, glow::UNSIGNED_INT) } else { (glow::RGBA, glow::FLOAT) };
        // SAFETY: the slice holds exactly the pixels asked for; the context is current.
        unsafe {
            self.gl.bind_framebuffer(glow::FRAMEBUFFER, Some(self.framebuffer));
            self.gl.pixel_store_i32(glow::PACK_ALIGNMENT, 4);
            self.gl.read_pixels(
                0,
                0,
                self.width as i32,
                self.height as i32,
                format,
                kind,
                glow::PixelPackData::Slice(Some(bytemuck::cast_slice_mut(&mut pixels))),
            );
        }
        pixels
    }

    /// What is drawn into.
    pub fn texture(&self) -> super::Texture {
        self.textures[0]
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> usize {
        self.width as usize * self.height as usize * 16 * self.textures.len()
    }
}

/// Lets the bound texture be interpolated, and end at its edges.
pub(super) fn smooth(gl: &Functions) {
    for (name, value) in [
        (glow::TEXTURE_MIN_FILTER, glow::LINEAR),
        (glow::TEXTURE_MAG_FILTER, glow::LINEAR),
        (glow::TEXTURE_WRAP_S, glow::CLAMP_TO_EDGE),
        (glow::TEXTURE_WRAP_T, glow::CLAMP_TO_EDGE),
    ] {
        // SAFETY: the context is current.
        unsafe { gl.tex_parameter_i32(glow::TEXTURE_2D, name, value as i32) };
    }
}

impl Drop for Target {
    fn drop(&mut self) {
        // SAFETY: the context outlives its objects: whoever owns both drops it last.
        unsafe {
            self.gl.delete_framebuffer(self.framebuffer);
            for texture in &self.textures {
                self.gl.delete_texture(*texture);
            }
            self.gl.delete_vertex_array(self.triangle);
        }
    }
}
