//! Whether two independent images agree within their own noise: the judge of every test of the reference renderer.

use glam::DVec3;

use super::Reference;

/// What a comparison found.
#[derive(Clone, Copy, Debug)]
pub struct Agreement {
    /// RMS over all values of difference over its standard error; near 1 where the images estimate the same thing.
    pub rms_deviation: f64,
    /// Share of values more than 6 standard errors apart: 0.05% by chance at 7 degrees of freedom.
    pub outliers: f64,
    /// The difference of the two images' means per channel, over its standard error: ±2 is chance, ±5 is not.
    pub mean_deviation: DVec3,
    /// The difference of the two images' means per channel.
    pub mean_difference: DVec3,
}

impl Agreement {
    /// Whether chance explains the difference.
    ///
    /// 5.5σ for the means: their errors are known to 7 degrees of freedom a side, so that 3 is no rarity. 1.5 for the
    /// RMS: with 7 degrees of freedom a side it is expected near 1.1, and a thousand pixels scatter by a few percent.
    pub fn holds(&self) -> bool {
        self.means_hold() && self.rms_deviation < 1.5
    }

    /// The same but for 3% of the values, for images with sharp edges: where all of a pixel's samples miss a sliver of
    /// another surface, they agree on a value that is wrong by many of its seeming errors.
    pub fn mostly_holds(&self) -> bool {
        self.means_hold() && self.outliers < 0.03
    }

    /// The same of the means alone, for images whose pixels' errors are far from normal.
    pub fn means_hold(&self) -> bool {
        self.mean_deviation.abs().max_element() < 5.5
    }
}

/// An image and what is known of its errors; those of an exact image are zero.
#[derive(Clone, Copy, Debug)]
pub struct Measured<'a> {
    /// Radiance of each pixel.
    pub values: &'a [DVec3],
    /// Standard error per pixel.
    pub errors: &'a [DVec3],
    /// Standard error of the mean over all pixels.
    pub overall_error: DVec3,
}

impl<'a> From<&'a Reference> for Measured<'a> {
    fn from(image: &'a Reference) -> Self {
        Self { values: &image.mean, errors: &image.standard_error, overall_error: image.overall_error }
    }
}

/// Compare two images of equal size.
///
/// # Panics
/// If the slices differ in length or are empty.
pub fn compare(a: Measured, b: Measured) -> Agreement {
    let count = a.values.len();
    assert!(count > 0 && [a.errors, b.values, b.errors].iter().all(|s| s.len() == count), "images of one size");
    let mut difference = DVec3::ZERO;
    let mut square_deviation = 0.0;
    let mut outliers = 0;
    // Where both images are exact the smallest scale that double precision resolves takes the error's place.
    let floor = 1e-12 * a.values.iter().map(|v| v.abs().max_element()).fold(f64::MIN_POSITIVE, f64::max);
    for i in 0..count {
        let d = a.values[i] - b.values[i];
        let variance = a.errors[i] * a.errors[i] + b.errors[i] * b.errors[i];
        difference += d / count as f64;
        let square = d * d / variance.max(DVec3::splat(floor * floor));
        square_deviation += square.element_sum();
        outliers += square.cmpgt(DVec3::splat(36.0)).bitmask().count_ones();
    }
    let variance = a.overall_error * a.overall_error + b.overall_error * b.overall_error;
    Agreement {
        rms_deviation: (square_deviation / (3 * count) as f64).sqrt(),
        outliers: f64::from(outliers) / (3 * count) as f64,
        mean_deviation: difference / variance.map(f64::sqrt).max(DVec3::splat(floor)),
        mean_difference: difference,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values ±1 standard error apart agree; a shift of half an error everywhere, or of many in one place, does not.
    #[test]
    fn noise_passes_and_shifts_are_noticed() {
        let n = 400;
        let noise = |i: usize| if i % 2 == 0 { 1.0 } else { -1.0 };
        let a: Vec<_> = (0..n).map(|i| DVec3::splat(10.0 + 0.1 * noise(i))).collect();
        let b = vec![DVec3::splat(10.0); n];
        let (error, exact) = (vec![DVec3::splat(0.1); n], vec![DVec3::ZERO; n]);
        let noisy = |values| Measured { values, errors: &error, overall_error: DVec3::splat(0.1 / 20.0) };
        let known = |values| Measured { values, errors: &exact, overall_error: DVec3::ZERO };
        let fair = compare(noisy(&a), known(&b));
        assert!(fair.holds() && (fair.rms_deviation - 1.0).abs() < 1e-9, "{fair:?}");

        let shifted: Vec<_> = a.iter().map(|v| *v + DVec3::new(0.0, 0.05, 0.0)).collect();
        let biased = compare(noisy(&shifted), known(&b));
        assert!(!biased.holds(), "{biased:?}");
        assert!((biased.mean_deviation.y - 10.0).abs() < 1e-6 && biased.mean_deviation.x.abs() < 1e-6);

        let mut spot = b.clone();
        spot[7].x += 10.0;
        spot[8].x -= 10.0;
        let few = compare(noisy(&spot), known(&b));
        assert!(!few.holds() && few.mostly_holds(), "opposite errors must not cancel: {few:?}");
        assert_eq!(few.outliers, 2.0 / 1200.0);
        let mut many = spot.clone();
        for i in 0..20 {
            (many[2 * i].y, many[2 * i + 1].y) = (10.7, 9.3);
        }
        assert!(!compare(noisy(&many), known(&b)).mostly_holds(), "40 of 1200 values 7 errors off are not chance");
    }
}
