//! Gather: how many photons a query has to test for each that it accepts, by radius, method, and cell or tile size.

use glam::Vec3;

use super::table::{Table, Value};
use super::{Measured, Options, Progress, Steps};
use crate::cpu;
use crate::cpu::gather::{PhotonMap, for_each_candidate, for_each_listed, near};
use crate::cpu::photons::{PhotonTables, photons};
use crate::error::{Error, Result};
use crate::packing::Packed;
use crate::plan::cells::{self, CELLS_PER_RADIUS, CELLS_PER_RADIUS_ALONE, CellSize, Form};
use crate::plan::choice;
use crate::plan::photon_sample::Sample;
use crate::plan::radius;
use crate::plan::tiling;
use crate::program::features::{Features, is_divided};
use crate::program::gathering::Gathering;
use crate::rays::camera::camera_direction;
use crate::rays::emission::{self, Emission};
use crate::rays::scene::SceneTables;
use crate::records::Frame;
use crate::records::face::faces_of;
use crate::scene::Scene;
use crate::settings::{Amount, Method, Pass, Sampler, Settings};

/// Cells along a radius, the same along rows as across them; and what backends take whose queries walk together or alone.
const CELLS: [CellSize; 6] = [
    CellSize::PerRadius(1.0),
    CellSize::PerRadius(CELLS_PER_RADIUS),
    CellSize::PerRadius(CELLS_PER_RADIUS_ALONE),
    CellSize::PerRadius(4.0),
    CellSize::Auto,
    CellSize::Alone,
];

/// The numbers of a run.
#[derive(serde::Serialize)]
struct Plan {
    stored: Vec<u32>,
    radii: Vec<f32>,
    /// Tiles of these sizes, pixels.
    tiles: [[u32; 2]; 3],
    size: [u32; 2],
    /// Every how many-th pixel's visible point asks, across and down.
    stride: u32,
}

/// What the queries of a picture found.
#[derive(Clone, Copy, Default)]
struct Found {
    queries: u64,
    candidates: u64,
    accepted: u64,
}

/// See [`super::Suite::Gather`].
pub fn run(options: &Options, progress: &mut dyn FnMut(Progress)) -> Result<Measured> {
    let (width, height) = options.or(options.size, (640, 480), (64, 48));
    let plan = Plan {
        stored: options.list(&options.photons, &[200_000], &[5_000]),
        radii: options.list(&options.radii, &[0.1, 0.2, 1.0], &[0.2]),
        tiles: choice::SIZES,
        size: [width, height],
        stride: if options.quick { 2 } else { 4 },
    };
    let mut steps = Steps::new(progress, options.scenes.len() * plan.stored.len() * (1 + plan.radii.len()));
    let mut rows = Table::new([
        "scene",
        "stored",
        "radius_m",
        "is_auto",
        "method",
        "cells_per_radius",
        "cells_along_rows",
        "form",
        "tile",
        "entries_per_photon",
        "candidates",
        "accepted",
        "candidates_per_accepted",
    ]);
    for scene in &options.scenes {
        let settings = Settings { width, height, ..Settings::default() };
        let features = Features::of(scene, &settings);
        let packed = Packed::new(scene, scene.camera.position);
        let tables = SceneTables::new(&packed, &features);
        let frame = packed.frame(&scene.camera, &settings, &Pass::single(&settings));
        for stored in &plan.stored {
            let map = emit(&tables, &packed, *stored, false)?;
            let count = map.len().min(radius::SAMPLE);
            let faces = map.surfaces[..count].iter().map(|s| cpu::grid::face_of(s) as u32).collect();
            let sample = Sample { positions: map.positions[..count].to_vec(), faces };
            let chosen = radius::choose(&tables, &frame, &sample, map.len() as u64);
            for (is_auto, radius) in [(true, chosen)].into_iter().chain(plan.radii.iter().map(|r| (false, *r))) {
                if options.is_stopped() {
                    break;
                }
                steps.begin(&format!("{}: {stored} photons, R={radius:.3}", scene.name));
                let mut add = |method: Method, place: [Value; 5], found: Found| {
                    let mean = |sum: u64| sum as f64 / found.queries as f64;
                    let mut row = vec![scene.name.as_str().into(), (*stored).into(), radius.into(), is_auto.into()];
                    row.push(method.name().into());
                    row.extend(place);
                    row.extend([mean(found.candidates).into(), mean(found.accepted).into()]);
                    row.push((found.candidates as f64 / found.accepted as f64).into());
                    rows.push(row);
                };
                for size in CELLS {
                    let bounds = cpu::grid::grid_bounds(&map.view(), faces_of(packed.shapes.len()));
                    let laid_out =
                        cells::plan(&packed.shapes, packed.is_glossy(), &bounds, map.len(), radius, size, Form::Auto)?;
                    let found = ask(scene, &tables, &frame, &map, &laid_out, plan.stride);
                    let form = if laid_out.hashed { "hashed" } else { "dense" };
                    let [along, across, _] = laid_out.gather.cell.map(|cell| Value::from(radius / cell));
                    add(Method::Grid, [across, along, form.into(), Value::Missing, 1.0.into()], found);
                }
                for (method, tile) in
                    [Method::Tiles, Method::TiledGrid].into_iter().flat_map(|m| plan.tiles.map(|tile| (m, tile)))
                {
                    let wanted = tiling::TileSettings { radius, tile, cells: method == Method::TiledGrid };
                    let seen = cpu::tiles::tiles_seen(&tables, &frame, tile);
                    let tiles = tiling::plan(&packed.shapes, &frame, seen, map.len(), &wanted)?;
                    let lists = cpu::tiles::tiles(&map.view(), &tiles, &frame)?;
                    let found = ask_tiles(&tables, &frame, &map, (&tiles, &lists), plan.stride);
                    let cells = (method == Method::TiledGrid).then_some(CELLS_PER_RADIUS);
                    let entries = lists.tile_photons.len() as f64 / map.len() as f64;
                    let size = format!("{}x{}", tile[0], tile[1]);
                    let place = [cells.into(), cells.into(), "dense".into(), size.as_str().into(), entries.into()];
                    add(method, place, found);
                }
            }
        }
    }
    let settings = serde_json::to_value(&plan).map_err(|e| Error::Failed(format!("JSON: {e}")))?;
    Ok(Measured { settings, rows, summaries: Vec::new(), charts: Vec::new(), ended: None })
}

/// A map of so many photons, with those that come straight from lights or without.
pub fn emit(scene: &SceneTables, packed: &Packed, stored: u32, store_direct: bool) -> Result<PhotonTables> {
    let amount = Amount::Stored(stored);
    let emission = Emission { amount, seed: 0, pass: 0, sampler: Sampler::default(), store_direct };
    photons(scene, &emission::EmissionPlan::of(packed, store_direct)?, &emission)
}

/// Points of a coarse raster of pixels ask a grid for their photons.
fn ask(
    scene: &Scene,
    tables: &SceneTables,
    frame: &Frame,
    map: &PhotonTables,
    plan: &cells::GridPlan,
    stride: u32,
) -> Found {
    let grid = cpu::grid::grid(&map.view(), plan);
    let own = Gathering::of(tables.shapes, tables.sphere_count, is_divided(scene));
    let gathering = Gathering { hashed: plan.hashed, ..own };
    let map = PhotonMap { gathering: &gathering, plan, stored: map.view(), grid: &grid, tiles: None };
    let mut found = Found::default();
    for Query { face, position, .. } in queries(tables, frame, stride) {
        found.queries += 1;
        for_each_candidate(&map, face, position, |_| found.candidates += 1);
        found.accepted += near(&map, face, position, 0).len() as u64;
    }
    found
}

/// The same of tiles' lists.
fn ask_tiles(
    tables: &SceneTables,
    frame: &Frame,
    map: &PhotonTables,
    (plan, lists): (&tiling::TilePlan, &cpu::tiles::TileTables),
    stride: u32,
) -> Found {
    let radius = plan.gather.radius;
    let mut found = Found::default();
    for Query { pixel: [x, y], face, position } in queries(tables, frame, stride) {
        let tile = cpu::tiles::tile_at(&plan.gather, x, y);
        let Some(region) = cpu::tiles::find_region(plan, tile, face, position) else { continue };
        found.queries += 1;
        for_each_listed(lists, region, radius, position, |photon| {
            found.candidates += 1;
            let away = Vec3::from(map.positions[photon].position) - position;
            found.accepted += u64::from(away.length_squared() < radius * radius);
        });
    }
    found
}

/// A visible point.
struct Query {
    pixel: [u32; 2],
    face: usize,
    position: Vec3,
}

/// What every so many-th pixel's centre sees.
fn queries(tables: &SceneTables, frame: &Frame, stride: u32) -> impl Iterator<Item = Query> {
    let along = move |pixels: f32| (0..pixels as u32).step_by(stride as usize);
    let origin = Vec3::from(frame.position);
    along(frame.height).flat_map(move |y| along(frame.width).map(move |x| [x, y])).filter_map(move |pixel| {
        let direction = camera_direction(frame, pixel[0] as f32 + 0.5, pixel[1] as f32 + 0.5);
        let hit = tables.closest_hit(origin, direction, None)?;
        let surface = tables.surface_at(origin, direction, hit);
        let face = surface.face_left();
        Some(Query { pixel, face, position: surface.position })
    })
}
