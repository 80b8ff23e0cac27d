//! Twin of `glsl/shared/shapes/quad.glsl`: a parallelogram. Its anchor and extent are its plane's, its row has two
//! coordinates along its edges.

use glam::Vec3;

use super::flat::{flat_cut, flat_place};
use super::{Cut, INFINITE, KeepSide, MARGIN, Placed, ShadowRay, ShapeAt, Sides, SurfaceOf, UNSURE, size_of};
use crate::records::{Chart, Quad, Shape};

/// Flat shapes do not see themselves.
pub const SEES_ITSELF: bool = false;

/// So much of the numbers that cancel an edge is wider than the quad: a ray between two quads that share an edge meets one
/// of them, whatever rounding says. Nor does one that starts beside a contact, which put its origin a [`MARGIN`] beyond its
/// own surface: hence a point's whole size counts, whichever way the edge lies.
const SLACK: f32 = 1.5e-6;

/// One of a quad's coordinates, and its gradient.
fn coordinates(quad: &Quad, p: Vec3) -> [(f32, Vec3, f32); 2] {
    [(quad.across_u, quad.offset_u), (quad.across_v, quad.offset_v)].map(|(across, offset)| {
        let across = Vec3::from(across);
        (across.dot(p) + offset, across, offset)
    })
}

/// Whether a point of the quad's plane lies on the quad.
fn holds(quad: &Quad, p: Vec3) -> bool {
    coordinates(quad, p).into_iter().all(|(at, across, offset)| {
        let size = size_of(across) * size_of(p) + offset.abs() + 1.0;
        at.abs() - 1.0 - SLACK * size <= 0.0
    })
}

/// See [`super::hit`]. Met from both sides, since light goes round its edges.
#[inline]
pub fn hit(at: &ShapeAt, origin: Vec3, direction: Vec3, on: bool, _sides: Sides) -> f32 {
    let normal = Vec3::from(at.anchor);
    let t = (at.extent - normal.dot(origin)) / normal.dot(direction);
    // A parallel ray gives ±infinity or NaN, both refused here.
    let hit = t > 0.0 && t < INFINITE && !on;
    if hit && holds(at.quad(), origin + direction * t) { t } else { INFINITE }
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
pub fn keep_side(at: &ShapeAt, ray: &KeepSide, position: Vec3) -> Vec3 {
    let (normal, size) = (Vec3::from(at.anchor), size_of(position));
    let [here, there] = [position, ray.origin].map(|p| normal.dot(p) - at.extent);
    let unsure = there.abs() <= 2.5e-7 * size_of(ray.origin);
    let there = if unsure { normal.dot(ray.direction) } else { there };
    let side = ray.leaves.unwrap_or(1f32.copysign(there));
    // Of the quad's plane only what is near the quad itself; far from it `here` is far from 0 on one side, and may be. A
    // ray that starts a margin beyond a wall, beside a contact, may end as far beyond it.
    let near_by = 4.0 * UNSURE * size.max(size_of(ray.origin));
    let unsure = !ray.is_hit && here * side < UNSURE * size && here.abs() < near_by;
    if unsure && holds(at.quad(), position) { position + normal * (side * MARGIN * size - here) } else { position }
}

/// See [`super::blocks`]: by sides, as a plane, and where the way crosses its plane.
#[inline]
pub fn blocks(at: &ShapeAt, ray: &ShadowRay, on: bool, _sides: Sides) -> bool {
    let [here, there] = [ray.origin, ray.light].map(|p| Vec3::from(at.anchor).dot(p) - at.extent);
    let size = ray.light.dot(ray.light).sqrt();
    let behind = here * there < 0.0 && there.abs() > 1e-6 * (size + at.extent.abs()) && !on;
    behind && holds(at.quad(), ray.origin + (ray.light - ray.origin) * (here / (here - there)))
}

/// See [`super::parts`].
pub fn parts(at: &ShapeAt, point: Vec3, photon: Vec3) -> bool {
    let normal = Vec3::from(at.anchor);
    let (here, there) = (at.extent - normal.dot(point), at.extent - normal.dot(photon));
    // Photons of the very edge count for both sides.
    here * there < 0.0 && holds(at.quad(), point + (photon - point) * (here / (here - there)))
}

/// Four edges cut the quad's own discs, and the first stands for the quad as a wall of others.
pub const CUTS: usize = 4;

/// See [`super::cut`]. Of the quad's own edges exact; as another surface's wall, where it reaches over the whole chord.
pub fn cut(at: &ShapeAt, number: usize, on: &SurfaceOf, inverse_radius: f32) -> Cut {
    if on.is_own {
        let (coordinate, across, _) = coordinates(at.quad(), on.position)[number / 2];
        let sign = if number % 2 == 0 { 1.0 } else { -1.0 };
        let steep = 1.0 / across.dot(across).sqrt();
        let beyond = ((1.0 - sign * coordinate) * steep * inverse_radius).max(1e-12);
        return Cut { across: across * (steep * sign), sine: 1.0, beyond };
    }
    if number > 0 {
        return Cut::NONE;
    }
    let wall = flat_cut(at, on, inverse_radius);
    let slope = 1.0 / wall.sine.max(1e-6);
    let h = (wall.beyond * slope).min(1.0);
    let towards = wall.across * (slope / inverse_radius);
    let along = on.normal.cross(towards) * (1.0 - h * h).max(0.0).sqrt();
    let foot = on.position + towards * h;
    let spans = holds(at.quad(), foot + along) && holds(at.quad(), foot - along);
    if spans { wall } else { Cut::NONE }
}

/// See [`super::distance`]; of a slanted quad's corners a little more.
#[inline]
pub fn distance(at: &ShapeAt, position: Vec3) -> f32 {
    let off = Vec3::from(at.anchor).dot(position) - at.extent;
    let beside = coordinates(at.quad(), position).map(|(coordinate, across, _)| {
        let beyond = (coordinate.abs() - 1.0).max(0.0);
        beyond * beyond / across.dot(across)
    });
    (off * off + beside[0] + beside[1]).sqrt()
}

/// See [`super::likeness`]: normals are the same all over it.
pub fn likeness(_shape: &Shape, _apart: Vec3, _reach: f32) -> f32 {
    1.0
}

/// See [`super::chart_point`].
pub fn chart_point(chart: &Chart, position: Vec3, normal: Vec3) -> (f32, f32) {
    super::flat::flat_chart(chart, position, normal)
}
