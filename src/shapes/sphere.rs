//! Spheres.

use glam::DVec3;

use super::{Shape, Sheet, ULP, View};
use crate::kinds::ShapeKind;
use crate::reading::rules::{COORDINATE, RADIUS};
use crate::reading::{Names, Read, Saved, Table, XYZ};
use crate::records;

/// A sphere; two-sided unless it transmits.
#[derive(Clone, Debug, PartialEq)]
pub struct Sphere {
    /// World space, metres.
    pub center: DVec3,
    /// Metres, > 0.
    pub radius: f64,
    /// Index into the scene's materials.
    pub material: usize,
}

impl Shape for Sphere {
    fn read(table: &Table, names: &Names) -> Read<Sphere> {
        table.allow_only(&["center", "radius", "material"])?;
        Ok(Sphere {
            center: table.need("center", "center = [x, y, z]")?.vector(XYZ, &COORDINATE)?,
            radius: table.need("radius", "radius = a number > 0")?.number(&RADIUS)?,
            material: names.material(table)?,
        })
    }

    fn saved(&self) -> Vec<Saved> {
        vec![Saved::vector("center", self.center), Saved::number("radius", self.radius)]
    }

    fn material(&self) -> usize {
        self.material
    }

    fn sheet(&self) -> Sheet {
        Sheet::Round { center: self.center, radius: self.radius }
    }

    fn pack(&self, origin: DVec3, _facing: f64) -> records::Shape {
        records::Shape {
            anchor: (self.center - origin).as_vec3().to_array(),
            extent: self.radius as f32,
            material: self.material as f32,
            kind: ShapeKind::Sphere.number(),
        }
    }

    fn unpacked(record: &records::Shape, _row: Option<&records::Quad>) -> Sphere {
        Sphere {
            center: DVec3::from(record.anchor.map(f64::from)),
            radius: f64::from(record.extent),
            material: record.material as usize,
        }
    }

    fn bounds(&self) -> Option<(DVec3, f64)> {
        Some((self.center, self.radius))
    }

    fn distance(&self, origin: DVec3, direction: DVec3, own: bool) -> Option<f64> {
        let approach = (self.center - origin).dot(direction);
        let aside = origin + direction * approach - self.center;
        let half_chord = (self.radius * self.radius - aside.length_squared()).sqrt(); // NaN where the ray misses
        let entry = approach - half_chord;
        let distance = if own || entry <= 0.0 { approach + half_chord } else { entry };
        // Outwards from a sphere its far side is where the ray starts.
        let least = if own { 1e-6 * self.radius } else { 0.0 };
        (distance > least && distance.is_finite()).then_some(distance)
    }

    fn place(&mut self, scale: f64, by: DVec3) {
        self.center = self.center * scale + by;
        self.radius *= scale;
    }

    fn warnings(all: &[Sphere], view: &View) -> Vec<String> {
        let mut warnings = Vec::new();
        if let Some((number, sphere)) = all.iter().enumerate().max_by(|a, b| a.1.radius.total_cmp(&b.1.radius)) {
            // A hundredth of a percent of the scene: below, walls of radius 10⁵ m around a room of metres.
            let known_to = 2.0 * ULP * sphere.radius;
            if known_to > 1e-2 * view.size {
                warnings.push(format!(
                    "sphere {number} has a radius of {:.3e} m: float32 knows its surface to {known_to:.1e} m, in a scene \
                     of {:.1e} m",
                    sphere.radius, view.size
                ));
            }
        }
        let far = |sphere: &Sphere| 4.0 * ULP * sphere.center.distance(view.camera) / sphere.radius;
        let worst = all.iter().map(far).enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((number, turned)) = worst.filter(|(_, turned)| *turned > 1e-2) {
            warnings.push(format!(
                "sphere {number} is far away for its size: float32 knows its normals to {turned:.1e} rad"
            ));
        }
        warnings
    }
}
