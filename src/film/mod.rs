//! Images of linear radiance: pixels, the stated tone map, and the way to and from PNG and EXR files.
//!
//! **Tone map.** A radiance L becomes the display value `sRGB(clamp(2^EV · L, 0, 1))`, each channel alone, with the
//! transfer function of IEC 61966-2-1; PNG rounds it to the nearest of 256 steps. There is no curve and no white
//! balance, so a value below white can be taken back to radiance. EXR holds radiance itself; exposure never touches it.

use std::path::Path;

use crate::error::{Error, Result};

mod accumulator;
mod exr_file;
mod heat_map;
pub mod metrics;
mod output;
mod png_file;

pub use accumulator::{Accumulator, REPLICATES, STUDENT_90, fnv1a};
pub use exr_file::{ExrFile, load_exr};
pub use heat_map::{HEAT_MAP_DECADES, HEAT_MAP_WHITE, heat_map};
pub use output::{Format, check_directory, check_distinct, check_output, finish_writing, write_beside};

/// Most pixels that a file may hold to be read, 2²⁸ (16384²): a corrupt header shall not ask for all memory.
const MAX_PIXELS: u64 = 1 << 28;

/// A picture of linear Rec. 709 radiance, W·m⁻²·sr⁻¹.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Pixels in a row.
    pub width: u32,
    /// Rows of pixels.
    pub height: u32,
    /// Row after row, row 0 at the top; `width · height` of them.
    pub pixels: Vec<[f32; 3]>,
}

/// A named plane of values that goes into an EXR beside red, green and blue, such as a standard error.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// As it shall appear in the file, such as `stderr.R`; not R, G or B.
    pub name: String,
    /// Row after row from the top, one a pixel.
    pub samples: Vec<f32>,
}

/// What goes into a file beside the pixels.
#[derive(Clone, Copy, Debug, Default)]
pub struct SaveOptions<'a> {
    /// Exposure value of the tone map (PNG only): radiance is scaled by 2^EV.
    pub exposure: f32,
    /// Scene, backend, seed … as `name = value` lines of the `comments` attribute (EXR only; PNG has no place for it).
    pub settings: &'a [(String, String)],
    /// Further planes (EXR only).
    pub channels: &'a [Channel],
}

impl Image {
    /// An image of so many pixels, all black.
    pub fn new(width: u32, height: u32) -> Image {
        Image { width, height, pixels: vec![[0.0; 3]; width as usize * height as usize] }
    }

    /// Pixels that `radiance(x, y)` gives, y counted from the top.
    pub fn from_fn(width: u32, height: u32, mut radiance: impl FnMut(u32, u32) -> [f32; 3]) -> Image {
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| radiance(x, y)).collect();
        Image { width, height, pixels }
    }

    /// Takes rows from the top.
    ///
    /// # Errors
    /// [`Error::Failed`] where there are not `width · height` pixels, or none.
    pub fn from_pixels(width: u32, height: u32, pixels: Vec<[f32; 3]>) -> Result<Image> {
        let image = Image { width, height, pixels };
        image.check_shape()?;
        Ok(image)
    }

    /// Radiance of the pixel in column `x` of row `y`, counted from the top left.
    ///
    /// # Panics
    /// Outside the image.
    pub fn at(&self, x: u32, y: u32) -> [f32; 3] {
        assert!(x < self.width && y < self.height, "pixel ({x}, {y}) of a {}x{} image", self.width, self.height);
        self.pixels[y as usize * self.width as usize + x as usize]
    }

    /// How many pixels have a NaN or infinite channel.
    pub fn non_finite(&self) -> usize {
        self.pixels.iter().filter(|pixel| !is_finite(pixel)).count()
    }

    /// Puts `value` in place of every pixel with a NaN or infinite channel and says how many there were. For callers
    /// that would rather have a picture with marked holes than [`Image::save`]'s refusal.
    pub fn replace_non_finite(&mut self, value: [f32; 3]) -> usize {
        let mut count = 0;
        for pixel in self.pixels.iter_mut().filter(|pixel| !is_finite(pixel)) {
            *pixel = value;
            count += 1;
        }
        count
    }

    /// The tone-mapped picture, three bytes a pixel, row after row from the top.
    pub fn to_rgb8(&self, exposure: f32) -> Vec<u8> {
        let scale = exposure.exp2();
        let step = |radiance: f32| (display_value(radiance * scale) * 255.0).round() as u8;
        self.pixels.iter().flat_map(|pixel| pixel.map(step)).collect()
    }

    /// Writes the image beside `path`, then renames it to `path`: the file is whole, the old one, or not there.
    ///
    /// # Errors
    /// [`Error::Usage`] for an extension other than `.png` or `.exr`; [`Error::Failed`] for NaN or infinite values, of which
    /// none is ever written; [`Error::File`] for what the system answers. On every error the target is untouched.
    pub fn save(&self, path: &Path, options: &SaveOptions) -> Result<()> {
        let format = Format::of(path)?;
        self.check_shape()?;
        let bad = self.non_finite();
        if bad > 0 {
            let first = self.pixels.iter().position(|pixel| !is_finite(pixel)).unwrap_or(0);
            let (x, y) = (first % self.width as usize, first / self.width as usize);
            return Err(Error::Failed(format!(
                "{}: not written: {bad} of {} pixels are NaN or infinite, the first at column {x}, row {y}: {:?}",
                path.display(),
                self.pixels.len(),
                self.pixels[first]
            )));
        }
        if !options.exposure.is_finite() {
            return Err(Error::Usage(format!("exposure {}: expected a finite number", options.exposure)));
        }
        match format {
            Format::Png => write_beside(path, |file| png_file::write(self, options.exposure, file)),
            Format::Exr => {
                exr_file::check_channels(self, options.channels)?;
                write_beside(path, |file| exr_file::write(self, options, file))
            }
        }
    }

    /// Reads a PNG (taken as sRGB at exposure 0; an alpha channel is dropped) or an EXR (channels R, G and B; values
    /// as they are, NaN included). What a file is, its first bytes say, not its name.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the file and what is wrong with it.
    pub fn load(path: &Path) -> Result<Image> {
        let bytes = std::fs::read(path).map_err(|error| unreadable(path, error))?;
        match bytes.as_slice() {
            [0x76, 0x2f, 0x31, 0x01, ..] => Ok(exr_file::read(path, &bytes)?.image),
            [0x89, b'P', b'N', b'G', ..] => png_file::read(path, &bytes),
            [] => Err(unreadable(path, "the file is empty, expected a PNG or an EXR image")),
            _ => Err(unreadable(path, "neither a PNG nor an EXR image")),
        }
    }

    /// Demands `other` to have the same width and height.
    ///
    /// # Errors
    /// [`Error::Usage`] with both sizes.
    pub fn check_same_size(&self, other: &Image) -> Result<()> {
        self.check_shape()?;
        other.check_shape()?;
        if (self.width, self.height) == (other.width, other.height) {
            return Ok(());
        }
        Err(Error::Usage(format!(
            "images differ in size: {}x{} and {}x{}",
            self.width, self.height, other.width, other.height
        )))
    }

    /// The public fields can be set apart from each other, so every way out checks them.
    fn check_shape(&self) -> Result<()> {
        if !self.pixels.is_empty() && self.pixels.len() == self.width as usize * self.height as usize {
            return Ok(());
        }
        Err(Error::Failed(format!("a {}x{} image with {} pixels", self.width, self.height, self.pixels.len())))
    }
}

/// The sRGB transfer function on a value clamped to [0, 1]; NaN gives 0.
pub fn display_value(linear: f32) -> f32 {
    // max drops a NaN, which clamp would keep.
    let linear = linear.max(0.0).clamp(0.0, 1.0);
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Linear value of an sRGB display value in [0, 1]: the inverse of [`display_value`].
pub fn linear_value(display: f32) -> f32 {
    if display <= 0.040_45 { display / 12.92 } else { ((display + 0.055) / 1.055).powf(2.4) }
}

fn is_finite(pixel: &[f32; 3]) -> bool {
    pixel.iter().all(|channel| channel.is_finite())
}

/// A picture given by the user that cannot be read is bad input: exit code 2.
fn unreadable(path: &Path, what: impl std::fmt::Display) -> Error {
    Error::Usage(format!("{}: cannot read the image: {what}", path.display()))
}

/// Refuses sizes that only a corrupt file has, before memory is asked for.
fn check_pixel_count(path: &Path, width: u64, height: u64) -> Result<()> {
    if width.saturating_mul(height) <= MAX_PIXELS {
        return Ok(());
    }
    Err(unreadable(path, format!("{width}x{height} pixels, expected at most {MAX_PIXELS} in all")))
}

#[cfg(test)]
mod tests;
