//! Rays, spheres and planes in double precision, on the very float32 numbers that the machines get. Directions are
//! taken as they are, not as unit vectors: what float32 loses by rounding them is not the tracer's fault.

use glam::DVec3;

/// A line's meeting with a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// Along the line, in units of its direction; `None` for a miss.
    pub t: Option<f64>,
    /// How closely it is decided: distance of the line from the sphere's rim, metres; infinite where nothing is close.
    pub margin: f64,
    /// Unit normal at the hit, away from centre or along the plane's own; zero for a miss.
    pub normal: DVec3,
    /// |cosine| between direction and normal.
    pub cosine: f64,
}

/// First meeting in front of the origin; `on`: the origin lies on the sphere, but for rounding.
pub fn sphere(origin: DVec3, direction: DVec3, center: DVec3, radius: f64, on: bool) -> Meeting {
    let from_center = origin - center;
    let length2 = direction.length_squared();
    let middle = -from_center.dot(direction) / length2;
    let closest = (from_center + direction * middle).length();
    // (r − d)(r + d) keeps the digits that r² − d² loses at the rim.
    let half = ((radius - closest) * (radius + closest)).max(0.0).sqrt() / length2.sqrt();
    let distance = from_center.length();
    let product = (distance - radius) * (distance + radius) / length2;
    let far = if middle < 0.0 { middle - half } else { middle + half };
    let near = if far == 0.0 { 0.0 } else { product / far };
    let hit = closest <= radius;
    let t = match on {
        // One root is the origin itself, but for rounding: the one nearer to 0.
        true => Some(if near.abs() < far.abs() { far } else { near }).filter(|t| hit && *t > 0.0),
        false => [near.min(far), near.max(far)].into_iter().find(|t| hit && *t > 0.0),
    };
    let normal = t.map_or(DVec3::ZERO, |t| (origin + direction * t - center).normalize());
    Meeting { t, margin: (closest - radius).abs(), normal, cosine: normal.dot(direction.normalize()).abs() }
}

/// The meeting with a plane whose normal is taken as it is.
pub fn plane(origin: DVec3, direction: DVec3, normal: DVec3, offset: f64) -> Meeting {
    let t = (offset - normal.dot(origin)) / normal.dot(direction);
    let t = (t > 0.0 && t.is_finite()).then_some(t);
    let unit = normal.normalize();
    Meeting { t, margin: f64::INFINITY, normal: unit, cosine: unit.dot(direction.normalize()).abs() }
}

/// Spacing of float32 numbers at a magnitude.
pub fn ulp(magnitude: f64) -> f64 {
    let x = magnitude.abs() as f32;
    if !x.is_finite() || x >= f32::MAX {
        return f64::INFINITY;
    }
    f64::from(f32::from_bits(x.to_bits() + 1)) - f64::from(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_by_pythagoras() {
        // 3-4-5: chord at distance 3 from the centre of a sphere of radius 5 is 8 long.
        let hit = sphere(DVec3::new(-10.0, 3.0, 0.0), DVec3::X, DVec3::ZERO, 5.0, false);
        // Double precision rounds too: some ulps of the numbers that take part.
        let is = |found: Option<f64>, expected: f64| found.is_some_and(|t| (t - expected).abs() < 1e-14);
        assert!(is(hit.t, 6.0) && (hit.normal - DVec3::new(-0.8, 0.6, 0.0)).length() < 1e-15, "{hit:?}");
        assert!((hit.margin - 2.0).abs() < 1e-15 && (hit.cosine - 0.8).abs() < 1e-15);
        let inside = sphere(DVec3::new(1.0, 3.0, 0.0), DVec3::X * 2.0, DVec3::ZERO, 5.0, false);
        assert!(is(inside.t, 1.5), "{inside:?}");
        let on = sphere(DVec3::new(-4.0, 3.0, 0.0), DVec3::X, DVec3::ZERO, 5.0, true);
        assert!(is(on.t, 8.0), "{on:?}");
        assert_eq!(sphere(DVec3::new(-4.0, 3.0, 0.0), -DVec3::X, DVec3::ZERO, 5.0, true).t, None);
        assert_eq!(sphere(DVec3::new(-10.0, 6.0, 0.0), DVec3::X, DVec3::ZERO, 5.0, false).t, None);
        assert_eq!(plane(DVec3::ZERO, DVec3::new(0.0, -0.5, 0.0), DVec3::Y, -1.0).t, Some(2.0));
        assert_eq!(ulp(1.0), f64::from(f32::EPSILON));
    }
}
