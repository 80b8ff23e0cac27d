//! Where light can be in a scene, as planes and spheres bound it, and which share of a texel that is.

use glam::DVec3;

use super::vector;
use crate::records::packing::Packed;
use crate::records::{Light, PLANE};

/// Points along a side of a texel at which it is asked what light can reach: an edge through a texel is known to about
/// 1/50 of it.
const SUBSAMPLES: u32 = 12;

/// A half-space that all light stays in: `dot(normal, p) <= offset`.
pub(super) struct HalfSpace {
    pub normal: DVec3,
    pub offset: f64,
    pub shape: usize,
}

/// What bounds the light of a scene.
pub(super) struct Domain<'a> {
    pub packed: &'a Packed,
    pub half_spaces: Vec<HalfSpace>,
    /// Texels on each side of one that its neighbourhood may have at most.
    pub widest: u32,
}

impl<'a> Domain<'a> {
    /// Planes that have all lights on one side keep their light on that side.
    pub fn new(packed: &'a Packed, widest: u32) -> Domain<'a> {
        let mut half_spaces = Vec::new();
        for (shape, plane) in packed.shapes.iter().enumerate().skip(packed.sphere_count) {
            let (normal, offset) = (vector(plane.anchor), f64::from(plane.extent));
            let heights = || packed.lights.iter().map(|light| normal.dot(vector(light.position)) - offset);
            // A light on the plane itself shines to both sides.
            if heights().all(|height| height < 0.0) {
                half_spaces.push(HalfSpace { normal, offset, shape });
            } else if heights().all(|height| height > 0.0) {
                half_spaces.push(HalfSpace { normal: -normal, offset: -offset, shape });
            }
        }
        Domain { packed, half_spaces, widest }
    }

    /// Whether light can come to the side of a shape that its own normal points to, or to the other one.
    pub fn lights_side(&self, shape: usize, front: bool) -> bool {
        let record = &self.packed.shapes[shape];
        if record.kind == PLANE {
            let outward = vector(record.anchor) * if front { 1.0 } else { -1.0 };
            // All light stays behind a half-space's plane.
            return !self.half_spaces.iter().any(|h| h.shape == shape && h.normal.dot(outward) > 0.0);
        }
        let side = if front { 1.0 } else { -1.0 };
        let above =
            |light: &Light| vector(light.position).distance(vector(record.anchor)) / f64::from(record.extent) - 1.0;
        self.packed.lights.iter().any(|light| side * above(light) > -1e-6) // on the surface is on both sides
    }

    /// Whether light can be at a point of a shape's surface.
    fn reaches(&self, point: DVec3, shape: usize) -> bool {
        let slack = 1e-9 * (1.0 + point.abs().max_element()); // a wall's own edge belongs to it
        let inside = |h: &HalfSpace| h.shape == shape || h.normal.dot(point) <= h.offset + slack;
        let covered = |(i, sphere): (usize, &crate::records::Shape)| {
            let radius = f64::from(sphere.extent);
            // A light inside makes a sphere's inside a place like any other.
            i != shape
                && point.distance_squared(vector(sphere.anchor)) < radius * radius
                && !self
                    .packed
                    .lights
                    .iter()
                    .any(|l| vector(l.position).distance_squared(vector(sphere.anchor)) < radius * radius)
        };
        self.half_spaces.iter().all(inside)
            && !self.packed.shapes[..self.packed.sphere_count].iter().enumerate().any(covered)
    }
}

/// Share of a texel that light reaches; `point` takes its inner coordinates in [0, 1]².
pub(super) fn reached(domain: &Domain, shape: usize, point: impl Fn(f64, f64) -> DVec3) -> f64 {
    let reaches = |x: f64, y: f64| domain.reaches(point(x, y), shape);
    // Corners a hair inside, since walls meet on the borders of charts.
    const NEAR: f64 = 1e-6;
    const FAR: f64 = 1.0 - NEAR;
    let probes = [
        (NEAR, NEAR),
        (FAR, NEAR),
        (NEAR, FAR),
        (FAR, FAR),
        (0.5, 0.5),
        (0.5, NEAR),
        (NEAR, 0.5),
        (FAR, 0.5),
        (0.5, FAR),
    ];
    let hits = probes.iter().filter(|(x, y)| reaches(*x, *y)).count();
    if hits == 0 || hits == probes.len() {
        return if hits == 0 { 0.0 } else { 1.0 };
    }
    let at = |i: u32| (f64::from(i) + 0.5) / f64::from(SUBSAMPLES);
    let inside: u32 =
        (0..SUBSAMPLES).map(|y| (0..SUBSAMPLES).map(|x| u32::from(reaches(at(x), at(y)))).sum::<u32>()).sum();
    f64::from(inside) / f64::from(SUBSAMPLES * SUBSAMPLES)
}
