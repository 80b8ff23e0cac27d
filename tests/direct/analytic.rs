//! Radiance against formulas in double precision.

use std::f64::consts::PI;

use glam::{DVec3, dvec3};
use photile::lights::PointLight;
use photile::materials::Material;
use photile::scene::Scene;
use photile::settings::Settings;
use photile::shapes::{Plane, Sphere};

use crate::common::{Pinhole, backends, direct, pixels, render, scene, to_plane, to_sphere};

/// Where a ray meets the scene: the point, the normal on the ray's side, the material.
fn first_hit(scene: &Scene, origin: DVec3, direction: DVec3) -> Option<(DVec3, DVec3, &Material)> {
    let sphere = |s: &Sphere| {
        let point = origin + direction * to_sphere(origin, direction, s.center, s.radius)?;
        Some((point, (point - s.center) / s.radius, &scene.materials[s.material]))
    };
    let plane = |p: &Plane| {
        let point = origin + direction * to_plane(origin, direction, p.normal, p.offset)?;
        Some((point, p.normal, &scene.materials[p.material]))
    };
    let hits = scene.shapes.spheres.iter().filter_map(sphere).chain(scene.shapes.planes.iter().filter_map(plane));
    let (point, normal, material) = hits.min_by(|a, b| a.0.distance(origin).total_cmp(&b.0.distance(origin)))?;
    Some((point, -normal * normal.dot(direction).signum(), material))
}

/// GGX with separable Smith G and Fresnel 1, as Walter et al. (EGSR 2007) write it: angles and tangents.
fn ggx(normal: DVec3, to_viewer: DVec3, to_light: DVec3, alpha: f64) -> f64 {
    let half_way = (to_viewer + to_light).normalize();
    let tangent = |v: DVec3| v.cross(normal).length() / v.dot(normal);
    let d = alpha.powi(2) / (PI * half_way.dot(normal).powi(4) * (alpha.powi(2) + tangent(half_way).powi(2)).powi(2));
    let g1 = |v: DVec3| 2.0 / (1.0 + (1.0 + (alpha * tangent(v)).powi(2)).sqrt());
    d * g1(to_viewer) * g1(to_light) / (4.0 * to_viewer.dot(normal) * to_light.dot(normal))
}

/// What a point light adds; no shadows but a surface's own.
fn reflected(point: DVec3, normal: DVec3, to_viewer: DVec3, material: &Material, light: &PointLight) -> DVec3 {
    let towards = light.position - point;
    let to_light = towards.normalize();
    let cos_i = normal.dot(to_light);
    if cos_i <= 0.0 {
        return DVec3::ZERO;
    }
    let mut bsdf = material.color * (material.diffuse / PI);
    if material.specular > 0.0 {
        bsdf += material.specular * ggx(normal, to_viewer, to_light, material.roughness);
    }
    bsdf * light.intensity * cos_i / towards.length_squared()
}

/// Radiance of a scene in which nothing shadows anything else.
fn expected(scene: &Scene, origin: DVec3, direction: DVec3) -> DVec3 {
    let Some((point, normal, material)) = first_hit(scene, origin, direction) else { return DVec3::ZERO };
    let lights = scene.lights.points.iter().map(|light| reflected(point, normal, -direction, material, light));
    lights.sum::<DVec3>() + material.color * material.ambient
}

/// Largest error over all pixels, relative to the expected value plus `dark`.
fn worst(scene: &Scene, settings: &Settings, image: &photile::film::Image, dark: f64) -> f64 {
    let camera = Pinhole::new(&scene.camera, settings);
    let error = |(x, y)| {
        let expected = expected(scene, camera.position, camera.through(x, y)).to_array();
        let found = image.at(x, y).map(f64::from);
        (0..3).map(|c| (found[c] - expected[c]).abs() / (expected[c] + dark)).fold(0.0, f64::max)
    };
    pixels(image).map(error).fold(0.0, f64::max)
}

/// Renders on every backend and demands every pixel to be within `tolerance` of the formula.
#[track_caller]
fn follows_the_formula(text: &str, dark: f64, tolerance: f64) {
    let scene = scene(text);
    let settings = direct(160, 120, 1);
    for mut pipeline in backends() {
        let image = render(&mut pipeline, &scene, &settings);
        let lit = image.pixels.iter().filter(|pixel| pixel[0] > 0.0).count();
        assert!(lit > 2000, "{}: {lit} pixels are lit", pipeline.backend.name());
        let worst = worst(&scene, &settings, &image, dark);
        assert!(worst <= tolerance, "{}: {worst:e}, bound {tolerance:e}", pipeline.backend.name());
    }
}

const CAMERA: &str = "[camera]\nposition = [2, 3, 5]\nlook_at = [0.5, 0, -0.3]\nup = [0.1, 1, 0]\nfov_y = 50\n";

fn plane(material: &str) -> String {
    format!(
        "{CAMERA}[materials.m]\n{material}\n[[lights]]\nposition = [-0.4, 2, 1]\nintensity = [30, 20, 10]\n\
         [[planes]]\nnormal = [0.2, 1, -0.1]\noffset = -0.6\nmaterial = \"m\"\n"
    )
}

// 2e-5: a primary ray's direction is off by 1e-7 of the distance, and the plane is seen and lit at grazing angles
// down to 0.05 in the image's corners, where that moves the point by twenty times as much.
const PLANE: f64 = 2e-5;

#[test]
fn a_plane_under_a_point_light() {
    follows_the_formula(&plane("color = [0.9, 0.5, 0.25]\ndiffuse = 0.8"), 1e-3, PLANE);
}

#[test]
fn the_formula_tells_a_wrong_light_apart() {
    let right = scene(&plane("color = [0.9, 0.5, 0.25]\ndiffuse = 0.8"));
    let settings = direct(160, 120, 1);
    for mut pipeline in backends() {
        for wrong in 0..3 {
            let mut other = right.clone();
            match wrong {
                0 => other.lights.points[0].position.x += 1e-4,
                1 => other.materials[0].diffuse *= 1.0001,
                _ => other.shapes.planes[0].offset += 1e-4,
            }
            let image = render(&mut pipeline, &other, &settings);
            assert!(worst(&right, &settings, &image, 1e-3) > PLANE, "{}: {wrong}", pipeline.backend.name());
        }
    }
}

#[test]
fn ggx_highlights_on_a_plane() {
    // 1e-3 at the narrowest lobe: D falls with (θ/α)⁴, so an error of 2e-6 in a direction is 1e-4 of the slope at
    // α = 0.02 and less for all broader ones.
    for (alpha, tolerance) in [(0.02, 1e-3), (0.1, 2e-4), (0.4, 1e-4), (1.0, 1e-4)] {
        let material = format!("color = [0.9, 0.5, 0.25]\ndiffuse = 0.3\nspecular = 0.6\nroughness = {alpha}");
        follows_the_formula(&plane(&material), 1e-3, tolerance);
    }
}

#[test]
fn a_sphere_from_outside_diffuse_and_glossy() {
    for material in ["color = [0.9, 0.5, 0.25]", "color = [1, 1, 1]\ndiffuse = 0\nspecular = 1\nroughness = 0.3"] {
        let text = format!(
            "{CAMERA}[materials.m]\n{material}\n[[lights]]\nposition = [3, 4, 2]\nintensity = [30, 20, 10]\n\
             [[spheres]]\ncenter = [0.5, 0, -0.3]\nradius = 1.7\nmaterial = \"m\"\n"
        );
        // Relative to the lobe's peak (dark = 1): at the limb and at the terminator a hit point moves by the root of
        // its ray's error, √1e-7 of the radius, and the cosines there start from 0.
        follows_the_formula(&text, 1.0, 2e-3);
    }
}

#[test]
fn a_sphere_from_inside() {
    let text = "[camera]\nposition = [0.3, 0.2, 0.5]\nlook_at = [-0.2, 0.1, -1]\nfov_y = 110\n\
                [materials.m]\ncolor = [0.9, 0.5, 0.25]\n[[lights]]\nposition = [-0.3, 0.6, -0.2]\nintensity = [3, 2, 1]\n\
                [[spheres]]\ncenter = [0.1, 0, -0.1]\nradius = 1.3\nmaterial = \"m\"\n";
    follows_the_formula(text, 1e-3, 1e-5); // no limb inside: only rounding of a few operations
}

#[test]
fn the_furnace_is_one_half_everywhere() {
    let scene = crate::common::shipped("furnace");
    for mut pipeline in backends() {
        let image = render(&mut pipeline, &scene, &direct(160, 120, 4));
        for pixel in &image.pixels {
            // 2e-6: r² = 1 to a few ulps, π and 1/π to one.
            assert!(pixel.iter().all(|c| (c - 0.5).abs() < 2e-6), "{}: {pixel:?}", pipeline.backend.name());
        }
    }
}

#[test]
fn surfaces_have_two_sides() {
    // Camera and light below the plane see what a plane with the opposite normal shows from above.
    let from = |side: f64, light: f64| {
        format!(
            "[camera]\nposition = [0, {}, 4]\nlook_at = [0, 0, 0]\n[materials.m]\ncolor = [0.9, 0.5, 0.25]\n\
             [[lights]]\nposition = [0.5, {}, 1]\nintensity = [3, 2, 1]\n\
             [[planes]]\nnormal = [0, 1, 0]\noffset = 0\nmaterial = \"m\"\n",
            side * 3.0,
            light * 1.5
        )
    };
    follows_the_formula(&from(-1.0, -1.0), 1e-3, PLANE);
    for mut pipeline in backends() {
        let settings = direct(64, 48, 1);
        let above = render(&mut pipeline, &scene(&from(1.0, 1.0)), &settings);
        let below = render(&mut pipeline, &scene(&from(-1.0, -1.0)), &settings);
        // The picture from below is the mirror image, row by row.
        for (x, y) in pixels(&above) {
            let (a, b) = (above.at(x, y), below.at(x, 47 - y));
            assert!((0..3).all(|c| (a[c] - b[c]).abs() <= 1e-5 * a[c] + 1e-7), "{a:?} {b:?} at {x} {y}");
        }
        // A light behind the surface gives nothing.
        for (camera, light) in [(1.0, -1.0), (-1.0, 1.0)] {
            let image = render(&mut pipeline, &scene(&from(camera, light)), &settings);
            assert!(image.pixels.iter().all(|pixel| *pixel == [0.0; 3]), "{}", pipeline.backend.name());
        }
    }
}

#[test]
fn a_wall_keeps_light_out() {
    // The lamp is outside: behind a sphere's shell, behind a wall beside the camera's room, and behind the camera.
    let inside_sphere = "[camera]\nposition = [0, 0, 0.5]\nlook_at = [0, 0, 0]\n[materials.m]\ncolor = [1, 1, 1]\n\
                         [[lights]]\nposition = [0, 5, 0]\nintensity = [9, 9, 9]\n\
                         [[spheres]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"m\"\n";
    let behind_wall = "[camera]\nposition = [0, 1, 3]\nlook_at = [0, 0, 0]\n[materials.m]\ncolor = [1, 1, 1]\n\
                       [[lights]]\nposition = [0, 5, 0]\nintensity = [9, 9, 9]\n\
                       [[planes]]\nnormal = [0, 1, 0]\noffset = 0\nmaterial = \"m\"\n\
                       [[planes]]\nnormal = [0.1, 1, 0]\noffset = 3\nmaterial = \"m\"\n";
    for (text, opened) in [(inside_sphere, "[0, 0.5, 0]"), (behind_wall, "[0, 2, 0]")] {
        for mut pipeline in backends() {
            let dark = render(&mut pipeline, &scene(text), &direct(64, 48, 1));
            assert!(dark.pixels.iter().all(|pixel| *pixel == [0.0; 3]), "{}", pipeline.backend.name());
            let lit = render(&mut pipeline, &scene(&text.replace("[0, 5, 0]", opened)), &direct(64, 48, 1));
            let lit = lit.pixels.iter().filter(|pixel| pixel[0] > 0.0).count();
            assert!(lit > 2500, "{}: {lit} of 3072 pixels are lit", pipeline.backend.name());
        }
    }
}

#[test]
fn a_lamp_that_lies_on_a_surface_lights_the_room_evenly() {
    // A lamp on the ceiling, where the shadow ray's hit with the ceiling and the lamp are the same point.
    for normal in ["[0, 1, 0]", "[0.3, 1, -0.2]"] {
        let text = format!(
            "[camera]\nposition = [0, 1, 6]\nlook_at = [0, 0.5, 0]\nfov_y = 60\n[materials.m]\ncolor = [0.9, 0.9, 0.9]\n\
             [[planes]]\nnormal = [0, 1, 0]\noffset = -1\nmaterial = \"m\"\n\
             [[planes]]\nnormal = {normal}\noffset = 3.7\nmaterial = \"m\"\n"
        );
        let mut scene = scene(&text);
        let ceiling = scene.shapes.planes[1].clone();
        let place = dvec3(0.31, 0.0, -1.7);
        let position = place + ceiling.normal * (ceiling.offset - ceiling.normal.dot(place));
        scene.lights.points.push(PointLight { position, intensity: DVec3::splat(20.0) });
        let settings = direct(160, 120, 1);
        let camera = Pinhole::new(&scene.camera, &settings);
        for mut pipeline in backends() {
            let image = render(&mut pipeline, &scene, &settings);
            let mut floor = 0;
            for (x, y) in pixels(&image) {
                let direction = camera.through(x, y);
                let Some((point, normal, material)) = first_hit(&scene, camera.position, direction) else { continue };
                if (point.y + 1.0).abs() < 1e-9 {
                    let expected = reflected(point, normal, -direction, material, &scene.lights.points[0]);
                    let found = f64::from(image.at(x, y)[0]);
                    let error = (found - expected.x).abs();
                    assert!(error <= 1e-4 * expected.x, "{normal} at {x} {y}: {found}, expected {}", expected.x);
                    floor += 1;
                }
            }
            assert!(floor > 5000, "{floor} pixels show the floor");
        }
    }
}

#[test]
fn ambient_is_added_once_and_exactly() {
    let text = "[camera]\nposition = [0, 1, 3]\nlook_at = [0, -0.3, 0]\nfov_y = 40\n\
                [materials.m]\ncolor = [0.75, 0.5, 0.25]\nambient = 0.25\n[materials.n]\ncolor = [1, 0.5, 0]\n\
                [[planes]]\nnormal = [0, 1, 0]\noffset = 0\nmaterial = \"m\"\n\
                [[spheres]]\ncenter = [0, 0.5, 0]\nradius = 0.5\nmaterial = \"n\"\n";
    for mut pipeline in backends() {
        // No light: ambient only, powers of two all of it, hence exact; the sphere has none and is black.
        let dark = render(&mut pipeline, &scene(text), &direct(64, 48, 1));
        let glowing = dark.pixels.iter().filter(|p| **p == [0.1875, 0.125, 0.0625]).count();
        let black = dark.pixels.iter().filter(|p| **p == [0.0; 3]).count();
        assert!(glowing > 1000 && black > 50, "{glowing} {black}");
        assert_eq!(glowing + black, dark.pixels.len(), "{}", pipeline.backend.name());
        // With a light, ambient and reflected light add up.
        let light = "[[lights]]\nposition = [1, 2, 1]\nintensity = [5, 5, 5]\n";
        let with = render(&mut pipeline, &scene(&format!("{text}{light}")), &direct(64, 48, 1));
        let without = text.replace("ambient = 0.25", "ambient = 0");
        let without = render(&mut pipeline, &scene(&format!("{without}{light}")), &direct(64, 48, 1));
        for ((with, without), dark) in with.pixels.iter().zip(&without.pixels).zip(&dark.pixels) {
            assert!((0..3).all(|c| (with[c] - without[c] - dark[c]).abs() <= 1e-6), "{with:?} {without:?}");
        }
    }
}

#[test]
fn no_objects_no_light_nothing_seen() {
    let camera = "[camera]\nposition = [0, 0, 3]\nlook_at = [0, 0, 0]\n";
    let light = "[[lights]]\nposition = [0, 1, 0]\nintensity = [5, 5, 5]\n";
    let behind = "[materials.m]\ncolor = [1, 1, 1]\nambient = 1\n\
                  [[spheres]]\ncenter = [0, 0, 9]\nradius = 1\nmaterial = \"m\"\n";
    // Eighteen lights and no object: more lights than uniforms hold, and nothing to shine on.
    let many = light.repeat(18);
    let seen_by_none = format!("{camera}{light}{behind}");
    let cases =
        [(camera.into(), 1), (format!("{camera}{light}"), 4), (format!("{camera}{many}"), 1), (seen_by_none, 4)];
    for mut pipeline in backends() {
        for (text, samples) in &cases {
            let image = render(&mut pipeline, &scene(text), &direct(33, 17, *samples));
            assert!(image.pixels.iter().all(|pixel| *pixel == [0.0; 3]), "{}: {text}", pipeline.backend.name());
        }
    }
}

#[test]
fn lights_add_up() {
    let mut scene = crate::common::shipped("gi_two_lights");
    let settings = direct(160, 120, 1);
    for mut pipeline in backends() {
        let parts: Vec<_> = (0..2)
            .map(|light| {
                let mut one = scene.clone();
                one.lights.points = vec![scene.lights.points[light].clone()];
                render(&mut pipeline, &one, &settings)
            })
            .collect();
        let both = render(&mut pipeline, &scene, &settings);
        let two = scene.lights.points.clone();
        let ninth = two.iter().map(|l| PointLight { position: l.position, intensity: l.intensity / 9.0 });
        // Eighteen lights travel through textures rather than uniforms.
        scene.lights.points = ninth.cycle().take(18).collect();
        let eighteen = render(&mut pipeline, &scene, &settings);
        scene.lights.points = two;
        let mut apart = 0;
        for (i, pixel) in both.pixels.iter().enumerate() {
            for (c, found) in pixel.iter().enumerate() {
                let sum = parts[0].pixels[i][c] + parts[1].pixels[i][c];
                apart += usize::from((found - sum).abs() > 1e-5 * sum); // sums of two to eighteen terms, an ulp each
                apart += usize::from((eighteen.pixels[i][c] - sum).abs() > 1e-5 * sum);
            }
        }
        assert_eq!(apart, 0, "{}", pipeline.backend.name());
    }
}
