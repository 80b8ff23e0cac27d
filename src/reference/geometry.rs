//! Rays against spheres and planes without an epsilon: a ray knows the surface it starts on and the one it ends on.
//!
//! A plane is never met twice by one line, and the second root of a sphere has a closed form when the first one is the
//! start, so self-intersection is excluded exactly, at every scale of scene.

use glam::DVec3;

use crate::scene::Scene;

/// Index of a surface: spheres first, then planes, each in the scene's order.
pub(super) type SurfaceId = usize;

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Along the (unit) ray, metres.
    pub distance: f64,
    /// World space; on the surface to the last few bits.
    pub position: DVec3,
    /// Unit; out of a sphere, along a plane's own normal.
    pub normal: DVec3,
    /// The surface that the ray met.
    pub surface: SurfaceId,
    /// Index into the scene's materials.
    pub material: usize,
}

struct Ball {
    center: DVec3,
    radius: f64,
    material: usize,
}

struct HalfSpace {
    normal: DVec3,
    offset: f64,
    material: usize,
}

/// All surfaces of a scene.
pub(super) struct Surfaces {
    spheres: Vec<Ball>,
    planes: Vec<HalfSpace>,
}

impl Surfaces {
    pub fn new(scene: &Scene) -> Self {
        Self {
            spheres: scene
                .spheres
                .iter()
                .map(|s| Ball { center: s.center, radius: s.radius, material: s.material })
                .collect(),
            planes: scene
                .planes
                .iter()
                .map(|p| HalfSpace { normal: p.normal, offset: p.offset, material: p.material })
                .collect(),
        }
    }

    /// The nearest surface along a unit `direction`, for a ray that starts in space or on the surface `from`.
    #[inline]
    pub fn nearest(&self, origin: DVec3, direction: DVec3, from: Option<SurfaceId>) -> Option<Hit> {
        let from = from.unwrap_or(SurfaceId::MAX);
        let mut nearest = f64::INFINITY;
        let mut found = SurfaceId::MAX;
        for (id, sphere) in self.spheres.iter().enumerate() {
            let t = sphere.first_root(origin, direction, id == from);
            if t < nearest {
                nearest = t;
                found = id;
            }
        }
        let first_plane = self.spheres.len();
        for (index, plane) in self.planes.iter().enumerate() {
            let t = (plane.offset - plane.normal.dot(origin)) / plane.normal.dot(direction);
            // A parallel ray gives ±inf or NaN, and each fails one of the comparisons.
            if t > 0.0 && t < nearest && first_plane + index != from {
                nearest = t;
                found = first_plane + index;
            }
        }
        if found == SurfaceId::MAX {
            return None;
        }
        let point = origin + direction * nearest;
        let (position, normal, material) = if let Some(sphere) = self.spheres.get(found) {
            let normal = (point - sphere.center).normalize();
            (sphere.center + normal * sphere.radius, normal, sphere.material)
        } else {
            let plane = &self.planes[found - first_plane];
            (point, plane.normal, plane.material)
        };
        Some(Hit { distance: nearest, position, normal, surface: found, material })
    }

    /// Whether anything lies strictly between `a` (on the surface `from`) and `b` (on `to`, or a light in space).
    #[inline]
    pub fn occluded(&self, a: DVec3, from: SurfaceId, b: DVec3, to: Option<SurfaceId>) -> bool {
        let to = to.unwrap_or(SurfaceId::MAX);
        let first_plane = self.spheres.len();
        for (id, sphere) in self.spheres.iter().enumerate() {
            if sphere.blocks(a, b, id == from, id == to) {
                return true;
            }
        }
        self.planes.iter().enumerate().any(|(index, plane)| {
            let id = first_plane + index;
            let side = (plane.normal.dot(a) - plane.offset) * (plane.normal.dot(b) - plane.offset);
            side < 0.0 && id != from && id != to
        })
    }
}

impl Ball {
    /// Distance to the first intersection after the start, or infinity.
    #[inline]
    fn first_root(&self, origin: DVec3, direction: DVec3, starts_here: bool) -> f64 {
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

    /// Whether the open segment from `a` to `b` crosses the sphere, its own end points on it not counted.
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
