//! Grid, tiles or tiled grid, where the user names none: what a picture would cost by each, from counts.
//!
//! The model is a sum: counts of what a method does, from a raster of visible points and a sample of the map, times
//! what one of each costs on this class of devices. `photile bench --suite choice` measures both, and fits the costs.

use glam::Vec3;

use crate::cells::{self, Bounds, CELLS_PER_RADIUS, CellSize, Form};
use crate::cpu::scene::SceneTables;
use crate::layout::{Frame, PLANE};
use crate::radius::{RASTER, visible_points};
use crate::settings::Method;
use crate::stage::map::Sample;
use crate::tiling::MAX_CELLS;

/// Sizes of tiles that are weighed where none are asked for, pixels.
pub const SIZES: [[u32; 2]; 3] = [[80, 80], [32, 32], [16, 16]];

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

    /// Nanoseconds of one of each of [`TERMS`]: only their ratios matter. Fitted by `bench --suite choice` to rows of two
    /// cores that others used too (PoCL, llvmpipe, the twin); those of GPUs are estimates.
    fn costs(self) -> &'static Counts {
        match self {
            Class::Cpu => &[960.0, 60.0, 5.0, 5.0, 571.0, 2200.0, 6.0, 8.0, 400.0, 240.0, 100.0, 540.0, 50.0, 0.0],
            Class::OpenClLanes => {
                &[48.0, 0.0, 0.42, 0.66, 69.0, 376.0, 0.75, 0.94, 46.0, 190.0, 153.0, 213.0, 30.0, 8200.0]
            }
            Class::OpenClGpu => &[0.2, 0.005, 0.005, 0.02, 0.03, 0.1, 0.03, 0.013, 0.03, 1.2, 1.5, 1.5, 0.2, 0.0],
            Class::OpenGlSoftware => {
                &[290.0, 40.0, 25.0, 35.0, 1190.0, 5420.0, 18.0, 35.0, 400.0, 100.0, 100.0, 1260.0, 0.0, 16000.0]
            }
            Class::OpenGlGpu => &[0.5, 0.02, 0.02, 0.15, 0.3, 1.0, 0.2, 0.1, 0.3, 5.0, 5.0, 5.0, 0.5, 0.0],
        }
    }

    /// How large the grid's cells are made for it.
    fn cell_size(self) -> CellSize {
        match self {
            Class::OpenGlSoftware | Class::OpenGlGpu => CellSize::Alone,
            _ => CellSize::Auto,
        }
    }
}

/// What is counted, for the whole picture.
pub const TERMS: [&str; 14] = [
    // Any method's share: rays, shadows, direct light.
    "pixels",
    // Photons within R of visible points, however they are found.
    "accepted",
    // Candidates in the cells around points, of a dense grid and of a hashed one.
    "candidates",
    "candidates-hashed",
    // Rows of cells around points: one on a plane along the axes, five elsewhere, whose surface crosses the rows.
    "rows",
    "rows-hashed",
    // Entries of lists that tiles look through; in tiled grids those in the cells around points, and rows of these.
    "listed",
    "celled",
    "rows-celled",
    // Photons sorted into a grid.
    "sorted",
    // Photons looked at for tiles, what of them enters lists, rays that look what tiles see, and tiles.
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
    /// The term that costs most, and its share of the cost.
    pub fn dearest(&self, class: Class) -> (&'static str, f64) {
        let terms = TERMS.iter().zip(self.counts.iter().zip(class.costs()).map(|(count, cost)| count * cost));
        let (name, most) = terms.max_by(|a, b| a.1.total_cmp(&b.1)).expect("there are terms");
        (name, most * 1e-6 / self.cost)
    }
}

/// Pairs of visible points and photons whose distance is taken: some hundred microseconds.
const PAIRS: usize = 3 << 16;

/// Visible points of them.
const POINTS: usize = 48;

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
        .map(|(p, (object, side))| (*p, 2 * object + usize::from(*side < 0.0)))
        .collect();
    let pixels = f64::from(frame.width * frame.height * frame.samples.max(1.0));
    // Points stand for this many pixels each.
    let each = pixels * share / points.len().max(1) as f64;

    // Photons by face, the first ones of the sample: any beginning of it is as well spread as the whole.
    let looked_at = sample.positions.len().min(PAIRS / points.len().max(1));
    let scale = stored as f64 / looked_at.max(1) as f64;
    let mut faces = vec![Vec::new(); 2 * scene.objects.len()];
    for (position, face) in sample.positions.iter().zip(&sample.faces).take(looked_at) {
        faces[*face as usize].push(Vec3::from(position.position));
    }
    let cell = radius / CELLS_PER_RADIUS;
    let [mut accepted, mut rows, mut candidates] = [0.0; 3];
    // By size of tiles: entries of lists, and those in the cells around points.
    let mut listed = vec![[0.0; 2]; sizes.len()];
    for &(p, face) in &points {
        let object = &scene.objects[face / 2];
        let flat = object.kind == PLANE && Vec3::from(object.anchor).abs().max_element() > 0.999;
        rows += if flat { 1.0 } else { 5.0 };
        // A tile's image on the surface, as a disc of the same area; slanted surfaces fill more of it.
        let away = p - Vec3::from(frame.position);
        let depth = away.dot(frame.forward.into());
        let normal = if object.kind == PLANE { object.anchor.into() } else { p - Vec3::from(object.anchor) };
        let cosine = (away.dot(normal) / (away.length() * normal.length())).abs().max(0.03);
        let [width, height] = [frame.right, frame.up].map(|half| 2.0 * Vec3::from(half).length() * depth);
        let reaches = |size: &[u32; 2]| {
            let across = width * (size[0] as f32 / frame.width).min(1.0);
            let down = height * (size[1] as f32 / frame.height).min(1.0) / cosine;
            // A large tile's cells are larger than a grid's: it has only so many, and towards a horizon sees far.
            let far = down / (1.0 - 0.5 * down / depth).max(0.05);
            let area = (across + 2.0 * radius) * (far + 2.0 * radius);
            let own_cell = cell.max((area / MAX_CELLS as f32).sqrt());
            [radius + (across * down / std::f32::consts::PI).sqrt(), radius + BEYOND * own_cell]
                .map(|reach| reach * reach)
        };
        let reaches: Vec<[f32; 2]> = sizes.iter().map(reaches).collect();
        let in_cells = (radius + BEYOND * cell).powi(2);
        for photon in &faces[face] {
            let d2 = photon.distance_squared(p);
            let within = |reach2: f32| f64::from(u8::from(d2 < reach2));
            accepted += within(radius * radius);
            candidates += within(in_cells);
            for (listed, [list, cells]) in listed.iter_mut().zip(&reaches) {
                listed[0] += within(*list);
                listed[1] += within(cells.min(*list));
            }
        }
    }
    let per_point = scale / points.len().max(1) as f64;
    let [accepted, candidates, rows] = [accepted * scale * each, candidates * scale * each, rows * each];
    let stored = stored as f64;

    let mut all = Vec::new();
    let mut add = |method, tile: Option<[u32; 2]>, candidates: f64, entries: f64, counted: &[(&str, f64)]| {
        let counts = TERMS.map(|term| counted.iter().find(|(name, _)| *name == term).map_or(0.0, |(_, count)| *count));
        let cost = counts.iter().zip(class.costs()).map(|(count, cost)| count * cost).sum::<f64>() * 1e-6;
        all.push(Estimate { method, tile, candidates, entries, cost, counts });
    };
    let seen = (pixels * share).max(1.0);
    let [in_cells, own_rows] =
        if is_hashed(scene, sample, question) { ["candidates-hashed", "rows-hashed"] } else { ["candidates", "rows"] };
    let any = [("pixels", pixels), ("accepted", accepted)];
    let counted = [&any[..], &[(in_cells, candidates), (own_rows, rows), ("sorted", stored)]].concat();
    add(Method::Grid, None, candidates / seen, stored, &counted);
    for (size, [in_lists, in_cells]) in sizes.iter().zip(listed) {
        let tiles = f64::from((frame.width / size[0] as f32).ceil() * (frame.height / size[1] as f32).ceil());
        // Tiles see one face and some of another.
        let entries = 1.2 * tiles * share * in_lists * per_point;
        let listed = in_lists * scale * each;
        let celled = in_cells * scale * each;
        let build = [("projected", stored), ("entered", entries), ("seen", pixels), ("tiles", tiles)];
        let tiled = [&any[..], &build[..]].concat();
        let gather = [("celled", celled), ("rows-celled", rows)];
        add(Method::Tiles, Some(*size), listed / seen, entries, &[&tiled[..], &[("listed", listed)]].concat());
        add(Method::TiledGrid, Some(*size), celled / seen, entries, &[&tiled[..], &gather].concat());
    }
    all.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    all
}

/// Whether a grid of the whole map would be hashed.
fn is_hashed(scene: &SceneTables, sample: &Sample, question: &Question) -> bool {
    let mut bounds = vec![Bounds::EMPTY; 2 * scene.objects.len()];
    for (position, face) in sample.positions.iter().zip(&sample.faces) {
        bounds[*face as usize].add(position.position);
    }
    let size = question.class.cell_size();
    let plan = cells::plan(scene.objects, &bounds, question.stored as usize, question.radius, size, Form::Auto);
    plan.is_ok_and(|plan| plan.hashed)
}

/// Costs of one of each term, nanoseconds, that fit measured milliseconds and none of them below 0: least squares by
/// coordinate descent (Franc, Hlaváč & Navara, "Sequential Coordinate-Wise Algorithm for the Non-negative Least Squares
/// Problem", 2005). Twice as much and half as much count alike: (predicted − measured) / √(predicted · measured).
pub fn fit(measured: &[(Counts, f64)]) -> Counts {
    let mut costs = [0.0; TERMS.len()];
    let mut predicted: Vec<f64> = measured.iter().map(|(_, ms)| *ms).collect();
    for _ in 0..20 {
        let weights: Vec<f64> = measured.iter().zip(&predicted).map(|((_, ms), p)| (ms * p).sqrt().recip()).collect();
        let scaled = |((counts, _), weight): (&(Counts, f64), &f64)| counts.map(|count| count * 1e-6 * weight);
        let rows: Vec<Counts> = measured.iter().zip(&weights).map(scaled).collect();
        let norms: Counts = std::array::from_fn(|term| rows.iter().map(|row| row[term] * row[term]).sum());
        let sum = |row: &Counts, costs: &Counts| row.iter().zip(costs).map(|(count, cost)| count * cost).sum::<f64>();
        let aims = measured.iter().zip(&weights).map(|((_, ms), weight)| ms * weight);
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
        predicted = measured.iter().map(|(counts, ms)| (sum(counts, &costs) * 1e-6).max(1e-3 * ms)).collect();
    }
    costs
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
            (counts, ms)
        };
        let found = fit(&(0..60).map(row).collect::<Vec<_>>());
        for (found, cost) in found.iter().zip(costs) {
            assert!((found - cost).abs() < 0.05, "{found}, made with {cost}");
        }
    }
}
