//! Grid, tiles or tiled grid, where the user names none: a model of what a picture costs by each, from counts.

use glam::Vec3;

use crate::cells::{self, Bounds, CellSize, Form};
use crate::cpu::scene::SceneTables;
use crate::layout::{Frame, PLANE};
use crate::radius::visible_points;
use crate::settings::Method;
use crate::stage::map::Sample;

/// Sizes of tiles that are weighed where none are asked for, pixels.
const SIZES: [[u32; 2]; 3] = [[80, 80], [32, 32], [16, 16]];

/// What is known when the choice is made.
#[derive(Clone, Copy, Debug)]
pub struct Question {
    /// Photons of the map.
    pub stored: u64,
    /// R, metres.
    pub radius: f32,
    /// Tiles of this size only, pixels.
    pub tile: Option<[u32; 2]>,
    /// Every pixel gathers alone, as fragments do, and the CPU, not 16 together.
    pub alone: bool,
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
    /// Building and gathering, in units of one candidate of the grid.
    pub cost: f64,
}

/// What things cost, in units of one candidate of a dense grid.
///
/// Measured on gi_ref and sphere_and_plane, 2k to 200k stored photons, R from 0.74 to 1.8 m, tiles of 16 to 80 pixels,
/// on PoCL (640 × 480) and llvmpipe (160 × 120) on two cores: a unit is about 0.25 ns there, and 5 ns in a fragment.
struct Costs {
    /// A candidate of the hashed grid, whose cell is looked at too.
    hashed: f64,
    /// A candidate of a tile's list: its number is fetched first, and its photon may lie anywhere.
    listed: f64,
    /// The same in a tile's cells, whose photons the next pixels ask for again.
    celled: f64,
    /// A run of cells.
    run: f64,
    /// Sorting a photon into the grid.
    sorted: f64,
    /// Looking at a photon for its tiles.
    projected: f64,
    /// Each entry that comes of it.
    entered: f64,
    /// A primary ray that looks what tiles see, and the way to a region.
    seen: f64,
    /// The grid's candidates for an accepted photon (`cells.rs`).
    per_accepted: f64,
    /// The grid's runs for a query on a plane, and elsewhere.
    runs: [f64; 2],
}

const ALONE: Costs = Costs {
    hashed: 6.0,
    listed: 7.0,
    celled: 3.0,
    run: 8.0,
    sorted: 20.0,
    projected: 30.0,
    entered: 34.0,
    seen: 2.5,
    per_accepted: 1.55,
    runs: [7.0, 35.0],
};

const TOGETHER: Costs = Costs {
    hashed: 1.7,
    listed: 1.8,
    celled: 2.2,
    run: 18.0,
    sorted: 400.0,
    projected: 600.0,
    entered: 680.0,
    seen: 50.0,
    per_accepted: 2.2,
    runs: [5.0, 25.0],
};

/// What each method would take, the cheapest first.
///
/// The counts come from a coarse raster of visible points and a sample of the map: photons within R of a point are
/// accepted ones; a tile's list holds those within R of its part of the surface, about a disc around the point.
pub fn estimates(scene: &SceneTables, frame: &Frame, sample: &Sample, question: &Question) -> Vec<Estimate> {
    let &Question { stored, radius, tile, alone } = question;
    let points = visible_points(scene, frame);
    let scale = stored as f64 / sample.positions.len().max(1) as f64;
    let eye = Vec3::from(frame.position);
    let pixels = f64::from(frame.width * frame.height * frame.samples.max(1.0));
    // Shares of the picture: all of it, for sums over points.
    let each = pixels / crate::radius::RASTER as f64;
    let faces = &sample.faces;
    let within = |point: Vec3, face: usize, reach: f32| {
        let near = |i: &usize| {
            faces[*i] as usize == face
                && Vec3::from(sample.positions[*i].position).distance_squared(point) < reach * reach
        };
        (0..faces.len()).filter(near).count() as f64 * scale
    };
    let points: Vec<(Vec3, usize)> =
        points.into_iter().map(|(p, (object, side))| (p, 2 * object + usize::from(side < 0.0))).collect();
    let mean = |sum: f64| sum / points.len().max(1) as f64;

    let costs = if alone { ALONE } else { TOGETHER };
    let [mut candidates, mut runs] = [0.0; 2];
    for &(p, face) in &points {
        let object = &scene.objects[face / 2];
        let flat = object.kind == PLANE && Vec3::from(object.anchor).abs().max_element() > 0.999;
        candidates += within(p, face, radius) * costs.per_accepted;
        runs += costs.runs[usize::from(!flat)];
    }
    let hashed = if is_hashed(scene, sample, stored, radius) { costs.hashed } else { 1.0 };
    let stored = stored as f64;
    let mut all = vec![Estimate {
        method: Method::Grid,
        tile: None,
        candidates: mean(candidates),
        entries: stored,
        cost: each * (candidates * hashed + runs * costs.run) + stored * costs.sorted,
    }];
    for size in tile.as_ref().map_or(&SIZES[..], std::slice::from_ref) {
        let (across, down) = (frame.width / size[0] as f32, frame.height / size[1] as f32);
        let mut listed = 0.0;
        for &(p, face) in &points {
            // The tile's image on the surface, as a disc of the same area; slanted surfaces fill more of it.
            let away = p - eye;
            let depth = away.dot(frame.forward.into());
            let object = &scene.objects[face / 2];
            let normal = if object.kind == PLANE { object.anchor.into() } else { p - Vec3::from(object.anchor) };
            let cosine = (away.dot(normal) / (away.length() * normal.length())).abs().max(0.1);
            let [width, height] = [frame.right, frame.up].map(|half| 2.0 * Vec3::from(half).length() * depth);
            let area = width / across.max(1.0) * (height / down.max(1.0)) / cosine;
            listed += within(p, face, radius + (area / std::f32::consts::PI).sqrt());
        }
        // Tiles see one face and some of another.
        let tiles = f64::from(across.ceil() * down.ceil()) * points.len() as f64 / crate::radius::RASTER as f64;
        let entries = 1.2 * tiles * mean(listed);
        let build = stored * costs.projected + entries * costs.entered + pixels * costs.seen;
        let mut add = |method, seen: f64, gather: f64| {
            let cost = build + each * gather;
            all.push(Estimate { method, tile: Some(*size), candidates: mean(seen), entries, cost });
        };
        add(Method::Tiles, listed, listed * costs.listed);
        let seen = candidates.min(listed);
        add(Method::TiledGrid, seen, seen * costs.celled + runs * costs.run);
    }
    all.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    all
}

/// Whether a grid of the whole map would be hashed.
fn is_hashed(scene: &SceneTables, sample: &Sample, stored: u64, radius: f32) -> bool {
    let mut bounds = vec![Bounds::EMPTY; 2 * scene.objects.len()];
    for (position, face) in sample.positions.iter().zip(&sample.faces) {
        bounds[*face as usize].add(position.position);
    }
    let plan = cells::plan(scene.objects, &bounds, stored as usize, radius, CellSize::Auto, Form::Auto);
    plan.is_ok_and(|plan| plan.hashed)
}
