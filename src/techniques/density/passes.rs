//! Passes of density estimates: each blurs over a disc of its own radius, which shrinks from pass to pass, and how they
//! depend on it tells the bias of their mean.

use glam::DVec3;

use super::super::Mean;
use crate::film::Image;
use crate::settings::{Method, Settings};

/// The radius of pass i falls such that variance per pass grows as i^(1−α), and so does what is summed of it as i^−α
/// with the squared bias: 2/3 makes both fall alike (Knaus & Zwicker 2011, §5).
const ALPHA: f64 = 2.0 / 3.0;

/// Sums that come before those of pixels: the first radius, Σs, Σs²; then Σs·L per value, s = (R_i/R_1)².
const HEAD: usize = 3;

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

/// The radius of a pass, and a method that no pass chooses anew.
pub fn of_pass(settings: &mut Settings, index: u64, sums: &[f64]) {
    let first_radius = sums.first().copied().unwrap_or(0.0);
    if index > 0 && first_radius > 0.0 {
        settings.gather.radius = Some((first_radius * radius_factor(index)) as f32);
    }
    // Which method is the fastest changes from map to map, and with it the order of sums: bytes would depend on where a
    // render was stopped.
    if settings.gather.method == Method::Auto {
        settings.gather.method = Method::Grid;
    }
}

/// How many sums there are for so many pixels.
pub fn sums(pixels: usize) -> usize {
    HEAD + 3 * pixels
}

/// Takes in a pass that was made with this radius.
pub fn add(sums: &mut [f64], index: u64, radius: f32, image: &Image) {
    if sums.len() < HEAD {
        return; // a checkpoint without them
    }
    let scale = radius_factor(index).powi(2);
    if index == 0 {
        sums[0] = f64::from(radius);
    }
    sums[1] += scale;
    sums[2] += scale * scale;
    for (sum, value) in sums[HEAD..].iter_mut().zip(image.pixels.iter().flatten()) {
        *sum += f64::from(*value) * scale;
    }
}

/// L_i = L + b·s_i + noise: the bias of the mean is b times the mean of s. A pixel alone knows its b badly; bias is as
/// smooth as the disc of radius R, so the mean over a few pixels around knows it well.
pub fn bias(sums: &[f64], mean: &Mean) -> Vec<DVec3> {
    const REACH: usize = 4;
    let (passes, (width, height)) = (mean.passes as f64, mean.size);
    if sums.len() < HEAD {
        return Vec::new();
    }
    let (sum, squares) = (sums[1], sums[2]);
    let spread = squares - sum * sum / passes;
    if spread <= 1e-12 * squares {
        return Vec::new();
    }
    let of = |(mean, weighted): (&DVec3, &[f64])| (DVec3::from_slice(weighted) - *mean * sum) / spread * (sum / passes);
    let raw: Vec<DVec3> = mean.pixels.iter().zip(sums[HEAD..].chunks_exact(3)).map(of).collect();
    box_blur(&raw, width as usize, height as usize, REACH)
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
