//! Charts of flat sheets: the rectangle around what light can reach, or a bent one about the scene.

use glam::{DVec2, DVec3};

use super::domain::{Domain, reached};
use super::neighbourhood::{self, Neighbourhood};
use super::{PlacedChart, PlacedTexel};
use crate::records::Chart;
use crate::shapes::Edges;

/// A plane's coordinates.
pub struct Axes {
    pub u: DVec3,
    pub v: DVec3,
    /// Any point of the plane.
    pub origin: DVec3,
    /// Of the angle between `u` and `v`.
    pub sine: f64,
}

impl Axes {
    /// Along the world's axes as far as the plane allows: most walls are aligned with them.
    pub fn of(normal: DVec3, offset: f64) -> Axes {
        let a = normal.abs();
        let helper = if a.x <= a.y && a.x <= a.z {
            DVec3::X
        } else if a.y <= a.z {
            DVec3::Y
        } else {
            DVec3::Z
        };
        let u = (helper - normal * normal.dot(helper)).normalize();
        Axes { u, v: normal.cross(u), origin: normal * offset, sine: 1.0 }
    }

    fn point(&self, p: DVec2) -> DVec3 {
        self.origin + self.u * p.x + self.v * p.y
    }
}

/// The coordinate that bends to `x`: the inverse of x/(1 + |x|).
fn unbend(x: f64) -> f64 {
    x / (1.0 - x.abs())
}

/// Cuts a polygon by `dot(normal, p) <= offset` (Sutherland & Hodgman 1974).
fn clip(polygon: &[DVec2], normal: DVec2, offset: f64) -> Vec<DVec2> {
    let mut kept = Vec::new();
    for (i, a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (from, to) = (normal.dot(*a) - offset, normal.dot(b) - offset);
        if from <= 0.0 {
            kept.push(*a);
        }
        if (from < 0.0 && to > 0.0) || (from > 0.0 && to < 0.0) {
            kept.push(*a + (b - *a) * (from / (from - to)));
        }
    }
    kept
}

/// Where a plane's chart lies: the box around what the half-spaces leave of it, else a bent one about the scene.
pub fn chart(domain: &Domain, shape: usize, axes: Axes) -> PlacedChart {
    // What the plane's light comes from or bounces off, seen along the normal.
    let lights = domain.lights.iter().map(|light| (*light, 0.0));
    let normal = axes.u.cross(axes.v);
    let mut near: Vec<(DVec2, f64)> = Vec::new();
    for (center, radius) in domain.bounds.iter().copied().chain(lights) {
        let from = center - axes.origin;
        near.push((DVec2::new(from.dot(axes.u), from.dot(axes.v)), from.dot(normal).abs() + radius));
    }
    let center = near.iter().map(|n| n.0).sum::<DVec2>() / near.len().max(1) as f64;
    let spread = near.iter().map(|(at, reach)| at.distance(center) + reach).fold(0.0, f64::max).max(1e-6);
    let far = 1e4 * spread;
    let corner = |x: f64, y: f64| center + DVec2::new(x, y) * far;
    let mut polygon = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    for h in domain.half_spaces.iter().filter(|h| h.shape != shape) {
        let across = DVec2::new(h.normal.dot(axes.u), h.normal.dot(axes.v));
        polygon = clip(&polygon, across, h.offset - h.normal.dot(axes.origin));
        if polygon.is_empty() {
            break; // nothing of it is lit
        }
    }
    let low = polygon.iter().copied().fold(DVec2::INFINITY, DVec2::min);
    let high = polygon.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
    let ends = !polygon.is_empty() && (low - center).abs().max((high - center).abs()).max_element() < 0.99 * far;
    let (middle, half, bend) = match ends {
        true => ((low + high) / 2.0, ((high - low) / 2.0).max(DVec2::splat(1e-9 * spread)), 0.0),
        false => (center, DVec2::splat(spread), 1.0),
    };
    let (axis_u, axis_v) = (axes.u / half.x, axes.v / half.y);
    let chart = Chart {
        axis_u: axis_u.as_vec3().to_array(),
        axis_v: axis_v.as_vec3().to_array(),
        offset_u: (-(axes.origin + axes.u * middle.x).dot(axis_u)) as f32,
        offset_v: (-(axes.origin + axes.v * middle.y).dot(axis_v)) as f32,
        bend,
        ..Chart::default()
    };
    // A bent chart gives half of its texels to the square of twice `spread` around the scene.
    let size = if ends { 2.0 * half } else { 6.0 * half };
    let axes = Axes { origin: axes.point(middle), u: axes.u * half.x, v: axes.v * half.y, sine: 1.0 };
    PlacedChart { chart, size, axes: Some(axes) }
}

/// The chart of what ends: all of it, whatever light can reach.
pub fn chart_within(edges: Edges, normal: DVec3) -> PlacedChart {
    let [u, v] = edges.half;
    // Dual to the halves of its edges.
    let gradient = |along: DVec3, other: DVec3| {
        let across = other.cross(normal);
        across / across.dot(along)
    };
    let (axis_u, axis_v) = (gradient(u, v), gradient(v, u));
    let chart = Chart {
        axis_u: axis_u.as_vec3().to_array(),
        axis_v: axis_v.as_vec3().to_array(),
        offset_u: -axis_u.dot(edges.center) as f32,
        offset_v: -axis_v.dot(edges.center) as f32,
        ..Chart::default()
    };
    let size = DVec2::new(2.0 * u.length(), 2.0 * v.length());
    PlacedChart {
        chart,
        size,
        axes: Some(Axes { origin: edges.center, u, v, sine: u.cross(v).length() / (u.length() * v.length()) }),
    }
}

/// A plane's texels. `axes` are those of the chart.
pub fn texels(domain: &Domain, shape: usize, axes: &Axes, chart: &Chart) -> Vec<PlacedTexel> {
    let (columns, rows) = (chart.columns as u32, chart.rows as u32);
    let straight = |x: f64| if chart.bend > 0.0 { unbend(x) } else { x };
    let (unit_u, unit_v) = (axes.u.length(), axes.v.length());
    let mut texels = Vec::with_capacity((columns * rows) as usize);
    for row in 0..rows {
        for column in 0..columns {
            let at = |i: u32, of: u32, part: f64| straight((f64::from(i) + part) / f64::from(of) * 2.0 - 1.0);
            let across = (at(column, columns, 1.0) - at(column, columns, 0.0)) * unit_u;
            let down = (at(row, rows, 1.0) - at(row, rows, 0.0)) * unit_v;
            let point = |x: f64, y: f64| axes.point(DVec2::new(at(column, columns, x), at(row, rows, y)));
            let area = across * down * axes.sine;
            let area = if area.is_finite() { area * reached(domain, shape, point) } else { 0.0 };
            let (place, size) = ((column, row), (columns, rows));
            let half_width =
                neighbourhood::half_width(&domain.sheets, shape, point(0.5, 0.5), across.max(down), place, size);
            let neighbourhood = Neighbourhood { half_width: half_width.min(domain.widest), stride: columns };
            texels.push(PlacedTexel { area, neighbourhood });
        }
    }
    texels
}
