//! Infinite planes.

use glam::DVec3;

use super::Surface;
use crate::shapes::Plane;

impl Surface for Plane {
    const SOLID: bool = false;

    #[inline]
    fn first_hit(&self, origin: DVec3, direction: DVec3, starts_here: bool) -> f64 {
        let t = (self.offset - self.normal.dot(origin)) / self.normal.dot(direction);
        // A parallel ray gives ±inf or NaN, neither of which is nearer than anything.
        if t > 0.0 && !starts_here { t } else { f64::INFINITY }
    }

    #[inline]
    fn placed(&self, point: DVec3) -> (DVec3, DVec3) {
        (point, self.normal)
    }

    #[inline]
    fn blocks(&self, a: DVec3, b: DVec3, a_on_it: bool, b_on_it: bool) -> bool {
        let side = (self.normal.dot(a) - self.offset) * (self.normal.dot(b) - self.offset);
        side < 0.0 && !a_on_it && !b_on_it
    }
}
