//! Infinite planes.

use glam::DVec3;

use super::{Cap, Shape, Sheet, ULP, View};
use crate::kinds::ShapeKind;
use crate::reading::rules::{COORDINATE, DIRECTION, unit};
use crate::reading::{Field, Names, Read, Saved, Table, XYZ};
use crate::records;

/// An infinite plane: `dot(normal, p) = offset`; two-sided.
///
/// The file's normal may have any length: offset is divided by it together with the normal, so that the equation
/// holds as it was written. `normal = [0, 2, 0]`, `offset = 6` is the plane y = 3.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// Unit length (normalised when read).
    pub normal: DVec3,
    /// Metres from the world's origin along `normal`.
    pub offset: f64,
    /// Index into the scene's materials.
    pub material: usize,
}

/// A plane's normal and offset with the normal at unit length; the points that it contains stay the same.
fn normalized(normal: (Field, DVec3), offset: (Field, f64)) -> Read<(DVec3, f64)> {
    let Some(unit) = unit(normal.1) else {
        return Err(normal.0.wrong("a direction, not all zeros"));
    };
    let distance = offset.1 / normal.1.dot(unit);
    if distance.is_finite() && (COORDINATE.holds)(distance) {
        return Ok((unit, distance));
    }
    let mut error = offset.0.wrong("a plane within 1e15 m of the origin (offset / length of normal)");
    error.found += &format!(" with {}", normal.0.quote());
    Err(error)
}

impl Shape for Plane {
    fn read(table: &Table, names: &Names) -> Read<Plane> {
        table.allow_only(&["normal", "offset", "material"])?;
        let normal = table.need("normal", "normal = [x, y, z]")?;
        let offset = table.need("offset", "offset = a number: dot(normal, p) = offset")?;
        let (normal, offset) =
            normalized((normal, normal.vector(XYZ, &DIRECTION)?), (offset, offset.number(&COORDINATE)?))?;
        Ok(Plane { normal, offset, material: names.material(table)? })
    }

    fn saved(&self) -> Vec<Saved> {
        // The window takes no plane, and the file's normal need not have unit length.
        Vec::new()
    }

    fn material(&self) -> usize {
        self.material
    }

    fn sheet(&self) -> Sheet {
        Sheet::Flat { normal: self.normal, offset: self.offset }
    }

    fn pack(&self, origin: DVec3, facing: f64) -> records::Shape {
        records::Shape {
            anchor: (self.normal * facing).as_vec3().to_array(),
            extent: (facing * (self.offset - self.normal.dot(origin))) as f32,
            material: self.material as f32,
            kind: ShapeKind::Plane.number(),
        }
    }

    fn unpacked(record: &records::Shape, _row: Option<&records::Quad>) -> Plane {
        Plane {
            normal: DVec3::from(record.anchor.map(f64::from)),
            offset: f64::from(record.extent),
            material: record.material as usize,
        }
    }

    fn bounds(&self) -> Option<(DVec3, f64)> {
        None
    }

    fn distance(&self, origin: DVec3, direction: DVec3, own: bool) -> Option<f64> {
        let distance = (self.offset - self.normal.dot(origin)) / self.normal.dot(direction);
        (!own && distance > 0.0 && distance.is_finite()).then_some(distance)
    }

    fn place(&mut self, scale: f64, by: DVec3) {
        self.offset = self.offset * scale + self.normal.dot(by);
    }

    fn cap(&self, light: DVec3) -> Option<Cap> {
        let distance = self.offset - self.normal.dot(light);
        // 1e-5 of the numbers that cancel: float32 resolves them to 1e-7.
        let is_beside = distance.abs() > 1e-5 * (light.abs().dot(self.normal.abs()) + self.offset.abs());
        is_beside.then(|| Cap::half((self.normal * distance.signum()).normalize()))
    }

    fn facing(&self, light: DVec3) -> f64 {
        if self.normal.dot(light) < self.offset { -1.0 } else { 1.0 }
    }

    fn always_shadows() -> bool {
        false
    }

    /// If the camera is on one side and some light on the other, or either of them within rounding of the plane. Any
    /// other plane has every visible point and every light in one closed half-space, which is convex: the segment
    /// between them cannot cross it.
    fn may_shadow(&self, camera: DVec3, lights: &[DVec3]) -> bool {
        let side = |p: DVec3| self.sheet().side(p, camera);
        let of_camera = side(camera);
        lights.iter().any(|light| side(*light) * of_camera <= 0.0)
    }

    fn shadows_said(blocking: usize, all: &str, _lights: usize) -> String {
        format!("{blocking} of {all} lie between the camera and a light")
    }

    fn backs_said(number: &str) -> String {
        format!("on both sides of {number}, or on them")
    }

    fn warnings(all: &[Plane], view: &View) -> Vec<String> {
        // Of a room, the way from a light to the farthest wall tells how large it is.
        let walls = view.lights.iter().flat_map(|light| all.iter().map(|plane| plane.sheet().height(*light).abs()));
        let room = walls.fold(0.0, f64::max);
        let away = view.lights.iter().map(|light| light.distance(view.camera)).fold(0.0, f64::max);
        if all.len() > 2 && 4.0 * ULP * away > 1e-4 * room {
            return vec![format!(
                "the camera is {away:.1e} m from a room of {room:.1e} m: float32 knows its walls to {:.1e} of it",
                4.0 * ULP * away / room
            )];
        }
        Vec::new()
    }
}
