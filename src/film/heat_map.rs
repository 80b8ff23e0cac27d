//! The false-colour picture of where two images differ, and by how much.

use super::{Image, linear_value};
use crate::error::Result;

/// Difference that gets the brightest colour, in radiance; greater ones too.
pub const HEAT_MAP_WHITE: f32 = 1.0;
/// How many powers of ten below [`HEAT_MAP_WHITE`] the darkest colour lies: 10⁻⁶ is float32's own noise at radiance 1.
pub const HEAT_MAP_DECADES: f32 = 6.0;

/// |a − b| of each pixel's worst channel as a colour: black (below 10⁻⁶ or equal) over violet, red and orange to pale
/// yellow (1 and more), one sixth of the way a power of ten. The scale is fixed, so two heat maps can be set side by
/// side. A pixel where either value is NaN or infinite is pure cyan, which the scale does not hold.
///
/// The result is meant for a PNG at exposure 0.
///
/// # Errors
/// Images of different size.
pub fn heat_map(a: &Image, b: &Image) -> Result<Image> {
    a.check_same_size(b)?;
    let pixels = a.pixels.iter().zip(&b.pixels).map(|(a, b)| heat(a, b)).collect();
    Image::from_pixels(a.width, a.height, pixels)
}

fn heat(a: &[f32; 3], b: &[f32; 3]) -> [f32; 3] {
    if a.iter().chain(b).any(|channel| !channel.is_finite()) {
        return [0.0, 1.0, 1.0];
    }
    let difference = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    // log10(0) is −∞, which clamps to 0.
    let t = (1.0 + (difference / HEAT_MAP_WHITE).log10() / HEAT_MAP_DECADES).clamp(0.0, 1.0);
    if t == 0.0 { [0.0; 3] } else { inferno(t).map(linear_value) }
}

/// Display colour of matplotlib's perceptually uniform `inferno` at t in [0, 1], as the degree-6 polynomial that
/// M. Zucker fitted (2019, public domain); within 0.03 of the table.
fn inferno(t: f32) -> [f32; 3] {
    const COEFFICIENTS: [[f32; 7]; 3] = [
        [0.0002, 0.1065, 11.6025, -41.704, 77.1629, -71.3194, 25.1311],
        [0.0017, 0.564, -3.9729, 17.4364, -33.4024, 32.6261, -12.2427],
        [-0.0195, 3.9327, -15.9424, 44.3541, -81.8073, 73.2095, -23.0703],
    ];
    COEFFICIENTS.map(|c| c.iter().rev().fold(0.0, |sum, &c| sum * t + c).clamp(0.0, 1.0))
}
