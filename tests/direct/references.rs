//! Images against those of an independent tracer (`tests/golden/README.md`).

use photile::film::Image;
use photile::film::metrics::{self, Within, edge_pixels, measure_except};
use photile::pipeline::Pipeline;
use photile::scene::Scene;

use crate::common::{REPORT, backends, direct, golden, render, shipped};

/// Away from edges 16 samples a pixel are as good as the reference's own noise, below 1e-7; what is left is the
/// curvature of radiance within a pixel, largest under the lamps.
const BOUND: f64 = 1e-6;

/// relMSE away from edges, and the share of pixels that count.
fn rel_mse(pipeline: &mut Pipeline, scene: &Scene, reference: &Image) -> (f64, f64) {
    let image = render(pipeline, scene, &direct(320, 240, 16));
    // A fifth is no edge's contrast that a pixel's neighbour could hide, and no gradient's but right under a lamp.
    let edges = edge_pixels(reference, &Within { abs: 0.02, rel: 0.2 });
    let kept = edges.iter().filter(|edge| !**edge).count() as f64 / edges.len() as f64;
    (measure_except(&image, reference, &edges, &metrics::Settings::default()).unwrap().rel_mse, kept)
}

#[test]
fn direct_light_is_the_independent_tracers() {
    for mut pipeline in backends() {
        for name in REPORT {
            let (error, kept) = rel_mse(&mut pipeline, &shipped(name), &golden(&format!("{name}_direct")));
            let backend = pipeline.backend.name();
            eprintln!("{backend} {name}: relMSE {error:e} over {:.1}% of pixels", kept * 100.0);
            assert!(kept > 0.9, "{name}: only {kept} of the pixels are no edges");
            assert!(error <= BOUND, "{backend} {name}: relMSE {error:e}");
        }
    }
}

#[test]
fn wrong_scenes_are_told_apart() {
    let name = "gi_ref";
    let (scene, reference) = (shipped(name), golden("gi_ref_direct"));
    let mut moved_light = scene.clone();
    moved_light.lights.points[0].position.x += 0.01;
    let mut darker = scene.clone();
    darker.materials.iter_mut().for_each(|material| material.diffuse *= 0.99);
    let mut turned = scene.clone();
    turned.camera.look_at.x += 0.01;
    for mut pipeline in backends() {
        for (what, wrong) in [("light", &moved_light), ("diffuse", &darker), ("camera", &turned)] {
            let (error, _) = rel_mse(&mut pipeline, wrong, &reference);
            assert!(error > BOUND, "{what}: relMSE {error:e} passes");
        }
    }
}
