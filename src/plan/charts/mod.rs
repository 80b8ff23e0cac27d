//! Charts: how every object's surface is cut into irradiance texels, and how much area light can reach in each.
//!
//! A sphere's chart is octahedral, a plane's is the rectangle around the part of it that light can reach; a plane
//! without such an end is bent into one, so that memory is bounded whatever the scene's extent and no photon falls
//! beside its chart. A texel that other surfaces cut counts only the part that light can reach: irradiance is power over that.

mod domain;
mod flat;
mod neighbourhood;
mod round;

use glam::DVec2;

pub use neighbourhood::Neighbourhood;

use crate::packing::Packed;
use crate::records::Chart;
use crate::shapes::Sheet;
use domain::Domain;
use flat::Axes;

/// Fewest and most columns of a chart.
const COLUMNS: (u32, u32) = (4, 1024);

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

impl Charts {
    /// The charts of a packed scene, with about `budget` texels on one side each of all objects.
    pub fn new(packed: &Packed, budget: u32) -> Charts {
        Charts::with_neighbourhoods(packed, budget, neighbourhood::WIDEST)
    }

    /// The same with neighbourhoods of at most `widest` texels on each side.
    fn with_neighbourhoods(packed: &Packed, budget: u32, widest: u32) -> Charts {
        let domain = Domain { widest, ..Domain::new(packed) };
        let mut charts = Vec::new();
        for (shape, sheet) in domain.sheets.iter().enumerate() {
            charts.push(match *sheet {
                Sheet::Flat { normal, offset } => match domain.edges[shape] {
                    Some(edges) => flat::chart_within(edges, normal),
                    None => flat::chart(&domain, shape, Axes::of(normal, offset)),
                },
                Sheet::Round { radius, .. } => {
                    let size = DVec2::splat((4.0 * std::f64::consts::PI).sqrt() * radius);
                    PlacedChart { chart: Chart::default(), size, axes: None }
                }
            });
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
            let texels = match (domain.sheets[shape], &placed.axes) {
                (Sheet::Round { center, radius }, _) => round::texels(&domain, shape, (center, radius), across),
                (Sheet::Flat { .. }, Some(axes)) => flat::texels(&domain, shape, axes, chart),
                (Sheet::Flat { .. }, None) => unreachable!("flat charts have axes"),
            };
            let inverse = |(texel, own): (usize, &PlacedTexel)| {
                let area: f64 = own.neighbourhood.texels(texel).map(|i| texels[i].area).sum();
                if own.area > 0.0 && area.is_finite() { (1.0 / area) as f32 } else { 0.0 }
            };
            for front in [true, false] {
                neighbourhoods.extend(texels.iter().map(|texel| texel.neighbourhood));
                let lit = domain.is_lit(shape, front);
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

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::records::PLANE;
    use crate::scene;

    fn vector(v: [f32; 3]) -> DVec3 {
        DVec3::from(v.map(f64::from))
    }

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
