//! Twin of `glsl/shared/shapes/plane.glsl`: its anchor is the unit normal n, its extent the offset d of dot(n, p) = d.

use glam::Vec3;

use super::flat::{flat_chart, flat_cut, flat_place};
use super::{Cut, INFINITE, KeepSide, LEAST_DISTANCE, MARGIN, Placed, ShadowRay, Sides, SurfaceOf, UNSURE, size_of};
use crate::records::{Chart, Shape};

/// A plane does not see itself.
pub const SEES_ITSELF: bool = false;

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

/// See [`super::hit`].
#[inline]
pub fn hit(shape: &Shape, origin: Vec3, direction: Vec3, on: bool, sides: Sides) -> f32 {
    hit_plane(origin, direction, shape.anchor.into(), shape.extent, on, sides)
}

/// See [`super::place`].
pub fn place(shape: &Shape, p: Vec3) -> Placed {
    flat_place(shape, p)
}

/// See [`super::met_behind`].
pub fn met_behind(shape: &Shape, _origin: Vec3, direction: Vec3, _on: bool) -> bool {
    Vec3::from(shape.anchor).dot(direction) > 0.0
}

/// See [`super::keep_side`].
#[inline]
pub fn keep_side(shape: &Shape, ray: &KeepSide, position: Vec3) -> Vec3 {
    let (normal, size) = (Vec3::from(shape.anchor), size_of(position));
    let [here, there] = [position, ray.origin].map(|p| normal.dot(p) - shape.extent);
    let unsure = there.abs() <= 2.5e-7 * size_of(ray.origin);
    let there = if unsure { normal.dot(ray.direction) } else { there };
    let side = ray.leaves.unwrap_or(1f32.copysign(there));
    if !ray.is_hit && here * side < UNSURE * size {
        position + normal * (side * MARGIN * size - here)
    } else {
        position
    }
}

/// See [`super::blocks`]. By sides rather than distances, which lose all digits where a ray grazes a plane that the light
/// lies on.
#[inline]
pub fn blocks(shape: &Shape, ray: &ShadowRay, on: bool, _sides: Sides) -> bool {
    let [here, there] = [ray.origin, ray.light].map(|p| Vec3::from(shape.anchor).dot(p) - shape.extent);
    // A light within rounding of the plane (a few ulps of the numbers that cancel) lies on it.
    let size = ray.light.dot(ray.light).sqrt();
    !on && here * there < 0.0 && there.abs() > 1e-6 * (size + shape.extent.abs())
}

/// See [`super::parts`]. Photons of the very edge count for both sides.
pub fn parts(shape: &Shape, point: Vec3, photon: Vec3) -> bool {
    let normal = Vec3::from(shape.anchor);
    (shape.extent - normal.dot(point)) * (shape.extent - normal.dot(photon)) < 0.0
}

/// Cuts of other surfaces' discs.
pub const CUTS: usize = 1;

/// See [`super::cut`].
pub fn cut(shape: &Shape, _number: usize, on: &SurfaceOf, inverse_radius: f32) -> Cut {
    flat_cut(shape, on, inverse_radius)
}

/// See [`super::distance`].
#[inline]
pub fn distance(shape: &Shape, position: Vec3) -> f32 {
    (Vec3::from(shape.anchor).dot(position) - shape.extent).abs()
}

/// See [`super::likeness`]: normals are the same all over it.
pub fn likeness(_shape: &Shape, _apart: Vec3, _reach: f32) -> f32 {
    1.0
}

/// See [`super::chart_point`]: along two axes, straight or, where the plane has no end, bent.
pub fn chart_point(chart: &Chart, position: Vec3, normal: Vec3) -> (f32, f32) {
    flat_chart(chart, position, normal)
}
