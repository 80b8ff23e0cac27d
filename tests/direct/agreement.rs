//! Backends against each other, on all shipped scenes.

use photile::film::Image;
use photile::film::metrics::{self, Within, flipped_pixels, measure_except};
use photile::settings::{Backend, Pass};

use crate::common::{all_shipped, backends, direct, open, render, shipped};

/// Differences that are no pixel's flip: of float32 code from another compiler.
const TOLERANCE: Within = Within { abs: 1e-4, rel: 1e-4 };
/// Outside flipped pixels.
const RMSE: f64 = 1e-5;
/// Of 640 × 480 pixels.
const FLIPS: usize = 50;

/// RMSE outside flipped pixels, and their number.
fn compare(a: &Image, b: &Image) -> (f64, usize) {
    let flipped = flipped_pixels(a, b, &TOLERANCE).unwrap();
    let rest = measure_except(a, b, &flipped, &metrics::Settings::default()).unwrap();
    (rest.rmse, flipped.iter().filter(|flip| **flip).count())
}

#[test]
fn all_shipped_scenes_look_alike_on_all_backends() {
    let mut pipelines = backends();
    for name in all_shipped() {
        let scene = shipped(&name);
        // Hundreds of objects take llvmpipe seconds at full size; edges, and so flips, shrink with the width.
        let shrink = if scene.shapes.spheres.len() > 100 { 4 } else { 1 };
        let (settings, most_flips) = (direct(640 / shrink, 480 / shrink, 1), FLIPS / shrink as usize);
        let images: Vec<Image> = pipelines.iter_mut().map(|pipeline| render(pipeline, &scene, &settings)).collect();
        assert!(images.iter().all(|image| image.pixels.iter().filter(|p| p[0] > 0.0).count() > 3000), "{name}");
        for (i, j) in [(0, 1), (0, 2), (1, 2)].into_iter().filter(|(_, j)| *j < images.len()) {
            let (rmse, flips) = compare(&images[i], &images[j]);
            let pair = format!("{name}, {} and {}", pipelines[i].backend.name(), pipelines[j].backend.name());
            assert!(rmse <= RMSE && flips <= most_flips, "{pair}: RMSE {rmse:e}, {flips} flips");
        }
    }
}

#[test]
fn a_perturbed_side_is_told_apart() {
    let settings = direct(640, 480, 1);
    let mut pipeline = open(Backend::Cpu).unwrap();
    let scene = shipped("glossy");
    let sound = render(&mut pipeline, &scene, &settings);
    let mut rougher = scene.clone();
    rougher.materials.iter_mut().for_each(|material| material.roughness *= 1.001);
    let mut moved_light = scene.clone();
    moved_light.lights.points[0].position.x += 1e-3;
    for (what, wrong) in [("roughness", rougher), ("light", moved_light)] {
        let (rmse, flips) = compare(&sound, &render(&mut pipeline, &wrong, &settings));
        assert!(rmse > RMSE, "{what}: RMSE {rmse:e}, {flips} flips");
    }
    // An image displaced by a pixel may pass as flips along its edges, but there are far too many of them.
    let shifted = Image::from_fn(640, 480, |x, y| sound.at((x + 1).min(639), y));
    let (_, flips) = compare(&sound, &shifted);
    assert!(flips > FLIPS, "{flips} flips");
}

#[test]
fn samples_lie_in_the_same_places() {
    for samples in [2, 4, 7] {
        let settings = direct(320, 240, samples);
        // One sample's flip changes a pixel by a share of the edge; any other pattern changes most edge pixels.
        let apart =
            |a: &Image, b: &Image| a.pixels.iter().zip(&b.pixels).filter(|(a, b)| TOLERANCE.apart(**a, **b)).count();
        let scene = shipped("gi_ref");
        let mut pipelines = backends();
        let images: Vec<Image> = pipelines.iter_mut().map(|pipeline| render(pipeline, &scene, &settings)).collect();
        for (image, pipeline) in images.iter().zip(&mut pipelines) {
            let differ = apart(image, &images[0]);
            assert!(differ <= FLIPS, "{samples} samples, {}: {differ} pixels differ", pipeline.backend.name());
            let own = Pass::single(&settings);
            for other in [Pass { seed: 0x1_0000, ..own }, Pass { first_sample: 1, ..own }] {
                let picture = pipeline.render_pass(&scene, &settings, &other).unwrap_or_else(|error| panic!("{error}"));
                let differ = apart(image, &picture.image);
                assert!(differ > 20 * FLIPS, "{samples} samples: {differ} pixels differ for {other:?}");
            }
        }
    }
}

#[test]
fn passes_go_on_where_the_last_one_stopped() {
    // The mean of samples 0–3 and 4–7 is the picture of samples 0–7.
    let scene = shipped("gi_ref");
    for mut pipeline in backends() {
        let whole = render(&mut pipeline, &scene, &direct(160, 120, 8));
        let settings = direct(160, 120, 4);
        let halves = [0, 4].map(|first_sample| {
            let pass = Pass { first_sample, ..Pass::single(&settings) };
            pipeline.render_pass(&scene, &settings, &pass).unwrap_or_else(|error| panic!("{error}")).image
        });
        for (i, pixel) in whole.pixels.iter().enumerate() {
            for (c, found) in pixel.iter().enumerate() {
                let mean = 0.5 * (halves[0].pixels[i][c] + halves[1].pixels[i][c]);
                assert!((found - mean).abs() <= 1e-5 * mean, "{}: {found} {mean}", pipeline.backend.name());
            }
        }
    }
}

#[test]
fn opencl_on_a_cpu_gives_the_twins_very_bits() {
    // Same bytes in, same operations in the same order, no contraction: then every stage in between agrees too. A
    // GPU's division and root may be an ulp off, which the other tests allow for.
    let Some(mut opencl) = open(Backend::OpenCl) else { return };
    let is_gpu = photile::device::cl::devices(None).unwrap()[0].is_gpu;
    let mut cpu = open(Backend::Cpu).unwrap();
    for name in all_shipped() {
        let scene = shipped(&name);
        // Odd sizes leave lanes and work-groups half empty.
        for (width, height, samples) in [(81, 59, 1), (67, 51, 4), (31, 1, 5), (1, 1, 1)] {
            let settings = direct(width, height, samples);
            let (device, twin) = (render(&mut opencl, &scene, &settings), render(&mut cpu, &scene, &settings));
            let bits = |image: &Image| image.pixels.iter().map(|p| p.map(f32::to_bits)).collect::<Vec<_>>();
            let differ = bits(&device).iter().zip(bits(&twin)).filter(|(a, b)| *a != b).count();
            let bound = if is_gpu { device.pixels.len() } else { 0 };
            assert!(differ <= bound, "{name}, {width}x{height}, {samples} samples: {differ} pixels differ");
        }
    }
}

#[test]
fn odd_sizes_and_repeats_change_nothing() {
    // A pixel depends on its place in the image plane alone, and the same picture is the same bytes.
    let scene = shipped("gi_ref");
    for mut pipeline in backends() {
        let settings = direct(150, 50, 3);
        let first = render(&mut pipeline, &scene, &settings);
        render(&mut pipeline, &scene, &direct(7, 93, 3));
        let again = render(&mut pipeline, &scene, &settings);
        assert!(first == again, "{}", pipeline.backend.name());
    }
}
