//! All backends show the same room of quads, by every method.

use photile::film::Image;
use photile::pipeline::Pipeline;
use photile::pipeline::progressive::Progressive;
use photile::scene::Scene;
use photile::settings::{FinalGather, GridForm, LightMode, Method, Settings, Technique};

use super::{apart, gathered, matte_room, room};
use crate::common::{backends, direct, render};

/// Of the mean, in any pixel: what another compiler's rounding makes of hundreds of photons.
const TOLERANCE: f64 = 1e-4;

/// Renders with every backend. All must agree, and another seed's picture must not pass for the same.
fn alike(
    pipelines: &mut [Pipeline],
    what: &str,
    settings: &Settings,
    mut picture: impl FnMut(&mut Pipeline, &Settings) -> Image,
) {
    let images: Vec<Image> = pipelines.iter_mut().map(|pipeline| picture(pipeline, settings)).collect();
    let twins = images.last().unwrap();
    for (image, pipeline) in images.iter().zip(pipelines.iter()) {
        let apart = apart(image, twins);
        eprintln!("{what}, {}: {apart:.1e}", pipeline.backend.name());
        assert!(apart < TOLERANCE, "{what}, {}: {apart}", pipeline.backend.name());
    }
    if settings.light != LightMode::Direct {
        let other = picture(pipelines.last_mut().unwrap(), &Settings { seed: 1, ..settings.clone() });
        assert!(apart(&other, twins) > 10.0 * TOLERANCE, "{what}: other photons must show");
    }
}

#[test]
fn backends_agree_in_a_room_of_quads() {
    let (mut pipelines, scene) = (backends(), room());
    let still = |pipeline: &mut Pipeline, settings: &Settings| render(pipeline, &scene, settings);
    alike(&mut pipelines, "direct", &direct(96, 72, 4), still);
    for (method, form, paths) in [
        (Method::Brute, GridForm::Auto, 2_000),
        (Method::Grid, GridForm::Dense, 20_000),
        (Method::Grid, GridForm::Hashed, 20_000),
        (Method::Tiles, GridForm::Auto, 10_000),
        (Method::TiledGrid, GridForm::Auto, 10_000),
        (Method::Knn, GridForm::Auto, 2_000),
    ] {
        let settings = gathered((64, 48), LightMode::Photons, (method, form), paths, 0.25);
        alike(&mut pipelines, &format!("{method:?}, {form:?}"), &settings, still);
    }
}

/// A render of two passes.
fn passes(pipeline: &mut Pipeline, scene: &Scene, settings: &Settings) -> Image {
    let mut progressive = Progressive::new(scene, settings).unwrap();
    while progressive.passes() < 2 {
        progressive.step(pipeline, scene).unwrap_or_else(|error| panic!("{error}"));
    }
    progressive.image().unwrap()
}

#[test]
fn passes_of_both_techniques_agree_in_a_room_of_quads() {
    let (mut pipelines, scene) = (backends(), matte_room());
    let settings = gathered((48, 36), LightMode::Hybrid, (Method::Grid, GridForm::Auto), 20_000, 0.25);
    let sites = Technique::FinalGather(FinalGather { rays: 8, ..FinalGather::default() });
    let pixels = Technique::FinalGather(FinalGather { rays: 4, spacing: 1, ..FinalGather::default() });
    for technique in [Technique::Map, sites, pixels] {
        let settings = Settings { technique, ..settings.clone() };
        alike(&mut pipelines, &format!("{technique:?}"), &settings, |pipeline, settings| {
            passes(pipeline, &scene, settings)
        });
    }
}

#[test]
fn a_perturbed_quad_is_told_apart() {
    let Some(mut pipeline) = crate::common::open(photile::settings::Backend::Cpu) else { return };
    let settings = gathered((64, 48), LightMode::Photons, (Method::Grid, GridForm::Auto), 10_000, 0.25);
    let sound = render(&mut pipeline, &room(), &settings);
    let mut shorter = room();
    shorter.shapes.quads[5].edges[0] *= 0.999;
    let mut moved = room();
    moved.shapes.quads[5].corner.y += 1e-3;
    for (what, wrong) in [("edge", shorter), ("corner", moved)] {
        let apart = apart(&render(&mut pipeline, &wrong, &settings), &sound);
        assert!(apart > 10.0 * TOLERANCE, "a perturbed {what} makes a difference of {apart}");
    }
}
