//! Point lights.

use std::f64::consts::PI;

use glam::DVec3;

use super::Light;
use crate::reading::rules::{BRIGHTEST, COORDINATE};
use crate::reading::{RGB, Read, Rule, Saved, Table, XYZ};
use crate::records;

const INTENSITY: Rule =
    Rule { holds: |x| (0.0..=BRIGHTEST).contains(&x), expected: "an intensity in W/sr from 0 to 1e30" };

/// An isotropic point light.
#[derive(Clone, Debug, PartialEq)]
pub struct PointLight {
    /// World space, metres.
    pub position: DVec3,
    /// Radiant intensity, W/sr per channel; the flux is 4π times this.
    pub intensity: DVec3,
}

impl Light for PointLight {
    fn read(table: &Table) -> Read<PointLight> {
        table.allow_only(&["kind", "position", "intensity"])?;
        Ok(PointLight {
            position: table.need("position", "position = [x, y, z]")?.vector(XYZ, &COORDINATE)?,
            intensity: table.need("intensity", "intensity = [r, g, b]")?.vector(RGB, &INTENSITY)?,
        })
    }

    fn saved(&self) -> Vec<Saved> {
        vec![Saved::vector("position", self.position), Saved::vector("intensity", self.intensity)]
    }

    fn origin(&self) -> DVec3 {
        self.position
    }

    fn flux(&self) -> DVec3 {
        self.intensity * (4.0 * PI)
    }

    fn pack(&self, origin: DVec3) -> records::Light {
        records::Light {
            position: (self.position - origin).as_vec3().to_array(),
            intensity: self.intensity.as_vec3().to_array(),
        }
    }

    fn place(&mut self, scale: f64, by: DVec3) {
        self.position = self.position * scale + by;
        self.intensity *= scale * scale;
    }
}
