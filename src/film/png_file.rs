//! PNG: 8 bits a channel, sRGB.

use std::io::{self, Cursor, Write};
use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageFormat, ImageReader};

use super::{Image, check_pixel_count, linear_value, unreadable};
use crate::error::Result;

/// The tone-mapped picture.
pub(super) fn write(image: &Image, exposure: f32, file: &mut impl Write) -> io::Result<()> {
    PngEncoder::new(file)
        .write_image(&image.to_rgb8(exposure), image.width, image.height, ExtendedColorType::Rgb8)
        .map_err(io::Error::other)
}

/// Any bit depth; gray becomes RGB.
pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Image> {
    let reader = || ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
    let (width, height) = reader().into_dimensions().map_err(|error| unreadable(path, error))?;
    check_pixel_count(path, width.into(), height.into())?;
    let decoded = reader().decode().map_err(|error| unreadable(path, error))?;
    // 16 bits hold 8 exactly: v · 257 / 65535 = v / 255.
    let pixels =
        decoded.into_rgb16().pixels().map(|pixel| pixel.0.map(|v| linear_value(f32::from(v) / 65535.0))).collect();
    Image::from_pixels(width, height, pixels)
}
