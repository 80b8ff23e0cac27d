//! The estimator against closed forms, against itself by other strategies, and against a deliberately wrong weight.

use std::f64::consts::PI;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use glam::DVec3;

use super::agreement::{Agreement, Measured, compare};
use super::technique::Heuristic;
use super::*;
use crate::lights::{Lights, PointLight};
use crate::materials::Material;
use crate::scene::{Camera, RenderDefaults};
use crate::shapes::{Plane, Shapes, Sphere};

fn matte(color: DVec3) -> Material {
    Material {
        name: "matte".into(),
        color,
        diffuse: 1.0,
        specular: 0.0,
        roughness: 0.0,
        transmission: 0.0,
        ior: 1.5,
        ambient: 0.0,
    }
}

fn empty(position: DVec3, look_at: DVec3) -> Scene {
    Scene {
        name: "test".into(),
        camera: Camera { position, look_at, up: DVec3::Y, fov_y: 60.0 },
        materials: vec![],
        lights: Lights::default(),
        shapes: Shapes::default(),
        render: RenderDefaults::default(),
    }
}

fn settings(size: (u32, u32), spp: u64, seed: u64) -> ReferenceSettings {
    ReferenceSettings { size, spp: Some(spp), seed, ..ReferenceSettings::default() }
}

fn go(_: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn image(scene: &Scene, settings: &ReferenceSettings) -> Reference {
    render(scene, settings, &mut go).unwrap()
}

fn image_by(scene: &Scene, settings: &ReferenceSettings, technique: Technique) -> Reference {
    let sums = start(scene, settings).unwrap();
    Reference::new(accumulate(scene, settings, technique, sums, &mut go).unwrap()).unwrap()
}

fn judge(a: &Reference, b: &Reference) -> Agreement {
    compare(a.into(), b.into())
}

/// A small room with a light 0.2 m below its ceiling, a matte and a rough metallic sphere.
fn room() -> Scene {
    let mut scene = empty(DVec3::new(0.0, 0.0, 1.9), DVec3::ZERO);
    scene.materials = vec![
        matte(DVec3::new(0.7, 0.6, 0.5)),
        matte(DVec3::ONE),
        Material { diffuse: 0.3, specular: 0.6, roughness: 0.3, ..matte(DVec3::new(0.9, 0.5, 0.1)) },
    ];
    for (axis, reach) in [(DVec3::X, 2.0), (DVec3::Y, 1.5), (DVec3::Z, 2.0)] {
        for offset in [-reach, reach] {
            scene.shapes.planes.push(Plane { normal: axis, offset, material: 0 });
        }
    }
    scene.shapes.spheres = vec![
        Sphere { center: DVec3::new(0.8, -1.0, -0.8), radius: 0.5, material: 1 },
        Sphere { center: DVec3::new(-0.7, -0.6, -0.6), radius: 0.6, material: 2 },
    ];
    scene.lights.points = vec![
        PointLight { position: DVec3::new(0.3, 1.3, -0.5), intensity: DVec3::new(5.0, 6.0, 7.0) },
        PointLight { position: DVec3::new(-1.7, -0.2, 0.5), intensity: DVec3::new(2.0, 1.0, 0.5) },
    ];
    scene
}

/// The same with the metallic sphere matte, so that anchors serve.
fn matte_room() -> Scene {
    let mut scene = room();
    scene.shapes.spheres[1].material = 1;
    scene.materials.truncate(2);
    scene
}

/// Looking straight down on a plane: L = c/π · I·h/r³ at every pixel, and nothing else as nothing reflects twice.
#[test]
fn a_plane_under_a_light_has_its_closed_form() {
    let mut scene = empty(DVec3::new(0.0, 3.0, 0.0), DVec3::ZERO);
    scene.camera.up = DVec3::NEG_Z;
    let color = DVec3::new(0.8, 0.4, 0.2);
    scene.materials = vec![Material { ambient: 0.25, ..matte(color) }];
    scene.shapes.planes = vec![Plane { normal: DVec3::Y, offset: 0.0, material: 0 }];
    scene.lights.points = vec![PointLight { position: DVec3::new(1.0, 2.0, 0.0), intensity: DVec3::splat(10.0) }];
    let size = (33, 21);
    let full = image(&scene, &settings(size, 256, 0));
    let direct = image(&scene, &ReferenceSettings { light: ReferenceLight::Direct, ..settings(size, 256, 0) });
    let scale = 3.0 * (30f64.to_radians()).tan() * 2.0 / f64::from(size.1);
    for row in 0..size.1 {
        for column in 0..size.0 {
            // Midpoint rule over the pixel's box; up is −z, so that rows go towards +z.
            let mut expected = DVec3::ZERO;
            for k in 0..64 {
                let (du, dv) = ((f64::from(k % 8) + 0.5) / 8.0, (f64::from(k / 8) + 0.5) / 8.0);
                let x = (f64::from(column) + du - f64::from(size.0) / 2.0) * scale;
                let z = (f64::from(row) + dv - f64::from(size.1) / 2.0) * scale;
                let r2 = (x - 1.0).powi(2) + 4.0 + z * z;
                expected += color * (0.25 + 10.0 * 2.0 / (PI * r2.powf(1.5))) / 64.0;
            }
            let index = (row * size.0 + column) as usize;
            for seen in [full.mean[index], direct.mean[index]] {
                // 256 stratified samples of a smooth pixel: a few 1e-5; the wrong half of a pixel would be 5e-2.
                assert!((seen - expected).abs().max_element() < 3e-4 * expected.x, "{column},{row}: {seen} {expected}");
            }
        }
    }
}

/// Inside a matte sphere all interreflected light is uniform: E = ρ/(1−ρ)·Φ/4πR², wherever the light is.
#[test]
fn a_furnace_has_its_closed_form() {
    let (radius, albedo) = (2.0, DVec3::new(0.9, 0.5, 0.1));
    let mut scene = empty(DVec3::new(0.0, 0.3, 1.0), DVec3::ZERO);
    scene.materials = vec![matte(albedo)];
    scene.shapes.spheres = vec![Sphere { center: DVec3::ZERO, radius, material: 0 }];
    let intensity = 7.0;
    // In the middle, and a tenth of the radius from the wall, where next-event estimation alone spikes.
    for at in [DVec3::ZERO, DVec3::new(-1.8, 0.0, 0.0)] {
        scene.lights.points = vec![PointLight { position: at, intensity: DVec3::splat(intensity) }];
        let size = (12, 8);
        let full = image(&scene, &settings(size, 1024, 3));
        let direct = image(&scene, &ReferenceSettings { light: ReferenceLight::Direct, ..settings(size, 1024, 4) });
        let reflected = DVec3::splat(intensity / (radius * radius)) * albedo / (DVec3::ONE - albedo);
        let exact: Vec<_> = direct.mean.iter().map(|d| d + albedo / PI * reflected).collect();
        let agreement = compare((&full).into(), Measured { values: &exact, ..(&direct).into() });
        // Only the means: roulette alone makes noise in so even a light, and rarely, so that errors are far from normal.
        assert!(agreement.means_hold(), "light at {at}: {agreement:?}");
        assert!(full.relative_noise() < 0.02, "light at {at}: {}", full.relative_noise());
        if at == DVec3::ZERO {
            let on_the_wall = albedo / PI * intensity / (radius * radius);
            assert!(direct.mean.iter().all(|d| (*d - on_the_wall).abs().max_element() < 1e-9));
        }
        // 1% too much light must be noticed.
        let brighter: Vec<_> = exact.iter().map(|e| e * 1.01).collect();
        let wrong = compare((&full).into(), Measured { values: &brighter, ..(&direct).into() });
        assert!(!wrong.means_hold(), "{wrong:?}");
    }
}

/// Next-event estimation alone, light paths alone, their combinations and anchors are ways to one image.
#[test]
fn strategies_agree_and_a_wrong_weight_does_not() {
    let size = (16, 12);
    let walked = Technique { anchors: 0, ..TECHNIQUE };
    let variants = [
        ("next event", Technique { light_vertices: 1, ..walked }),
        ("light paths", Technique { heuristic: Heuristic::LightPathsOnly, ..walked }),
        ("balance", Technique { heuristic: Heuristic::Balance, ..walked }),
        ("longer light paths", Technique { light_vertices: 4, light_paths: 1, ..walked }),
        ("early roulette", Technique { roulette_from: 1, light_paths: 3, ..walked }),
    ];
    let glossy = room();
    let judged = image_by(&glossy, &settings(size, 512, 1), walked);
    for (name, technique) in variants {
        let other = image_by(&glossy, &settings(size, 256, 2), technique);
        let agreement = judge(&judged, &other);
        // Only the means: strategies alone have spikes, so that eight replicates are far from normal.
        assert!(agreement.means_hold(), "{name}: {agreement:?}");
        assert!(other.relative_noise() < 0.5 && other.relative_noise() > 0.0, "{name}: {}", other.relative_noise());
    }
    let wrong = Technique { heuristic: Heuristic::Unweighted, ..walked };
    let agreement = judge(&judged, &image_by(&glossy, &settings(size, 256, 2), wrong));
    assert!(!agreement.holds(), "paths counted twice must be noticed: {agreement:?}");
}

/// Anchors change neither the image, however few they are, nor the honesty of its error.
#[test]
fn anchors_are_unbiased() {
    let (scene, size) = (matte_room(), (24, 18));
    let walked = image_by(&scene, &settings(size, 512, 1), Technique { anchors: 0, ..TECHNIQUE });
    for (anchors, difference_rate) in [(TECHNIQUE.anchors, TECHNIQUE.difference_rate), (12, 0.2)] {
        let other = image_by(&scene, &settings(size, 256, 2), Technique { anchors, difference_rate, ..TECHNIQUE });
        let agreement = judge(&walked, &other);
        assert!(agreement.holds(), "{anchors}: {agreement:?}");
    }
    let never = Technique { difference_rate: 1e-9, ..TECHNIQUE };
    let agreement = judge(&walked, &image_by(&scene, &settings(size, 256, 2), never));
    assert!(!agreement.holds(), "leaving the differences out must be noticed: {agreement:?}");
}

/// The stated error is the true one: against a longer run, 90% of values lie within Student's bound.
#[test]
fn standard_errors_cover_the_truth() {
    let (scene, size) = (matte_room(), (24, 18));
    let short = image(&scene, &settings(size, 128, 5));
    let long = image(&scene, &settings(size, 512, 6));
    let covered = |scale: f64| {
        let mut inside = 0;
        for i in 0..short.mean.len() {
            for c in 0..3 {
                let bound = 1.895 * scale * short.standard_error[i][c].hypot(long.standard_error[i][c]);
                inside += u32::from((short.mean[i][c] - long.mean[i][c]).abs() < bound);
            }
        }
        f64::from(inside) / (3 * short.mean.len()) as f64
    };
    // 432 pixels scatter by 1 to 2%; skewed estimates cost a little coverage.
    assert!((0.84..0.96).contains(&covered(1.0)), "{}", covered(1.0));
    assert!(covered(0.5) < 0.84, "halved errors must be noticed: {}", covered(0.5));
}

/// Stopped, saved, loaded and continued on another number of threads: the same bytes.
#[test]
fn a_resumed_image_is_the_uninterrupted_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sums");
    let (scene, settings) = (matte_room(), settings((40, 30), 24, 9));
    let whole = image(&scene, &settings);
    let mut passes = 0;
    let stopped = render(&scene, &settings, &mut |progress| {
        passes += 1;
        if passes < 11 {
            return ControlFlow::Continue(());
        }
        progress.accumulator.save(&path).unwrap();
        ControlFlow::Break(())
    });
    assert_eq!(stopped.unwrap().accumulator.passes(), 11);
    let one = ReferenceSettings { threads: NonZeroUsize::new(1), ..settings.clone() };
    let resumed = resume(&scene, &one, Accumulator::load(&path).unwrap(), &mut go).unwrap();
    assert_eq!(resumed.accumulator, whole.accumulator);

    let (a, b) = (folder.path().join("a.exr"), folder.path().join("b.exr"));
    let made_by = [("seed".to_string(), "9".to_string())];
    whole.write_exr(&a, &made_by).unwrap();
    resumed.write_exr(&b, &made_by).unwrap();
    assert_eq!(std::fs::read(&a).unwrap(), std::fs::read(&b).unwrap());
    let read = crate::film::load_exr(&a).unwrap();
    assert_eq!(read.settings, made_by);
    let names: Vec<_> = read.channels.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["stderr.B", "stderr.G", "stderr.R"]);
    for (i, (mean, error)) in whole.mean.iter().zip(&whole.standard_error).enumerate() {
        assert_eq!(read.image.pixels[i], mean.as_vec3().to_array());
        assert_eq!([2, 1, 0].map(|c: usize| read.channels[c].samples[i]), error.as_vec3().to_array());
    }

    // Sums of another scene or seed are refused.
    let mut moved = scene.clone();
    moved.lights.points[0].position.x += 1e-9;
    let sums = || Accumulator::load(&path).unwrap();
    assert_eq!(resume(&moved, &settings, sums(), &mut go).unwrap_err().exit_code(), 2);
    let reseeded = ReferenceSettings { seed: 10, ..settings.clone() };
    assert!(resume(&scene, &reseeded, sums(), &mut go).is_err());
}

#[test]
fn what_cannot_be_rendered_is_refused_and_darkness_is_black() {
    let mut scene = room();
    let refused =
        |scene: &Scene, settings: &ReferenceSettings| render(scene, settings, &mut go).unwrap_err().exit_code();
    assert_eq!(refused(&scene, &settings((0, 4), 8, 0)), 2);
    assert_eq!(refused(&scene, &settings((4, 4), 0, 0)), 2);
    assert_eq!(refused(&scene, &ReferenceSettings { spp: None, ..settings((4, 4), 8, 0) }), 2);
    let early = render(&scene, &settings((4, 4), 8, 0), &mut |_| ControlFlow::Break(()));
    assert_eq!(early.unwrap_err().exit_code(), 1);
    scene.materials[2].roughness = 0.0;
    assert_eq!(refused(&scene, &settings((4, 4), 8, 0)), 2);
    let direct = ReferenceSettings { light: ReferenceLight::Direct, ..settings((16, 12), 16, 0) };
    assert!(image(&scene, &direct).mean.iter().all(|m| m.is_finite()));

    scene = room();
    scene.lights.points.clear();
    let dark = image(&scene, &settings((8, 6), 8, 0));
    assert!(dark.mean.iter().chain(&dark.standard_error).all(|v| *v == DVec3::ZERO) && dark.relative_noise() == 0.0);
    scene.shapes.planes.clear();
    scene.shapes.spheres.clear();
    assert!(image(&scene, &settings((8, 6), 8, 0)).mean.iter().all(|v| *v == DVec3::ZERO));
}
