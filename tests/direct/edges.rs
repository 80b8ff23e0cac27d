//! Edges at their exact place, pixel by pixel at the size that the report used.

use glam::{DVec3, dvec3};
use photile::film::Image;

use crate::common::{Pinhole, backends, direct, pixels, render, scene, to_plane, to_sphere};

const SPHERE: (DVec3, f64) = (dvec3(0.2, 1.3, -0.4), 0.9);
const LIGHT: DVec3 = dvec3(-2.0, 5.0, 1.5);

/// Ambient tells what is seen, light what is lit: the sphere glows red, the plane is white.
const TEXT: &str = "[camera]\nposition = [1, 4, 6]\nlook_at = [0.5, 0.4, -0.2]\nfov_y = 50\n\
    [materials.ball]\ncolor = [1, 0, 0]\nambient = 1\ndiffuse = 0\n[materials.floor]\ncolor = [0, 1, 1]\n\
    [[lights]]\nposition = [-2, 5, 1.5]\nintensity = [30, 30, 30]\n\
    [[spheres]]\ncenter = [0.2, 1.3, -0.4]\nradius = 0.9\nmaterial = \"ball\"\n\
    [[planes]]\nnormal = [0, 1, 0]\noffset = 0\nmaterial = \"floor\"\n";

/// What stands in a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Seen {
    Ball,
    Shadow,
    Floor,
    Nothing,
}

/// By geometry, for a sphere of the given radius.
fn expected(camera: &Pinhole, (x, y): (u32, u32), radius: f64) -> Seen {
    let (origin, direction) = (camera.position, camera.through(x, y));
    if to_sphere(origin, direction, SPHERE.0, radius).is_some() {
        return Seen::Ball;
    }
    let Some(t) = to_plane(origin, direction, DVec3::Y, 0.0) else { return Seen::Nothing };
    let point = origin + direction * t;
    match to_sphere(point, (LIGHT - point).normalize(), SPHERE.0, radius) {
        Some(_) => Seen::Shadow,
        None => Seen::Floor,
    }
}

fn found(image: &Image, (x, y): (u32, u32), camera: &Pinhole) -> Seen {
    match image.at(x, y) {
        [r, _, _] if r > 0.0 => Seen::Ball,
        [_, g, _] if g > 0.0 => Seen::Floor,
        _ if camera.through(x, y).y < 0.0 => Seen::Shadow,
        _ => Seen::Nothing,
    }
}

/// Pixels in which geometry and image disagree.
fn wrong(image: &Image, camera: &Pinhole, radius: f64) -> Vec<(u32, u32)> {
    pixels(image).filter(|pixel| expected(camera, *pixel, radius) != found(image, *pixel, camera)).collect()
}

#[test]
fn limb_and_shadow_edge_lie_where_geometry_puts_them() {
    let scene = scene(TEXT);
    let settings = direct(640, 480, 1);
    let camera = Pinhole::new(&scene.camera, &settings);
    for mut pipeline in backends() {
        let image = render(&mut pipeline, &scene, &settings);
        for kind in [Seen::Ball, Seen::Shadow, Seen::Floor] {
            let count = pixels(&image).filter(|pixel| found(&image, *pixel, &camera) == kind).count();
            assert!(count > 5000, "{}: {kind:?} in {count} pixels", pipeline.backend.name());
        }
        // A pixel's centre lies within float32's rounding of an edge (1e-6 of the distance, 1/2000 pixel) in about one
        // of 2000 pixels along it, and the edges are some 1500 pixels long. None is a pixel off.
        let wrong_here = wrong(&image, &camera, SPHERE.1);
        assert!(wrong_here.len() <= 4, "{}: {wrong_here:?}", pipeline.backend.name());
        for (x, y) in wrong_here {
            let around = [(-1, 0), (1, 0), (0, -1), (0, 1)]
                .map(|(dx, dy)| (x.saturating_add_signed(dx), y.saturating_add_signed(dy)));
            let here = expected(&camera, (x, y), SPHERE.1);
            assert!(around.iter().any(|p| expected(&camera, *p, SPHERE.1) != here), "{x} {y} is not at an edge");
        }
        // A tenth of a pixel (0.001 of the radius) must show, in about a tenth of the edges' pixels.
        let displaced = wrong(&image, &camera, SPHERE.1 * 1.001).len();
        assert!(displaced > 20, "{}: {displaced}", pipeline.backend.name());
    }
}

#[test]
fn horizons_are_where_the_plane_ends() {
    // Looking level over an infinite plane: every row below the middle is floor, none above, up to rays that meet the
    // floor a thousand times the camera's height away.
    let text = "[camera]\nposition = [0, 2, 0]\nlook_at = [0, 2, -1]\nfov_y = 60\n\
        [materials.floor]\ncolor = [1, 1, 1]\nambient = 1\n[[planes]]\nnormal = [0, 1, 0]\noffset = 0\nmaterial = \"floor\"\n";
    for mut pipeline in backends() {
        let image = render(&mut pipeline, &scene(text), &direct(64, 480, 1));
        for (x, y) in pixels(&image) {
            assert_eq!(image.at(x, y), if y < 240 { [0.0; 3] } else { [1.0; 3] }, "{x} {y}");
        }
    }
}
