//! How far one image is from another. All sums are in double precision.
//!
//! A pixel where either image is NaN or infinite differs without bound: it makes every error infinite, so that no
//! bound holds by accident (`NaN > bound` is false, and `f32::max` drops a NaN).
//!
//! FLIP is left out: the one crate for it (`nv-flip`, last released in 2023) builds a C++ library, and a C++ compiler
//! is more than a fresh machine needs for all the rest.

use serde::Serialize;

use crate::error::{Error, Result};
use crate::film::{Image, display_value};

mod flips;

pub use flips::{edge_pixels, flipped_pixels};

/// Pixels in an image's order; `true` is one that stands out, and is left out of [`measure_except`].
pub type Mask = Vec<bool>;

/// How far two values may lie apart: `|a − b| ≤ abs + rel · max(|a|, |b|)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Within {
    /// In the values' unit.
    pub abs: f64,
    /// As a share of the larger value.
    pub rel: f64,
}

impl Within {
    /// Whether two pixels lie apart in some channel; NaN and infinity are apart from everything.
    pub fn apart(&self, a: [f32; 3], b: [f32; 3]) -> bool {
        a.iter().zip(&b).any(|(&a, &b)| {
            let (a, b) = (f64::from(a), f64::from(b));
            // Infinite difference against infinite bound is NaN or false: ask for finiteness first.
            !(a - b).is_finite() || (a - b).abs() > self.abs + self.rel * a.abs().max(b.abs())
        })
    }
}

/// What [`measure`] finds; x is the image, r the reference; means run over pixels and channels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Metrics {
    /// Root mean square error √mean((x−r)²), radiance.
    pub rmse: f64,
    /// Mean absolute error mean(|x−r|), radiance.
    pub mae: f64,
    /// Largest |x−r|, radiance.
    pub max_abs: f64,
    /// Relative mean square error mean((x−r)²/(r²+0.01)).
    pub rel_mse: f64,
    /// Symmetric mean absolute percentage error mean(2|x−r|/(|x|+|r|)), from 0 to 2; 0/0 counts as 0.
    pub smape: f64,
    /// Peak signal-to-noise ratio −10·log₁₀(mean square error) of the display values in [0, 1] that
    /// [`film`](crate::film)'s tone map gives, unrounded, dB. Infinite for equal images (`null` in JSON).
    pub psnr: f64,
    /// Pixels with a channel that is not [`Within`] the tolerance.
    pub pixels_over: usize,
    /// Pixels where either image is NaN or infinite.
    pub non_finite: usize,
    /// Pixels measured: all but the excluded.
    pub pixels: usize,
}

/// What [`measure`] needs to know beside the images.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// What [`Metrics::pixels_over`] lets pass.
    pub tolerance: Within,
    /// Exposure value of the tone map before [`Metrics::psnr`]: radiance is scaled by 2^EV.
    pub exposure: f32,
}

impl Default for Settings {
    fn default() -> Settings {
        // 1e-5: what float32 code of another compiler may differ by after a few dozen operations (an ulp is 6e-8).
        Settings { tolerance: Within { abs: 1e-5, rel: 1e-5 }, exposure: 0.0 }
    }
}

/// Compares an image with a reference, pixel by pixel.
///
/// # Errors
/// [`Error::Usage`] for images of different size.
pub fn measure(image: &Image, reference: &Image, settings: &Settings) -> Result<Metrics> {
    image.check_same_size(reference)?;
    sum_up(image.pixels.iter().zip(&reference.pixels), settings)
}

/// As [`measure`], without the pixels that are `true` in `excluded`.
///
/// # Errors
/// [`Error::Usage`] for images of different size; [`Error::Failed`] for a mask of another size, or one that leaves no
/// pixel (which would otherwise pass every bound).
pub fn measure_except(image: &Image, reference: &Image, excluded: &Mask, settings: &Settings) -> Result<Metrics> {
    image.check_same_size(reference)?;
    if excluded.len() != image.pixels.len() {
        return Err(Error::Failed(format!("a mask of {} for {} pixels", excluded.len(), image.pixels.len())));
    }
    let pairs = image.pixels.iter().zip(&reference.pixels);
    sum_up(pairs.zip(excluded).filter(|(_, excluded)| !**excluded).map(|(pair, _)| pair), settings)
}

fn sum_up<'a>(pairs: impl Iterator<Item = (&'a [f32; 3], &'a [f32; 3])>, settings: &Settings) -> Result<Metrics> {
    let scale = settings.exposure.exp2();
    let [mut squares, mut absolutes, mut relative_squares, mut symmetric, mut display_squares] = [0.0f64; 5];
    let [mut pixels, mut pixels_over, mut non_finite] = [0usize; 3];
    let mut max_abs = 0.0f64;
    for (x, r) in pairs {
        pixels += 1;
        pixels_over += usize::from(settings.tolerance.apart(*x, *r));
        if x.iter().chain(r).any(|channel| !channel.is_finite()) {
            non_finite += 1;
            continue;
        }
        for (&x, &r) in x.iter().zip(r) {
            let display = f64::from(display_value(x * scale)) - f64::from(display_value(r * scale));
            display_squares += display * display;
            let (x, r) = (f64::from(x), f64::from(r));
            let error = (x - r).abs();
            squares += error * error;
            absolutes += error;
            relative_squares += error * error / (r * r + 0.01); // 0.01: a radiance of 0.1 and below is dark
            symmetric += if error > 0.0 { 2.0 * error / (x.abs() + r.abs()) } else { 0.0 };
            max_abs = max_abs.max(error);
        }
    }
    if pixels == 0 {
        return Err(Error::Failed("no pixel is left to compare: all are excluded".to_owned()));
    }
    let samples = 3.0 * pixels as f64;
    let mean = |sum: f64| {
        if non_finite == 0 { sum / samples } else { f64::INFINITY }
    };
    Ok(Metrics {
        rmse: mean(squares).sqrt(),
        mae: mean(absolutes),
        max_abs: if non_finite == 0 { max_abs } else { f64::INFINITY },
        rel_mse: mean(relative_squares),
        smape: mean(symmetric),
        psnr: -10.0 * mean(display_squares).log10(),
        pixels_over,
        non_finite,
        pixels,
    })
}

#[cfg(test)]
mod tests;
