//! In which directions a light can hit anything: an object is a cap of the sphere of directions, a cell of the emission
//! map a small cone.

use std::sync::LazyLock;

use glam::DVec3;

use super::{CELLS, COLUMNS_LOG2, ROWS_LOG2};
use crate::records::packing::Packed;
use crate::records::{PLANE, Shape};

/// Directions from a light in which it can hit an object: those within an angle of an axis.
pub struct Cap {
    /// Unit.
    axis: DVec3,
    /// Of the angle, at most a right one.
    sine: f64,
    cosine: f64,
}

impl Cap {
    /// Whether a cell's cone meets the cap: the angle between their axes is less than the sum of their own.
    pub fn meets(&self, cone: &Cone) -> bool {
        cone.axis.dot(self.axis) > self.cosine * cone.cosine - self.sine * cone.sine
    }
}

/// Where a light can hit something, an object a cap; none where it can everywhere. In doubt, it can.
pub fn caps(packed: &Packed, light: DVec3) -> Option<Vec<Cap>> {
    let cap = |shape: &Shape| {
        let anchor = DVec3::from(shape.anchor.map(f64::from));
        let extent = f64::from(shape.extent);
        if shape.kind == PLANE {
            let distance = extent - anchor.dot(light);
            // 1e-5 of the numbers that cancel: float32 resolves them to 1e-7.
            let is_beside = distance.abs() > 1e-5 * (light.abs().dot(anchor.abs()) + extent.abs());
            is_beside.then(|| Cap { axis: (anchor * distance.signum()).normalize(), sine: 1.0, cosine: 0.0 })
        } else {
            let distance = (anchor - light).length();
            let sine = extent * (1.0 + 1e-5) / distance; // not below 1 within it
            (sine < 1.0).then(|| Cap { axis: (anchor - light) / distance, sine, cosine: (1.0 - sine * sine).sqrt() })
        }
    };
    packed.shapes.iter().map(cap).collect()
}

/// A cone around a direction.
pub struct Cone {
    /// Unit.
    pub axis: DVec3,
    /// Of half of its opening angle.
    sine: f64,
    cosine: f64,
}

/// A cone around each cell.
pub fn cones() -> &'static [Cone] {
    // A light that moves asks for them with every picture.
    static CONES: LazyLock<Vec<Cone>> = LazyLock::new(|| (0..CELLS as u32).map(bounding_cone).collect());
    &CONES
}

fn bounding_cone(cell: u32) -> Cone {
    let direction = |row: f64, column: f64| {
        let height = 1.0 - row * 2.0 / f64::from(1 << ROWS_LOG2);
        let turn = (column / f64::from(1 << COLUMNS_LOG2) - 0.125) * std::f64::consts::TAU;
        let radius = (1.0 - height * height).max(0.0).sqrt();
        DVec3::new(radius * turn.cos(), height, radius * turn.sin())
    };
    let (row, column) = (f64::from(cell >> COLUMNS_LOG2), f64::from(cell & ((1 << COLUMNS_LOG2) - 1)));
    let axis = direction(row + 0.5, column + 0.5);
    // The farthest point lies on the border; 8 points an edge miss it by less than the 2% added.
    let border = (0..=8).flat_map(|i| {
        let s = f64::from(i) / 8.0;
        [(row, column + s), (row + 1.0, column + s), (row + s, column), (row + s, column + 1.0)]
    });
    let farthest = border.map(|(r, c)| axis.angle_between(direction(r, c))).fold(0.0, f64::max);
    let (sine, cosine) = (farthest * 1.02 + 1e-5).sin_cos(); // 1e-5 rad: float32 directions
    Cone { axis, sine, cosine }
}
