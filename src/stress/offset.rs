//! Suite: the same scene elsewhere and at another scale is the same picture, photons and all.
//!
//! What a move changes is held against the picture's own noise: the difference that another seed makes.

use glam::DVec3;

use super::{Bench, Fault, Found, Row, Spread, Suite};
use crate::bench::scenes::built_in;
use crate::error::{Error, Result};
use crate::film::Image;
use crate::film::metrics::{self, measure};
use crate::scene::Scene;
use crate::settings::{Amount, Method, Settings};

/// Scale about the world's origin, then the way from there.
const PLACES: [(&str, f64, DVec3); 8] = [
    ("moved by 1e3", 1.0, DVec3::new(1e3, -500.0, 2e3)),
    ("moved by 1e5", 1.0, DVec3::new(1e5, -1e5, 1e5)),
    ("scale 1e-6", 1e-6, DVec3::ZERO),
    ("scale 1e-3", 1e-3, DVec3::ZERO),
    ("scale 1e3", 1e3, DVec3::ZERO),
    ("scale 1e6", 1e6, DVec3::ZERO),
    ("scale 1e-3, moved by 1e5", 1e-3, DVec3::new(1e5, -1e5, 1e5)),
    ("scale 1e3, moved by 1e5", 1e3, DVec3::new(1e5, -1e5, 1e5)),
];

/// Intensities grow with the square of lengths, so radiance stays.
pub(super) fn placed(scene: &Scene, scale: f64, by: DVec3) -> Scene {
    let mut placed = scene.clone();
    let place = |p: &mut DVec3| *p = *p * scale + by;
    place(&mut placed.camera.position);
    place(&mut placed.camera.look_at);
    placed.lights.place(scale, by);
    placed.shapes.place(scale, by);
    placed
}

/// World coordinates kept in float32, as renderers do that do not recentre.
fn rounded(mut scene: Scene) -> Scene {
    let round = |p: &mut DVec3| *p = p.as_vec3().as_dvec3();
    round(&mut scene.camera.position);
    round(&mut scene.camera.look_at);
    scene.lights.points.iter_mut().for_each(|light| round(&mut light.position));
    for sphere in &mut scene.shapes.spheres {
        round(&mut sphere.center);
        sphere.radius = f64::from(sphere.radius as f32);
    }
    scene.shapes.planes.iter_mut().for_each(|plane| plane.offset = f64::from(plane.offset as f32));
    scene
}

pub(super) fn run(bench: &mut Bench) -> Result<Found> {
    let all = ["gi_ref", "sphere_and_plane", "gi_two_lights"];
    let names = &all[..bench.options.by_size(1, 2, 3)];
    let (width, height) = bench.options.by_size((64, 48), (96, 72), (320, 240));
    let paths = bench.options.by_size(5_000, 20_000, 100_000);
    let places = bench.options.by_size(2, PLACES.len(), PLACES.len());
    let mut found = Found::default();
    for backend in bench.backends() {
        let mut pipeline = bench.pipeline(backend)?;
        for name in names {
            let scene = match built_in(name) {
                Some(scene) => scene?,
                None => return Err(Error::Failed(format!("no scene named {name}"))),
            };
            // Several samples a pixel, so that what another seed changes includes the edges' own error: which side of
            // an edge a sample lies on, the last bit may decide.
            let mut settings = Settings { width, height, samples: 4, ..Settings::default() };
            settings.photons.amount = Amount::Paths(paths);
            settings.gather.method = Method::Grid;
            settings.gather.radius = Some(0.4);
            bench.step(&format!("offset: {name}, {}", backend.name()))?;
            let here = pipeline.render(&scene, &settings)?.image;
            let other_seed = Settings { seed: 1, ..settings.clone() };
            // Two independent pictures differ by √2 of the error of one.
            let noise = rmse(&pipeline.render(&scene, &other_seed)?.image, &here)? / std::f64::consts::SQRT_2;
            for (place, scale, by) in PLACES.into_iter().take(places) {
                bench.step(&format!("offset: {name} {place}, {}", backend.name()))?;
                let mut moved = placed(&scene, scale, by);
                if bench.options.fault == Some(Fault::WorldCoordinates) {
                    moved = rounded(moved);
                }
                let mut settings = settings.clone();
                settings.gather.radius = Some((0.4 * scale) as f32);
                let image = pipeline.render(&moved, &settings)?.image;
                let change = rmse(&image, &here)? / noise;
                let (measure, spread) = ("change, share of the image's noise", Spread::one(change));
                found.rows.push(Row::new(Suite::Offset, format!("{name} {place}"), backend, measure, spread, CHANGE));
            }
        }
    }
    Ok(found)
}

/// The figure: below a hundredth of the error, nobody can tell.
const CHANGE: f64 = 0.01;

fn rmse(image: &Image, reference: &Image) -> Result<f64> {
    Ok(measure(image, reference, &metrics::Settings::default())?.rmse)
}
