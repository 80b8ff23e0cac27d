//! Where light can be in a scene.

use glam::DVec3;

use super::neighbourhood;
use crate::packing::Packed;
use crate::shapes::{Edges, Shape, Shapes, Sheet};

/// Points along a side of a texel at which it is asked what light can reach: an edge through a texel is known to about
/// 1/50 of it.
const SUBSAMPLES: u32 = 12;

/// A half-space that all light stays in: `dot(normal, p) <= offset`.
pub struct HalfSpace {
    pub normal: DVec3,
    pub offset: f64,
    /// Whose border it is.
    pub shape: usize,
}

/// What bounds the light of a scene.
pub struct Domain {
    /// Of the shapes, in the order of their records.
    pub sheets: Vec<Sheet>,
    /// Where flat ones of them end, if they do.
    pub edges: Vec<Option<Edges>>,
    /// Centres and radii of shapes that have an end.
    pub bounds: Vec<(DVec3, f64)>,
    /// Places of the lights.
    pub lights: Vec<DVec3>,
    pub half_spaces: Vec<HalfSpace>,
    /// See [`neighbourhood::WIDEST`].
    pub widest: u32,
}

impl Domain {
    /// Planes that have all lights on one side keep their light on that side.
    pub fn new(packed: &Packed) -> Domain {
        let shapes = Shapes::unpacked(&packed.shapes, &packed.quads);
        let lights: Vec<DVec3> = packed.lights.iter().map(|light| DVec3::from(light.position.map(f64::from))).collect();
        let mut half_spaces = Vec::new();
        // Light goes round what has an end.
        for (number, shape) in shapes.iter().enumerate().filter(|(_, shape)| shape.bounds().is_none()) {
            let sheet = shape.sheet();
            let Sheet::Flat { normal, offset } = sheet else { continue };
            let heights = || lights.iter().map(|light| sheet.height(*light));
            // A light on the plane itself shines to both sides.
            if heights().all(|height| height < 0.0) {
                half_spaces.push(HalfSpace { normal, offset, shape: number });
            } else if heights().all(|height| height > 0.0) {
                half_spaces.push(HalfSpace { normal: -normal, offset: -offset, shape: number });
            }
        }
        Domain {
            sheets: shapes.iter().map(Shape::sheet).collect(),
            edges: shapes.iter().map(Shape::edges).collect(),
            bounds: shapes.iter().filter_map(Shape::bounds).collect(),
            lights,
            half_spaces,
            widest: neighbourhood::WIDEST,
        }
    }

    /// Whether light can come to the side of a shape that its own normal points to, or to the other one.
    pub fn is_lit(&self, shape: usize, front: bool) -> bool {
        // Light goes round edges, from one side to the other.
        self.lights.iter().any(|light| self.edges[shape].is_some() || self.sheets[shape].is_lit(*light, front))
    }

    /// Whether light can be at a point of a shape's surface.
    pub fn reaches(&self, point: DVec3, shape: usize) -> bool {
        let slack = 1e-9 * (1.0 + point.abs().max_element()); // a wall's own edge belongs to it
        let inside = |h: &HalfSpace| h.shape == shape || h.normal.dot(point) <= h.offset + slack;
        // A light inside makes a sphere's inside a place like any other.
        let covered = |(i, sheet): (usize, &Sheet)| {
            i != shape && sheet.holds(point) && !self.lights.iter().any(|light| sheet.holds(*light))
        };
        self.half_spaces.iter().all(inside) && !self.sheets.iter().enumerate().any(covered)
    }
}

/// Share of a texel that light reaches; `point` takes its inner coordinates in [0, 1]².
pub fn reached(domain: &Domain, shape: usize, point: impl Fn(f64, f64) -> DVec3) -> f64 {
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
