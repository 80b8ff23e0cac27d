//! How far around a texel photons are counted: density estimation with a neighbourhood that is as wide as irradiance is smooth.
//!
//! Irradiance by bounced light varies over lengths in proportion to the distance of the next surface (Ward, Rubinstein
//! & Clear, "A Ray Tracing Solution for Diffuse Interreflection", SIGGRAPH 1988), so a texel in the open may count the
//! photons of its neighbours too, and one beside a contact only its own.

use glam::DVec3;

use crate::shapes::Sheet;

/// Half-width of a neighbourhood as a share of the distance to the next surface. Measured: see the README.
const SHARE: f64 = 0.2;

/// Texels on each side at most: a neighbourhood of 9 × 9 leaves a ninth of the noise.
pub const WIDEST: u32 = 4;

/// The texels around one, `half_width` on each side in both directions, rows `stride` apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Neighbourhood {
    /// 0 to [`WIDEST`].
    pub half_width: u32,
    /// Columns of the chart.
    pub stride: u32,
}

impl Neighbourhood {
    /// For kernels.
    pub fn packed(self) -> u32 {
        self.stride << 8 | self.half_width
    }

    /// The texels of the neighbourhood around `texel`, row by row.
    pub fn texels(self, texel: usize) -> impl Iterator<Item = usize> {
        let (half, stride) = (self.half_width as usize, self.stride as usize);
        let first = texel - half * stride - half;
        (0..=2 * half).flat_map(move |row| (0..=2 * half).map(move |column| first + row * stride + column))
    }
}

/// How wide the neighbourhood around the texel at (column, row) of a chart may be. `length`: the texel's longer side, metres.
pub fn half_width(
    sheets: &[Sheet],
    shape: usize,
    point: DVec3,
    length: f64,
    (column, row): (u32, u32),
    (columns, rows): (u32, u32),
) -> u32 {
    let distance = |(number, other): (usize, &Sheet)| {
        if number == shape { f64::INFINITY } else { other.height(point).abs() }
    };
    let clearance = sheets.iter().enumerate().map(distance).fold(f64::INFINITY, f64::min);
    // Irradiance turns with the normal.
    let clearance = clearance.min(sheets[shape].curvature_radius());
    // Evenly to both sides, also beside the chart's border: else the neighbourhood's middle is elsewhere.
    let inside = column.min(row).min(columns - 1 - column).min(rows - 1 - row);
    let wanted = (SHARE * clearance / length).min(f64::from(WIDEST));
    (wanted as u32).min(inside)
}
