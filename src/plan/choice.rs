//! Grid, tiles or tiled grid, where the user names none: what a picture would cost by each, from counts.
//!
//! The model is a sum: counts of what a method does, from a raster of visible points and a sample of the map, times
//! what one of each costs on this class of devices. `photile bench --suite choice` measures both, and fits the costs.

use glam::Vec3;

use crate::plan::cells::{self, Bounds, CELLS_PER_RADIUS, CellSize, Form, photon_density};
use crate::plan::photon_sample::Sample;
use crate::plan::radius::{RASTER, visible_points};
use crate::plan::tiling::MAX_CELLS;
use crate::rays::camera::camera_direction;
use crate::rays::scene::SceneTables;
use crate::records::{Frame, PLANE, Shape};
use crate::settings::Method;

/// Sizes of tiles that are weighed where none are asked for, pixels.
pub const SIZES: [[u32; 2]; MOST_SIZES] = [[80, 80], [32, 32], [16, 16]];

/// How many these are.
const MOST_SIZES: usize = 3;

/// Who gathers: devices on which things cost about the same, but for a common factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    /// The twin.
    Cpu,
    /// OpenCL with several lanes a work-item: blocks of pixels walk together.
    OpenClLanes,
    /// OpenCL with one.
    OpenClGpu,
    /// Fragments of a software rasteriser.
    OpenGlSoftware,
    /// Fragments of a GPU.
    OpenGlGpu,
}

impl Class {
    /// All of them.
    pub const ALL: [Class; 5] =
        [Class::Cpu, Class::OpenClLanes, Class::OpenClGpu, Class::OpenGlSoftware, Class::OpenGlGpu];

    /// OpenCL with so many lanes a work-item.
    pub fn of_opencl(lanes: u32) -> Class {
        if lanes == 1 { Class::OpenClGpu } else { Class::OpenClLanes }
    }

    /// Fragments of such a renderer.
    pub fn of_opengl(is_software: bool) -> Class {
        if is_software { Class::OpenGlSoftware } else { Class::OpenGlGpu }
    }

    /// As files have it.
    pub fn name(self) -> &'static str {
        match self {
            Class::Cpu => "cpu",
            Class::OpenClLanes => "opencl-lanes",
            Class::OpenClGpu => "opencl-gpu",
            Class::OpenGlSoftware => "opengl-software",
            Class::OpenGlGpu => "opengl-gpu",
        }
    }

    /// Nanoseconds of one of each of [`TERMS`]: only their ratios matter. Fitted by `bench --suite choice`, on two cores
    /// of a Xeon (PoCL, llvmpipe, the twin) and on an H200. A cost of 0 is one that others of the terms account for.
    pub fn costs(self) -> &'static Counts {
        match self {
            Class::Cpu => {
                &[0.0, 3.77, 0.0, 9.15, 49.8, 250.0, 8.7, 2.11, 97.4, 0.0, 107.0, 46.2, 1.57e6, 0.0, 326.0, 87.9, 0.0]
            }
            Class::OpenClLanes => &[
                0.0, 0.0922, 0.0, 0.0495, 1.48, 4.75, 0.386, 0.111, 2.02, 3.83e5, 25.6, 2.57, 3.02e5, 3.83, 55.4, 12.9,
                0.0,
            ],
            Class::OpenClGpu => &[
                0.0, 0.0, 0.000638, 0.0, 0.0, 0.151, 0.00081, 0.000361, 0.0, 3.74e5, 0.797, 0.262, 1.16e6, 1.05, 0.842,
                2.52, 48.4,
            ],
            Class::OpenGlSoftware => {
                &[25.0, 2.48, 0.0, 0.278, 7.67, 19.8, 4.6, 2.06, 16.0, 2.28e6, 44.0, 0.0, 0.0, 29.9, 477.0, 0.0, 0.0]
            }
            Class::OpenGlGpu => &[
                0.0, 0.0448, 0.0, 0.0384, 0.196, 0.545, 0.0459, 0.000775, 0.00429, 6.18e5, 7.37, 1.46, 4.76e6, 1.64,
                6.13, 44.7, 190.0,
            ],
        }
    }

    /// Pixels along a side of what gathers together: the lanes of a work-item.
    fn block(self) -> f32 {
        match self {
            Class::OpenClLanes => 4.0,
            _ => 1.0,
        }
    }

    /// How large the grid's cells are made for it.
    pub fn cell_size(self) -> CellSize {
        match self {
            Class::OpenGlSoftware => CellSize::Fragments,
            Class::OpenGlGpu => CellSize::Alone,
            Class::Cpu | Class::OpenClLanes | Class::OpenClGpu => CellSize::Auto,
        }
    }
}

/// What is counted, for the whole picture.
pub const TERMS: [&str; 17] = [
    // Any method's share: rays, shadows, direct light.
    "pixels",
    // Photons within R of visible points, however they are found.
    "accepted",
    // Candidates in the cells around points, of a dense grid and of a hashed one.
    "candidates",
    "candidates-hashed",
    // Rows of cells that queries walk through.
    "rows",
    "rows-hashed",
    // Entries of lists that tiles look through; in tiled grids those in the cells around points, and rows of these.
    "listed",
    "celled",
    "rows-celled",
    // A grid, photons sorted into it, and its cells.
    "grid",
    "sorted",
    "cells",
    // A tiling, photons looked at for tiles, what of them enters lists, rays that look what tiles see, and tiles.
    "tiling",
    "projected",
    "entered",
    "seen",
    "tiles",
];

/// A number of each of [`TERMS`].
pub type Counts = [f64; TERMS.len()];

/// Sides of a cell by which candidates lie farther than R: at R/2 a cell that makes 1.7 candidates of each accepted
/// photon, as measured in a closed room.
const BEYOND: f32 = 0.6;

/// What is known when the choice is made.
#[derive(Clone, Copy, Debug)]
pub struct Question {
    /// Photons of the map.
    pub stored: u64,
    /// R, metres.
    pub radius: f32,
    /// Tiles of this size only, pixels.
    pub tile: Option<[u32; 2]>,
    /// Who asks.
    pub class: Class,
}

/// What one method would take.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// How photons are found.
    pub method: Method,
    /// Width and height of tiles, where there are any.
    pub tile: Option<[u32; 2]>,
    /// Photons looked at, a visible pixel.
    pub candidates: f64,
    /// Entries of the tiles' lists, or photons of the grid.
    pub entries: f64,
    /// Building and gathering, milliseconds on the machine where costs were measured: others differ by a factor.
    pub cost: f64,
    /// Of [`TERMS`], in their order.
    pub counts: Counts,
}

impl Estimate {
    /// The cost with other costs of the terms, milliseconds.
    pub fn cost_at(&self, costs: &Counts) -> f64 {
        cost(&self.counts, costs)
    }

    /// The term that costs most, and its share of the cost.
    pub fn dearest(&self, class: Class) -> (&'static str, f64) {
        let terms = TERMS.iter().zip(self.counts.iter().zip(class.costs()).map(|(count, cost)| count * cost));
        let (name, most) = terms.max_by(|a, b| a.1.total_cmp(&b.1)).expect("there are terms");
        (name, most * 1e-6 / self.cost)
    }
}

/// Milliseconds of so many of each term.
fn cost(counts: &Counts, costs: &Counts) -> f64 {
    counts.iter().zip(costs).map(|(count, cost)| count * cost).sum::<f64>() * 1e-6
}

/// Pairs of visible points and photons whose distance is taken: some hundred microseconds.
const PAIRS: usize = 3 << 17;

/// Visible points of them.
const POINTS: usize = 96;

/// What each method would take, the cheapest first.
///
/// Photons within R of a point are accepted ones; a tile's list holds those within R of its part of the surface, about
/// a disc around the point.
pub fn estimates(scene: &SceneTables, frame: &Frame, sample: &Sample, question: &Question) -> Vec<Estimate> {
    let &Question { stored, radius, tile, class } = question;
    let sizes = tile.as_ref().map_or(&SIZES[..], std::slice::from_ref);
    let visible = visible_points(scene, frame);
    let share = visible.len() as f64 / RASTER as f64; // of the picture
    let points: Vec<(Vec3, usize)> = visible
        .iter()
        .step_by(visible.len().div_ceil(POINTS).max(1))
        .map(|(p, (shape, side))| (*p, 2 * shape + usize::from(*side < 0.0)))
        .collect();
    let pixels = f64::from(frame.width * frame.height * frame.samples.max(1.0));
    // Points stand for this many pixels each.
    let each = pixels * share / points.len().max(1) as f64;

    // Photons by face, the first ones of the sample: any beginning of it is as well spread as the whole.
    let looked_at = sample.positions.len().min(PAIRS / points.len().max(1));
    let scale = stored as f64 / looked_at.max(1) as f64;
    let mut faces = vec![Vec::new(); 2 * scene.shapes.len()];
    for (position, face) in sample.positions.iter().zip(&sample.faces).take(looked_at) {
        faces[*face as usize].push(Vec3::from(position.position));
    }
    let grid = grid(scene, sample, question);
    // Cells along rows and across them.
    let usual = radius / CELLS_PER_RADIUS;
    let [along, cell, hashed, cells] = grid.map_or([usual, usual, 0.0, 0.0], |grid| {
        [grid.gather.cell[0], grid.gather.cell[1], f32::from(u8::from(grid.hashed)), grid.cells as f32]
    });
    let beyond = 0.5 * BEYOND * (along + cell);
    let [mut accepted, mut rows, mut candidates] = [0.0; 3];
    // By size of tiles: entries of lists, those in the cells around points, rows of these cells, and cells of a tile.
    let mut tiled = vec![[0.0; 4]; sizes.len()];
    for &(p, face) in &points {
        let shape = &scene.shapes[face / 2];
        let flat = shape.kind == PLANE && Vec3::from(shape.anchor).abs().max_element() > 0.999;
        // An area's image on the surface, as a disc of the same area; slanted surfaces fill more of it.
        let away = p - Vec3::from(frame.position);
        let depth = away.dot(frame.forward.into());
        let normal = if shape.kind == PLANE { shape.anchor.into() } else { p - Vec3::from(shape.anchor) };
        let cosine = (away.dot(normal) / (away.length() * normal.length())).abs().max(0.03);
        let [width, height] = [frame.right, frame.up].map(|half| 2.0 * Vec3::from(half).length() * depth);
        let image = |size: [f32; 2]| {
            [width * (size[0] / frame.width).min(1.0), height * (size[1] / frame.height).min(1.0) / cosine]
        };
        let disc = |[across, down]: [f32; 2]| (across * down / std::f32::consts::PI).sqrt();
        // Pixels that gather together walk over what is near any of them, unless that is far apart.
        let together = if class.block() > 1.0 { disc(image([class.block(); 2])).min(2.0 * radius) } else { 0.0 };
        let reach = radius + together;
        // Where the surface crosses the rows, there are as many in the other direction too.
        let rows_of = |cell: f32| {
            let along = 2.0 * reach / cell + 1.0;
            f64::from(if flat { along } else { along * along })
        };
        rows += rows_of(cell);
        let mut reaches = [[0.0; 2]; MOST_SIZES];
        let mut farthest = reach + beyond;
        for ((size, tiled), reaches) in sizes.iter().zip(&mut tiled).zip(&mut reaches) {
            let [across, down] = image(size.map(|pixels| pixels as f32));
            // A large tile's cells are larger than a grid's: it has only so many, and towards a horizon sees far.
            let area = match shape.kind == PLANE {
                true => plane_area(shape, frame, pixel_of(frame, away), *size, radius),
                false => (across + 2.0 * radius) * (down + 2.0 * radius),
            };
            let own_cell = (radius / CELLS_PER_RADIUS).max((area / MAX_CELLS as f32).sqrt());
            tiled[2] += rows_of(own_cell);
            tiled[3] += f64::from(area / (own_cell * own_cell));
            let list = radius + disc([across, down]);
            *reaches = [list, list.min(reach + BEYOND * own_cell)];
            farthest = farthest.max(list);
        }
        let (near, in_cells) = (radius * radius, (reach + beyond).powi(2));
        let reaches = reaches.map(|reaches| reaches.map(|reach| reach * reach));
        let farthest = farthest * farthest;
        for photon in &faces[face] {
            let d2 = photon.distance_squared(p);
            // Most are.
            if d2 >= farthest {
                continue;
            }
            let within = |reach2: f32| f64::from(u8::from(d2 < reach2));
            accepted += within(near);
            candidates += within(in_cells);
            for (tiled, [list, cells]) in tiled.iter_mut().zip(&reaches) {
                tiled[0] += within(*list);
                tiled[1] += within(*cells);
            }
        }
    }
    let per_point = scale / points.len().max(1) as f64;
    let [accepted, candidates, rows] = [accepted * scale * each, candidates * scale * each, rows * each];
    let stored = stored as f64;

    let mut all = Vec::new();
    let mut add = |method, tile: Option<[u32; 2]>, candidates: f64, entries: f64, counted: &[(&str, f64)]| {
        let counts = TERMS.map(|term| counted.iter().find(|(name, _)| *name == term).map_or(0.0, |(_, count)| *count));
        let cost = cost(&counts, class.costs());
        all.push(Estimate { method, tile, candidates, entries, cost, counts });
    };
    let seen = (pixels * share).max(1.0);
    let [in_cells, own_rows] = if hashed > 0.0 { ["candidates-hashed", "rows-hashed"] } else { ["candidates", "rows"] };
    let any = [("pixels", pixels), ("accepted", accepted)];
    let build = [("grid", 1.0), ("sorted", stored), ("cells", f64::from(cells))];
    let counted = [&any[..], &build[..], &[(in_cells, candidates), (own_rows, rows)]].concat();
    add(Method::Grid, None, candidates / seen, stored, &counted);
    for (size, [in_lists, in_cells, rows, cells]) in sizes.iter().zip(tiled) {
        let tiles = f64::from((frame.width / size[0] as f32).ceil() * (frame.height / size[1] as f32).ceil());
        // Tiles see one face and some of another.
        let regions = 1.2 * tiles * share;
        let entries = regions * in_lists * per_point;
        let listed = in_lists * scale * each;
        let celled = in_cells * scale * each;
        let build = [("tiling", 1.0), ("projected", stored), ("entered", entries), ("seen", pixels), ("tiles", tiles)];
        let tiled = [&any[..], &build[..]].concat();
        let gather =
            [("celled", celled), ("rows-celled", rows * each), ("cells", regions * cells / points.len().max(1) as f64)];
        add(Method::Tiles, Some(*size), listed / seen, entries, &[&tiled[..], &[("listed", listed)]].concat());
        add(Method::TiledGrid, Some(*size), celled / seen, entries, &[&tiled[..], &gather].concat());
    }
    all.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    all
}

/// The pixel that sees what lies in this direction.
fn pixel_of(frame: &Frame, away: Vec3) -> [f32; 2] {
    let depth = away.dot(frame.forward.into());
    let [x, y] =
        [frame.right, frame.up].map(|half| away.dot(half.into()) / (depth * Vec3::from(half).length_squared()));
    [0.5 * (1.0 + x) * frame.width, 0.5 * (1.0 - y) * frame.height]
}

/// Square metres of the box of what a pixel's tile sees of a plane, R farther on all sides; nothing stands before it. Where
/// the tile reaches beyond the horizon, as far as its last pixel may see.
fn plane_area(plane: &Shape, frame: &Frame, pixel: [f32; 2], tile: [u32; 2], radius: f32) -> f32 {
    let (origin, normal) = (Vec3::from(frame.position), Vec3::from(plane.anchor));
    let height = plane.extent - normal.dot(origin);
    let farthest = height.abs() * frame.height / Vec3::from(frame.up).length();
    let sides = |axis: usize, all: f32| {
        let side = tile[axis] as f32;
        let first = (pixel[axis] / side).floor() * side;
        [first + 0.5, (first + side).min(all) - 0.5]
    };
    let mut bounds = Bounds::EMPTY;
    for x in sides(0, frame.width) {
        for y in sides(1, frame.height) {
            let direction = camera_direction(frame, x, y);
            let distance = height / normal.dot(direction);
            let distance = if distance > 0.0 { distance.min(farthest) } else { farthest };
            bounds.add((origin + direction * distance).to_array());
        }
    }
    let mut extents = [0, 1, 2].map(|axis| bounds.high[axis] - bounds.low[axis] + 2.0 * radius);
    extents.sort_by(f32::total_cmp);
    extents[1] * extents[2]
}

/// The grid of the whole map, by what the sample tells of it.
fn grid(scene: &SceneTables, sample: &Sample, question: &Question) -> Option<cells::Plan> {
    let mut bounds = vec![Bounds::EMPTY; 2 * scene.shapes.len()];
    for (position, face) in sample.positions.iter().zip(&sample.faces) {
        bounds[*face as usize].add(position.position);
    }
    let (stored, wanted) = (question.stored as usize, (question.class.cell_size(), Form::Auto));
    let crowd = || Ok(photon_density::crowd(&sample.positions, sample.faces.iter().copied(), stored, question.radius));
    cells::plan_by_crowd(scene.shapes, scene.is_glossy(), &bounds, stored, question.radius, wanted, crowd).ok()
}

/// What a method took.
#[derive(Clone, Copy, Debug)]
pub struct Taken {
    /// Of [`TERMS`].
    pub counts: Counts,
    /// Milliseconds.
    pub ms: f64,
    /// How many times longer than the best method of the same setting.
    pub over_best: f64,
}

/// Costs of one of each term, nanoseconds, that fit measured milliseconds and none of them below 0: least squares by
/// coordinate descent (Franc, Hlaváč & Navara, "Sequential Coordinate-Wise Algorithm for the Non-negative Least Squares
/// Problem", 2005). Twice as much and half as much count alike: (predicted − measured) / √(predicted · measured). What
/// is far from the best of its setting need not be known as well: it counts less by that factor to the power `shun`.
pub fn fit(measured: &[Taken], shun: i32) -> Counts {
    let mut costs = [0.0; TERMS.len()];
    let mut predicted: Vec<f64> = measured.iter().map(|taken| taken.ms).collect();
    for _ in 0..20 {
        let weight = |(taken, p): (&Taken, &f64)| 1.0 / (taken.over_best.powi(shun) * (taken.ms * p).sqrt());
        let weights: Vec<f64> = measured.iter().zip(&predicted).map(weight).collect();
        let scaled = |(taken, weight): (&Taken, &f64)| taken.counts.map(|count| count * 1e-6 * weight);
        let rows: Vec<Counts> = measured.iter().zip(&weights).map(scaled).collect();
        let norms: Counts = std::array::from_fn(|term| rows.iter().map(|row| row[term] * row[term]).sum());
        let sum = |row: &Counts, costs: &Counts| row.iter().zip(costs).map(|(count, cost)| count * cost).sum::<f64>();
        let aims = measured.iter().zip(&weights).map(|(taken, weight)| taken.ms * weight);
        let mut left: Vec<f64> = rows.iter().zip(aims).map(|(row, aim)| aim - sum(row, &costs)).collect();
        for _ in 0..2000 {
            for term in (0..TERMS.len()).filter(|term| norms[*term] > 0.0) {
                let slope: f64 = rows.iter().zip(&left).map(|(row, left)| row[term] * left).sum();
                let cost = (costs[term] + slope / norms[term]).max(0.0);
                let step = cost - costs[term];
                costs[term] = cost;
                left.iter_mut().zip(&rows).for_each(|(left, row)| *left -= step * row[term]);
            }
        }
        // Nothing predicts less than a thousandth: that would outweigh all else.
        predicted = measured.iter().map(|taken| (sum(&taken.counts, &costs) * 1e-6).max(1e-3 * taken.ms)).collect();
    }
    costs
}

/// How sure a difference in cost makes the choice, in [`regret`]: a method that costs 8% less is e times as likely.
const SURE: f64 = 12.0;

/// How much longer than the best ones the methods take that these costs choose, the mean over settings of the logarithm.
/// What nearly was chosen counts as well, so that it changes smoothly and close decisions weigh little.
fn regret(settings: &[Vec<Taken>], costs: &Counts) -> f64 {
    let of = |rivals: &Vec<Taken>| {
        let predicted: Vec<f64> = rivals.iter().map(|rival| cost(&rival.counts, costs).max(1e-12).ln()).collect();
        let least = predicted.iter().copied().fold(f64::INFINITY, f64::min);
        let chance = |ln: &f64| (-SURE * (ln - least)).exp();
        let all: f64 = predicted.iter().map(chance).sum();
        let lost = predicted.iter().zip(rivals).map(|(ln, rival)| chance(ln) * rival.over_best.max(1.0).ln());
        lost.sum::<f64>() / all
    };
    settings.iter().map(of).sum::<f64>() / settings.len().max(1) as f64
}

/// What leaving the costs that fit the times is worth: a regret of 0.05% for a cost that is e times another.
const LEAVING: f64 = 5e-4;

/// Costs by which the methods that take least are chosen: from those that [`fit`] the times, steps of each cost as long
/// as these lower the [`regret`] by more than they lead away; the best of several such ways. A setting is the methods that
/// were measured for it.
pub fn fit_choice(settings: &[Vec<Taken>]) -> Counts {
    let ways = [1, 2, 3].map(|shun| descend(settings, fit(&settings.concat(), shun)));
    ways.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).expect("several ways").0
}

/// The steps of [`fit_choice`] from some costs on, and what is lost by those that they lead to.
fn descend(settings: &[Vec<Taken>], mut costs: Counts) -> (Counts, f64) {
    let typical = |term: usize, costs: &Counts| {
        // A cost of 0 cannot be stepped from: a thousandth of the longest time's share is where it begins.
        let most = settings.iter().flatten().map(|taken| taken.counts[term]).fold(0.0, f64::max);
        let longest = settings.iter().flatten().map(|taken| taken.ms).fold(0.0, f64::max);
        if costs[term] > 0.0 || most == 0.0 { costs[term] } else { 1e-3 * longest * 1e6 / most }
    };
    let begun: Counts = std::array::from_fn(|term| typical(term, &costs));
    let lost = |costs: &Counts| {
        let away = costs.iter().zip(&begun).filter(|(cost, _)| **cost > 0.0).map(|(cost, begun)| (cost / begun).ln());
        regret(settings, costs) + LEAVING * away.map(|ln| ln * ln).sum::<f64>()
    };
    let mut least = lost(&costs);
    for step in [2.0, 1.5, 1.2, 1.1, 1.05].into_iter().flat_map(|step: f64| [step; 12]) {
        for term in 0..TERMS.len() {
            for factor in [step, 1.0 / step] {
                let mut other = costs;
                other[term] = typical(term, &costs) * factor;
                let lost = lost(&other);
                if lost < least {
                    (costs, least) = (other, lost);
                }
            }
        }
    }
    (costs, least)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_finds_the_costs_that_made_the_times() {
        let costs: Counts = std::array::from_fn(|term| if term == 4 { 0.0 } else { 1.0 + term as f64 });
        let row = |number: usize| {
            // Numbers of no pattern, some of them 0 as where a method has no such term.
            let count =
                |term: usize| ((number * 7919 + term * 104_729) % 97 * usize::from((number + term) % 3 > 0)) as f64;
            let counts: Counts = std::array::from_fn(|term| 1e4 * (1.0 + count(term)));
            let ms = counts.iter().zip(&costs).map(|(count, cost)| count * cost).sum::<f64>() * 1e-6;
            Taken { counts, ms, over_best: 1.0 }
        };
        let found = fit(&(0..60).map(row).collect::<Vec<_>>(), 1);
        for (found, cost) in found.iter().zip(costs) {
            assert!((found - cost).abs() < 0.05, "{found}, made with {cost}");
        }
    }

    #[test]
    fn tiles_see_as_much_of_a_plane_as_their_corners_do() {
        // A metre above the ground, a pixel a hundredth wide at a distance of 1; the horizon between rows 49 and 50.
        let (width, height) = (200.0, 100.0);
        let (right, up, forward) = ([1.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, -1.0]);
        let frame = Frame { right, up, forward, position: [0.0, 1.0, 0.0], width, height, ..Frame::default() };
        let ground = Shape { kind: PLANE, anchor: [0.0, 1.0, 0.0], extent: 0.0, ..Shape::default() };
        let point = Vec3::new(0.35, 0.0, -2.5);
        let pixel = pixel_of(&frame, point - Vec3::from(frame.position));
        assert!((pixel[0] - 114.0).abs() < 1e-3 && (pixel[1] - 90.0).abs() < 1e-3, "{pixel:?}");
        // Pixels' centres of rows 80 to 89 lie 0.305 to 0.395 below the horizon, at distances of 1 / 0.305 and 1 / 0.395.
        let [far, near] = [1.0 / 0.305, 1.0 / 0.395];
        // Columns 110 to 119, 0.105 to 0.195 to the right.
        let expected = (0.195 * far - 0.105 * near + 0.2) * (far - near + 0.2);
        let found = plane_area(&ground, &frame, [114.0, 85.0], [10, 10], 0.1);
        assert!((found / expected - 1.0).abs() < 1e-4, "{found} m², {expected} expected");
        // Across the horizon it is as far as the lowest pixel that might see the ground: 200 m.
        let beyond = plane_area(&ground, &frame, [114.0, 55.0], [20, 20], 0.1);
        assert!(beyond > 100.0 * 20.0 && beyond < 400.0 * 100.0, "{beyond} m²");
        assert!(beyond > 100.0 * found);
    }

    #[test]
    fn a_choice_is_fitted_where_times_alone_would_choose_wrong() {
        // A's times are those of two unlike things that one term counts; only B's term can make up for it.
        let rival = |term: usize, count: f64, ms: f64, best: f64| {
            let mut counts = [0.0; TERMS.len()];
            counts[term] = count * 1e6;
            Taken { counts, ms, over_best: ms / best }
        };
        let setting = |a: f64, b: f64| vec![rival(0, 1.0, a, a.min(b)), rival(1, 1.0, b, a.min(b))];
        let settings = [setting(1.0, 4.0), setting(5.0, 4.0), setting(1.0, 4.2), setting(1.2, 4.0)];
        let costs = fit_choice(&settings);
        assert!(regret(&settings, &costs) <= regret(&settings, &fit(&settings.concat(), 1)));
        assert!(costs[0] < costs[1], "three of four are better with A: {costs:?}");
        let wrong = [vec![rival(0, 1.0, 4.0, 1.0), rival(1, 1.0, 1.0, 1.0)]];
        assert!(regret(&wrong, &costs) > 1.0, "the worse one is chosen, which takes four times as long");
    }
}
