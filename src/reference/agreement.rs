//! Whether two independent images agree within their own noise: the judge of every test of the reference renderer.

use glam::DVec3;

/// What a comparison found.
#[derive(Clone, Copy, Debug)]
pub struct Agreement {
    /// RMS over all values of difference over its standard error; near 1 where the images estimate the same thing.
    pub rms_deviation: f64,
    /// The difference of the two images' means per channel, over its standard error: ±2 is chance, ±5 is not.
    pub mean_deviation: DVec3,
    /// The difference of the two images' means per channel.
    pub mean_difference: DVec3,
}

impl Agreement {
    /// Whether chance explains the difference.
    ///
    /// 4.5σ: three channels pass by chance all but once in 50 000 comparisons. 1.5 for the RMS: with 7 degrees of
    /// freedom a side it is expected at 1.08, and a thousand pixels scatter by a few percent.
    pub fn holds(&self) -> bool {
        self.mean_deviation.abs().max_element() < 4.5 && self.rms_deviation < 1.5
    }
}

/// Compare images `a` and `b` of equal size, given as values and their standard errors per pixel.
///
/// # Panics
/// If the slices differ in length or are empty.
pub fn compare(a: (&[DVec3], &[DVec3]), b: (&[DVec3], &[DVec3])) -> Agreement {
    let count = a.0.len();
    assert!(count > 0 && [a.1.len(), b.0.len(), b.1.len()] == [count; 3], "images of one size");
    let mut difference = DVec3::ZERO;
    let mut variance = DVec3::ZERO;
    let mut square_deviation = 0.0;
    // Where both images are exact the smallest scale that double precision resolves takes the error's place.
    let floor = 1e-12 * a.0.iter().map(|v| v.abs().max_element()).fold(f64::MIN_POSITIVE, f64::max);
    for i in 0..count {
        let d = a.0[i] - b.0[i];
        let v = a.1[i] * a.1[i] + b.1[i] * b.1[i];
        difference += d;
        variance += v;
        square_deviation += (d * d / v.max(DVec3::splat(floor * floor))).element_sum();
    }
    let error = DVec3::new(variance.x.sqrt(), variance.y.sqrt(), variance.z.sqrt()).max(DVec3::splat(floor));
    Agreement {
        rms_deviation: (square_deviation / (3 * count) as f64).sqrt(),
        mean_deviation: difference / error,
        mean_difference: difference / count as f64,
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
        let fair = compare((&a, &error), (&b, &exact));
        assert!(fair.holds() && (fair.rms_deviation - 1.0).abs() < 1e-9, "{fair:?}");

        let shifted: Vec<_> = a.iter().map(|v| *v + DVec3::new(0.0, 0.05, 0.0)).collect();
        let biased = compare((&shifted, &error), (&b, &exact));
        assert!(!biased.holds(), "{biased:?}");
        assert!((biased.mean_deviation.y - 10.0).abs() < 1e-6 && biased.mean_deviation.x.abs() < 1e-6);

        let mut spot = b.clone();
        spot[7].x += 10.0;
        spot[8].x -= 10.0;
        assert!(!compare((&spot, &error), (&b, &exact)).holds(), "opposite errors must not cancel");
    }
}
