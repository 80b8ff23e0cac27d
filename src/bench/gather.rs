//! Gather: how many photons a query has to test for each that it accepts, by radius and cell size.

use super::table::Table;
use super::{Measured, Options, Progress, Steps};
use crate::cells::{self, CELLS_PER_RADIUS, CELLS_PER_RADIUS_ALONE, CellSize, Form};
use crate::cpu;
use crate::cpu::camera::camera_direction;
use crate::cpu::gather::{PhotonMap, for_each_candidate, near};
use crate::cpu::photons::{PhotonTables, photons};
use crate::cpu::scene::SceneTables;
use crate::emission::{self, Emission};
use crate::error::{Error, Result};
use crate::features::{Features, is_divided};
use crate::gathering::Gathering;
use crate::layout::Frame;
use crate::pack::Packed;
use crate::radius;
use crate::scene::Scene;
use crate::settings::{Amount, Sampler, Settings};
use crate::stage::map::Sample;

/// Cells along a radius: one, and what the backends take.
const CELLS: [f32; 4] = [1.0, CELLS_PER_RADIUS, CELLS_PER_RADIUS_ALONE, 4.0];

/// The numbers of a run.
#[derive(serde::Serialize)]
struct Plan {
    stored: Vec<u32>,
    radii: Vec<f32>,
    cells_per_radius: [f32; 4],
    /// Pixels whose visible points ask.
    queries: [u32; 2],
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
    let (width, height) = options.or(options.size, (160, 120), (32, 24));
    let plan = Plan {
        stored: options.list(&options.photons, &[200_000], &[5_000]),
        radii: options.list(&options.radii, &[0.1, 0.2, 1.0], &[0.2]),
        cells_per_radius: CELLS,
        queries: [width, height],
    };
    let mut steps = Steps::new(progress, options.scenes.len() * plan.stored.len() * (1 + plan.radii.len()));
    let mut rows = Table::new([
        "scene",
        "stored",
        "radius_m",
        "is_auto",
        "cells_per_radius",
        "form",
        "candidates",
        "accepted",
        "candidates_per_accepted",
    ]);
    for scene in &options.scenes {
        let settings = Settings { width, height, ..Settings::default() };
        let features = Features::of(scene, &settings);
        let packed = Packed::new(scene, scene.camera.position);
        let tables = SceneTables::new(&packed, &features);
        let frame = packed.frame(&scene.camera, &settings);
        for stored in &plan.stored {
            let map = emit(&tables, &packed, *stored)?;
            let count = map.len().min(radius::SAMPLE);
            let faces = map.surfaces[..count].iter().map(|s| cpu::grid::face_of(s) as u32).collect();
            let sample = Sample { positions: map.positions[..count].to_vec(), faces };
            let chosen = radius::choose(&tables, &frame, &sample, map.len() as u64);
            for (is_auto, radius) in [(true, chosen)].into_iter().chain(plan.radii.iter().map(|r| (false, *r))) {
                steps.begin(&format!("{}: {stored} photons, R={radius:.3}", scene.name));
                for cells_per_radius in CELLS {
                    let size = CellSize::PerRadius(cells_per_radius);
                    let bounds = cpu::grid::grid_bounds(&map.view(), 2 * packed.objects.len());
                    let laid_out = cells::plan(&packed.objects, &bounds, map.len(), radius, size, Form::Auto)?;
                    let found = ask(scene, &tables, &frame, &map, &laid_out);
                    let mean = |sum: u64| sum as f64 / found.queries as f64;
                    rows.push([
                        scene.name.as_str().into(),
                        (*stored).into(),
                        radius.into(),
                        is_auto.into(),
                        cells_per_radius.into(),
                        if laid_out.hashed { "hashed" } else { "dense" }.into(),
                        mean(found.candidates).into(),
                        mean(found.accepted).into(),
                        (found.candidates as f64 / found.accepted as f64).into(),
                    ]);
                }
            }
        }
    }
    let settings = serde_json::to_value(&plan).map_err(|e| Error::Failed(format!("JSON: {e}")))?;
    Ok(Measured { settings, rows, summaries: Vec::new(), charts: Vec::new() })
}

fn emit(scene: &SceneTables, packed: &Packed, stored: u32) -> Result<PhotonTables> {
    let amount = Amount::Stored(stored);
    let emission = Emission { amount, seed: 0, pass: 0, sampler: Sampler::default(), store_direct: false };
    photons(scene, &emission::Plan::indirect(packed)?, &emission)
}

/// Every visible point of the picture asks for its photons.
fn ask(scene: &Scene, tables: &SceneTables, frame: &Frame, map: &PhotonTables, plan: &cells::Plan) -> Found {
    let grid = cpu::grid::grid(&map.view(), plan);
    let own = Gathering::of(tables.objects, tables.sphere_count, is_divided(scene));
    let gathering = Gathering { hashed: plan.hashed, ..own };
    let map = PhotonMap { gathering: &gathering, plan, stored: map.view(), grid: &grid, tiles: None };
    let mut found = Found::default();
    for (x, y) in (0..frame.height as u32).flat_map(|y| (0..frame.width as u32).map(move |x| (x, y))) {
        let (origin, direction) = (frame.position.into(), camera_direction(frame, x as f32 + 0.5, y as f32 + 0.5));
        let Some(hit) = tables.closest_hit(origin, direction, None) else { continue };
        let surface = tables.surface_at(origin, direction, hit);
        let face = 2 * surface.object + usize::from(surface.side < 0.0);
        found.queries += 1;
        for_each_candidate(&map, face, surface.position, |_| found.candidates += 1);
        found.accepted += near(&map, face, surface.position, 0).len() as u64;
    }
    found
}
