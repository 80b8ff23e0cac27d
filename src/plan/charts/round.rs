//! Charts of round sheets: octahedral.

use glam::DVec3;

use super::PlacedTexel;
use super::domain::{Domain, reached};
use super::neighbourhood::{self, Neighbourhood};

/// A sphere's texels.
pub fn texels(domain: &Domain, shape: usize, (center, radius): (DVec3, f64), columns: u32) -> Vec<PlacedTexel> {
    let mut texels = Vec::with_capacity((columns * columns) as usize);
    for row in 0..columns {
        for column in 0..columns {
            let direction = |x: f64, y: f64| {
                let coordinate = |i: u32, part: f64| (f64::from(i) + part) / f64::from(columns) * 2.0 - 1.0;
                octahedral_vector(coordinate(column, x), coordinate(row, y))
            };
            let [a, b, c, d] = [direction(0.0, 0.0), direction(1.0, 0.0), direction(1.0, 1.0), direction(0.0, 1.0)];
            // The fold runs along one diagonal of the texels that it crosses: both halves are flat there.
            let half = columns / 2;
            let along_main_diagonal = (column < half) == (row >= half);
            let solid_angle = match along_main_diagonal {
                true => solid_angle(a, b, c) + solid_angle(a, c, d),
                false => solid_angle(a, b, d) + solid_angle(b, c, d),
            };
            let point = |x: f64, y: f64| center + direction(x, y) * radius;
            let whole = solid_angle * radius * radius;
            let (place, size, length) = ((column, row), (columns, columns), whole.sqrt());
            let half_width = neighbourhood::half_width(&domain.sheets, shape, point(0.5, 0.5), length, place, size);
            let neighbourhood = Neighbourhood { half_width: half_width.min(domain.widest), stride: columns };
            texels.push(PlacedTexel { area: whole * reached(domain, shape, point), neighbourhood });
        }
    }
    texels
}

/// Twin of `octahedral_vector` in `texels.glsl`, in double precision.
fn octahedral_vector(u: f64, v: f64) -> DVec3 {
    let y = 1.0 - u.abs() - v.abs();
    let (x, z) = if y < 0.0 { ((1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v)) } else { (u, v) };
    DVec3::new(x, y, z).normalize()
}

/// Solid angle of a spherical triangle (Van Oosterom & Strackee, 1983).
fn solid_angle(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}
