//! Quads.

use glam::DVec3;

use super::Surface;
use crate::shapes::Quad;

impl Surface for Quad {
    const SOLID: bool = false;

    #[inline]
    fn first_hit(&self, origin: DVec3, direction: DVec3, starts_here: bool) -> f64 {
        let normal = self.normal();
        let t = normal.dot(self.corner - origin) / normal.dot(direction);
        // A parallel ray gives ±inf or NaN, neither of which is nearer than anything.
        if t > 0.0 && !starts_here && holds(self, origin + direction * t) { t } else { f64::INFINITY }
    }

    #[inline]
    fn placed(&self, point: DVec3) -> (DVec3, DVec3) {
        (point, self.normal())
    }

    #[inline]
    fn blocks(&self, a: DVec3, b: DVec3, a_on_it: bool, b_on_it: bool) -> bool {
        let normal = self.normal();
        let (from, to) = (normal.dot(a - self.corner), normal.dot(b - self.corner));
        from * to < 0.0 && !a_on_it && !b_on_it && holds(self, a + (b - a) * (from / (from - to)))
    }
}

/// Whether a point of its plane lies on the quad; two that share an edge both have it, whatever rounding says.
fn holds(quad: &Quad, p: DVec3) -> bool {
    quad.coordinates(p).iter().all(|x| x.abs() <= 1.0 + 1e-14)
}
