//! Pixel buffer objects: memory of the driver's, from which textures are filled.

use glow::HasContext;

use super::Functions;
use crate::error::{Error, Result};

/// A buffer whose content becomes texels; deleted when dropped.
pub struct PixelBuffer {
    gl: Functions,
    handle: glow::NativeBuffer,
    bytes: usize,
}

impl PixelBuffer {
    /// Empty, on the current context.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver gives no buffer.
    pub fn new(gl: &Functions) -> Result<PixelBuffer> {
        // SAFETY: the context is current; the buffer is owned by the result.
        let handle = unsafe { gl.create_buffer() }.map_err(|e| Error::Device(format!("OpenGL: pixel buffer: {e}")))?;
        Ok(PixelBuffer { gl: gl.clone(), handle, bytes: 0 })
    }

    /// Lets `write` overwrite `bytes` bytes, and leaves the buffer bound for the texture that reads them.
    ///
    /// # Errors
    /// [`Error::Device`] when memory is out, and those of `write`.
    pub fn write(&mut self, bytes: usize, write: impl FnOnce(&mut [u8]) -> Result<()>) -> Result<()> {
        let gl = &self.gl;
        // SAFETY: the context is current; the mapping has the size asked for, is checked, and is written only before
        // it is undone.
        unsafe {
            gl.bind_buffer(glow::PIXEL_UNPACK_BUFFER, Some(self.handle));
            if bytes == 0 {
                return Ok(());
            }
            // Fresh storage each time, so that nothing waits for a texture that still reads the last one.
            self.bytes = bytes.max(self.bytes);
            gl.buffer_data_size(glow::PIXEL_UNPACK_BUFFER, self.bytes as i32, glow::STREAM_DRAW);
            let access = glow::MAP_WRITE_BIT | glow::MAP_INVALIDATE_BUFFER_BIT;
            let address = gl.map_buffer_range(glow::PIXEL_UNPACK_BUFFER, 0, bytes as i32, access);
            if address.is_null() {
                self.unbind();
                return Err(Error::Device(format!("OpenGL: no pixel buffer of {bytes} bytes")));
            }
            let written = write(std::slice::from_raw_parts_mut(address, bytes));
            gl.unmap_buffer(glow::PIXEL_UNPACK_BUFFER);
            if written.is_err() {
                self.unbind();
            }
            written
        }
    }

    /// Textures are filled from host memory again.
    pub fn unbind(&self) {
        // SAFETY: the context is current.
        unsafe { self.gl.bind_buffer(glow::PIXEL_UNPACK_BUFFER, None) }
    }

    /// How many bytes it holds.
    pub fn bytes(&self) -> usize {
        self.bytes
    }
}

impl Drop for PixelBuffer {
    fn drop(&mut self) {
        // SAFETY: the context outlives its objects: whoever owns both drops it last.
        unsafe { self.gl.delete_buffer(self.handle) }
    }
}
