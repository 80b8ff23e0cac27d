//! Twin of `glsl/shared/shapes/sphere.glsl`: its anchor is the centre, its extent the radius.

use glam::Vec3;

use super::{Cut, INFINITE, KeepSide, LEAST_DISTANCE, MARGIN, Placed, ShadowRay, Sides, SurfaceOf, UNSURE, size_of};
use crate::rays::camera::normalize3;
use crate::records::{Chart, Shape};

/// Two points of a sphere see each other from within.
pub const SEES_ITSELF: bool = true;

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

/// See [`super::hit`].
#[inline]
pub fn hit(shape: &Shape, origin: Vec3, direction: Vec3, on: bool, sides: Sides) -> f32 {
    hit_sphere(origin, direction, shape.anchor.into(), shape.extent, on, sides)
}

/// See [`super::place`].
pub fn place(shape: &Shape, p: Vec3) -> Placed {
    let center = Vec3::from(shape.anchor);
    let outward = normalize3(p - center);
    Placed { position: center + outward * shape.extent, normal: outward }
}

/// See [`super::met_behind`]. Where a ray grazes a sphere its angle is rounding: where it starts tells, as it did the root.
pub fn met_behind(shape: &Shape, origin: Vec3, _direction: Vec3, on: bool) -> bool {
    let from_center = origin - Vec3::from(shape.anchor);
    on || from_center.dot(from_center) <= shape.extent * shape.extent
}

/// See [`super::keep_side`].
#[inline]
pub fn keep_side(shape: &Shape, ray: &KeepSide, position: Vec3) -> Vec3 {
    let (center, radius) = (Vec3::from(shape.anchor), shape.extent);
    let (away, before) = (position - center, ray.origin - center);
    let [here, there] = [away, before].map(|p| p.dot(p) - radius * radius);
    let reach = radius + size_of(position);
    if ray.is_hit || here.abs() >= 4.0 * UNSURE * radius * reach {
        return position;
    }
    // Of a camera on the sphere, the direction tells the side.
    let unsure = there.abs() <= UNSURE * (radius * radius);
    let there = if unsure { before.dot(ray.direction) } else { there };
    let side = ray.leaves.unwrap_or(1f32.copysign(there));
    if here * side < 2.0 * UNSURE * radius * reach {
        position + away * ((side * MARGIN * reach - here / (2.0 * radius)) / radius)
    } else {
        position
    }
}

/// See [`super::blocks`].
#[inline]
pub fn blocks(shape: &Shape, ray: &ShadowRay, on: bool, sides: Sides) -> bool {
    // Half an ulp of the distance: a light that lies on a sphere is not shadowed by it.
    hit(shape, ray.origin, ray.direction, on, sides) < ray.distance * 0.999_999_9
}

/// See [`super::parts`]: a sphere is convex, and what it hides is left out as a footprint.
pub fn parts(_shape: &Shape, _point: Vec3, _photon: Vec3) -> bool {
    false
}

/// Spheres cover circles of flat surfaces rather than cut them.
pub const CUTS: usize = 0;

/// See [`super::cut`].
pub fn cut(_shape: &Shape, _number: usize, _on: &SurfaceOf, _inverse_radius: f32) -> Cut {
    Cut::NONE
}

/// Distance, in radii of the disc, of a plane's cut from a point on the sphere, which the plane cuts in a circle. Lambert's
/// equal-area map keeps chordal distances. `offset`: of the plane from the point, along its normal.
pub fn plane_cut(shape: &Shape, position: Vec3, normal: Vec3, offset: f32, inverse_radius: f32) -> f32 {
    let radius = shape.extent;
    let outward = (position - Vec3::from(shape.anchor)) * (1.0 / radius);
    let point_cosine = normal.dot(outward);
    let circle_cosine = offset / radius + point_cosine;
    let point_sine = (1.0 - point_cosine * point_cosine).max(0.0).sqrt();
    let circle_sine = (1.0 - circle_cosine * circle_cosine).max(0.0).sqrt();
    let (dc, ds) = (point_cosine - circle_cosine, point_sine - circle_sine);
    // A circle of less than R/20 takes 1/400 of the disc at most; a sphere that just touches the plane has one or
    // none by the last bit.
    let resembles_a_chord = circle_sine * radius * inverse_radius > 0.05;
    if resembles_a_chord { (dc * dc + ds * ds).sqrt() * radius * inverse_radius } else { f32::INFINITY }
}

/// See [`super::distance`].
#[inline]
pub fn distance(shape: &Shape, position: Vec3) -> f32 {
    let from_center = position - Vec3::from(shape.anchor);
    (from_center.dot(from_center).sqrt() - shape.extent).abs()
}

/// See [`super::likeness`].
pub fn likeness(shape: &Shape, apart: Vec3, reach: f32) -> f32 {
    let radius = shape.extent * reach;
    (1.0 - 10.0 * (apart.dot(apart) / (radius * radius))).max(0.0)
}

/// Octahedral coordinates of a unit vector, in [−1, 1]².
pub fn octahedral(n: Vec3) -> (f32, f32) {
    let scale = 1.0 / (n.x.abs() + n.y.abs() + n.z.abs());
    let (u, v) = (n.x * scale, n.z * scale);
    if n.y < 0.0 { ((1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v)) } else { (u, v) }
}

/// See [`super::chart_point`].
pub fn chart_point(_chart: &Chart, _position: Vec3, normal: Vec3) -> (f32, f32) {
    octahedral(normal)
}
