//! A table's shape as a texture.

/// A table's shape as a texture: records wrap into rows of a power-of-two width.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextureShape {
    /// Texels, a power of two.
    pub width: u32,
    /// Rows; at least 1, since GL has no empty texture.
    pub height: u32,
}

impl TextureShape {
    /// The smallest texture of rows of `1 << width_log2` texels that holds `texels`; narrower if one row suffices.
    pub fn of(texels: usize, width_log2: u32) -> TextureShape {
        let full = 1usize << width_log2;
        let width = texels.max(1).next_power_of_two().min(full);
        TextureShape { width: width as u32, height: texels.div_ceil(width).max(1) as u32 }
    }

    /// Texels in all, padding included.
    pub fn texels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

/// Texture width used everywhere but in `validate`, as a power of two: 4M texels fit in 2048 rows, and every GL 3.3
/// driver takes at least 1024 × 1024 (in practice 8192).
pub const TEXTURE_WIDTH_LOG2: u32 = 11;
