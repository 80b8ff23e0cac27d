//! Rules that keys of several tables share.
//!
//! Scenes are kept in f64 but rendered in float32, whose largest number is 3.4e38. The rules refuse what would
//! overflow or vanish there, so that no image can turn into NaN because of its file.

use glam::DVec3;

use super::table::Rule;

/// Metres. Intersection squares distances and sums three squares: (1e15)² · 12 stays far below 3.4e38. It is a
/// tenth of a light year.
const FARTHEST: f64 = 1e15;
/// Metres. Its square, 1e-30, still is a normal float32.
const SMALLEST: f64 = 1e-15;
/// W/sr, and radiance where a surface shines by itself. Leaves eight digits for 4π, the BSDF, 1/r² and many lights.
pub const BRIGHTEST: f64 = 1e30;

/// A coordinate of a place, or a distance with a sign.
pub const COORDINATE: Rule =
    Rule { holds: |x| x.abs() <= FARTHEST, expected: "a coordinate in metres between -1e15 and 1e15" };
/// A component of a direction of any length.
pub const DIRECTION: Rule = Rule { holds: |x| x.abs() <= FARTHEST, expected: "a number between -1e15 and 1e15" };
/// A length that something is divided by.
pub const RADIUS: Rule =
    Rule { holds: |x| (SMALLEST..=FARTHEST).contains(&x), expected: "a radius > 0 (in metres, 1e-15 to 1e15)" };

/// `v` at length 1, however short or long it is; none if it is zero.
pub fn unit(v: DVec3) -> Option<DVec3> {
    // Scaled first: the squares of 1e-200 would vanish even in f64.
    let scale = v.abs().max_element();
    (scale > 0.0).then(|| (v / scale).normalize())
}
