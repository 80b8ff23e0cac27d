//! Twin of `glsl/shared/intersect.glsl`: rays against spheres and planes, without any epsilon.

use glam::Vec3;

/// Farther than any hit; finite, so that 0 · INFINITE stays a number.
pub const INFINITE: f32 = 3.0e38;

/// Of a hit: a root that rounding has brought to nothing or behind is still in front.
const LEAST_DISTANCE: f32 = 1e-18;

/// Which side of an object rays meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// The one that normals point to, or behind it by rounding alone.
    Front,
    /// Either.
    Both {
        /// A ray that starts on the object leaves behind it.
        behind: bool,
    },
}

/// Distance to the nearest root in front of the origin, or [`INFINITE`]. `origin_on`: the ray starts on this sphere.
///
/// Haines et al., "Precision Improvements for Ray/Sphere Intersection", Ray Tracing Gems, ch. 7.
pub fn hit_sphere(origin: Vec3, direction: Vec3, center: Vec3, radius: f32, origin_on: bool, sides: Sides) -> f32 {
    let from_center = origin - center;
    let approach = -from_center.dot(direction);
    let closest = from_center + direction * approach;
    let approach = approach - closest.dot(direction);
    if origin_on {
        let within = sides == Sides::Both { behind: true };
        return if within { (2.0 * approach).max(LEAST_DISTANCE) } else { INFINITE };
    }
    let discriminant = radius * radius - closest.dot(closest);
    if discriminant < 0.0 {
        return INFINITE;
    }
    let root = discriminant.sqrt();
    let outside = sides == Sides::Front || from_center.dot(from_center) > radius * radius;
    if outside && approach <= 0.0 {
        return INFINITE;
    }
    (if outside { approach - root } else { approach + root }).max(LEAST_DISTANCE)
}

/// Distance to the plane `dot(normal, p) = offset`, or [`INFINITE`]. `origin_on`: the ray starts on this plane.
pub fn hit_plane(origin: Vec3, direction: Vec3, normal: Vec3, offset: f32, origin_on: bool, sides: Sides) -> f32 {
    let slope = normal.dot(direction);
    let t = (offset - normal.dot(origin)) / slope;
    match sides {
        _ if origin_on => INFINITE,
        // A parallel ray gives ±infinity or NaN, both refused here.
        Sides::Both { .. } if t > 0.0 && t < INFINITE => t,
        Sides::Front if slope < 0.0 => t.max(LEAST_DISTANCE),
        _ => INFINITE,
    }
}
