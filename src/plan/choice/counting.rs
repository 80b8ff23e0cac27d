//! What each method would have to do for a picture, counted around visible points in a sample of the map.

use glam::Vec3;

use super::view::{Extent, pixel_of, plane_area};
use super::{Class, Counts, Estimate, Question, TERMS, cost};
use crate::plan::cells::{self, Bounds, CELLS_PER_RADIUS, Form, photon_density};
use crate::plan::photon_sample::Sample;
use crate::plan::radius::{RASTER, visible_points};
use crate::plan::tiling::MAX_CELLS;
use crate::rays::scene::SceneTables;
use crate::records::{Frame, PLANE, Shape};
use crate::settings::Method;

/// Sizes of tiles that are weighed where none are asked for, pixels.
pub const SIZES: [[u32; 2]; MOST_SIZES] = [[80, 80], [32, 32], [16, 16]];

/// How many these are.
const MOST_SIZES: usize = 3;

/// Sides of a cell by which candidates lie farther than R: at R/2 a cell that makes 1.7 candidates of each accepted
/// photon, as measured in a closed room.
const BEYOND: f32 = 0.6;

/// Pairs of visible points and photons whose distance is taken: some hundred microseconds.
const PAIRS: usize = 3 << 17;

/// Visible points of them.
const POINTS: usize = 96;

/// What each method would take, the cheapest first.
///
/// Photons within R of a point are accepted ones; a tile's list holds those within R of its part of the surface, about
/// a disc around the point.
pub fn estimates(scene: &SceneTables, frame: &Frame, sample: &Sample, question: &Question) -> Vec<Estimate> {
    let sizes = question.tile.as_ref().map_or(&SIZES[..], std::slice::from_ref);
    let picture = Picture::of(scene, frame);
    let photons = PhotonsByFace::of(scene, sample, question.stored, picture.points.len());
    let cells = GridCells::of(scene, sample, question);
    let mut sums = Sums::default();
    for &(point, face) in &picture.points {
        let around = Around { scene, frame, question, cells: &cells, sizes };
        around.count(point, face, &photons.faces[face], &mut sums);
    }
    let weighing = Weighing { picture: &picture, photons: &photons, question, accepted: sums.accepted };
    let mut all = vec![weighing.by_grid(&cells, &sums)];
    for (size, tiled) in sizes.iter().zip(&sums.tiled) {
        all.extend(weighing.by_tiles(frame, *size, tiled));
    }
    all.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    all
}

/// The picture, and the points of its surfaces that stand for it.
struct Picture {
    /// Samples of pixels.
    pixels: f64,
    /// Which share of them sees a surface.
    share: f64,
    /// How many of them a point stands for.
    each: f64,
    /// World space, and the face that each lies on.
    points: Vec<(Vec3, usize)>,
}

impl Picture {
    fn of(scene: &SceneTables, frame: &Frame) -> Picture {
        let visible = visible_points(scene, frame);
        let share = visible.len() as f64 / RASTER as f64;
        let points: Vec<(Vec3, usize)> = visible
            .iter()
            .step_by(visible.len().div_ceil(POINTS).max(1))
            .map(|(p, (shape, side))| (*p, 2 * shape + usize::from(*side < 0.0)))
            .collect();
        let pixels = f64::from(frame.width * frame.height * frame.samples.max(1.0));
        Picture { pixels, share, each: pixels * share / points.len().max(1) as f64, points }
    }
}

/// The sample's first photons by face: any beginning of it is as well spread as the whole.
struct PhotonsByFace {
    /// Positions in scene space, a list for each face.
    faces: Vec<Vec<Vec3>>,
    /// Photons of the map for each of these.
    scale: f64,
}

impl PhotonsByFace {
    fn of(scene: &SceneTables, sample: &Sample, stored: u64, points: usize) -> PhotonsByFace {
        let looked_at = sample.positions.len().min(PAIRS / points.max(1));
        let mut faces = vec![Vec::new(); 2 * scene.shapes.len()];
        for (position, face) in sample.positions.iter().zip(&sample.faces).take(looked_at) {
            faces[*face as usize].push(Vec3::from(position.position));
        }
        PhotonsByFace { faces, scale: stored as f64 / looked_at.max(1) as f64 }
    }
}

/// Cells of the grid that the map would have.
struct GridCells {
    /// Across rows, metres.
    cell: f32,
    /// How far beyond R candidates lie, metres.
    beyond: f32,
    hashed: bool,
    count: f32,
}

impl GridCells {
    fn of(scene: &SceneTables, sample: &Sample, question: &Question) -> GridCells {
        let usual = question.radius / CELLS_PER_RADIUS;
        let [along, cell, hashed, count] = grid(scene, sample, question).map_or([usual, usual, 0.0, 0.0], |grid| {
            [grid.gather.cell[0], grid.gather.cell[1], f32::from(u8::from(grid.hashed)), grid.cells as f32]
        });
        GridCells { cell, beyond: 0.5 * BEYOND * (along + cell), hashed: hashed > 0.0, count }
    }
}

/// The grid of the whole map, by what the sample tells of it.
fn grid(scene: &SceneTables, sample: &Sample, question: &Question) -> Option<cells::GridPlan> {
    let mut bounds = vec![Bounds::EMPTY; 2 * scene.shapes.len()];
    for (position, face) in sample.positions.iter().zip(&sample.faces) {
        bounds[*face as usize].add(position.position);
    }
    let (stored, wanted) = (question.stored as usize, (question.class.cell_size(), Form::Auto));
    let crowd = || Ok(photon_density::crowd(&sample.positions, sample.faces.iter().copied(), stored, question.radius));
    cells::plan_by_crowd(scene.shapes, scene.is_glossy(), &bounds, stored, question.radius, wanted, crowd).ok()
}

/// Counts around all points.
#[derive(Default)]
struct Sums {
    accepted: f64,
    candidates: f64,
    rows: f64,
    tiled: [TiledSums; MOST_SIZES],
}

/// Counts around all points, for one size of tiles.
#[derive(Clone, Copy, Default)]
struct TiledSums {
    /// Entries of lists.
    listed: f64,
    /// Those of them in the cells around points.
    celled: f64,
    /// Rows of these cells.
    rows: f64,
    /// Cells of a tile.
    cells: f64,
}

/// How far from a point a method looks at photons: metres, squared.
#[derive(Clone, Copy, Default)]
struct Reaches {
    list: f32,
    cells: f32,
}

/// What counting goes by.
struct Around<'a> {
    scene: &'a SceneTables<'a>,
    frame: &'a Frame,
    question: &'a Question,
    cells: &'a GridCells,
    sizes: &'a [[u32; 2]],
}

impl Around<'_> {
    /// Adds what lies around one point.
    fn count(&self, point: Vec3, face: usize, photons: &[Vec3], sums: &mut Sums) {
        let shape = &self.scene.shapes[face / 2];
        let radius = self.question.radius;
        let extent = Extent::at(point, shape, self.frame);
        // Pixels that gather together walk over what is near any of them, unless that is far apart.
        let block = block(self.question.class);
        let together = if block > 1.0 { extent.disc([block; 2]).min(2.0 * radius) } else { 0.0 };
        let reach = radius + together;
        sums.rows += rows(shape, reach, self.cells.cell);
        let mut farthest = reach + self.cells.beyond;
        let in_cells = farthest.powi(2);
        let mut reaches = [Reaches::default(); MOST_SIZES];
        for ((size, tiled), reaches) in self.sizes.iter().zip(&mut sums.tiled).zip(&mut reaches) {
            // A large tile's cells are larger than a grid's: it has only so many, and towards a horizon sees far.
            let area = match shape.kind == PLANE {
                true => plane_area(shape, self.frame, pixel_of(self.frame, extent.away), *size, radius),
                false => extent.area(size.map(|pixels| pixels as f32), 2.0 * radius),
            };
            let own_cell = (radius / CELLS_PER_RADIUS).max((area / MAX_CELLS as f32).sqrt());
            tiled.rows += rows(shape, reach, own_cell);
            tiled.cells += f64::from(area / (own_cell * own_cell));
            let list = radius + extent.disc(size.map(|pixels| pixels as f32));
            *reaches = Reaches { list: list * list, cells: list.min(reach + BEYOND * own_cell).powi(2) };
            farthest = farthest.max(list);
        }
        let (near, farthest) = (radius * radius, farthest * farthest);
        for photon in photons {
            let d2 = photon.distance_squared(point);
            // Most are.
            if d2 >= farthest {
                continue;
            }
            let within = |reach2: f32| f64::from(u8::from(d2 < reach2));
            sums.accepted += within(near);
            sums.candidates += within(in_cells);
            for (tiled, reaches) in sums.tiled.iter_mut().zip(&reaches) {
                tiled.listed += within(reaches.list);
                tiled.celled += within(reaches.cells);
            }
        }
    }
}

/// Pixels along a side of what gathers together: the lanes of a work-item.
fn block(class: Class) -> f32 {
    match class {
        Class::OpenClLanes => 4.0,
        _ => 1.0,
    }
}

/// Rows of cells of this width that a query goes through. Where the surface crosses the rows, there are as many in the
/// other direction too.
fn rows(shape: &Shape, reach: f32, cell: f32) -> f64 {
    let is_flat = shape.kind == PLANE && Vec3::from(shape.anchor).abs().max_element() > 0.999;
    let along = 2.0 * reach / cell + 1.0;
    f64::from(if is_flat { along } else { along * along })
}

/// Makes the picture's numbers of sums over points, and costs of these.
struct Weighing<'a> {
    picture: &'a Picture,
    photons: &'a PhotonsByFace,
    question: &'a Question,
    /// Photons within R of all points.
    accepted: f64,
}

impl Weighing<'_> {
    fn by_grid(&self, cells: &GridCells, sums: &Sums) -> Estimate {
        let stored = self.question.stored as f64;
        let (candidates, rows) = (self.of_picture(sums.candidates), sums.rows * self.picture.each);
        let [candidates_term, rows_term] =
            if cells.hashed { ["candidates-hashed", "rows-hashed"] } else { ["candidates", "rows"] };
        let build = [("grid", 1.0), ("sorted", stored), ("cells", f64::from(cells.count))];
        let gather = [(candidates_term, candidates), (rows_term, rows)];
        self.estimate(Method::Grid, None, candidates, stored, &[&build[..], &gather].concat())
    }

    /// Of tiles and of tiled grids.
    fn by_tiles(&self, frame: &Frame, size: [u32; 2], sums: &TiledSums) -> [Estimate; 2] {
        let Picture { pixels, share, each, points } = self.picture;
        let per_point = self.photons.scale / points.len().max(1) as f64;
        let tiles = f64::from((frame.width / size[0] as f32).ceil() * (frame.height / size[1] as f32).ceil());
        // Tiles see one face and some of another.
        let regions = 1.2 * tiles * share;
        let entries = regions * sums.listed * per_point;
        let (listed, celled) = (self.of_picture(sums.listed), self.of_picture(sums.celled));
        let cells = regions * sums.cells / points.len().max(1) as f64;
        let stored = self.question.stored as f64;
        let build = [("tiling", 1.0), ("projected", stored), ("entered", entries), ("seen", *pixels), ("tiles", tiles)];
        let gather = [("celled", celled), ("rows-celled", sums.rows * each), ("cells", cells)];
        let by = |method, candidates, gather: &[(&str, f64)]| {
            self.estimate(method, Some(size), candidates, entries, &[&build[..], gather].concat())
        };
        [by(Method::Tiles, listed, &[("listed", listed)]), by(Method::TiledGrid, celled, &gather)]
    }

    /// Photons counted around points, for the whole map and picture.
    fn of_picture(&self, counted: f64) -> f64 {
        counted * self.photons.scale * self.picture.each
    }

    fn estimate(
        &self,
        method: Method,
        tile: Option<[u32; 2]>,
        candidates: f64,
        entries: f64,
        counted: &[(&str, f64)],
    ) -> Estimate {
        let seen = (self.picture.pixels * self.picture.share).max(1.0);
        let any = [("pixels", self.picture.pixels), ("accepted", self.of_picture(self.accepted))];
        let count = |term| any.iter().chain(counted).find(|(name, _)| *name == term).map_or(0.0, |(_, count)| *count);
        let counts: Counts = TERMS.map(count);
        let cost = cost(&counts, self.question.class.costs());
        Estimate { method, tile, candidates: candidates / seen, entries, cost, counts }
    }
}
