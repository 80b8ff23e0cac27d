//! In which directions a light can hit anything: a shape is a cap of the sphere of directions, a cell of the emission
//! map a small cone.

use std::sync::LazyLock;

use glam::DVec3;

use super::{CELLS, COLUMNS_LOG2, ROWS_LOG2};
use crate::shapes::{Cap, Shapes};

/// Where a light can hit something, a shape a cap; none where it can everywhere. In doubt, it can.
pub fn caps(shapes: &Shapes, light: DVec3) -> Option<Vec<Cap>> {
    shapes.iter().map(|shape| shape.cap(light)).collect()
}

/// A cone around a direction.
pub struct Cone {
    /// Unit.
    pub axis: DVec3,
    /// Of half of its opening angle.
    sine: f64,
    cosine: f64,
}

impl Cone {
    /// Whether it meets a cap: the angle between their axes is less than the sum of their own.
    pub fn meets(&self, cap: &Cap) -> bool {
        self.axis.dot(cap.axis) > cap.cosine * self.cosine - cap.sine * self.sine
    }
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
