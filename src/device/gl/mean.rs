//! The running mean of a picture's passes, and finished pictures that another context may show meanwhile.

use glow::HasContext;

use super::target::smooth;
use super::{Functions, Program, Target, Texture};
use crate::device::live_objects::{Api, Counted};
use crate::error::{Error, Result};
use crate::film::Image;
use crate::program::source::{Options, assemble};

/// The mean of the passes so far: of blocks of [`BLOCK`] passes `mean += (pass − mean) / n`, then of blocks likewise.
/// Every step rounds what it is added to: so it is rounded 64 times less often.
pub struct Mean {
    gl: Functions,
    program: Program,
    /// Takes what another picture, of another size, has there.
    patch: Program,
    /// Goes over from the row above a gap to the one below.
    bridge: Program,
    /// Where a film in host memory goes first.
    upload: Texture,
    /// Width, height, and the passes since the last whole block.
    block: Option<(u32, u32, Target)>,
    /// All whole blocks, once there is one.
    whole: Option<Target>,
    passes: u32,
    /// Those in whole blocks.
    merged: u32,
    _counted: Counted,
}

/// Passes of a block.
const BLOCK: u32 = 64;

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
        let variant = |define: &str| {
            let options = Options { defines: vec![define.into()], ..Options::default() };
            Program::new(gl, &assemble("mean.frag", None, &options))
        };
        let (patch, bridge) = (variant("SCALED")?, variant("BRIDGED")?);
        // SAFETY: the context is current; the texture is owned by the result.
        let upload = unsafe { gl.create_texture() }.map_err(|e| Error::Device(format!("OpenGL: texture: {e}")))?;
        let _counted = Counted::new(Api::OpenGl);
        Ok(Mean {
            gl: gl.clone(),
            program,
            patch,
            bridge,
            upload,
            block: None,
            whole: None,
            passes: 0,
            merged: 0,
            _counted,
        })
    }

    /// Forgets all passes.
    pub fn restart(&mut self) {
        (self.passes, self.merged) = (0, 0);
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
        if self.block.as_ref().is_none_or(|(w, h, _)| (*w, *h) != (width, height)) {
            (self.block, self.whole) = (None, None); // the old ones' memory first
            self.block = Some((width, height, Target::new(&self.gl, width, height, false)?));
            self.restart();
        }
        let Some((_, _, block)) = &self.block else { return Ok(()) };
        self.passes += 1;
        let in_block = self.passes - self.merged;
        self.mix(pass, block, 1, in_block)?;
        if in_block == BLOCK {
            let whole = match self.whole.take() {
                Some(whole) => whole,
                None => Target::new(&self.gl, width, height, false)?,
            };
            self.mix(block.texture(), &whole, BLOCK, self.passes)?;
            (self.whole, self.merged) = (Some(whole), self.passes);
        }
        Ok(())
    }

    /// Mixes the mean of `passes` of all `of` passes into the mean of the others.
    fn mix(&self, mean: Texture, into: &Target, passes: u32, of: u32) -> Result<()> {
        self.program.activate();
        self.program.bind("pass", glow::TEXTURE_2D, mean);
        // The first ones replace what was there: a NaN in it must not survive as 0 · NaN.
        into.draw_mixed(&self.program, (of > passes).then(|| passes as f32 / of as f32))
    }

    /// Puts blocks and what has come since together, and waits until that is there.
    fn combine(&self, block: &Target, to: &Target) -> Result<()> {
        match &self.whole {
            Some(whole) if self.merged > 0 => {
                if self.passes > self.merged {
                    whole.copy_to(to)?;
                    self.mix(block.texture(), to, self.passes - self.merged, self.passes)?;
                    // SAFETY: the context is current.
                    unsafe { self.gl.finish() };
                    return Ok(());
                }
                whole.copy_to(to)
            }
            _ => block.copy_to(to),
        }
    }

    /// Takes a pass in that lies in host memory.
    ///
    /// # Errors
    /// As [`Mean::add`].
    pub fn add_image(&mut self, image: &Image) -> Result<()> {
        self.upload(image);
        self.add(self.upload, image.width, image.height)
    }

    /// Replaces rows of the first pass, from and to each, by what a picture of another size has there, interpolated.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver reports an error.
    pub fn patch(&self, from: Texture, rows: &[[u32; 2]]) -> Result<()> {
        let Some((width, height, target)) = &self.block else { return Ok(()) };
        self.patch.activate();
        self.patch.set_texels("whole", &[*width as f32, *height as f32, 1.0]);
        self.patch.bind("pass", glow::TEXTURE_2D, from);
        smooth(&self.gl);
        target.draw_rows(&self.patch, rows)
    }

    /// Fills rows that the first pass lacks, from and to each, with what lies between the rows around them. `pass` is that
    /// pass; none where it came from host memory.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver reports an error.
    pub fn bridge(&self, pass: Option<Texture>, rows: &[[u32; 2]]) -> Result<()> {
        let Some((_, height, target)) = &self.block else { return Ok(()) };
        let mut rows = rows.to_vec();
        rows.sort_unstable();
        self.bridge.activate();
        self.bridge.bind("pass", glow::TEXTURE_2D, pass.unwrap_or(self.upload));
        for gap in rows.chunk_by(|one, next| one[1] == next[0]) {
            let (from, to) = (gap[0][0], gap[gap.len() - 1][1]);
            // At an edge of the picture there is one row only.
            let (above, below) = (from.checked_sub(1).unwrap_or(to), if to < *height { to } else { from - 1 });
            self.bridge.set_texels("gap", &[above as f32, below as f32, 0.0]);
            target.draw_rows(&self.bridge, &[[from, to]])?;
        }
        Ok(())
    }

    /// The same as [`Mean::patch`] from a picture in host memory.
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
        let Some((width, height, block)) = &self.block else { return Ok(()) };
        if picture.target.as_ref().is_none_or(|(w, h, _)| (w, h) != (width, height)) {
            picture.target = None;
            let target = Target::new(&self.gl, *width, *height, false)?;
            target.smooth();
            picture.target = Some((*width, *height, target));
        }
        let Some((_, _, to)) = &picture.target else { return Ok(()) };
        self.combine(block, to)
    }

    /// The mean on the host.
    ///
    /// # Errors
    /// [`Error::Failed`] before the first pass.
    pub fn read(&self) -> Result<Image> {
        let Some((width, height, block)) = &self.block else {
            return Err(Error::Failed("there is no picture yet".into()));
        };
        let target = Target::new(&self.gl, *width, *height, false)?;
        self.combine(block, &target)?;
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
    /// No picture yet: its texture is made by the first one.
    pub fn empty() -> Picture {
        Picture { target: None }
    }

    /// Texture, width and height.
    pub fn texture(&self) -> Option<(Texture, u32, u32)> {
        self.target.as_ref().map(|(width, height, target)| (target.texture(), *width, *height))
    }
}
