//! Quads: parallelograms.

use glam::DVec3;

use super::{Cap, Edges, Shape, Sheet};
use crate::kinds::ShapeKind;
use crate::reading::rules::{COORDINATE, DIRECTION};
use crate::reading::{Field, Names, Read, Saved, Table, XYZ};
use crate::records;

/// A parallelogram with corners `corner`, `corner + edges[0]`, `corner + edges[0] + edges[1]`, `corner + edges[1]`;
/// two-sided. Its normal is `edges[0] × edges[1]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Quad {
    /// World space, metres.
    pub corner: DVec3,
    /// From there to the corners beside it, metres; neither is zero, nor along the other.
    pub edges: [DVec3; 2],
    /// Index into the scene's materials.
    pub material: usize,
}

/// Least sine of the angle between the edges: of less, float32 keeps no digit of a coordinate along them.
const LEAST_SINE: f64 = 1e-4;

impl Quad {
    /// Unit.
    pub fn normal(&self) -> DVec3 {
        // Each at unit length first: squares of lengths of 1e-20 m or 1e15 m would leave nothing of the rest.
        self.edges[0].normalize().cross(self.edges[1].normalize()).normalize()
    }

    /// Its middle, metres.
    fn center(&self) -> DVec3 {
        self.corner + (self.edges[0] + self.edges[1]) / 2.0
    }

    /// Gradients of the coordinates that are −1 and 1 on the edges, 1/m: dual to half the edges.
    pub fn across(&self) -> [DVec3; 2] {
        let normal = self.normal();
        let dual = |along: DVec3, other: DVec3| {
            let across = other.cross(normal);
            across * (2.0 / across.dot(along))
        };
        [dual(self.edges[0], self.edges[1]), dual(self.edges[1], self.edges[0])]
    }

    /// Both coordinates of a point of its plane.
    pub fn coordinates(&self, p: DVec3) -> [f64; 2] {
        self.across().map(|across| across.dot(p - self.center()))
    }
}

impl Shape for Quad {
    fn read(table: &Table, names: &Names) -> Read<Quad> {
        table.allow_only(&["corner", "edges", "material"])?;
        let corner = table.need("corner", "corner = [x, y, z]")?.vector(XYZ, &COORDINATE)?;
        let field = table.need("edges", "edges = [[x, y, z], [x, y, z]]: from the corner to those beside it")?;
        let edges: [Field; 2] = field.array("two edges, [[x, y, z], [x, y, z]]")?;
        let edges = [edges[0].vector(XYZ, &DIRECTION)?, edges[1].vector(XYZ, &DIRECTION)?];
        let [a, b] = edges.map(DVec3::normalize_or_zero);
        if a == DVec3::ZERO || b == DVec3::ZERO || a.cross(b).length() < LEAST_SINE {
            return Err(
                field.wrong("two edges of some length in different directions, by more than 1/10000 of a right angle")
            );
        }
        Ok(Quad { corner, edges, material: names.material(table)? })
    }

    fn saved(&self) -> Vec<Saved> {
        vec![Saved::vector("corner", self.corner)]
    }

    fn material(&self) -> usize {
        self.material
    }

    fn sheet(&self) -> Sheet {
        let normal = self.normal();
        Sheet::Flat { normal, offset: normal.dot(self.center()) }
    }

    fn edges(&self) -> Option<Edges> {
        Some(Edges { center: self.center(), half: self.edges.map(|edge| edge / 2.0) })
    }

    fn pack(&self, origin: DVec3, facing: f64) -> records::Shape {
        let normal = self.normal() * facing;
        records::Shape {
            anchor: normal.as_vec3().to_array(),
            extent: normal.dot(self.center() - origin) as f32,
            material: self.material as f32,
            kind: ShapeKind::Quad.number(),
        }
    }

    fn row(&self, origin: DVec3) -> Option<records::Quad> {
        let center = self.center() - origin;
        let [across_u, across_v] = self.across();
        Some(records::Quad {
            across_u: across_u.as_vec3().to_array(),
            across_v: across_v.as_vec3().to_array(),
            offset_u: -across_u.dot(center) as f32,
            offset_v: -across_v.dot(center) as f32,
            count: 0.0, // of all of them: packing knows
        })
    }

    fn unpacked(record: &records::Shape, row: Option<&records::Quad>) -> Quad {
        let vector = |v: [f32; 3]| DVec3::from(v.map(f64::from));
        let (normal, offset) = (vector(record.anchor), f64::from(record.extent));
        let material = record.material as usize;
        let Some(row) = row else {
            // Its plane alone is known.
            let edge = normal.normalize().any_orthonormal_vector();
            return Quad { corner: normal * offset, edges: [edge, normal.cross(edge)], material };
        };
        let [across_u, across_v] = [row.across_u, row.across_v].map(vector);
        // Dual to the gradients, which lie in the plane.
        let half = |across: DVec3, other: DVec3| {
            let along = other.cross(normal);
            along / along.dot(across)
        };
        let half = [half(across_u, across_v), half(across_v, across_u)];
        let center = normal * offset - half[0] * f64::from(row.offset_u) - half[1] * f64::from(row.offset_v);
        Quad { corner: center - half[0] - half[1], edges: half.map(|half| half * 2.0), material }
    }

    fn bounds(&self) -> Option<(DVec3, f64)> {
        let [a, b] = self.edges.map(|edge| edge / 2.0);
        Some((self.center(), (a + b).length().max((a - b).length())))
    }

    fn distance(&self, origin: DVec3, direction: DVec3, own: bool) -> Option<f64> {
        let normal = self.normal();
        let distance = normal.dot(self.center() - origin) / normal.dot(direction);
        let is_met = !own && distance > 0.0 && distance.is_finite();
        let is_on = || self.coordinates(origin + direction * distance).iter().all(|x| x.abs() <= 1.0);
        (is_met && is_on()).then_some(distance)
    }

    fn place(&mut self, scale: f64, by: DVec3) {
        self.corner = self.corner * scale + by;
        self.edges = self.edges.map(|edge| edge * scale);
    }

    fn cap(&self, light: DVec3) -> Option<Cap> {
        let (center, radius) = self.bounds()?;
        Cap::around(center - light, radius)
    }

    fn facing(&self, light: DVec3) -> f64 {
        if self.sheet().height(light) < 0.0 { -1.0 } else { 1.0 }
    }

    fn backs_said(number: &str) -> String {
        format!("on either side of {number}")
    }
}
