//! Progressive passes: pictures of few photons each, whose mean converges to the right one.
//!
//! What a pass is made of depends on its index alone: its photons, its subpixel positions, its radius (Knaus & Zwicker,
//! "Progressive Photon Mapping: A Probabilistic Approach", ACM TOG 2011). Passes are therefore independent and can be
//! summed in any grouping; a stopped render goes on to the same bytes as another.
//!
//! Pass i belongs to replicate i mod 8. Each replicate has a random shift of its own and goes on in one low-discrepancy
//! sequence, so that its error falls faster than with independent passes, and the spread of the replicates tells the
//! error without a reference.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::film::{Accumulator, Channel, Image, REPLICATES, STUDENT_90};
use crate::pipeline::fingerprint::fingerprint;
use crate::pipeline::{Pipeline, Rendering};
use crate::rays::random::hash2_u;
use crate::records::MAX_EXACT_INDEX;
use crate::scene::Scene;
use crate::settings::{Amount, Pass, Settings};
use crate::techniques::{self, Mean};

/// An unfinished picture.
pub struct Progressive {
    settings: Settings,
    sums: Accumulator,
}

/// How wrong a picture is, as far as it can tell by itself.
pub struct Estimate {
    /// Standard error of each pixel's mean, W·m⁻²·sr⁻¹ per channel.
    pub standard_error: Vec<[f32; 3]>,
    /// Bias of the mean, where the technique has any and can tell it; else empty.
    pub bias: Vec<[f32; 3]>,
    /// Mean over all pixels of (standard error + |bias|) / radiance, in luminance.
    pub relative: f64,
}

impl Progressive {
    /// Without passes.
    ///
    /// # Errors
    /// [`Error::Usage`] for pictures beyond 2²⁸ pixels.
    pub fn new(scene: &Scene, settings: &Settings) -> Result<Progressive> {
        let (width, height) = (settings.width, settings.height);
        if u64::from(width) * u64::from(height) > 1 << 28 {
            return Err(Error::Usage(format!("{width}x{height} pixels in passes: expected at most 2^28")));
        }
        let sums = Accumulator::new((width, height), fingerprint(scene, settings));
        Ok(Progressive { settings: settings.clone(), sums })
    }

    /// Goes on from what was saved.
    ///
    /// # Errors
    /// [`Error::Usage`] if it belongs to another scene or to other settings.
    pub fn resume(scene: &Scene, settings: &Settings, saved: Accumulator) -> Result<Progressive> {
        let fresh = Progressive::new(scene, settings)?;
        if !saved.continues(&fresh.sums) {
            let ((width, height), passes) = (saved.size(), saved.passes());
            return Err(Error::Usage(format!(
                "found {width}x{height} pixels after {passes} passes, expected an image of the same scene and settings"
            )));
        }
        Ok(Progressive { sums: saved, ..fresh })
    }

    /// What is saved in a checkpoint.
    pub fn sums(&self) -> &Accumulator {
        &self.sums
    }

    /// Passes so far.
    pub fn passes(&self) -> u64 {
        self.sums.passes()
    }

    /// The next pass and its settings, for those who draw it themselves and then [`Progressive::add`] it.
    ///
    /// # Errors
    /// [`Error::Usage`] after 2²⁴ samples a pixel.
    pub fn next_pass(&mut self) -> Result<(Settings, Pass)> {
        let index = self.sums.passes();
        let (replicate, round) = (index % REPLICATES as u64, index / REPLICATES as u64);
        let mut settings = self.settings.clone();
        let first_sample = round * u64::from(settings.samples);
        if first_sample + u64::from(settings.samples) >= MAX_EXACT_INDEX {
            return Err(Error::Usage(format!("{index} passes: samples can be counted no further in float values")));
        }
        let pass = Pass {
            index: index as u32,
            seed: hash2_u(settings.seed, replicate as u32 + 1),
            round: round as u32,
            first_sample: first_sample as u32,
            jittered: true,
        };
        let row = techniques::asked(&self.settings);
        (row.of_pass)(&mut settings, index, self.bias_sums());
        Ok((settings, pass))
    }

    /// The sums that the technique estimates its bias from.
    fn bias_sums(&mut self) -> &mut [f64] {
        let (width, height) = self.sums.size();
        let pixels = width as usize * height as usize;
        let count = techniques::asked(&self.settings).bias.as_ref().map_or(0, |bias| (bias.sums)(pixels));
        self.sums.extras(count).unwrap_or_default()
    }

    /// Renders a few pixels of a pass and forgets them: drivers finish their compilation at a program's first use.
    ///
    /// # Errors
    /// As [`Progressive::step`].
    pub fn warm_up(&mut self, pipeline: &mut Pipeline, scene: &Scene) -> Result<Rendering> {
        let (mut settings, pass) = self.next_pass()?;
        (settings.width, settings.height) = (settings.width.min(16), settings.height.min(16));
        if let Amount::Paths(paths) = &mut settings.photons.amount {
            *paths = (*paths).min(1024);
        }
        pipeline.render_pass(scene, &settings, &pass)
    }

    /// Renders one more pass.
    ///
    /// # Errors
    /// As [`Pipeline::render`]; [`Error::Usage`] after 2²⁴ samples a pixel.
    pub fn step(&mut self, pipeline: &mut Pipeline, scene: &Scene) -> Result<Rendering> {
        let (settings, pass) = self.next_pass()?;
        let rendering = pipeline.render_pass(scene, &settings, &pass)?;
        self.add(&rendering);
        Ok(rendering)
    }

    /// Takes in the pass that [`Progressive::next_pass`] asked for, image included.
    pub fn add(&mut self, rendering: &Rendering) {
        let index = self.sums.passes();
        if let (Some(bias), Some(radius)) = (&techniques::asked(&self.settings).bias, rendering.radius) {
            (bias.add)(self.bias_sums(), index, radius, &rendering.image);
        }
        self.sums.add(rendering.image.pixels.iter().flatten().map(|value| f64::from(*value)));
    }

    /// The mean of the passes.
    ///
    /// # Errors
    /// [`Error::Failed`] before the first pass.
    pub fn image(&self) -> Result<Image> {
        let (width, height) = self.sums.size();
        let mean = self.sums.mean().ok_or_else(|| Error::Failed("no pass was finished".into()))?;
        Image::from_pixels(width, height, mean.iter().map(|m| m.as_vec3().to_array()).collect())
    }

    /// How wrong the picture is; `None` before every replicate has a pass.
    pub fn estimate(&mut self) -> Option<Estimate> {
        let (mean, standard_error) = self.sums.image()?;
        let (passes, size) = (self.sums.passes(), self.sums.size());
        let bias = match &techniques::asked(&self.settings).bias {
            Some(bias) => (bias.estimate)(self.bias_sums(), &Mean { pixels: &mean, passes, size }),
            None => Vec::new(),
        };
        let luminance = DVec3::new(0.2126, 0.7152, 0.0722);
        let (mut total, mut lit) = (0.0, 0u64);
        for (i, (mean, error)) in mean.iter().zip(&standard_error).enumerate() {
            let radiance = luminance.dot(*mean);
            if radiance > 0.0 {
                let wrong = *error + bias.get(i).map_or(DVec3::ZERO, |b| b.abs());
                total += luminance.dot(wrong) / radiance;
                lit += 1;
            }
        }
        let narrow = |v: &DVec3| v.as_vec3().to_array();
        Some(Estimate {
            standard_error: standard_error.iter().map(narrow).collect(),
            bias: bias.iter().map(narrow).collect(),
            relative: if lit > 0 { total / lit as f64 } else { 0.0 },
        })
    }
}

/// Half-width of the interval that holds the truth of 90% of the pixels, per channel.
pub fn bound_90(estimate: &Estimate, pixel: usize, channel: usize) -> f32 {
    let bias = estimate.bias.get(pixel).map_or(0.0, |bias| bias[channel].abs());
    STUDENT_90 as f32 * estimate.standard_error[pixel][channel] + bias
}

/// The planes of an estimate that go into an EXR beside the mean.
pub fn channels(estimate: &Estimate) -> Vec<Channel> {
    let planes = [("stderr", &estimate.standard_error), ("bias", &estimate.bias)];
    let named = planes.into_iter().filter(|(_, values)| !values.is_empty()).flat_map(|(name, values)| {
        ["R", "G", "B"].into_iter().enumerate().map(move |(index, channel)| Channel {
            name: format!("{name}.{channel}"),
            samples: values.iter().map(|value| value[index]).collect(),
        })
    });
    named.collect()
}
