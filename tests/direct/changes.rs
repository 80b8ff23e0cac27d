//! What is redone after a change, and that the picture follows it.

use glam::DVec3;
use photile::pipeline::change::Stage::{self, Compile, Grid, Photons, Textures, Tiles, Trace, Upload};
use photile::program::features::Features;
use photile::scene::Scene;
use photile::settings::{Amount, Backend, FinalGather, Gather, LightMode, Method, Pass, Settings, Technique};
use photile::shapes::Sphere;

use crate::common::{backends, direct, open, scene, shipped};

/// A change to scene, settings or pass, and the stages that it leaves alone.
type Case = (&'static str, fn(&mut Scene, &mut Settings, &mut Pass), &'static [Stage]);

const CASES: &[Case] = &[
    ("nothing", |_, _, _| {}, &[Compile, Upload, Trace]),
    ("camera", |scene, _, _| scene.camera.position.x += 0.5, &[Compile, Upload]),
    ("field of view", |scene, _, _| scene.camera.fov_y = 40.0, &[Compile, Upload]),
    ("size", |_, settings, _| settings.width = 90, &[Compile, Upload]),
    ("seed", |_, _, pass| pass.seed = 7, &[Compile, Upload]),
    ("first sample", |_, _, pass| pass.first_sample = 3, &[Compile, Upload]),
    ("light's place", |scene, _, _| scene.lights.points[0].position.y -= 0.5, &[Compile]),
    ("light's intensity", |scene, _, _| scene.lights.points[0].intensity.x *= 2.0, &[Compile]),
    ("material's colour", |scene, _, _| scene.materials[0].color.x *= 0.5, &[Compile]),
    ("sphere", |scene, _, _| scene.shapes.spheres[0].center.x += 0.3, &[Compile]),
    ("plane", |scene, _, _| scene.shapes.planes[0].offset += 0.3, &[Compile]),
    ("other material", |scene, _, _| scene.shapes.planes[0].material = 1, &[Compile]),
    ("samples", |_, settings, _| settings.samples = 1, &[Upload]),
    ("second light", |scene, _, _| scene.lights.points.push(scene.lights.points[0].clone()), &[]),
    ("ambient", |scene, _, _| scene.materials[0].ambient = 0.1, &[]),
    (
        "third sphere",
        |scene, _, _| {
            scene.shapes.spheres.push(Sphere { center: DVec3::new(-0.5, 0.5, -8.0), ..scene.shapes.spheres[0] })
        },
        &[],
    ),
    ("no spheres", |scene, _, _| scene.shapes.spheres.clear(), &[]),
    ("no lights", |scene, _, _| scene.lights.points.clear(), &[]),
];

#[test]
fn only_what_changed_is_redone_and_the_picture_is_that_of_a_fresh_start() {
    let (scene, settings) = (shipped("gi_ref"), direct(64, 48, 2));
    for mut pipeline in backends() {
        let mut fresh = open(pipeline.backend).unwrap();
        let first = pipeline.render(&scene, &settings).unwrap();
        assert_eq!(first.skipped, [Photons, Grid, Tiles, Textures]);
        for (what, change, skipped) in CASES {
            let what = format!("{}, {what}", pipeline.backend.name());
            pipeline.render(&scene, &settings).unwrap();
            let (mut changed, mut changed_settings) = (scene.clone(), settings.clone());
            let mut pass = Pass::single(&settings);
            change(&mut changed, &mut changed_settings, &mut pass);
            let found = pipeline.render_pass(&changed, &changed_settings, &pass).unwrap();
            // With direct light only, there is never a photon map.
            let of_photons = |stage: &Stage| [Photons, Grid, Tiles, Textures].contains(stage);
            assert!(found.skipped.iter().filter(|stage| of_photons(stage)).count() == 4, "{what}");
            let others: Vec<Stage> = found.skipped.into_iter().filter(|stage| !of_photons(stage)).collect();
            assert_eq!(others, *skipped, "{what}");
            for (stage, time) in [(Upload, found.times.upload), (Trace, found.times.trace)] {
                assert_eq!(time == 0.0, skipped.contains(&stage), "{what}: {stage:?} took {time} ms");
            }
            if !skipped.contains(&Trace) {
                assert!(found.image != first.image, "{what}: the picture is the old one");
            }
            // As on a backend that never saw the scene before the change, but for the origin that a moved camera keeps.
            let expected = fresh.render_pass(&changed, &changed_settings, &pass).unwrap().image;
            let apart = expected.pixels.iter().zip(&found.image.pixels);
            let apart = apart.filter(|(a, b)| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-4 * a[c] + 1e-5)).count();
            assert!(apart <= 3, "{what}: {apart} pixels are not those of a fresh start");
        }
    }
}

/// What only pictures of photons show.
const OF_PHOTONS: &[Case] = &[
    ("number of photons", |_, settings, _| settings.photons.amount = Amount::Paths(1500), &[Compile, Upload]),
    ("pass", |_, _, pass| pass.index = 5, &[Compile, Upload]),
];

#[test]
fn pictures_of_photons_follow_every_change_to_the_byte() {
    let (scene, other) = (shipped("gi_ref"), shipped("sphere_and_plane"));
    let direct = direct(24, 18, 2);
    let photons = photile::settings::Photons { amount: Amount::Paths(1000), ..direct.photons };
    let map = |method| {
        // A chosen radius stands as long as its map does, from wherever that is seen.
        let gather = Gather { method, radius: Some(0.8), ..direct.gather };
        Settings { light: LightMode::Hybrid, photons, gather, ..direct.clone() }
    };
    let rays = FinalGather { rays: 4, own_rays: 2, points: 4, texels: 2000, ..FinalGather::default() };
    let final_gather = Settings { technique: Technique::FinalGather(rays), ..map(Method::Grid) };
    for backend in [Backend::Cpu, Backend::OpenCl] {
        let (Some(mut pipeline), Some(mut fresh)) = (open(backend), open(backend)) else { continue };
        for settings in [map(Method::Grid), map(Method::Tiles), final_gather.clone()] {
            for (what, change, skipped) in CASES.iter().chain(OF_PHOTONS) {
                // Kernels of PoCL take seconds to build: one backend is enough for what needs other programs.
                if backend == Backend::OpenCl && !skipped.contains(&Compile) {
                    continue;
                }
                let what = format!("{}, {:?}, {what}", backend.name(), settings.technique);
                let first = pipeline.render(&scene, &settings).unwrap().image;
                let (mut changed, mut changed_settings) = (scene.clone(), settings.clone());
                let mut pass = Pass::single(&settings);
                change(&mut changed, &mut changed_settings, &mut pass);
                let found = pipeline.render_pass(&changed, &changed_settings, &pass).unwrap().image;
                assert_eq!(found == first, what.ends_with("nothing"), "{what}: the picture is the old one");
                // All that this one holds is another scene's.
                fresh.render(&other, &settings).unwrap();
                let expected = fresh.render_pass(&changed, &changed_settings, &pass).unwrap().image;
                // A moved camera keeps the origin where it was.
                assert!(found == expected || changed.camera != scene.camera, "{what}: not the bytes of a fresh start");
            }
        }
        // From one technique to the next nothing stays behind.
        let kinds = [map(Method::Grid), direct.clone(), final_gather.clone(), map(Method::Tiles), final_gather.clone()];
        for settings in kinds.iter().chain(&kinds) {
            let found = pipeline.render(&scene, settings).unwrap().image;
            fresh.render(&other, settings).unwrap();
            assert!(found == fresh.render(&scene, settings).unwrap().image, "{settings:?}");
        }
    }
}

#[test]
fn several_pipelines_of_a_thread_keep_to_themselves() {
    let (room, open_scene, settings) = (shipped("gi_ref"), shipped("furnace"), direct(64, 48, 1));
    assert_ne!(Features::of(&room, &settings), Features::of(&open_scene, &settings));
    let mut first = backends();
    let room_images: Vec<_> = first.iter_mut().map(|p| p.render(&room, &settings).unwrap().image).collect();
    let mut second = backends();
    let open_images: Vec<_> = second.iter_mut().map(|p| p.render(&open_scene, &settings).unwrap().image).collect();
    // The first ones still hold their scene although others have been made current since.
    for (pipeline, image) in first.iter_mut().zip(&room_images) {
        assert!(pipeline.render(&room, &settings).unwrap().image == *image, "{}", pipeline.backend.name());
        pipeline.retrace(&room, &settings, &Pass::single(&settings)).unwrap();
        assert!(pipeline.render(&room, &settings).unwrap().image == *image, "{}", pipeline.backend.name());
    }
    // And the second ones theirs, when the first are gone.
    drop(first);
    for (pipeline, image) in second.iter_mut().zip(&open_images) {
        assert!(pipeline.render(&open_scene, &settings).unwrap().image == *image, "{}", pipeline.backend.name());
        let larger = direct(70, 50, 1);
        assert!(pipeline.render(&open_scene, &larger).unwrap().image.pixels.iter().any(|p| p[2] > 0.0));
    }
}

#[test]
fn a_refused_picture_leaves_the_pipeline_usable() {
    // A target larger than any GL driver's limit; the others would only need the memory, so they are not asked.
    let (scene, settings) = (shipped("gi_ref"), direct(64, 48, 1));
    let Some(mut pipeline) = open(Backend::OpenGl) else { return };
    let image = pipeline.render(&scene, &settings).unwrap().image;
    let refused = pipeline.render(&scene, &direct(1 << 20, 1, 1)).err().expect("a million columns").to_string();
    assert!(refused.contains("1048576 × 1") && refused.contains("limit"), "{refused}");
    assert!(pipeline.render(&scene, &settings).unwrap().image == image);
}

#[test]
fn a_camera_that_crosses_a_wall_sees_no_photons_through_it() {
    // Photons carry all light; the wall's far side has none, though the map's discs reach through the wall.
    let camera = |y: f64| {
        format!(
            "[camera]\nposition = [0, {y}, 3]\nlook_at = [0, 0, 0]\n[materials.m]\ncolor = [0.8, 0.8, 0.8]\n\
             [[lights]]\nposition = [0, 1.5, 0]\nintensity = [3, 3, 3]\n\
             [[planes]]\nnormal = [0, 1, 0]\noffset = 0\nmaterial = \"m\"\n\
             [[planes]]\nnormal = [1, 0, 0]\noffset = -1\nmaterial = \"m\"\n"
        )
    };
    let amount = Amount::Paths(5_000);
    let photons = photile::settings::Photons { amount, ..Settings::default().photons };
    let settings = Settings { light: LightMode::Photons, photons, ..direct(64, 48, 1) };
    for mut pipeline in backends() {
        let lit = pipeline.render(&scene(&camera(2.0)), &settings).unwrap().image;
        assert!(lit.pixels.iter().filter(|pixel| pixel[0] > 0.0).count() > 1000);
        let dark = pipeline.render(&scene(&camera(-2.0)), &settings).unwrap();
        assert!(dark.skipped.contains(&Photons), "the camera moves no light");
        let leaks = dark.image.pixels.iter().filter(|pixel| pixel[0] > 0.0).count();
        assert_eq!(leaks, 0, "{}: light comes through the wall", pipeline.backend.name());
    }
}
