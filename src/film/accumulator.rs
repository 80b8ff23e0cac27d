//! Running sums of an unfinished image: what is kept, what it is worth, and how it is saved and resumed.

use std::io::Write as _;
use std::path::Path;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::film::write_beside;

/// Independent scramblings whose spread gives the standard error.
///
/// More of them make the error better known and the image worse, as each then has fewer points to be even with.
pub const REPLICATES: usize = 8;

/// Relative luminance of linear Rec. 709 (ITU-R BT.709).
const LUMINANCE: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

const MAGIC: &[u8; 8] = b"photacc2";

/// The 95% quantile of Student's t with 7 degrees of freedom, those of [`REPLICATES`] means: within so many standard
/// errors lies the truth of 90% of unbiased pixels.
pub const STUDENT_90: f64 = 1.895;

/// Sums over samples, per replicate and pixel, in double precision.
///
/// A *pass* is one sample of every pixel; pass p belongs to replicate p mod [`REPLICATES`]. Sums depend on the number
/// of passes alone, not on threads, interruptions or time, so that a resumed image has the same bytes as another.
#[derive(Clone, Debug, PartialEq)]
pub struct Accumulator {
    size: (u32, u32),
    /// Of everything that the samples depend on: scene, size, light mode, seed.
    fingerprint: u64,
    passes: u64,
    /// Replicate-major, then row, column, channel.
    sums: Vec<f64>,
    /// What else the renderer sums up from pass to pass; empty before the first.
    extras: Vec<f64>,
}

impl Accumulator {
    /// Without passes. `fingerprint`: of everything that the samples depend on (see [`fnv1a`]).
    pub fn new(size: (u32, u32), fingerprint: u64) -> Self {
        let values = size.0 as usize * size.1 as usize * 3;
        Self { size, fingerprint, passes: 0, sums: vec![0.0; values * REPLICATES], extras: vec![] }
    }

    /// Pixels: width, height.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Samples taken in every pixel.
    pub fn passes(&self) -> u64 {
        self.passes
    }

    /// Whether passes may be added to this image just as to `other`: same scene, size, light mode and seed.
    pub fn continues(&self, other: &Self) -> bool {
        self.size == other.size && self.fingerprint == other.fingerprint
    }

    /// Add one pass: radiance per pixel, rows from the top, three channels.
    ///
    /// # Panics
    /// When there are fewer values than the image has.
    pub fn add(&mut self, pass: impl IntoIterator<Item = f64>) {
        let values = self.sums.len() / REPLICATES;
        let replicate = (self.passes % REPLICATES as u64) as usize;
        let mut added = 0;
        for (sum, value) in self.sums[replicate * values..][..values].iter_mut().zip(pass) {
            *sum += value;
            added += 1;
        }
        assert!(added == values, "a pass of {added} values for an image of {values}");
        self.passes += 1;
    }

    /// The renderer's own sums, `count` of them; they begin as zeros. None if a loaded image has another number.
    pub fn extras(&mut self, count: usize) -> Option<&mut [f64]> {
        if self.passes == 0 {
            self.extras.resize(count, 0.0);
        }
        (self.extras.len() == count).then_some(&mut self.extras[..])
    }

    /// Mean radiance per pixel, rows from the top; None before the first pass.
    pub fn mean(&self) -> Option<Vec<DVec3>> {
        let values = self.sums.len() / REPLICATES;
        let sum =
            |at: usize| -> DVec3 { (0..REPLICATES).map(|r| DVec3::from_slice(&self.sums[r * values + at..])).sum() };
        (self.passes > 0).then(|| (0..values / 3).map(|pixel| sum(3 * pixel) / self.passes as f64).collect())
    }

    /// Mean radiance and its standard error per pixel, rows from the top; None before every replicate has a sample.
    ///
    /// The error is that of the mean of [`REPLICATES`] independent estimates, so it has 7 degrees of freedom: 90% of
    /// pixels lie within 1.89 of it (Student's t), not 1.64.
    pub fn image(&self) -> Option<(Vec<DVec3>, Vec<DVec3>)> {
        if self.passes < REPLICATES as u64 {
            return None;
        }
        let values = self.sums.len() / REPLICATES;
        let mut mean = Vec::with_capacity(values / 3);
        let mut error = Vec::with_capacity(values / 3);
        for pixel in 0..values / 3 {
            let sum = |replicate: usize| DVec3::from_slice(&self.sums[replicate * values + pixel * 3..]);
            let m = (0..REPLICATES).map(sum).sum::<DVec3>() / self.passes as f64;
            let spread: DVec3 = (0..REPLICATES)
                .map(|replicate| {
                    let d = sum(replicate) / self.count(replicate) - m;
                    d * d
                })
                .sum();
            let variance = spread / (REPLICATES * (REPLICATES - 1)) as f64;
            mean.push(m);
            error.push(variance.map(f64::sqrt));
        }
        Some((mean, error))
    }

    /// Standard error of the mean of all pixels, from the replicates' own means.
    ///
    /// Zero before every replicate has a sample.
    pub fn overall_error(&self) -> DVec3 {
        if self.passes < REPLICATES as u64 {
            return DVec3::ZERO;
        }
        let values = self.sums.len() / REPLICATES;
        let means: Vec<DVec3> = (self.sums.chunks_exact(values).enumerate())
            .map(|(replicate, sums)| {
                let sum: DVec3 = sums.chunks_exact(3).map(DVec3::from_slice).sum();
                sum / ((values / 3) as f64 * self.count(replicate))
            })
            .collect();
        let mean = means.iter().sum::<DVec3>() / REPLICATES as f64;
        let spread: DVec3 = means.iter().map(|m| (m - mean) * (m - mean)).sum();
        (spread / (REPLICATES * (REPLICATES - 1)) as f64).map(f64::sqrt)
    }

    /// Mean over pixels of the luminance's standard error over the luminance; black pixels are left out.
    ///
    /// Zero before every replicate has a sample.
    pub fn relative_noise(&self) -> f64 {
        if self.passes < REPLICATES as u64 {
            return 0.0;
        }
        let values = self.sums.len() / REPLICATES;
        let (mut total, mut lit) = (0.0, 0u64);
        for pixel in 0..values / 3 {
            // Replicates' luminances are summed before their spread is taken: channels do not err independently.
            let sum = |replicate: usize| LUMINANCE.dot(DVec3::from_slice(&self.sums[replicate * values + pixel * 3..]));
            let mean = (0..REPLICATES).map(sum).sum::<f64>() / self.passes as f64;
            let spread: f64 = (0..REPLICATES).map(|r| (sum(r) / self.count(r) - mean).powi(2)).sum();
            if mean > 0.0 {
                total += (spread / (REPLICATES * (REPLICATES - 1)) as f64).sqrt() / mean;
                lit += 1;
            }
        }
        if lit > 0 { total / lit as f64 } else { 0.0 }
    }

    /// Samples a pixel in one replicate.
    fn count(&self, replicate: usize) -> f64 {
        let r = REPLICATES as u64;
        (self.passes / r + u64::from((replicate as u64) < self.passes % r)) as f64
    }

    /// Write the sums to `path`, beside it first and then renamed, so that a crash leaves the old file whole.
    ///
    /// # Errors
    /// [`Error::File`] if the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        write_beside(path, |file| {
            let mut check = Fnv1a::default();
            let mut put = |bytes: &[u8]| {
                check.add(bytes);
                file.write_all(bytes)
            };
            put(MAGIC)?;
            let extras = self.extras.len() as u64;
            for value in [self.fingerprint, u64::from(self.size.0), u64::from(self.size.1), self.passes, extras] {
                put(&value.to_le_bytes())?;
            }
            for sum in self.sums.iter().chain(&self.extras) {
                put(&sum.to_le_bytes())?;
            }
            file.write_all(&check.0.to_le_bytes())
        })
    }

    /// Read what [`Accumulator::save`] wrote.
    ///
    /// # Errors
    /// [`Error::File`] if the file cannot be read; [`Error::Usage`] if it is not a whole file of this kind.
    pub fn load(path: &Path) -> Result<Self> {
        let bytes =
            std::fs::read(path).map_err(|e| Error::File { path: path.into(), what: format!("cannot be read: {e}") })?;
        let wrong = |what: &str| Error::Usage(format!("{}: {what}", path.display()));
        if !bytes.starts_with(MAGIC) || bytes.len() < 56 {
            return Err(wrong("not a checkpoint of an image"));
        }
        let (content, check) = bytes.split_at(bytes.len() - 8);
        if fnv1a(content).to_le_bytes() != check {
            return Err(wrong("checkpoint is damaged (its checksum differs)"));
        }
        let mut words = content[8..].chunks_exact(8).map(|w| u64::from_le_bytes(w.try_into().expect("8 bytes")));
        let mut word = || words.next().unwrap_or(0);
        let (fingerprint, width, height, passes, extra_sums) = (word(), word(), word(), word(), word());
        let mut sums: Vec<f64> = words.map(f64::from_bits).collect();
        let expected = width
            .checked_mul(height)
            .and_then(|n| n.checked_mul(3 * REPLICATES as u64))
            .and_then(|n| n.checked_add(extra_sums));
        let (Ok(width), Ok(height)) = (u32::try_from(width), u32::try_from(height)) else {
            return Err(wrong("checkpoint has an impossible size"));
        };
        if expected != Some(sums.len() as u64) {
            return Err(wrong(&format!("checkpoint of {width}x{height} pixels holds {} values", sums.len())));
        }
        let extras = sums.split_off(sums.len() - extra_sums as usize);
        Ok(Self { size: (width, height), fingerprint, passes, sums, extras })
    }
}

/// FNV-1a, 64 bits: stable across platforms and releases, which the standard hasher does not promise.
struct Fnv1a(u64);

impl Default for Fnv1a {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fnv1a {
    fn add(&mut self, bytes: &[u8]) {
        self.0 = bytes.iter().fold(self.0, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    }
}

/// FNV-1a of some bytes, 64 bits.
pub fn fnv1a(bytes: &[u8]) -> u64 {
    let mut hash = Fnv1a::default();
    hash.add(bytes);
    hash.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(passes: u64) -> Accumulator {
        let mut accumulator = Accumulator::new((2, 1), 42);
        for pass in 0..passes {
            let value = (pass % 8) as f64;
            accumulator.add([value, 2.0 * value, 1.0, 0.0, 0.0, 5.0]);
        }
        accumulator
    }

    /// Replicates 0…7: mean 3.5, variance of the replicates 6, of their mean 6/8.
    #[test]
    fn mean_and_error_are_those_of_the_replicates() {
        assert!(filled(7).image().is_none());
        let (mean, error) = filled(16).image().unwrap();
        assert_eq!(mean[0], DVec3::new(3.5, 7.0, 1.0));
        assert!((error[0] - DVec3::new(0.75f64.sqrt(), 3f64.sqrt(), 0.0)).length() < 1e-12);
        // First pixel: luminance 1.6430·v + 0.0722 of v = 0…7; the second one is exact.
        let expected = 0.5 * 1.643 * 0.75f64.sqrt() / (1.643 * 3.5 + 0.0722);
        assert!((filled(16).relative_noise() - expected).abs() < 1e-12);
        assert_eq!((mean[1], error[1]), (DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO));
        let (mean, _) = filled(9).image().unwrap();
        assert!((mean[0].x - 28.0 / 9.0).abs() < 1e-12, "an odd pass counts as a sample like any other");
    }

    #[test]
    fn saved_and_loaded_are_equal_and_damage_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state");
        filled(11).save(&path).unwrap();
        assert_eq!(Accumulator::load(&path).unwrap(), filled(11));
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1, "nothing but the file is left");

        let mut bytes = std::fs::read(&path).unwrap();
        bytes[60] ^= 1;
        std::fs::write(&path, &bytes).unwrap();
        assert!(Accumulator::load(&path).unwrap_err().to_string().contains("damaged"));
        std::fs::write(&path, &bytes[..30]).unwrap();
        assert!(Accumulator::load(&path).unwrap_err().to_string().contains("not a checkpoint"));
        let missing = Accumulator::load(&folder.path().join("none")).unwrap_err();
        assert!(missing.to_string().contains("none"));
        assert!(filled(1).save(&folder.path().join("no/such/folder")).is_err());
    }
}
