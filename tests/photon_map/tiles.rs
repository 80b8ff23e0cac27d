//! Screen-space tiles: nothing that brute force accepts is missing, device against twin, pictures against the grid's.

use glam::Vec3;
use photile::cpu::gather::{PhotonMap, near};
use photile::cpu::grid::{GridTables, face_of};
use photile::cpu::tiles::{find_region, slopes, tile_at, tiles, tiles_seen};
use photile::device::cl::Context;
use photile::device::gl::{Current, Headless};
use photile::film::Image;
use photile::kinds::{ShapeKind, ShapeSet};
use photile::packing::Packed;
use photile::pipeline::change::Stage;
use photile::pipeline::{Machine, Pipeline};
use photile::plan::choice::Class;
use photile::plan::tiling::{self, TileSettings, plan};
use photile::program::features::{Features, Lights};
use photile::program::gathering::{Gathering, Method};
use photile::rays::camera::sample_direction;
use photile::rays::scene::SceneTables;
use photile::records::Frame;
use photile::scene::{Scene, load};
use photile::settings::{Amount, Backend, Gather, Settings};
use photile::stage::tiles::TileStage;

use super::{Map, ROOM_SPHERES, Random, device, like_a_gpu, packed_of, room, room_material, room_photons, upload};
use crate::common::one_at_a_time;

pub const FEATURES: Features = Features {
    shapes: ShapeSet::of(ShapeKind::Sphere).and(ShapeSet::of(ShapeKind::Plane)),
    lights: Lights::None,
    shadows: ShapeSet::NONE,
    two_sided: true,
    glossy: true,
    ambient: false,
    one_sample: true,
    in_uniforms: true,
    counts: None,
};

pub fn packed() -> Packed {
    packed_of(room(), ROOM_SPHERES, room_material())
}

/// A view from inside the room, of 40 × 30 pixels.
pub fn frame(eye: Vec3, forward: Vec3, fov_y: f32, samples: u32) -> Frame {
    let forward = forward.normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let half_height = (fov_y.to_radians() / 2.0).tan();
    Frame {
        position: eye.to_array(),
        right: (right * half_height * 4.0 / 3.0).to_array(),
        up: (right.cross(forward) * half_height).to_array(),
        forward: forward.to_array(),
        width: 40.0,
        height: 30.0,
        samples: samples as f32,
        sphere_count: ROOM_SPHERES as f32,
        plane_count: (room().len() - ROOM_SPHERES) as f32,
        ..Frame::default()
    }
}

/// A random view: narrow, usual or wide; in the room's middle or with its eye close to a wall.
fn view(random: &mut Random, samples: u32) -> Frame {
    let near_wall = random.uniform(0.0, 1.0) < 0.3;
    let x = if near_wall { -2.99 } else { random.uniform(-2.0, 0.5) };
    let eye = Vec3::new(x, random.uniform(-1.9, 1.9), random.uniform(-2.5, 2.5));
    let fov_y = [1.0, 20.0, 60.0, 120.0, 170.0][random.below(5)];
    frame(eye, Vec3::from(random.direction()), fov_y, samples)
}

/// Pixel–photon pairs that were looked at, accepted ones, and those of them that the tiles miss. `queried` is the
/// radius of the queries, `wanted.radius` that of the tiles.
pub fn missing(map: &Map, frame: &Frame, wanted: &TileSettings, queried: f32) -> [usize; 3] {
    let packed = packed();
    let features = Features { one_sample: frame.samples == 1.0, ..FEATURES };
    let scene = SceneTables::new(&packed, &features);
    let seen = tiles_seen(&scene, frame, wanted.tile);
    let mut plan = plan(&packed.shapes, frame, seen, map.len(), wanted).unwrap();
    let tables = tiles(&map.tables(), &plan, frame).unwrap();
    plan.gather.radius = queried;
    plan.gather.inverse_radius = 1.0 / queried;
    let cells = photile::plan::cells::GridPlan { hashed: false, cells: 0, faces: Vec::new(), gather: plan.gather };
    let grid = GridTables::default();
    let by = |method| Gathering { method, ..Gathering::default() };
    let (tiled, brute) = (by(Method::Tiles), by(Method::Brute));
    let [tiled, brute] = [(&tiled, Some((&plan, &tables))), (&brute, None)].map(|(gathering, tiles)| PhotonMap {
        gathering,
        plan: &cells,
        stored: map.tables(),
        grid: &grid,
        tiles,
    });
    let [mut looked, mut accepted, mut missed] = [0; 3];
    for (row, column) in (0..frame.height as u32).flat_map(|y| (0..frame.width as u32).map(move |x| (y, x))) {
        let tile = tile_at(&plan.gather, column, row);
        for sample in 0..frame.samples as u32 {
            let direction = sample_direction(frame, features.one_sample, column, row, sample);
            let Some(hit) = scene.closest_hit(frame.position.into(), direction, None) else { continue };
            let surface = scene.surface_at(frame.position.into(), direction, hit);
            let face = 2 * surface.shape + usize::from(surface.side < 0.0);
            assert!(find_region(&plan, tile, face, surface.position).is_some(), "its own rays saw this point");
            let photons = |map| {
                let mut found: Vec<_> =
                    near(map, face, surface.position, tile).iter().map(|near| near.photon).collect();
                found.sort_unstable();
                found
            };
            let (found, truth) = (photons(&tiled), photons(&brute));
            assert!(found.windows(2).all(|pair| pair[0] != pair[1]), "a photon is listed twice");
            assert!(found.iter().all(|i| face_of(&map.surfaces[*i]) == face), "a photon of another face is listed");
            looked += map.len();
            accepted += truth.len();
            missed += truth.iter().filter(|i| found.binary_search(i).is_err()).count();
        }
    }
    [looked, accepted, missed]
}

#[test]
fn no_photon_that_brute_force_accepts_is_missing_from_its_tile() {
    let map = room_photons(1000, 21);
    let mut random = Random::new(22);
    let [mut looked, mut accepted] = [0; 2];
    for case in 0..40 {
        let frame = view(&mut random, 1 + case % 2);
        let tile = [[1, 1], [7, 5], [16, 16], [40, 1], [64, 64]][random.below(5)];
        let radius = [0.05, 0.3, 1.0, 6.0][random.below(4)];
        let wanted = TileSettings { radius, tile, cells: random.uniform(0.0, 1.0) < 0.5 };
        let [pairs, found, missed] = missing(&map, &frame, &wanted, radius);
        assert_eq!(missed, 0, "{wanted:?}, {frame:?}");
        looked += pairs;
        accepted += found;
    }
    assert!(looked > 10_000_000 && accepted > 1_000_000, "{looked} pairs, {accepted} accepted");
}

#[test]
fn a_radius_too_small_is_noticed() {
    let map = room_photons(1000, 23);
    let frame = frame(Vec3::new(-0.5, 1.2, 1.0), Vec3::new(-0.3, -0.35, -0.9), 60.0, 1);
    for cells in [false, true] {
        let wanted = TileSettings { radius: 0.3, tile: [7, 5], cells };
        assert!(missing(&map, &frame, &wanted, 0.5)[2] > 0, "tiles for R = 0.3 serve no query of R = 0.5");
    }
}

#[test]
fn slopes_bound_every_point_of_a_disc() {
    let mut random = Random::new(24);
    for _ in 0..2000 {
        let radius = random.uniform(0.01, 2.0);
        let (across, depth) = (random.uniform(-4.0, 4.0), random.uniform(-3.0, 6.0));
        let [low, high] = slopes(across, depth, radius);
        for _ in 0..50 {
            let (angle, r) = (random.uniform(0.0, std::f32::consts::TAU), radius * random.uniform(0.0, 1.0).sqrt());
            let (x, z) = (across + r * angle.cos(), depth + r * angle.sin());
            assert!(z <= 1e-6 || (low <= x / z && x / z <= high), "{x}/{z} outside {low} … {high}");
        }
        let far = depth > 2.0 * radius;
        assert!(!far || high - low < 8.0 * radius / depth * (1.0 + (across / depth).powi(2)), "not more than it must");
    }
}

#[test]
fn device_and_twin_make_the_same_lists_and_see_the_same() {
    make_the_same_lists(&device());
}

#[test]
fn work_groups_make_the_twins_lists() {
    make_the_same_lists(&like_a_gpu());
}

fn make_the_same_lists(context: &Context) {
    let mut stage = TileStage::new(context).unwrap();
    let packed = packed();
    let mut random = Random::new(25);
    for (case, count) in [20_000, 3000, 17, 1, 0].into_iter().enumerate() {
        let map = room_photons(count, 26);
        let uploaded = upload(context, &map);
        for tile in [[7, 5], [16, 16], [1, 1], [64, 64]] {
            let frame = view(&mut random, 1 + case as u32 % 2);
            let features = Features { one_sample: frame.samples == 1.0, ..FEATURES };
            stage.upload(context, &packed, &features).unwrap();
            let wanted = TileSettings { radius: 0.4, tile, cells: tile[0] % 2 == 0 };
            let of = |seen| plan(&packed.shapes, &frame, seen, count, &wanted).unwrap();
            let twin = of(tiles_seen(&SceneTables::new(&packed, &features), &frame, tile));
            let found = of(stage.seen(context, &frame, tile).unwrap());
            // A ray along an edge may hit either side of it: other regions, but few.
            let same = |plan: &tiling::TilePlan| plan.regions.iter().map(|r| r.face).collect::<Vec<_>>();
            assert!(same(&twin).len().abs_diff(same(&found).len()) <= 2, "{:?}, {:?}", same(&twin), same(&found));
            if same(&twin) == same(&found) {
                for (a, b) in twin.regions.iter().zip(&found.regions) {
                    let off = |a: [f32; 3], b: [f32; 3]| (Vec3::from(a) - Vec3::from(b)).abs().max_element();
                    // Distances of some metres, an ulp or two apart.
                    assert!(off(a.low, b.low) < 1e-5 && off(a.high, b.high) < 1e-5, "{a:?}, {b:?}");
                }
            }
            let expected = tiles(&map.tables(), &twin, &frame).unwrap();
            let made = stage.fill(context, twin.clone(), &frame, &uploaded.view()).unwrap();
            let mut starts = made.cell_starts.to_vec(context).unwrap();
            let mut photons = made.tile_photons.to_vec(context).unwrap();
            starts.truncate(twin.cells + 1);
            photons.truncate(made.pairs);
            assert!(starts == expected.cell_starts, "{count} photons, {tile:?}");
            assert!(photons == expected.tile_photons, "{count} photons, {tile:?}");
        }
    }
}

pub fn scene(name: &str) -> Scene {
    load(format!("{}/scenes/{name}.toml", env!("CARGO_MANIFEST_DIR")).as_ref()).unwrap()
}

pub fn settings(method: Method, tile: [u32; 2], samples: u32) -> Settings {
    let default = Settings::default();
    Settings {
        width: 90,
        height: 65,
        samples,
        photons: photile::settings::Photons { amount: Amount::Paths(4000), ..default.photons },
        gather: Gather { method, tile: Some(tile), ..default.gather },
        ..default
    }
}

/// Greatest difference of two pictures, in means of the first.
pub fn apart(a: &Image, b: &Image) -> f32 {
    let mean = a.pixels.iter().flatten().sum::<f32>() / (3 * a.pixels.len()) as f32;
    let pairs = a.pixels.iter().flatten().zip(b.pixels.iter().flatten());
    pairs.map(|(a, b)| (a - b).abs() / mean).fold(0.0, f32::max)
}

/// Some hundred terms in another order: 1e-7 each, on lights ten times the mean.
pub const SAME: f32 = 5e-5;

#[test]
fn a_photon_more_is_another_picture() {
    let machine = Machine { backend: Some(Backend::Cpu), ..Machine::default() };
    let mut pipeline = Pipeline::open(&machine, |_| {}).unwrap();
    let (scene, mut settings) = (scene("gi_ref"), settings(Method::Tiles, [32, 32], 1));
    let mut with = |amount| {
        settings.photons.amount = amount;
        pipeline.render(&scene, &settings).unwrap().image
    };
    // 2 ppm of the light less for each photon, and one that is nowhere else.
    let (a, b) = (with(Amount::Stored(4000)), with(Amount::Stored(4001)));
    assert!(apart(&a, &b) > SAME, "{}", apart(&a, &b));
}

#[test]
fn groups_of_work_items_gather_what_single_ones_do() {
    // One lane, as on GPUs: their groups gather together, wherever that runs.
    one_at_a_time();
    let machine = Machine { backend: Some(Backend::OpenCl), lanes: Some(1), ..Machine::default() };
    let mut pipeline = Pipeline::open(&machine, |_| {}).expect("OpenCL works where tests run");
    for (name, samples) in [("gi_ref", 1), ("sphere_and_plane", 2), ("glossy", 1)] {
        let scene = scene(name);
        let mut by = |method, tile| pipeline.render(&scene, &settings(method, tile, samples)).unwrap().image;
        let brute = by(Method::Brute, [32, 32]);
        // 90 × 65 pixels: groups hang over the edge, and over tiles' edges.
        for (method, tile) in [
            (Method::Grid, [32, 32]),
            (Method::Tiles, [32, 32]),
            (Method::TiledGrid, [32, 32]),
            (Method::TiledGrid, [7, 5]),
            (Method::Tiles, [1, 1]),
            (Method::Tiles, [500, 500]),
        ] {
            let off = apart(&brute, &by(method, tile));
            assert!(off < SAME, "{name}, {method:?}, {tile:?}: {off}");
        }
    }
}

#[test]
fn pictures_equal_the_grids_on_every_backend() {
    one_at_a_time();
    for backend in Backend::ALL {
        let machine = Machine { backend: Some(backend), ..Machine::default() };
        let mut pipeline = Pipeline::open(&machine, |_| {}).expect("every backend works where tests run");
        for (name, samples) in [("gi_ref", 1), ("sphere_and_plane", 2)] {
            let scene = scene(name);
            let grid = pipeline.render(&scene, &settings(Method::Grid, [32, 32], samples)).unwrap().image;
            for (method, tile) in [
                (Method::Tiles, [32, 32]),
                (Method::TiledGrid, [32, 32]),
                (Method::Tiles, [1, 1]),
                (Method::TiledGrid, [7, 5]),
                (Method::Tiles, [500, 500]),
                (Method::TiledGrid, [500, 500]),
            ] {
                let tiled = pipeline.render(&scene, &settings(method, tile, samples)).unwrap().image;
                let off = apart(&grid, &tiled);
                assert!(off < SAME, "{backend:?}, {name}, {method:?}, {tile:?}: {off}");
            }
        }
    }
}

#[test]
fn a_moved_camera_rebuilds_tiles_only() {
    one_at_a_time();
    for (backend, method) in
        Backend::ALL.into_iter().flat_map(|backend| [Method::Tiles, Method::TiledGrid].map(|method| (backend, method)))
    {
        let machine = Machine { backend: Some(backend), ..Machine::default() };
        let mut pipeline = Pipeline::open(&machine, |_| {}).expect("every backend works where tests run");
        let mut scene = scene("gi_ref");
        let settings = settings(method, [16, 16], 1);
        let first = pipeline.render(&scene, &settings).unwrap();
        assert_eq!(first.skipped, [Stage::Grid]);
        let again = pipeline.render(&scene, &settings).unwrap();
        assert_eq!(again.skipped, Stage::ALL, "nothing changed");
        assert_eq!(again.uploads, 0, "{backend:?}");
        assert_eq!((again.times.tiles, again.times.upload, again.times.trace), (0.0, 0.0, 0.0), "{backend:?}");
        scene.camera.position.x += 0.1;
        let moved = pipeline.render(&scene, &settings).unwrap();
        let done: Vec<_> = Stage::ALL.into_iter().filter(|stage| !moved.skipped.contains(stage)).collect();
        assert_eq!(done, [Stage::Tiles, Stage::Trace]);
        assert!(moved.uploads <= 4, "lists, regions, tiles and cells at most: {}", moved.uploads);
    }
}

#[test]
fn what_scatters_nothing_has_no_regions() {
    let mut packed = packed();
    for material in &mut packed.materials[..4] {
        material.diffuse = 0.0;
        material.specular = 0.0;
    }
    let frame = frame(Vec3::new(-0.5, 1.2, 1.0), Vec3::new(-0.3, -0.35, -0.9), 120.0, 1);
    let seen = tiles_seen(&SceneTables::new(&packed, &FEATURES), &frame, [8, 8]);
    assert!(!seen.is_empty() && seen.iter().all(|seen| seen.face >= 8));
}

#[test]
fn the_choice_goes_with_the_map() {
    let machine = Machine { backend: Some(Backend::Cpu), ..Machine::default() };
    let mut pipeline = Pipeline::open(&machine, |_| {}).unwrap();
    let mut chosen = |name: &str| {
        let Settings { gather, .. } = settings(Method::Auto, [16, 16], 1);
        let settings = Settings { gather: Gather { tile: None, ..gather }, ..settings(Method::Auto, [16, 16], 1) };
        pipeline.render(&scene(name), &settings).unwrap().method
    };
    // A closed room's dense grid costs least; an infinite plane's hashed one is dear where every pixel gathers alone.
    assert_eq!(chosen("gi_ref"), Some(Method::Grid));
    assert!(chosen("sphere_and_plane").is_some_and(Method::is_tiled));
}

#[test]
fn a_windows_context_costs_what_its_renderer_does() {
    one_at_a_time();
    let headless = Headless::new().expect("an OpenGL driver");
    for (is_software, class) in [(true, Class::OpenGlSoftware), (false, Class::OpenGlGpu)] {
        let current = Current { is_software, ..headless.current() };
        let pipeline = Pipeline::open_within(Backend::OpenGl, &Machine::default(), &current, |_| {}).unwrap();
        assert_eq!(pipeline.class(), class);
        assert_eq!(pipeline.is_on_gpu(), !is_software);
    }
}
