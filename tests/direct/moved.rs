//! The same scene elsewhere or at another scale is the same picture: nothing has a fixed epsilon.

use glam::{DVec3, dvec3};
use photile::film::Image;
use photile::film::metrics::{self, Within, measure};
use photile::scene::Scene;

use crate::common::{REPORT, backends, direct, render, shipped};

/// Scaled about the world's origin, then moved. Intensities grow with the square of lengths, so radiance stays.
fn placed(scene: &Scene, scale: f64, by: DVec3) -> Scene {
    let mut placed = scene.clone();
    let place = |p: &mut DVec3| *p = *p * scale + by;
    place(&mut placed.camera.position);
    place(&mut placed.camera.look_at);
    placed.lights.place(scale, by);
    placed.shapes.place(scale, by);
    placed
}

/// Where, and how much of a value may be lost there.
const PLACES: [(&str, f64, DVec3); 6] = [
    ("moved", 1.0, dvec3(1000.0, -500.0, 2000.0)),
    ("moved by 1e5", 1.0, dvec3(1e5, -1e5, 1e5)),
    ("small", 1e-3, DVec3::ZERO),
    ("large", 1e3, DVec3::ZERO),
    ("small and moved", 1e-3, dvec3(1000.0, -500.0, 2000.0)),
    ("large and moved", 1e3, dvec3(1000.0, -500.0, 2000.0)),
];

/// Pixels off by more than 1e-4 of themselves, and the relMSE of all others. f64 keeps a millimetre scene at 2000 m to
/// 2e-13 m, 2e-10 of its size, so float32's own 6e-8 is all that can differ: each coordinate is rounded to another
/// neighbour, and a few operations later 1e-6 of a value is left, squared 1e-12.
fn differences(image: &Image, reference: &Image) -> (usize, f64) {
    let apart = Within { abs: 1e-6, rel: 1e-4 };
    let pairs = || image.pixels.iter().zip(&reference.pixels);
    let mask: Vec<bool> = pairs().map(|(a, b)| apart.apart(*a, *b)).collect();
    let rest = metrics::measure_except(image, reference, &mask, &metrics::Settings::default()).unwrap();
    (mask.iter().filter(|apart| **apart).count(), rest.rel_mse)
}

#[test]
fn place_and_scale_do_not_show() {
    let settings = direct(320, 240, 1);
    for mut pipeline in backends() {
        for name in REPORT.into_iter().chain(["glossy"]) {
            let scene = shipped(name);
            let reference = render(&mut pipeline, &scene, &settings);
            for (what, scale, by) in PLACES {
                // On the same pipeline: what it holds of the scene elsewhere must not spoil this one.
                let image = render(&mut pipeline, &placed(&scene, scale, by), &settings);
                let (apart, rel_mse) = differences(&image, &reference);
                let backend = pipeline.backend.name();
                // Some 2000 of the 76,800 pixels lie at an edge, and one in 2000 of those within rounding of it.
                assert!(apart <= 10, "{backend}, {name} {what}: {apart} pixels differ");
                assert!(rel_mse <= 1e-10, "{backend}, {name} {what}: relMSE {rel_mse:e}");
            }
        }
    }
}

#[test]
fn a_hundredth_of_a_percent_shows() {
    let settings = direct(320, 240, 1);
    for mut pipeline in backends() {
        let scene = shipped("gi_ref");
        let reference = render(&mut pipeline, &scene, &settings);
        // A scale without its intensity, a place without its light, an offset too large by 1e-4 of the room.
        let mut dim = placed(&scene, 1e3, DVec3::ZERO);
        dim.lights.points[0].intensity *= 0.9999;
        let mut askew = placed(&scene, 1.0, dvec3(1000.0, -500.0, 2000.0));
        askew.lights.points[0].position.x += 1e-3;
        for wrong in [dim, askew] {
            let image = render(&mut pipeline, &wrong, &settings);
            let (apart, rel_mse) = differences(&image, &reference);
            assert!(apart > 10 || rel_mse > 1e-10, "{apart} pixels, relMSE {rel_mse:e}");
        }
    }
}

#[test]
fn a_camera_that_walks_far_away_keeps_the_scene_sharp() {
    // 200 m away through a telephoto lens: scene space may stay where the first camera stood.
    let settings = direct(160, 120, 1);
    for mut pipeline in backends() {
        let mut scene = shipped("sphere_and_plane");
        render(&mut pipeline, &scene, &settings);
        scene.camera.position = dvec3(0.0, 0.0, 200.0);
        scene.camera.fov_y = 4.0;
        let walked = render(&mut pipeline, &scene, &settings);
        let mut fresh = crate::common::open(pipeline.backend).unwrap();
        let fresh = render(&mut fresh, &scene, &settings);
        let (apart, _) = differences(&walked, &fresh);
        let rmse = measure(&walked, &fresh, &metrics::Settings::default()).unwrap().rmse;
        assert!(apart <= 10, "{}: {apart} pixels, RMSE {rmse:e}", pipeline.backend.name());
    }
}
