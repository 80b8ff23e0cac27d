//! In which directions from a light something can be hit.

use glam::DVec3;

/// Directions within an angle of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cap {
    /// Unit.
    pub axis: DVec3,
    /// Of the angle, at most a right one.
    pub sine: f64,
    /// Of the same.
    pub cosine: f64,
}

impl Cap {
    /// Directions to a sphere whose centre is `to` away; none within it, or within rounding of it.
    pub fn around(to: DVec3, radius: f64) -> Option<Cap> {
        let distance = to.length();
        let sine = radius * (1.0 + 1e-5) / distance; // not below 1 within it
        (sine < 1.0).then(|| Cap { axis: to / distance, sine, cosine: (1.0 - sine * sine).sqrt() })
    }

    /// Half of all directions.
    pub fn half(axis: DVec3) -> Cap {
        Cap { axis, sine: 1.0, cosine: 0.0 }
    }
}
