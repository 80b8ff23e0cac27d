//! Owen-scrambled Sobol' points over a whole path, four dimensions at a time.
//!
//! Each pixel of each replicate has a scrambling of its own, so that pixels err independently and the spread over
//! replicates measures the error (Owen 1997; Burley, Practical Hash-based Owen Scrambling, JCGT 2020).

use sobol_burley::{NUM_DIMENSION_SETS_4D, sample_4d};

/// Longest sequence that the generator offers; a longer run goes on with fresh scramblings.
const SEQUENCE_LENGTH: u64 = 1 << 16;

/// Which four dimensions: the same decision of every path of a pixel reads the same set.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dimensions(pub u32);

/// The point of one path.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sampler {
    index: u32,
    seed: u32,
}

impl Sampler {
    /// The `index`-th point of a pixel in one replicate.
    pub fn new(seed: u64, replicate: u64, pixel: u64, index: u64) -> Self {
        Self::of(index, mix(mix(mix(seed) ^ replicate) ^ pixel))
    }

    fn of(index: u64, stream: u64) -> Self {
        Self { index: (index % SEQUENCE_LENGTH) as u32, seed: (mix(stream ^ (index / SEQUENCE_LENGTH)) >> 32) as u32 }
    }

    /// The `part`-th of `parts` points of another sequence that belong to this point.
    pub fn split(&self, parts: u32, part: u32) -> Self {
        Self::of(u64::from(self.index) * u64::from(parts) + u64::from(part), u64::from(!self.seed))
    }

    /// Four numbers in (0, 1).
    ///
    /// The generator gives multiples of 2⁻²³; half a step keeps their mean at ½ and logarithms and divisions away
    /// from 0.
    #[inline]
    pub fn get(&self, Dimensions(set): Dimensions) -> [f64; 4] {
        // Beyond the generator's last dimension: the same ones again, scrambled and shuffled anew ("padding", Burley).
        let round = set / NUM_DIMENSION_SETS_4D;
        let seed =
            if round == 0 { self.seed } else { (mix(u64::from(self.seed) << 32 | u64::from(round)) >> 32) as u32 };
        sample_4d(self.index, set % NUM_DIMENSION_SETS_4D, seed).map(|u| f64::from(u) + 0.5 / 8_388_608.0)
    }
}

/// SplitMix64's finaliser: a bijection in which every bit depends on every other (Steele et al. 2014).
fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 4ᵏ points put exactly one in each cell of a 2ᵏ×2ᵏ grid: what makes the error fall faster than 1/√N.
    #[test]
    fn the_first_two_dimensions_are_stratified() {
        for replicate in 0..4 {
            let mut cells = [0u32; 256];
            for index in 0..256 {
                let [x, y, _, _] = Sampler::new(1, replicate, 77, index).get(Dimensions(0));
                cells[(x * 16.0) as usize * 16 + (y * 16.0) as usize] += 1;
            }
            assert_eq!(cells, [1; 256]);
        }
    }

    #[test]
    fn pixels_replicates_and_seeds_differ() {
        let point = |seed, replicate, pixel| Sampler::new(seed, replicate, pixel, 5).get(Dimensions(1));
        let base = point(1, 2, 3);
        assert_ne!(base, point(2, 2, 3));
        assert_ne!(base, point(1, 3, 3));
        assert_ne!(base, point(1, 2, 4));
        assert_ne!(base, point(1, 3, 2), "replicate and pixel must not be interchangeable");
    }

    #[test]
    fn numbers_stay_inside_the_open_interval_and_average_a_half() {
        let mut sum = 0.0;
        for index in 0..4096 {
            for u in Sampler::new(9, 0, 0, index).get(Dimensions(70)) {
                assert!(u > 0.0 && u < 1.0);
                sum += u / 16384.0;
            }
        }
        assert!((sum - 0.5).abs() < 1e-4, "{sum}"); // stratified: random numbers would be off by 2e-3
    }
}
