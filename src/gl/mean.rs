//! The running mean of a picture's passes, and finished pictures that another context may show meanwhile.

use glow::HasContext;

use super::target::smooth;
use super::{Functions, Program, Target, Texture};
use crate::census::{Counted, Kind};
use crate::error::{Error, Result};
use crate::film::Image;
use crate::source::{Options, assemble};

/// The mean of the passes so far: `mean += (pass − mean) / n`.
pub struct Mean {
    gl: Functions,
    program: Program,
    /// Takes what another picture, of another size, has there.
    patch: Program,
    /// Where a film in host memory goes first.
    upload: Texture,
    target: Option<(u32, u32, Target)>,
    passes: u32,
    _counted: Counted,
}

/// A picture that stays as it is while the next one is made.
pub struct Picture {
    target: Option<(u32, u32, Target)>,
}

impl Mean {
    /// On the current context.
    ///
    /// # Errors
    /// [`Error::Build`] and [`Error::Device`] from the driver.
    pub fn new(gl: &Functions) -> Result<Mean> {
        let program = Program::new(gl, &assemble("mean.frag", None, &Options::default()))?;
        let scaled = Options { defines: vec!["SCALED".into()], ..Options::default() };
        let patch = Program::new(gl, &assemble("mean.frag", None, &scaled))?;
        // SAFETY: the context is current; the texture is owned by the result.
        let upload = unsafe { gl.create_texture() }.map_err(|e| Error::Device(format!("OpenGL: texture: {e}")))?;
        let _counted = Counted::new(Kind::OpenGl);
        Ok(Mean { gl: gl.clone(), program, patch, upload, target: None, passes: 0, _counted })
    }

    /// Forgets all passes.
    pub fn restart(&mut self) {
        self.passes = 0;
    }

    /// Passes in the mean.
    pub fn passes(&self) -> u32 {
        self.passes
    }

    /// Takes a pass in, from a texture of this context.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver refuses the size.
    pub fn add(&mut self, pass: Texture, width: u32, height: u32) -> Result<()> {
        if self.target.as_ref().is_none_or(|(w, h, _)| (*w, *h) != (width, height)) {
            self.target = None; // the old one's memory first
            self.target = Some((width, height, Target::new(&self.gl, width, height, false)?));
            self.passes = 0;
        }
        let Some((_, _, target)) = &self.target else { return Ok(()) };
        self.passes += 1;
        self.program.activate(&["pass"]);
        // SAFETY: the context is current.
        unsafe {
            self.gl.active_texture(glow::TEXTURE0);
            self.gl.bind_texture(glow::TEXTURE_2D, Some(pass));
        }
        // The first pass replaces what was there: a NaN in it must not survive as 0 · NaN.
        let weight = (self.passes > 1).then(|| 1.0 / self.passes as f32);
        target.draw_mixed(&self.program, weight)
    }

    /// Takes a pass in that lies in host memory.
    ///
    /// # Errors
    /// As [`Mean::add`].
    pub fn add_image(&mut self, image: &Image) -> Result<()> {
        self.upload(image);
        self.add(self.upload, image.width, image.height)
    }

    /// Replaces rows, from and to each, by what a picture of another size has there, interpolated.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver reports an error.
    pub fn patch(&self, from: Texture, rows: &[[u32; 2]]) -> Result<()> {
        let Some((width, height, target)) = &self.target else { return Ok(()) };
        self.patch.activate(&["pass"]);
        self.patch.set_texels("whole", &[*width as f32, *height as f32, 1.0]);
        // SAFETY: the context is current.
        unsafe {
            self.gl.active_texture(glow::TEXTURE0);
            self.gl.bind_texture(glow::TEXTURE_2D, Some(from));
        }
        smooth(&self.gl);
        target.draw_rows(&self.patch, rows)
    }

    /// The same from a picture in host memory.
    ///
    /// # Errors
    /// As [`Mean::patch`].
    pub fn patch_image(&self, image: &Image, rows: &[[u32; 2]]) -> Result<()> {
        self.upload(image);
        self.patch(self.upload, rows)
    }

    fn upload(&self, image: &Image) {
        let gl = &self.gl;
        // SAFETY: the context is current; an image has `width · height` pixels of three floats.
        unsafe {
            gl.bind_texture(glow::TEXTURE_2D, Some(self.upload));
            gl.pixel_store_i32(glow::UNPACK_ALIGNMENT, 4);
            gl.tex_image_2d(
                glow::TEXTURE_2D,
                0,
                glow::RGB32F as i32,
                image.width as i32,
                image.height as i32,
                0,
                glow::RGB,
                glow::FLOAT,
                glow::PixelUnpackData::Slice(Some(bytemuck::cast_slice(&image.pixels))),
            );
            gl.tex_parameter_i32(glow::TEXTURE_2D, glow::TEXTURE_MIN_FILTER, glow::NEAREST as i32);
            gl.tex_parameter_i32(glow::TEXTURE_2D, glow::TEXTURE_MAG_FILTER, glow::NEAREST as i32);
        }
    }

    /// Copies the mean into a picture and waits until it is there.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver refuses the size.
    pub fn copy_to(&self, picture: &mut Picture) -> Result<()> {
        let Some((width, height, from)) = &self.target else { return Ok(()) };
        if picture.target.as_ref().is_none_or(|(w, h, _)| (w, h) != (width, height)) {
            picture.target = None;
            let target = Target::new(&self.gl, *width, *height, false)?;
            target.smooth();
            picture.target = Some((*width, *height, target));
        }
        let Some((_, _, to)) = &picture.target else { return Ok(()) };
        from.copy_to(to)
    }

    /// The mean on the host.
    ///
    /// # Errors
    /// [`Error::Failed`] before the first pass.
    pub fn read(&self) -> Result<Image> {
        let Some((width, height, target)) = &self.target else {
            return Err(Error::Failed("there is no picture yet".into()));
        };
        let pixels = target.read().iter().map(|[r, g, b, _]| [*r, *g, *b].map(f32::from_bits)).collect();
        Image::from_pixels(*width, *height, pixels)
    }
}

impl Drop for Mean {
    fn drop(&mut self) {
        // SAFETY: the context outlives its objects: whoever owns both drops it last.
        unsafe { self.gl.delete_texture(self.upload) }
    }
}

impl Picture {
    /// Nothing yet.
    pub fn empty() -> Picture {
        Picture { target: None }
    }

    /// Texture, width and height.
    pub fn texture(&self) -> Option<(Texture, u32, u32)> {
        self.target.as_ref().map(|(width, height, target)| (target.texture(), *width, *height))
    }
}
