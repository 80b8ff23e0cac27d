//! Tables as RGB32F textures, read with GL_NEAREST.
//!
//! Rectangles: they have one level and are addressed by texel, so that a shader may ask the sampler for a texel's centre
//! where that is the faster way (`shim.glsl`).

use bytemuck::Pod;
use glow::{HasContext, PixelUnpackData};

use super::{Functions, PixelBuffer, Program, checked};
use crate::device::live_objects::{Api, Counted};
use crate::error::{Error, Result};
use crate::records::{Record, TEXEL, TextureShape};

/// Rows that may lie idle in any image: 1.5 MB.
const IDLE_ROWS: u32 = 64;

/// Whether a table of one shape can lie in an image of another: rows are as wide, and not too much of it would lie idle.
/// Tables of views that move change their length in every picture, and drivers take their time to make an image.
fn serves(image: TextureShape, table: TextureShape) -> bool {
    let idle = image.height.checked_sub(table.height);
    image.width == table.width && idle.is_some_and(|idle| idle <= table.height.max(IDLE_ROWS))
}

/// A table of records; deleted when dropped.
pub struct TableTexture {
    gl: Functions,
    handle: glow::NativeTexture,
    shape: Option<TextureShape>,
    width_log2: u32,
    /// How often it was filled.
    pub uploads: u64,
    _counted: Counted,
}

impl TableTexture {
    /// An empty table whose rows are at most `1 << width_log2` texels wide.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver gives no texture.
    pub fn new(gl: &Functions, width_log2: u32) -> Result<TableTexture> {
        // SAFETY: the context is current; the texture is owned by the result.
        unsafe {
            let handle = gl.create_texture().map_err(|e| Error::Device(format!("OpenGL: texture: {e}")))?;
            gl.bind_texture(glow::TEXTURE_RECTANGLE, Some(handle));
            for (name, value) in [
                (glow::TEXTURE_MIN_FILTER, glow::NEAREST),
                (glow::TEXTURE_MAG_FILTER, glow::NEAREST),
                (glow::TEXTURE_WRAP_S, glow::CLAMP_TO_EDGE),
                (glow::TEXTURE_WRAP_T, glow::CLAMP_TO_EDGE),
            ] {
                gl.tex_parameter_i32(glow::TEXTURE_RECTANGLE, name, value as i32);
            }
            Ok(TableTexture {
                gl: gl.clone(),
                handle,
                shape: None,
                width_log2,
                uploads: 0,
                _counted: Counted::new(Api::OpenGl),
            })
        }
    }

    /// Replaces the table's records. The host's bytes go to the driver as they are: whole rows, then what is left.
    ///
    /// # Errors
    /// [`Error::Device`] when the table is larger than the driver's textures, or memory is out.
    pub fn fill<R: Record>(&mut self, records: &[R]) -> Result<()> {
        self.fill_texels::<f32>(bytemuck::cast_slice(records))
    }

    /// The same for loose floats, three a texel.
    ///
    /// # Errors
    /// As [`TableTexture::fill`].
    pub fn fill_texels<F: Pod>(&mut self, texels: &[F]) -> Result<()> {
        let floats: &[f32] = bytemuck::cast_slice(texels);
        self.allocate(floats.len() / TEXEL)?;
        self.fill_from(floats.len() / TEXEL, |first, texels| {
            PixelUnpackData::Slice(Some(bytemuck::cast_slice(&floats[first * TEXEL..(first + texels) * TEXEL])))
        })
    }

    /// The same from a pixel buffer object, into which `write` puts the texels: for records that lie on the GPU, which
    /// come and go by DMA this way.
    ///
    /// # Errors
    /// As [`TableTexture::fill`], and those of `write`.
    pub fn fill_through(
        &mut self,
        buffer: &mut PixelBuffer,
        texels: usize,
        write: impl FnOnce(&mut [u8]) -> Result<()>,
    ) -> Result<()> {
        self.allocate(texels)?;
        buffer.write(texels * TEXEL * 4, write)?;
        let filled = self.fill_from(texels, |first, _| PixelUnpackData::BufferOffset((first * TEXEL * 4) as u32));
        buffer.unbind();
        filled
    }

    /// Makes the image for so many texels, where it is not there yet.
    fn allocate(&mut self, texels: usize) -> Result<()> {
        let shape = TextureShape::of(texels, self.width_log2);
        let gl = &self.gl;
        // SAFETY: the context is current, and no pixel buffer is bound: the image's memory is only made.
        unsafe {
            let limit = gl.get_parameter_i32(glow::MAX_RECTANGLE_TEXTURE_SIZE) as u32;
            if shape.height > limit || shape.width > limit {
                return Err(Error::Device(format!(
                    "OpenGL: a table of {texels} texels needs a texture of {} × {}, the driver's limit is {limit}",
                    shape.width, shape.height
                )));
            }
            gl.bind_texture(glow::TEXTURE_RECTANGLE, Some(self.handle));
            if !self.shape.is_some_and(|have| serves(have, shape)) {
                gl.tex_image_2d(
                    glow::TEXTURE_RECTANGLE,
                    0,
                    glow::RGB32F as i32,
                    shape.width as i32,
                    shape.height as i32,
                    0,
                    glow::RGB,
                    glow::FLOAT,
                    PixelUnpackData::Slice(None),
                );
                self.shape = Some(shape);
            }
        }
        Ok(())
    }

    /// Whole rows, then what is left; `part` gives so many texels from the first on.
    fn fill_from<'a>(&mut self, texels: usize, part: impl Fn(usize, usize) -> PixelUnpackData<'a>) -> Result<()> {
        let width = TextureShape::of(texels, self.width_log2).width as usize;
        let gl = &self.gl;
        // SAFETY: the context is current; every part has exactly the size of the rows it fills, checked by `TextureShape`.
        unsafe {
            gl.bind_texture(glow::TEXTURE_RECTANGLE, Some(self.handle));
            gl.pixel_store_i32(glow::UNPACK_ALIGNMENT, 4);
            let rows = texels / width;
            for (y, columns, rows) in [(0, width, rows), (rows, texels % width, 1)] {
                if columns * rows > 0 {
                    gl.tex_sub_image_2d(
                        glow::TEXTURE_RECTANGLE,
                        0,
                        0,
                        y as i32,
                        columns as i32,
                        rows as i32,
                        glow::RGB,
                        glow::FLOAT,
                        part(y * width, columns * rows),
                    );
                }
            }
            checked(gl, format!("upload of {texels} texels"))?;
        }
        self.uploads += 1;
        Ok(())
    }

    /// Binds the table to a sampler of the active program, where that reads it.
    pub fn bind(&self, program: &Program, sampler: &str) {
        program.bind(sampler, glow::TEXTURE_RECTANGLE, self.handle);
    }

    /// Bytes on the device, padding included.
    pub fn bytes(&self) -> usize {
        self.shape.map_or(0, |shape| shape.texels() * TEXEL * 4)
    }
}

impl Drop for TableTexture {
    fn drop(&mut self) {
        // SAFETY: the context outlives its objects: whoever owns both drops it last.
        unsafe { self.gl.delete_texture(self.handle) }
    }
}
