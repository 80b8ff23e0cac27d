//! Charts: how every object's surface is cut into irradiance texels, and how much area light can reach in each.
//!
//! A sphere's chart is octahedral, a plane's is the rectangle around the part of it that light can reach; a plane
//! without such an end is bent into one, so that memory is bounded whatever the scene's extent and no photon falls
//! beside its chart. A texel that other surfaces cut counts only the part that light can reach: irradiance is power over that.

mod neighbourhood;

use glam::{DVec2, DVec3};

pub use neighbourhood::Neighbourhood;

use crate::records::packing::Packed;
use crate::records::{Chart, Light, PLANE};

/// Fewest and most columns of a chart.
const COLUMNS: (u32, u32) = (4, 1024);

/// Points along a side of a texel at which it is asked what light can reach: an edge through a texel is known to about
/// 1/50 of it.
const SUBSAMPLES: u32 = 12;

/// The charts of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Charts {
    /// By object.
    pub records: Vec<Chart>,
    /// By texel: which texels' photons it counts.
    pub neighbourhoods: Vec<Neighbourhood>,
    /// By texel: 1 / (area that light can reach in its neighbourhood), 1/m²; 0 where it reaches nothing of the texel itself.
    pub inverse_areas: Vec<f32>,
}

/// A half-space that all light stays in: `dot(normal, p) <= offset`.
struct HalfSpace {
    normal: DVec3,
    offset: f64,
    shape: usize,
}

/// What bounds the light of a scene.
struct Domain<'a> {
    packed: &'a Packed,
    half_spaces: Vec<HalfSpace>,
    /// See [`neighbourhood::WIDEST`].
    widest: u32,
}

fn vector(v: [f32; 3]) -> DVec3 {
    DVec3::from(v.map(f64::from))
}

impl<'a> Domain<'a> {
    /// Planes that have all lights on one side keep their light on that side.
    fn new(packed: &'a Packed) -> Domain<'a> {
        let mut half_spaces = Vec::new();
        for (shape, plane) in packed.shapes.iter().enumerate().skip(packed.sphere_count) {
            let (normal, offset) = (vector(plane.anchor), f64::from(plane.extent));
            let heights = || packed.lights.iter().map(|light| normal.dot(vector(light.position)) - offset);
            // A light on the plane itself shines to both sides.
            if heights().all(|height| height < 0.0) {
                half_spaces.push(HalfSpace { normal, offset, shape });
            } else if heights().all(|height| height > 0.0) {
                half_spaces.push(HalfSpace { normal: -normal, offset: -offset, shape });
            }
        }
        Domain { packed, half_spaces, widest: neighbourhood::WIDEST }
    }

    /// Whether light can come to the side of an object that its own normal points to, or to the other one.
    fn lights_side(&self, shape: usize, front: bool) -> bool {
        let record = &self.packed.shapes[shape];
        if record.kind == PLANE {
            let outward = vector(record.anchor) * if front { 1.0 } else { -1.0 };
            // All light stays behind a half-space's plane.
            return !self.half_spaces.iter().any(|h| h.shape == shape && h.normal.dot(outward) > 0.0);
        }
        let side = if front { 1.0 } else { -1.0 };
        let above =
            |light: &Light| vector(light.position).distance(vector(record.anchor)) / f64::from(record.extent) - 1.0;
        self.packed.lights.iter().any(|light| side * above(light) > -1e-6) // on the surface is on both sides
    }

    /// Whether light can be at a point of an object's surface.
    fn reaches(&self, point: DVec3, shape: usize) -> bool {
        let slack = 1e-9 * (1.0 + point.abs().max_element()); // a wall's own edge belongs to it
        let inside = |h: &HalfSpace| h.shape == shape || h.normal.dot(point) <= h.offset + slack;
        let covered = |(i, sphere): (usize, &crate::records::Shape)| {
            let radius = f64::from(sphere.extent);
            // A light inside makes a sphere's inside a place like any other.
            i != shape
                && point.distance_squared(vector(sphere.anchor)) < radius * radius
                && !self
                    .packed
                    .lights
                    .iter()
                    .any(|l| vector(l.position).distance_squared(vector(sphere.anchor)) < radius * radius)
        };
        self.half_spaces.iter().all(inside)
            && !self.packed.shapes[..self.packed.sphere_count].iter().enumerate().any(covered)
    }
}

/// A plane's coordinates.
struct Axes {
    u: DVec3,
    v: DVec3,
    /// Any point of the plane.
    origin: DVec3,
}

impl Axes {
    /// Along the world's axes as far as the plane allows: most walls are aligned with them.
    fn of(normal: DVec3, offset: f64) -> Axes {
        let a = normal.abs();
        let helper = if a.x <= a.y && a.x <= a.z {
            DVec3::X
        } else if a.y <= a.z {
            DVec3::Y
        } else {
            DVec3::Z
        };
        let u = (helper - normal * normal.dot(helper)).normalize();
        Axes { u, v: normal.cross(u), origin: normal * offset }
    }

    fn point(&self, p: DVec2) -> DVec3 {
        self.origin + self.u * p.x + self.v * p.y
    }
}

/// The coordinate that bends to `x`: the inverse of x/(1 + |x|).
fn unbend(x: f64) -> f64 {
    x / (1.0 - x.abs())
}

impl Charts {
    /// The charts of a packed scene, with about `budget` texels on one side each of all objects.
    pub fn new(packed: &Packed, budget: u32) -> Charts {
        Charts::with_neighbourhoods(packed, budget, neighbourhood::WIDEST)
    }

    /// The same with neighbourhoods of at most `widest` texels on each side.
    fn with_neighbourhoods(packed: &Packed, budget: u32, widest: u32) -> Charts {
        let domain = Domain { widest, ..Domain::new(packed) };
        let mut charts = Vec::new();
        for (shape, record) in packed.shapes.iter().enumerate() {
            let extent = f64::from(record.extent);
            if record.kind == PLANE {
                charts.push(plane_chart(&domain, shape, Axes::of(vector(record.anchor), extent)));
            } else {
                let size = DVec2::splat((4.0 * std::f64::consts::PI).sqrt() * extent);
                charts.push(PlacedChart { chart: Chart::default(), size, axes: None });
            }
        }
        // One length of texel for all of them, but for the shortest and the longest.
        let area: f64 = charts.iter().map(|c| c.size.x * c.size.y).sum();
        let length = (area / f64::from(budget)).sqrt();
        let columns = |size: f64| {
            let wanted = if length > 0.0 { size / length } else { 0.0 };
            // Even, so that an octahedron's edges are borders of texels.
            (wanted.clamp(f64::from(COLUMNS.0), f64::from(COLUMNS.1)) as u32).next_multiple_of(2)
        };
        let mut first = 0;
        let (mut neighbourhoods, mut inverse_areas) = (Vec::new(), Vec::new());
        for (shape, placed) in charts.iter_mut().enumerate() {
            let (across, down) = (columns(placed.size.x), columns(placed.size.y));
            let chart = &mut placed.chart;
            (chart.first, chart.columns, chart.rows) = (first as f32, across as f32, down as f32);
            first += 2 * across * down;
            let texels = match &placed.axes {
                Some(axes) => plane_texels(&domain, shape, axes, chart),
                None => sphere_texels(&domain, shape, across),
            };
            let inverse = |(texel, own): (usize, &PlacedTexel)| {
                let area: f64 = own.neighbourhood.texels(texel).map(|i| texels[i].area).sum();
                if own.area > 0.0 && area.is_finite() { (1.0 / area) as f32 } else { 0.0 }
            };
            for front in [true, false] {
                neighbourhoods.extend(texels.iter().map(|texel| texel.neighbourhood));
                let lit = domain.lights_side(shape, front);
                inverse_areas.extend(texels.iter().enumerate().map(|texel| if lit { inverse(texel) } else { 0.0 }));
            }
        }
        Charts { records: charts.into_iter().map(|c| c.chart).collect(), neighbourhoods, inverse_areas }
    }

    /// Texels of all charts.
    pub fn texels(&self) -> usize {
        self.inverse_areas.len()
    }
}

/// A chart before it has texels.
struct PlacedChart {
    chart: Chart,
    /// Metres along its two coordinates, to share out texels by.
    size: DVec2,
    /// A plane's.
    axes: Option<Axes>,
}

/// A texel of one side.
struct PlacedTexel {
    /// That light reaches, m².
    area: f64,
    neighbourhood: Neighbourhood,
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
fn plane_chart(domain: &Domain, shape: usize, axes: Axes) -> PlacedChart {
    let packed = domain.packed;
    // What the plane's light comes from or bounces off, seen along the normal.
    let spheres = packed.shapes[..packed.sphere_count].iter().map(|s| (vector(s.anchor), f64::from(s.extent)));
    let lights = packed.lights.iter().map(|l| (vector(l.position), 0.0));
    let normal = axes.u.cross(axes.v);
    let mut near: Vec<(DVec2, f64)> = Vec::new();
    for (center, radius) in spheres.chain(lights) {
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
    let axes = Axes { origin: axes.point(middle), u: axes.u * half.x, v: axes.v * half.y };
    PlacedChart { chart, size, axes: Some(axes) }
}

/// A plane's texels. `axes` are those of the chart.
fn plane_texels(domain: &Domain, shape: usize, axes: &Axes, chart: &Chart) -> Vec<PlacedTexel> {
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
            let area = across * down;
            let area = if area.is_finite() { area * reached(domain, shape, point) } else { 0.0 };
            let (place, size) = ((column, row), (columns, rows));
            let half_width =
                neighbourhood::half_width(domain.packed, shape, point(0.5, 0.5), across.max(down), place, size);
            let neighbourhood = Neighbourhood { half_width: half_width.min(domain.widest), stride: columns };
            texels.push(PlacedTexel { area, neighbourhood });
        }
    }
    texels
}

/// A sphere's texels.
fn sphere_texels(domain: &Domain, shape: usize, columns: u32) -> Vec<PlacedTexel> {
    let sphere = &domain.packed.shapes[shape];
    let (center, radius) = (vector(sphere.anchor), f64::from(sphere.extent));
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
            let half_width = neighbourhood::half_width(domain.packed, shape, point(0.5, 0.5), length, place, size);
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

/// Share of a texel that light reaches; `point` takes its inner coordinates in [0, 1]².
fn reached(domain: &Domain, shape: usize, point: impl Fn(f64, f64) -> DVec3) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene;

    fn charts(name: &str) -> (Packed, Charts) {
        let scene = scene::load(std::path::Path::new(&format!("scenes/{name}.toml"))).expect("a scene of ours");
        let packed = Packed::new(&scene, scene.camera.position);
        let charts = Charts::new(&packed, 24_576);
        (packed, charts)
    }

    /// Area of the lit side of an object, m², where every texel counts for itself.
    fn area(packed: &Packed, shape: usize) -> f64 {
        let charts = Charts::with_neighbourhoods(packed, 24_576, 0);
        let chart = &charts.records[shape];
        let count = (chart.columns * chart.rows) as usize;
        let side = |side: usize| {
            let texels = &charts.inverse_areas[chart.first as usize + side * count..][..count];
            texels.iter().filter(|inverse| **inverse > 0.0).map(|inverse| 1.0 / f64::from(*inverse)).sum::<f64>()
        };
        side(0).max(side(1))
    }

    #[test]
    fn a_room_has_the_area_of_its_walls() {
        let (packed, _) = charts("gi_ref");
        // Two spheres of radius 1 that touch nothing; floor and ceiling 7 × 14.5, back and front 7 × 6.5, sides 14.5 × 6.5.
        let expected = [12.566, 12.566, 101.5, 101.5, 45.5, 45.5, 94.25, 94.25];
        assert_eq!(packed.shapes.len(), expected.len());
        for (shape, expected) in expected.into_iter().enumerate() {
            let found = area(&packed, shape);
            assert!((found / expected - 1.0).abs() < 2e-3, "object {shape}: {found}, expected {expected}");
        }
    }

    #[test]
    fn a_wall_that_cuts_a_sphere_leaves_its_cap() {
        let (packed, _) = charts("color_bleeding");
        // Centre on the plane x = −5: half of the sphere is in the room, and the wall misses a disc.
        let radius = f64::from(packed.shapes[0].extent);
        let half = 2.0 * std::f64::consts::PI * radius * radius;
        assert!((area(&packed, 0) / half - 1.0).abs() < 0.01, "{} of {half}", area(&packed, 0));
        let wall = (0..packed.shapes.len())
            .find(|i| {
                packed.shapes[*i].kind == PLANE && packed.shapes[*i].anchor[0] != 0.0 && {
                    let sphere = vector(packed.shapes[0].anchor);
                    (vector(packed.shapes[*i].anchor).dot(sphere) - f64::from(packed.shapes[*i].extent)).abs() < 1e-4
                }
            })
            .expect("the wall");
        let whole = 14.0 * 23.0;
        let expected = whole - std::f64::consts::PI * radius * radius;
        assert!((area(&packed, wall) / expected - 1.0).abs() < 1e-3, "{} of {expected}", area(&packed, wall));
    }

    #[test]
    fn a_plane_without_an_end_keeps_its_memory_bounded() {
        let (_, charts) = charts("sphere_and_plane");
        assert!(charts.texels() < 200_000, "{}", charts.texels());
        assert!(charts.records.iter().any(|chart| chart.bend == 1.0));
    }

    #[test]
    fn windows_stay_in_their_charts_are_wide_in_the_open_and_narrow_at_contacts() {
        for name in ["gi_ref", "color_bleeding", "sphere_and_plane"] {
            let (packed, charts) = charts(name);
            let mut widths = [0; 1 + neighbourhood::WIDEST as usize];
            for chart in &charts.records {
                let (columns, rows) = (chart.columns as usize, chart.rows as usize);
                for side in 0..2 {
                    let first = chart.first as usize + side * columns * rows;
                    for i in 0..columns * rows {
                        let neighbourhood = charts.neighbourhoods[first + i];
                        let around: Vec<usize> = neighbourhood.texels(first + i).collect();
                        let width = 2 * neighbourhood.half_width as usize + 1;
                        assert_eq!(around.len(), width * width);
                        assert!(around.iter().all(|t| (first..first + columns * rows).contains(t)));
                        // The rows of a neighbourhood do not wrap around the chart's border.
                        let (low, high) = (around[0] - first, around[width - 1] - first);
                        assert_eq!(low / columns, high / columns, "{name}: texel {i} of {columns} columns");
                        assert_eq!(around[around.len() / 2], first + i);
                        widths[neighbourhood.half_width as usize] += 1;
                    }
                }
            }
            // Contacts and the open, and most texels share.
            assert!(widths[0] > 0 && widths[neighbourhood::WIDEST as usize] > 0, "{name}: {widths:?}");
            assert!(widths[1..].iter().sum::<i32>() > widths[0], "{name}: {widths:?}");
            assert_eq!(charts.neighbourhoods.len(), charts.inverse_areas.len());
            assert!(packed.shapes.len() == charts.records.len());
        }
    }

    #[test]
    fn sides_that_no_light_can_come_to_are_dark() {
        let (packed, charts) = charts("gi_ref");
        for (shape, chart) in charts.records.iter().enumerate() {
            let count = (chart.columns * chart.rows) as usize;
            let lit = |side: usize| {
                let first = chart.first as usize + side * count;
                charts.inverse_areas[first..first + count].iter().any(|inverse| *inverse > 0.0)
            };
            // The lamp is inside the room and outside both spheres.
            assert!(lit(0) != lit(1), "object {shape} of {}", packed.shapes.len());
            assert!(shape >= packed.sphere_count || lit(0), "a sphere's outside");
        }
    }
}
