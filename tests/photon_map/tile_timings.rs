//! Grid against tiles, on request: `cargo test --release --test all photon_map::tile_timings -- --ignored --nocapture`.

use glam::Vec3;
use photile::cpu::gather::{PhotonMap, for_each_candidate, for_each_listed, near};
use photile::cpu::grid::{grid, grid_bounds};
use photile::cpu::tiles::{find_region, tile_at, tiles, tiles_seen};
use photile::packing::Packed;
use photile::pipeline::{Machine, Pipeline};
use photile::plan::cells::{CellSize, Form, plan};
use photile::plan::tiling;
use photile::program::features::Features;
use photile::program::gathering::{Gathering, Method};
use photile::rays::camera::camera_direction;
use photile::rays::emission::{self, Emission};
use photile::rays::scene::SceneTables;
use photile::settings::{Amount, Backend, Gather, Pass, Photons, Sampler, Settings};

use super::tiles::scene;
use crate::common::one_at_a_time;

const TILES: [[u32; 2]; 3] = [[80, 80], [32, 32], [16, 16]];

fn settings(method: Method, tile: [u32; 2], stored: u32, radius: Option<f32>, size: [u32; 2]) -> Settings {
    let default = Settings::default();
    Settings {
        width: size[0],
        height: size[1],
        photons: Photons { amount: Amount::Stored(stored), ..default.photons },
        gather: Gather { method, tile: Some(tile), radius, ..default.gather },
        ..default
    }
}

#[test]
#[ignore = "measures, asserts nothing"]
fn tile_timings() {
    one_at_a_time();
    for (backend, size) in [(Backend::OpenCl, [640, 480]), (Backend::OpenGl, [160, 120])] {
        let machine = Machine { backend: Some(backend), ..Machine::default() };
        let mut pipeline = Pipeline::open(&machine, |_| {}).unwrap();
        for name in ["gi_ref", "sphere_and_plane"] {
            let mut scene = scene(name);
            for (stored, radius) in
                [(2000, None), (12_000, None), (200_000, None), (12_000, Some(1.0)), (200_000, Some(1.0))]
            {
                for method in [Method::Grid, Method::Tiles, Method::TiledGrid] {
                    for tile in if method == Method::Grid { &TILES[..1] } else { &TILES[..] } {
                        let settings = settings(method, *tile, stored, radius, size);
                        let Ok(first) = pipeline.render(&scene, &settings) else { continue };
                        scene.camera.position.x += 1e-6; // tiles again, without building kernels
                        let moved = pipeline.render(&scene, &settings).unwrap();
                        let mut times: Vec<_> = (0..3)
                            .map(|_| pipeline.retrace(&scene, &settings, &Pass::single(&settings)).unwrap())
                            .collect();
                        times.sort_by(f64::total_cmp);
                        println!(
                            "{} {name} {stored} R {:.3} {} {tile:?}: grid {:.1} tiles {:.1} trace {:.1} ms",
                            backend.name(),
                            first.radius.unwrap_or(0.0),
                            method.name(),
                            first.times.grid,
                            moved.times.tiles,
                            times[1]
                        );
                    }
                }
            }
        }
    }
}

#[test]
#[ignore = "measures, asserts nothing"]
fn candidates_of_an_accepted_photon() {
    for name in ["gi_ref", "sphere_and_plane"] {
        let scene = scene(name);
        for radius in [0.3, 1.0] {
            let settings = settings(Method::Grid, [80, 80], 200_000, Some(radius), [640, 480]);
            let packed = Packed::new(&scene, scene.camera.position);
            let features = Features::of(&scene, &settings);
            let tables = SceneTables::new(&packed, &features);
            let emission = Emission {
                amount: settings.photons.amount,
                seed: 0,
                pass: 0,
                sampler: Sampler::Sequence,
                store_direct: false,
            };
            let plan_of_paths = emission::EmissionPlan::new(&packed).unwrap();
            let stored = photile::cpu::photons::photons(&tables, &plan_of_paths, &emission).unwrap();
            let view = stored.view();
            let bounds = grid_bounds(&view, 2 * packed.shapes.len());
            let cells = plan(&packed.shapes, false, &bounds, stored.len(), radius, CellSize::Auto, Form::Auto).unwrap();
            let sorted = grid(&view, &cells);
            let gathering = Gathering { hashed: cells.hashed, ..Gathering::default() };
            let map = PhotonMap { gathering: &gathering, plan: &cells, stored: view, grid: &sorted, tiles: None };
            let frame = packed.frame(&scene.camera, &settings, &Pass::single(&settings));
            let points: Vec<_> = (0..480u32)
                .step_by(7)
                .flat_map(|y| (0..640u32).step_by(7).map(move |x| (x, y)))
                .filter_map(|(x, y)| {
                    let direction = camera_direction(&frame, x as f32 + 0.5, y as f32 + 0.5);
                    let hit = tables.closest_hit(frame.position.into(), direction, None)?;
                    let s = tables.surface_at(frame.position.into(), direction, hit);
                    Some((x, y, 2 * s.shape + usize::from(s.side < 0.0), s.position))
                })
                .collect();
            let (mut accepted, mut candidates) = (0, 0);
            for &(_, _, face, p) in &points {
                accepted += near(&map, face, p, 0).len();
                for_each_candidate(&map, face, p, |_| candidates += 1);
            }
            let per_pixel = accepted as f64 / points.len() as f64;
            println!(
                "{name} R {radius} grid: {:.2}, {per_pixel:.0} accepted a pixel",
                candidates as f64 / accepted as f64
            );
            for (cells, tile) in [false, true].into_iter().flat_map(|cells| TILES.map(|tile| (cells, tile))) {
                let wanted = tiling::TileSettings { radius, tile, cells };
                let seen = tiles_seen(&tables, &frame, tile);
                let plan = tiling::plan(&packed.shapes, &frame, seen, stored.len(), &wanted).unwrap();
                let lists = tiles(&view, &plan, &frame).unwrap();
                let mut candidates = 0usize;
                for &(x, y, face, p) in &points {
                    let p: Vec3 = p;
                    let Some(region) = find_region(&plan, tile_at(&plan.gather, x, y), face, p) else { continue };
                    for_each_listed(&lists, region, radius, p, |_| candidates += 1);
                }
                println!(
                    "{name} R {radius} {} {tile:?}: {:.2}; {:.2} entries a photon",
                    if cells { "tiled-grid" } else { "tiles" },
                    candidates as f64 / accepted as f64,
                    lists.tile_photons.len() as f64 / stored.len() as f64
                );
            }
        }
    }
}
