//! Two rooms in which a float32 renderer of note goes wrong, against the reference renderer's double precision.

use std::ops::ControlFlow;

use glam::DVec3;
use photile::film::Image;
use photile::film::metrics::{self, Within, edge_pixels, measure_except};
use photile::reference::{self, ReferenceLight, ReferenceSettings};
use photile::scene::Scene;

use super::one_at_a_time;
use crate::common::{backends, direct, render, scene};

const SIZE: (u32, u32) = (80, 60);

fn double_precision(scene: &Scene) -> Image {
    let settings =
        ReferenceSettings { size: SIZE, light: ReferenceLight::Direct, spp: Some(64), ..ReferenceSettings::default() };
    let done = reference::render(scene, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
    Image::from_fn(SIZE.0, SIZE.1, |x, y| done.mean[(y * SIZE.0 + x) as usize].as_vec3().to_array())
}

/// relMSE away from edges.
fn rel_mse(image: &Image, reference: &Image) -> f64 {
    let edges = edge_pixels(reference, &Within { abs: 0.02, rel: 0.2 });
    let kept = edges.iter().filter(|edge| !**edge).count();
    assert!(kept > edges.len() / 2, "{kept} pixels are left");
    measure_except(image, reference, &edges, &metrics::Settings::default()).unwrap().rel_mse
}

/// Spheres that touch the floor and each other, at coordinates around 2,000.
fn contact_shadows() -> Scene {
    scene(
        "[camera]\nposition = [2000, 2001.5, 2004]\nlook_at = [2000, 2000.3, 2000]\nfov_y = 50\n\
         [materials.white]\ncolor = [0.8, 0.8, 0.8]\n\
         [[lights]]\nposition = [2001.5, 2003.5, 2001]\nintensity = [20, 20, 20]\n\
         [[planes]]\nnormal = [0, 1, 0]\noffset = 2000\nmaterial = \"white\"\n\
         [[planes]]\nnormal = [0, 0, 1]\noffset = 1997\nmaterial = \"white\"\n\
         [[spheres]]\ncenter = [1999.5, 2000.5, 2000]\nradius = 0.5\nmaterial = \"white\"\n\
         [[spheres]]\ncenter = [2000.4, 2000.4, 2000]\nradius = 0.4\nmaterial = \"white\"\n\
         [[spheres]]\ncenter = [2000, 2000.05, 2001]\nradius = 0.05\nmaterial = \"white\"\n",
    )
}

/// A room of 10 m whose walls are spheres of radius 10⁵ m.
fn sphere_walls() -> Scene {
    let mut text = String::from(
        "[camera]\nposition = [0, 0, 4.5]\nlook_at = [0, 0, 0]\nfov_y = 60\n\
         [materials.white]\ncolor = [0.8, 0.8, 0.8]\n[materials.red]\ncolor = [0.8, 0.2, 0.2]\n\
         [[lights]]\nposition = [1, 3, 1]\nintensity = [30, 30, 30]\n\
         [[spheres]]\ncenter = [-1, -4, -1]\nradius = 1\nmaterial = \"white\"\n",
    );
    for (center, material) in [
        ("-100005, 0, 0", "red"),
        ("100005, 0, 0", "white"),
        ("0, -100005, 0", "white"),
        ("0, 100005, 0", "white"),
        ("0, 0, -100005", "white"),
        ("0, 0, 100005", "white"),
    ] {
        text += &format!("[[spheres]]\ncenter = [{center}]\nradius = 1e5\nmaterial = \"{material}\"\n");
    }
    scene(&text)
}

/// The reference's own noise away from edges, with 64 samples of curved radiance a pixel.
const SAMPLING: f64 = 2e-6;
/// Walls of radius 10⁵ are known to an ulp of 8 mm, a five hundredth of the way to the light: squared.
const WALLS: f64 = 2e-5;

#[test]
fn contact_shadows_far_from_the_origin_are_those_of_double_precision() {
    one_at_a_time();
    let scene = contact_shadows();
    let reference = double_precision(&scene);
    for mut pipeline in backends() {
        let error = rel_mse(&render(&mut pipeline, &scene, &direct(SIZE.0, SIZE.1, 64)), &reference);
        eprintln!("{}: relMSE {error:e}", pipeline.backend.name());
        assert!(error < SAMPLING, "{}: relMSE {error:e}", pipeline.backend.name());
        // As a renderer sees it that keeps float32 coordinates with an epsilon of a centimetre: without the contact.
        let mut lifted = scene.clone();
        lifted.shapes.spheres.iter_mut().for_each(|sphere| sphere.center.y += 0.01);
        let wrong = rel_mse(&render(&mut pipeline, &lifted, &direct(SIZE.0, SIZE.1, 64)), &reference);
        assert!(wrong > SAMPLING, "a centimetre must show: {wrong:e}");
    }
}

#[test]
fn rooms_walled_by_huge_spheres_are_those_of_double_precision() {
    one_at_a_time();
    let scene = sphere_walls();
    let reference = double_precision(&scene);
    for mut pipeline in backends() {
        let image = render(&mut pipeline, &scene, &direct(SIZE.0, SIZE.1, 64));
        let error = rel_mse(&image, &reference);
        let mean = |image: &Image| image.pixels.iter().map(|p| f64::from(p[1])).sum::<f64>();
        let ratio = mean(&image) / mean(&reference);
        eprintln!("{}: relMSE {error:e}, brightness {ratio}", pipeline.backend.name());
        assert!(error < WALLS, "{}: relMSE {error:e}", pipeline.backend.name());
        assert!((ratio - 1.0).abs() < 2e-3, "{}: {ratio} times as bright", pipeline.backend.name());
        let mut moved = scene.clone();
        moved.lights.points[0].position += DVec3::splat(0.1);
        assert!(rel_mse(&render(&mut pipeline, &moved, &direct(SIZE.0, SIZE.1, 64)), &reference) > WALLS);
    }
}
