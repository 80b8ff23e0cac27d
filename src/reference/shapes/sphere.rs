//! Spheres.

use glam::DVec3;

use super::Surface;
use crate::shapes::Sphere;

impl Surface for Sphere {
    const SOLID: bool = true;

    #[inline]
    fn first_hit(&self, origin: DVec3, direction: DVec3, starts_here: bool) -> f64 {
        let to_origin = origin - self.center;
        let b = to_origin.dot(direction);
        if starts_here {
            // One root is the start, 0; Vieta gives the other, ahead only for a ray that goes into the sphere.
            return if b < 0.0 { -2.0 * b } else { f64::INFINITY };
        }
        // Discriminant from the closest approach: b² − c cancels for small and far spheres (Haines et al. 2019).
        let closest = to_origin - direction * b;
        let discriminant = self.radius * self.radius - closest.length_squared();
        if discriminant < 0.0 {
            return f64::INFINITY;
        }
        let c = to_origin.length_squared() - self.radius * self.radius;
        let root = discriminant.sqrt();
        if b < 0.0 {
            let q = root - b;
            if c > 0.0 { c / q } else { q }
        } else if c < 0.0 {
            c / (-b - root)
        } else {
            f64::INFINITY
        }
    }

    #[inline]
    fn placed(&self, point: DVec3) -> (DVec3, DVec3) {
        let normal = (point - self.center).normalize();
        (self.center + normal * self.radius, normal)
    }

    #[inline]
    fn blocks(&self, a: DVec3, b: DVec3, a_on_it: bool, b_on_it: bool) -> bool {
        let segment = b - a;
        let (from_center, to_center) = (a - self.center, b - self.center);
        let length2 = segment.length_squared();
        match (a_on_it, b_on_it) {
            // A chord has no third point on the sphere.
            (true, true) => false,
            (true, false) => {
                let other = -2.0 * from_center.dot(segment);
                other > 0.0 && other < length2
            }
            (false, true) => {
                let other = 2.0 * to_center.dot(segment);
                other > 0.0 && other < length2
            }
            (false, false) => {
                let r2 = self.radius * self.radius;
                let (a_inside, b_inside) = (from_center.length_squared() < r2, to_center.length_squared() < r2);
                if a_inside || b_inside {
                    return a_inside != b_inside;
                }
                let along = -from_center.dot(segment);
                along > 0.0 && along < length2 && (from_center + segment * (along / length2)).length_squared() < r2
            }
        }
    }
}
