//! How close photons lie, told by a few of them: boxes of faces tell nothing where photons lie kilometres out.

use std::collections::HashMap;

use crate::records::PhotonPosition;

/// Photons of a map's beginning, which is as well spread as the whole, that tell enough.
pub const SAMPLE: usize = 1024;

/// Photons of the sample in one cell that tell how many there are of the whole: within a third.
const ENOUGH: u32 = 10;

/// Photons that a disc of radius `radius` (metres) holds where they lie closest, of `stored` in all. Light that is looked
/// at is mostly near that: over all photons the mean tells of those far out. Positions are in scene space, and each has a
/// face; the first [`SAMPLE`] of them are counted in cells of a face, which are widened until one of them holds enough.
pub fn crowd(positions: &[PhotonPosition], faces: impl IntoIterator<Item = u32>, stored: usize, radius: f32) -> f32 {
    let sample: Vec<_> = positions.iter().map(|p| p.position).zip(faces).take(SAMPLE).collect();
    let mut width = radius;
    loop {
        let mut cells = HashMap::<(u32, [i32; 3]), u32>::new();
        for (position, face) in &sample {
            *cells.entry((*face, position.map(|x| (x / width).floor() as i32))).or_default() += 1;
        }
        let fullest = cells.values().copied().max().unwrap_or(0);
        if fullest >= ENOUGH.min(sample.len() as u32) || !width.is_normal() {
            let share = f64::from(fullest) / sample.len().max(1) as f64;
            return (std::f64::consts::PI * f64::from(radius / width).powi(2) * share * stored as f64) as f32;
        }
        width *= 2.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_tells_how_many_photons_a_disc_holds() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        // Half of all on 10 m × 10 m of one face, the others within kilometres around them.
        let mut photon = |i: usize| {
            let side = if i % 2 == 0 { 10.0 } else { 1e4 };
            PhotonPosition { position: [random() * side, 0.5, random() * side] }
        };
        let sample: Vec<_> = (0..SAMPLE).map(&mut photon).collect();
        let one_face = std::iter::repeat(4);
        for radius in [0.1f32, 0.5, 2.0] {
            let (found, expected) =
                (crowd(&sample, one_face.clone(), 40_000, radius), 200.0 * std::f32::consts::PI * radius * radius);
            // Where they lie closest there are more than the mean, by chance alone.
            assert!(found > 0.9 * expected && found < 3.0 * expected, "R = {radius}: {found}, expected {expected}");
        }
        assert!(crowd(&sample, 0.., 40_000, 0.5) < 1.0, "each on a face of its own");
        let far_out = PhotonPosition { position: [1e30, 0.0, 0.0] };
        assert_eq!(crowd(&[far_out], [0], 1, 2.0), std::f32::consts::PI);
        assert_eq!(crowd(&[], [], 0, 1.0), 0.0);
    }
}
