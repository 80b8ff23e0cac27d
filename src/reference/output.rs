//! A reference image as OpenEXR: radiance in R, G, B and its standard error in stderr.R, stderr.G, stderr.B.

use std::path::Path;

use exr::prelude::*;
use glam::DVec3;

use super::Reference;
use super::accumulator::replace_file;
use crate::error::Result as CrateResult;

impl Reference {
    /// Write float32 channels R, G, B, stderr.R, stderr.G and stderr.B to `path`, beside it first and then renamed.
    ///
    /// # Errors
    /// [`Error::File`] if the file cannot be written.
    pub fn write_exr(&self, path: &Path) -> CrateResult<()> {
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        let channel = |name: &str, values: &[DVec3], index: usize| {
            let samples = values.iter().map(|v| v[index] as f32).collect();
            AnyChannel::new(name, FlatSamples::F32(samples))
        };
        let mut channels = SmallVec::new();
        for (index, name) in ["R", "G", "B"].into_iter().enumerate() {
            channels.push(channel(name, &self.mean, index));
            channels.push(channel(&format!("stderr.{name}"), &self.standard_error, index));
        }
        let layer = Layer::new(
            (width, height),
            LayerAttributes::named("reference"),
            Encoding::SMALL_LOSSLESS,
            AnyChannels::sort(channels),
        );
        replace_file(path, |beside| {
            Image::from_layer(layer).write().to_file(beside).map_err(|e| match e {
                exr::error::Error::Io(e) => e,
                other => std::io::Error::other(other.to_string()),
            })
        })
    }
}
