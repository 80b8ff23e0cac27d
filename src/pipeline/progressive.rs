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
use crate::film::{Accumulator, Channel, Image, REPLICATES, STUDENT_90, fnv1a};
use crate::pipeline::{Pipeline, Rendering};
use crate::rays::random::hash2_u;
use crate::records::MAX_EXACT_INDEX;
use crate::scene::Scene;
use crate::settings::{Amount, Method, Settings, Technique};

/// The radius of pass i falls such that variance per pass grows as i^(1−α), and so does what is summed of it as i^−α
/// with the squared bias: 2/3 makes both fall alike (Knaus & Zwicker 2011, §5).
const ALPHA: f64 = 2.0 / 3.0;

/// R_i / R_1 of pass `index`, counted from 0: √∏ (j + α)/(j + 1) over j = 1 … index.
///
/// The product is Γ(i + α)/(Γ(1 + α) Γ(i + 1)) with i = index + 1.
pub fn radius_factor(index: u64) -> f64 {
    // Exact for the first passes; then Stirling's ratio, whose relative error is below 1e-9 from there on.
    let exact = index.min(1 << 12);
    let product: f64 = (1..=exact).map(|j| (j as f64 + ALPHA) / (j as f64 + 1.0)).product();
    let ratio = |i: f64| i.powf(ALPHA - 1.0) * (1.0 + (ALPHA - 1.0) * ALPHA / (2.0 * i));
    (product * ratio(index as f64 + 1.0) / ratio(exact as f64 + 1.0)).sqrt()
}

/// How often texels are halved in pass `index`: what they blur falls with the passes, as the noise does.
pub fn texel_level(index: u64) -> u32 {
    match index {
        0..512 => 0,
        512..8192 => 1,
        _ => 2,
    }
}

/// An unfinished picture.
pub struct Progressive {
    settings: Settings,
    sums: Accumulator,
}

/// How wrong a picture is, as far as it can tell by itself.
pub struct Estimate {
    /// Standard error of each pixel's mean, W·m⁻²·sr⁻¹ per channel.
    pub standard_error: Vec<[f32; 3]>,
    /// Bias of the density estimates, from how the passes depend on their radius. Empty for final gathering.
    pub bias: Vec<[f32; 3]>,
    /// Mean over all pixels of (standard error + |bias|) / radiance, in luminance.
    pub relative: f64,
}

/// Sums besides the accumulator's own: the first radius, Σs, Σs², then Σs·L per value, s = (R_i/R_1)².
const HEAD: usize = 3;

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

    /// The settings of the next pass, for those who draw it themselves and then [`Progressive::add`] it.
    ///
    /// # Errors
    /// [`Error::Usage`] after 2²⁴ samples a pixel.
    pub fn next_settings(&mut self) -> Result<Settings> {
        let index = self.sums.passes();
        let (replicate, turn) = (index % REPLICATES as u64, index / REPLICATES as u64);
        let mut settings = Settings { jittered: true, ..self.settings.clone() };
        settings.seed = hash2_u(self.settings.seed, replicate as u32 + 1);
        let first_sample = turn * u64::from(settings.samples);
        if first_sample + u64::from(settings.samples) >= MAX_EXACT_INDEX {
            return Err(Error::Usage(format!("{index} passes: samples can be counted no further in float values")));
        }
        settings.first_sample = first_sample as u32;
        settings.photons.pass = index as u32;
        if let Technique::FinalGather(gather) = &mut settings.technique {
            gather.turn = turn as u32;
            gather.texels <<= 2 * texel_level(index);
            // As many photons a texel as before: their noise is that of every ray.
            if let Amount::Paths(paths) = &mut settings.photons.amount {
                *paths = paths.saturating_mul(1 << (2 * texel_level(index)));
            }
        } else {
            let first_radius = self.extras().first().copied().unwrap_or(0.0);
            if index > 0 && first_radius > 0.0 {
                settings.gather.radius = Some((first_radius * radius_factor(index)) as f32);
            }
            // Which method is the fastest changes from map to map, and with it the order of sums: bytes would depend
            // on where a render was stopped.
            if settings.gather.method == Method::Auto {
                settings.gather.method = Method::Grid;
            }
        }
        Ok(settings)
    }

    /// The sums that the bias is estimated from.
    fn extras(&mut self) -> &mut [f64] {
        let (width, height) = self.sums.size();
        let count = match self.settings.technique {
            Technique::FinalGather(_) => 0,
            Technique::Map => HEAD + width as usize * height as usize * 3,
        };
        self.sums.extras(count).unwrap_or_default()
    }

    /// Renders a few pixels of a pass and forgets them: drivers finish their compilation at a program's first use.
    ///
    /// # Errors
    /// As [`Progressive::step`].
    pub fn warm_up(&mut self, pipeline: &mut Pipeline, scene: &Scene) -> Result<Rendering> {
        let mut settings = self.next_settings()?;
        (settings.width, settings.height) = (settings.width.min(16), settings.height.min(16));
        if let Amount::Paths(paths) = &mut settings.photons.amount {
            *paths = (*paths).min(1024);
        }
        pipeline.render(scene, &settings)
    }

    /// Renders one more pass.
    ///
    /// # Errors
    /// As [`Pipeline::render`]; [`Error::Usage`] after 2²⁴ samples a pixel.
    pub fn step(&mut self, pipeline: &mut Pipeline, scene: &Scene) -> Result<Rendering> {
        let settings = self.next_settings()?;
        let rendering = pipeline.render(scene, &settings)?;
        self.add(&rendering);
        Ok(rendering)
    }

    /// Takes in the pass that [`Progressive::next_settings`] asked for, image included.
    pub fn add(&mut self, rendering: &Rendering) {
        if let Some(radius) = rendering.radius {
            let index = self.sums.passes();
            let scale = radius_factor(index).powi(2);
            let extras = self.extras();
            if index == 0 {
                extras[0] = f64::from(radius);
            }
            extras[1] += scale;
            extras[2] += scale * scale;
            for (sum, value) in extras[HEAD..].iter_mut().zip(rendering.image.pixels.iter().flatten()) {
                *sum += f64::from(*value) * scale;
            }
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
        let bias = self.bias(&mean);
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

    /// L_i = L + b·s_i + noise: the bias of the mean is b times the mean of s. A pixel alone knows its b badly; bias is
    /// as smooth as the disc of radius R, so the mean over a few pixels around knows it well.
    fn bias(&mut self, mean: &[DVec3]) -> Vec<DVec3> {
        const REACH: usize = 4;
        let passes = self.sums.passes() as f64;
        let (width, height) = self.sums.size();
        let extras = self.extras();
        if extras.len() < HEAD {
            return Vec::new();
        }
        let (sum, squares) = (extras[1], extras[2]);
        let spread = squares - sum * sum / passes;
        if spread <= 1e-12 * squares {
            return Vec::new();
        }
        let of =
            |(mean, weighted): (&DVec3, &[f64])| (DVec3::from_slice(weighted) - *mean * sum) / spread * (sum / passes);
        let raw: Vec<DVec3> = mean.iter().zip(extras[HEAD..].chunks_exact(3)).map(of).collect();
        box_blur(&raw, width as usize, height as usize, REACH)
    }
}

/// Mean over the square of pixels up to `reach` away, rows first, then columns.
fn box_blur(image: &[DVec3], width: usize, height: usize, reach: usize) -> Vec<DVec3> {
    let blur = |count: usize, at: &dyn Fn(usize) -> DVec3| -> Vec<DVec3> {
        (0..count)
            .map(|i| {
                let (low, high) = (i.saturating_sub(reach), (i + reach).min(count - 1));
                (low..=high).map(at).sum::<DVec3>() / (high - low + 1) as f64
            })
            .collect()
    };
    let rows: Vec<DVec3> = (0..height).flat_map(|y| blur(width, &|x| image[y * width + x])).collect();
    let columns: Vec<Vec<DVec3>> = (0..width).map(|x| blur(height, &|y| rows[y * width + x])).collect();
    (0..width * height).map(|i| columns[i % width][i / width]).collect()
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

/// Of all that decides a pass's pixels.
fn fingerprint(scene: &Scene, settings: &Settings) -> u64 {
    let Scene { name: _, camera, materials, lights, shapes, render: _ } = scene;
    // Debug prints every float in full, and any change of a type's fields changes it too.
    fnv1a(format!("passes {camera:?}{materials:?}{lights:?}{shapes:?}{settings:?}").as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radii_follow_knaus_and_zwicker() {
        assert_eq!(radius_factor(0), 1.0);
        assert!((radius_factor(1).powi(2) - (1.0 + ALPHA) / 2.0).abs() < 1e-12);
        // The same product whether it is taken step by step or by Stirling's ratio.
        let step = |i: u64| (i as f64 + ALPHA) / (i as f64 + 1.0);
        for i in [4095, 4096, 4097, 5000, 100_000] {
            let ratio = (radius_factor(i) / radius_factor(i - 1)).powi(2);
            assert!((ratio - step(i)).abs() < 1e-10, "{i}: {ratio} {}", step(i));
        }
        // R² falls as i^(α − 1).
        let slope = (radius_factor(100_000).powi(2) / radius_factor(1000).powi(2)).ln() / 100f64.ln();
        assert!((slope - (ALPHA - 1.0)).abs() < 1e-3, "{slope}");
    }

    #[test]
    fn a_blur_keeps_the_mean_of_a_flat_image_and_spreads_a_point() {
        let flat = vec![DVec3::splat(2.0); 35];
        assert_eq!(box_blur(&flat, 7, 5, 2), flat);
        let mut point = vec![DVec3::ZERO; 81];
        point[40] = DVec3::ONE;
        let blurred = box_blur(&point, 9, 9, 1);
        assert!((blurred[40].x - 1.0 / 9.0).abs() < 1e-15 && (blurred[30].x - 1.0 / 9.0).abs() < 1e-15);
        assert_eq!(blurred[42], DVec3::ZERO);
    }
}
