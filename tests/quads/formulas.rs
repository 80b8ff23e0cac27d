//! Light on quads against formulas in double precision, and against planes.

use std::f64::consts::PI;

use glam::DVec3;
use photile::scene::Scene;
use photile::settings::{GridForm, LightMode, Method};
use photile::shapes::Quad;

use super::{apart, cubes, gathered, mean, quad};
use crate::common::{Pinhole, backends, direct, pixels, render, scene};
use crate::photons::{Case, paths, power_by_bounce};

/// Where a ray meets a quad's plane, and how far along the quad's edges that is, by Cramer's rule.
fn met(quad: &Quad, origin: DVec3, direction: DVec3) -> (DVec3, [f64; 2]) {
    let [a, b] = quad.edges;
    let normal = a.cross(b);
    let point = origin + direction * (normal.dot(quad.corner - origin) / normal.dot(direction));
    let from = point - quad.corner;
    let area2 = normal.length_squared();
    (point, [from.cross(b).dot(normal) / area2, a.cross(from).dot(normal) / area2])
}

#[test]
fn a_lamp_over_a_slanted_quad_lights_it_as_the_formula_says_and_nothing_beside_it() {
    let text = quad("[-1, 0.3, 0.5]", "[[2.1, 0.2, 0.3], [-0.4, 0.5, -1.8]]", "m");
    let scene = scene(&format!(
        "[camera]\nposition = [0.5, 2.5, 2]\nlook_at = [-0.1, 0.7, -0.2]\nfov_y = 60\n[materials.m]\n\
         color = [0.9, 0.5, 0.25]\n[[lights]]\nposition = [0.4, 2, 0.6]\nintensity = [3, 2, 1]\n{text}"
    ));
    let (quad, light, settings) = (&scene.shapes.quads[0], &scene.lights.points[0], direct(160, 120, 1));
    let camera = Pinhole::new(&scene.camera, &settings);
    let color = DVec3::new(0.9, 0.5, 0.25);
    for mut pipeline in backends() {
        let (image, mut counts) = (render(&mut pipeline, &scene, &settings), [0, 0]);
        for (x, y) in pixels(&image) {
            let (point, at) = met(quad, camera.position, camera.through(x, y));
            // How far within the nearest edge, in edges.
            let within = at.iter().map(|x| x.min(1.0 - x)).fold(f64::INFINITY, f64::min);
            if within.abs() < 1e-5 {
                continue;
            }
            let towards = light.position - point;
            let cosine = quad.edges[0].cross(quad.edges[1]).normalize().dot(towards.normalize());
            let lit = color * light.intensity / PI * cosine.abs() / towards.length_squared();
            let expected = if within > 0.0 { lit } else { DVec3::ZERO };
            counts[usize::from(within > 0.0)] += 1;
            let error = (DVec3::from(image.at(x, y).map(f64::from)) - expected).length();
            // 1e-5: a ray's direction is off by 1e-7 of the distance, seen and lit at angles of 20 degrees and more.
            assert!(error <= 1e-5 * lit.length(), "{}, {x} {y}: off by {error}", pipeline.backend.name());
        }
        assert!(counts.iter().all(|count| *count > 2000), "pixels beside and on the quad: {counts:?}");
    }
}

/// Solid angle of a rectangle of half sides a and b, seen from d above its middle.
fn solid_angle(a: f64, b: f64, d: f64) -> f64 {
    4.0 * (a * b / ((a * a + d * d) * (b * b + d * d)).sqrt()).asin()
}

#[test]
fn a_rectangle_catches_its_solid_angle_of_a_lamps_light() {
    let number = 200_000;
    for (a, b, d) in [(0.5, 0.5, 1.0), (1.5, 0.2, 0.4), (0.1, 0.1, 2.0)] {
        let [x, z] = [2.0 * a, 2.0 * b];
        let text = quad(&format!("[{}, 0, {}]", 5.0 - a, -7.0 - b), &format!("[[{x}, 0, 0], [0, 0, {z}]]"), "m");
        let case = Case::parse(&format!(
            "[materials.m]\ncolor = [0, 0, 0]\n[[lights]]\nposition = [5, {d}, -7]\nintensity = [1, 1, 1]\n{text}"
        ));
        let found = power_by_bounce(&case.twin(&paths(number)))[0] / 3.0;
        let expected = solid_angle(a, b, d);
        // 2,000 paths and more go where the quad is, evenly spread: within a fifth of what chance would make of them.
        let bound = 0.01 * expected;
        eprintln!("{a} × {b} at {d}: {found} for {expected}, ±{bound}");
        assert!((found - expected).abs() < bound, "{a} × {b} at {d}: {found} for {expected}");
        assert!((found - solid_angle(1.02 * a, 1.02 * b, d)).abs() > bound, "a larger quad must show");
    }
}

/// A cube of walls, seen from within.
fn cube(walls: &str) -> Scene {
    scene(&format!(
        "[camera]\nposition = [0.4, -0.3, 0.8]\nlook_at = [-0.5, 0.2, -1]\nfov_y = 80\n[materials.grey]\n\
         color = [0.7, 0.7, 0.7]\n[[lights]]\nposition = [0.3, 0.2, 0.1]\nintensity = [1, 1, 1]\n{walls}"
    ))
}

#[test]
fn a_cube_of_quads_is_a_cube_of_planes() {
    let [planes, quads] = cubes().map(|walls| cube(&walls));
    // The same paths end at the same points, to an ulp, but where they pass an edge of the cube within a few: these
    // are other paths from there on, each one of 20,000. No path escapes between two quads.
    let [power, other] = [&planes, &quads].map(|scene| power_by_bounce(&Case::new(scene).twin(&paths(20_000))));
    for (bounce, (power, other)) in power.iter().zip(&other).enumerate() {
        assert!((power - other).abs() < 5e-4 * power + 1e-9, "bounce {bounce}: {other} for {power}");
    }
    assert!((power[0] / (12.0 * PI) - 1.0).abs() < 1e-5, "{}", power[0]);
    let direct = direct(96, 72, 1);
    let map = gathered((64, 48), LightMode::Photons, (Method::Grid, GridForm::Auto), 50_000, 0.3);
    for mut pipeline in backends() {
        let name = pipeline.backend.name();
        let [a, b] = [&planes, &quads].map(|scene| render(&mut pipeline, scene, &direct));
        assert!(apart(&b, &a) < 1e-5, "{name}, direct: {}", apart(&b, &a));
        let [a, b] = [&planes, &quads].map(|scene| render(&mut pipeline, scene, &map));
        // Discs are cut by the same lines, a quad's edges and the walls that stand on them; hundreds of photons each.
        eprintln!("{name}: {:e} apart, means {} {}", apart(&b, &a), mean(&b), mean(&a));
        assert!(apart(&b, &a) < 2e-3, "{name}, photons: {}", apart(&b, &a));
    }
}

#[test]
fn a_closed_box_of_quads_follows_the_albedo_series() {
    let number = 100_000;
    let [_, quads] = cubes();
    for albedo in [0.3, 0.7] {
        let mut scene = cube(&quads);
        scene.materials[0].color = DVec3::splat(albedo);
        let power = power_by_bounce(&Case::new(&scene).twin(&paths(number)));
        for bounce in 0..8 {
            // Φ·ρᵏ, carried by N·ρᵏ photons of equal power: binomial, five standard deviations.
            let share = albedo.powi(bounce);
            let deviation = 5.0 * (share * (1.0 - share) / f64::from(number)).sqrt();
            let measured = power[bounce as usize] / (12.0 * PI);
            assert!((measured - share).abs() <= deviation + 1e-6, "ρ {albedo}, bounce {bounce}: {measured}");
            assert!(bounce > 2 || (measured * 1.1 - share).abs() > deviation, "10% too much must show");
        }
    }
}
