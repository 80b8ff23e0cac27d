//! From which side rays meet objects: mostly known beforehand, asked only where it must be.

use glam::{DVec3, Vec3};
use photile::packing::Packed;
use photile::program::features::Features;
use photile::rays::random::{hash_u, hash2_u};
use photile::rays::scene::SceneTables;
use photile::rays::walk::{sample_cosine, sample_sphere};
use photile::scene::Scene;
use photile::settings::{Amount, Settings};
use photile::shapes::Sphere;

use super::one_at_a_time;
use crate::common::{backends, render, shipped};

fn two_sided(scene: &Scene) -> bool {
    Features::of(scene, &Settings::default()).two_sided
}

#[test]
fn sides_are_asked_only_where_a_ray_may_begin_behind_something() {
    for name in ["gi_ref", "gi_two_lights", "sphere_and_plane", "color_bleeding", "glossy", "box", "many_spheres"] {
        assert!(!two_sided(&shipped(name)), "{name}");
        let mut far = shipped(name);
        let by = DVec3::new(1e5, -1e5, 1e5);
        far.camera.position += by;
        far.camera.look_at += by;
        far.lights.points.iter_mut().for_each(|light| light.position += by);
        far.shapes.spheres.iter_mut().for_each(|sphere| sphere.center += by);
        far.shapes.planes.iter_mut().for_each(|plane| plane.offset += plane.normal.dot(by));
        assert!(!two_sided(&far), "{name}, far away");
    }
    let changed = |change: &dyn Fn(&mut Scene)| {
        let mut scene = shipped("gi_ref");
        change(&mut scene);
        two_sided(&scene)
    };
    let around =
        |scene: &mut Scene, center: DVec3| scene.shapes.spheres.push(Sphere { center, radius: 0.5, material: 0 });
    assert!(!changed(&|_| ()));
    assert!(changed(&|scene| scene.camera.position.z = 9.0), "camera outside the room");
    assert!(changed(&|scene| scene.camera.position.z = 1.5), "camera on a wall");
    assert!(changed(&|scene| scene.lights.points[0].position.y = 3.5), "light on the ceiling");
    assert!(changed(&|scene| scene.lights.points[0].position.y = 30.0), "light outside the room");
    assert!(changed(&|scene| around(scene, scene.camera.position)), "camera in a sphere");
    assert!(changed(&|scene| around(scene, scene.lights.points[0].position)), "light in a sphere");
    assert!(changed(&|scene| around(scene, scene.camera.position + DVec3::X * 0.5)), "camera on a sphere");
    assert!(!changed(&|scene| around(scene, DVec3::new(0.0, -2.0, -5.0))), "a sphere elsewhere");
    assert!(changed(&|scene| scene.lights.points.clear()), "no light to tell a side");
}

#[test]
fn both_codes_meet_the_same() {
    for name in ["gi_ref", "sphere_and_plane", "many_spheres"] {
        let scene = shipped(name);
        let packed = Packed::new(&scene, scene.camera.position);
        let front = Features::of(&scene, &Settings::default());
        let both = Features { two_sided: true, ..front };
        let [front, both] = [&front, &both].map(|features| SceneTables::new(&packed, features));
        let (mut origin, mut face) = (Vec3::from(packed.lights[0].position), None);
        let mut direction = sample_sphere(1, 2);
        let (mut hits, mut apart) = (0, 0);
        for ray in 0..100_000 {
            let number = |n| hash_u(hash2_u(ray, 3).wrapping_add(n));
            let found = [front, both].map(|scene| {
                let hit = scene.closest_hit(origin, direction, face)?;
                Some((hit.t, hit.shape, scene.surface_at(origin, direction, hit)))
            });
            match found {
                [Some((t, shape, surface)), Some((same_t, same_object, same))] => {
                    assert_eq!((t, shape, surface.normal), (same_t, same_object, same.normal), "{name}, ray {ray}");
                    // Beside an edge one of them moves the point, by eight ulps.
                    let size = origin.abs().element_sum() + t;
                    assert!(surface.position.distance(same.position) < 4e-6 * size, "{name}, ray {ray}");
                    apart += usize::from(surface.position != same.position);
                    hits += 1;
                    (origin, face) = (surface.position, Some(surface.face_left()));
                    direction = sample_cosine(surface.normal, number(1), number(2));
                }
                [None, None] => {
                    (origin, face) = (packed.lights[0].position.into(), None);
                    direction = sample_sphere(number(1), number(2));
                }
                _ => panic!("{name}, ray {ray}: {found:?}"),
            }
        }
        assert!(hits > 20_000 && apart < 20, "{name}: {hits} hits, {apart} apart");
    }
}

#[test]
fn a_map_does_not_know_where_the_camera_is() {
    one_at_a_time();
    let inside = shipped("gi_ref");
    let mut outside = inside.clone();
    outside.camera.position.z = 9.0;
    let mut settings = Settings { width: 16, height: 12, ..Settings::default() };
    settings.photons.amount = Amount::Paths(20_000);
    settings.gather.radius = Some(1.0);
    for mut pipeline in backends() {
        let [here, there] = [&inside, &outside].map(|scene| pipeline.render(scene, &settings).unwrap());
        assert_eq!(here.photons, there.photons);
        assert!(there.skipped.iter().any(|stage| format!("{stage:?}") == "Photons"), "{:?}", there.skipped);
        // Seen from outside the room's front wall is in the way, lit by nothing.
        let image = render(&mut pipeline, &outside, &settings);
        assert!(image.pixels.iter().all(|pixel| *pixel == [0.0; 3]), "{}", pipeline.backend.name());
    }
}

#[test]
fn directions_never_vanish_nor_point_into_the_surface() {
    // Opposite the pole and around: where the normal and the point of the sphere cancel.
    let normals = [Vec3::NEG_Y, Vec3::Y, Vec3::X, Vec3::new(0.48, -0.6, 0.64), Vec3::new(1e-4, -1.0, 0.0)];
    for normal in normals {
        for number in 0..200_000u32 {
            let ends = [number << 8, u32::MAX - (number << 4), hash_u(number)];
            for height in ends {
                let direction = sample_cosine(normal, height, hash_u(number ^ 0x5555));
                let cosine = direction.dot(normal);
                assert!((direction.length() - 1.0).abs() < 1e-6, "{normal} {height:#x}: {direction}");
                assert!(cosine > 0.0 && cosine < 1.000_001, "{normal} {height:#x}: cosine {cosine}");
            }
        }
    }
}
