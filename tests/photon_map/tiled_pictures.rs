//! Whole pictures by tiles against brute force, on every backend: in rooms, glossy and divided scenes; through narrow and
//! wide lenses, and from within photons' discs.

use glam::DVec3;
use photile::film::Image;
use photile::pipeline::change::Stage;
use photile::pipeline::{Machine, Pipeline};
use photile::program::features::is_divided;
use photile::scene::Scene;
use photile::settings::{Amount, Backend, Gather, Method, Photons, Settings};
use photile::shapes::Plane;
use photile::stage::map::MapView;

use super::tiles::{SAME, apart, scene, settings};
use crate::common::one_at_a_time;

/// 48 × 36 pixels, 3000 photons.
fn small(method: Method, tile: [u32; 2], radius: Option<f32>) -> Settings {
    let usual = settings(method, tile, 1);
    let photons = Photons { amount: Amount::Stored(3000), ..usual.photons };
    let gather = Gather { radius, ..usual.gather };
    Settings { width: 48, height: 36, photons, gather, ..usual }
}

fn open(backend: Backend, lanes: Option<u32>) -> Pipeline {
    let machine = Machine { backend: Some(backend), lanes, ..Machine::default() };
    Pipeline::open(&machine, |_| {}).expect("every backend works where tests run")
}

/// R of views whose eye is nearer to the floor than that, metres.
const WIDE: f32 = 0.8;

/// The scene's own view, through a narrow and a wide lens, and from 0.1 m above the floor, which is within the discs of
/// the photons there.
fn views(scene: &Scene) -> Vec<(&'static str, Scene, Option<f32>)> {
    let with_lens = |fov_y: f64| {
        let mut view = scene.clone();
        view.camera.fov_y = fov_y;
        view
    };
    let mut low = scene.clone();
    low.camera.position.y = -2.9;
    low.camera.look_at = low.camera.position + DVec3::new(0.2, -0.3, -1.0);
    vec![
        ("as it is", scene.clone(), None),
        ("1 degree", with_lens(1.0), None),
        ("170 degrees", with_lens(170.0), None),
        ("within discs", low, Some(WIDE)),
    ]
}

/// Photons whose disc the camera is in.
fn around_the_camera(pipeline: &Pipeline, scene: &Scene) -> usize {
    let (map, packed, _) = pipeline.map().expect("there are photons");
    let MapView::Host { stored, .. } = map else { panic!("the twins' maps are in host memory") };
    let eye = (scene.camera.position - packed.origin).as_vec3();
    stored.positions.iter().filter(|photon| eye.distance(photon.position.into()) < WIDE).count()
}

/// Brute force, tiles and tiled grids, view by view; and that another map is another picture in each of them.
fn equal_brute_force(scene: &Scene) {
    one_at_a_time();
    for backend in Backend::ALL {
        let mut pipeline = open(backend, None);
        for (name, view, radius) in views(scene) {
            let mut by = |settings: &Settings| pipeline.render(&view, settings).unwrap().image;
            let brute = by(&small(Method::Brute, [16, 16], radius));
            for (method, tile) in
                [(Method::Tiles, [16, 16]), (Method::TiledGrid, [16, 16]), (Method::TiledGrid, [7, 5])]
            {
                let off = apart(&brute, &by(&small(method, tile, radius)));
                assert!(off < SAME, "{backend:?}, {name}, {method:?}, {tile:?}: {off}");
            }
            let other = by(&Settings { seed: 1, ..small(Method::Tiles, [16, 16], radius) });
            let off = apart(&brute, &other);
            assert!(off > 100.0 * SAME, "{backend:?}, {name}: photons hardly matter here: {off}");
            if (backend, radius) == (Backend::Cpu, Some(WIDE)) {
                assert!(around_the_camera(&pipeline, &view) > 0, "the camera is in no photon's disc");
            }
        }
    }
}

#[test]
fn a_closed_room_by_tiles_is_that_by_brute_force() {
    equal_brute_force(&scene("gi_ref"));
}

#[test]
fn glossy_surfaces_by_tiles_are_those_by_brute_force() {
    equal_brute_force(&scene("glossy"));
}

/// Two lamps with an oblique wall between them, through the middle of a sphere: photons lie on both sides of it, and
/// those beyond it on floor and ceiling light nothing on this side.
fn divided() -> Scene {
    let mut scene = scene("gi_two_lights");
    let (normal, material) = (DVec3::new(1.0, 0.0, 0.2), scene.shapes.planes[0].material);
    scene.shapes.planes.push(Plane { normal: normal.normalize(), offset: -1.4 / normal.length(), material });
    scene
}

#[test]
fn a_scene_that_planes_divide_by_tiles_is_that_by_brute_force() {
    let scene = divided();
    for (name, view, _) in views(&scene) {
        assert!(is_divided(&view), "{name}");
    }
    equal_brute_force(&scene);
}

#[test]
fn one_photon_more_is_another_picture_on_every_backend() {
    one_at_a_time();
    let scene = scene("gi_ref");
    for backend in Backend::ALL {
        let mut pipeline = open(backend, None);
        let mut by = |method, stored| {
            let mut settings = small(method, [16, 16], Some(WIDE));
            settings.photons.amount = Amount::Stored(stored);
            pipeline.render(&scene, &settings).unwrap().image
        };
        let brute = by(Method::Brute, 3000);
        // A path more takes some 1e-3 of the mean from the brightest pixels. A photon that lies where the camera looks
        // is a share of some twenty around it: two of five do.
        let shows = |image: Image| apart(&brute, &image) > 0.02;
        assert!((3001..3016).any(|stored| shows(by(Method::Tiles, stored))), "{backend:?}");
        assert!(!shows(by(Method::Tiles, 3000)), "{backend:?}");
    }
}

#[test]
fn a_tile_larger_than_the_image_is_as_large_as_it_is_and_takes_no_more_memory() {
    one_at_a_time();
    let scene = scene("gi_ref");
    // As GPUs and as CPUs take the strips of tiles.
    for lanes in [Some(1), None] {
        let of = |tile| {
            let mut pipeline = open(Backend::OpenCl, lanes);
            let image = pipeline.render(&scene, &small(Method::TiledGrid, tile, None)).unwrap().image;
            (image, pipeline.bytes(), pipeline.most_bytes().unwrap())
        };
        let whole = of([48, 36]);
        assert!(whole.2 < 8 << 20, "{lanes:?}: {} bytes for 3000 photons", whole.2);
        // The largest that the command line takes, in both directions and in one.
        for tile in [[32_768, 32_768], [48, 32_768]] {
            let found = of(tile);
            assert_eq!((found.1, found.2), (whole.1, whole.2), "{lanes:?}, {tile:?}");
            assert!(found.0 == whole.0, "{lanes:?}, {tile:?}: another picture");
        }
        // The account tells other tiles from these.
        assert_ne!(of([1, 1]).1, whole.1, "{lanes:?}");
    }
}

#[test]
fn a_moved_camera_uploads_nothing_where_a_grid_is_gathered() {
    one_at_a_time();
    for backend in Backend::ALL {
        let mut pipeline = open(backend, None);
        let mut scene = scene("gi_ref");
        let mut settings = small(Method::Grid, [16, 16], None);
        let first = pipeline.render(&scene, &settings).unwrap();
        assert_eq!(first.uploads > 0, backend == Backend::OpenGl, "{backend:?}: only OpenGL has tables of its own");
        scene.camera.position.x += 0.1;
        let moved = pipeline.render(&scene, &settings).unwrap();
        assert!(!moved.skipped.contains(&Stage::Trace) && moved.image != first.image, "{backend:?}");
        assert_eq!(moved.uploads, 0, "{backend:?}");
        // What does change the map is counted.
        settings.seed = 1;
        let other = pipeline.render(&scene, &settings).unwrap();
        assert_eq!(other.uploads, first.uploads, "{backend:?}");
        // And so are the tiles of another view.
        settings.gather.method = Method::Tiles;
        pipeline.render(&scene, &settings).unwrap();
        scene.camera.position.x += 0.1;
        let tiled = pipeline.render(&scene, &settings).unwrap();
        assert_eq!(tiled.uploads > 0, backend == Backend::OpenGl, "{backend:?}");
    }
}
