//! A reference image as OpenEXR: radiance in R, G, B and its standard error in stderr.R, stderr.G, stderr.B.

use std::path::Path;

use super::Reference;
use crate::error::Result;
use crate::film::{Channel, Image, SaveOptions};

impl Reference {
    /// Write float32 channels R, G, B, stderr.R, stderr.G and stderr.B to `path`, beside it first and then renamed.
    ///
    /// `settings`: what made the image, as `name = value` lines of the file's comments.
    ///
    /// # Errors
    /// As [`Image::save`]: another extension than `.exr`, values beyond float32, a file that cannot be written.
    pub fn write_exr(&self, path: &Path, settings: &[(String, String)]) -> Result<()> {
        let (width, height) = self.size;
        let image = Image::from_pixels(width, height, self.mean.iter().map(|m| m.as_vec3().to_array()).collect())?;
        let channels = ["stderr.R", "stderr.G", "stderr.B"].into_iter().enumerate().map(|(index, name)| Channel {
            name: name.into(),
            samples: self.standard_error.iter().map(|error| error[index] as f32).collect(),
        });
        let channels: Vec<_> = channels.collect();
        image.save(path, &SaveOptions { settings, channels: &channels, ..SaveOptions::default() })
    }
}
