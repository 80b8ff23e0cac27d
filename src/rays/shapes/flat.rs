//! Twin of `glsl/shared/shapes/flat.glsl`: what flat shapes share.

use glam::Vec3;

use super::{Cut, Placed, SurfaceOf, sphere};
use crate::kinds::ShapeKind;
use crate::records::{Chart, Shape};

/// The line of a flat shape, as if it had no end, as seen from a point of another surface.
pub fn flat_cut(shape: &Shape, on: &SurfaceOf, inverse_radius: f32) -> Cut {
    let normal = Vec3::from(shape.anchor);
    let offset = shape.extent - normal.dot(on.position);
    let across = normal - on.normal * normal.dot(on.normal);
    let sine = across.length();
    let mut beyond = offset.abs() * inverse_radius;
    if ShapeKind::of(on.shape.kind) == ShapeKind::Sphere {
        beyond = sphere::plane_cut(on.shape, on.position, normal, offset, inverse_radius) * sine;
    }
    // The surface's own plane cuts nothing, nor does one along it, whose line is nowhere. (Around a sphere's pole it cuts a
    // circle, which no line resembles.)
    if on.is_own || sine < 1e-6 {
        beyond = f32::INFINITY;
    }
    Cut { across: across * 1f32.copysign(offset), sine, beyond: beyond.max(1e-12) }
}

/// A hit point put back on a flat shape's plane.
pub fn flat_place(shape: &Shape, p: Vec3) -> Placed {
    let normal = Vec3::from(shape.anchor);
    Placed { position: p + normal * (shape.extent - normal.dot(p)), normal }
}

/// Coordinates along two axes, straight or, where the shape has no end, bent.
pub fn flat_chart(chart: &Chart, position: Vec3, _normal: Vec3) -> (f32, f32) {
    let u = Vec3::from(chart.axis_u).dot(position) + chart.offset_u;
    let v = Vec3::from(chart.axis_v).dot(position) + chart.offset_v;
    (u / (1.0 + chart.bend * u.abs()), v / (1.0 + chart.bend * v.abs()))
}
