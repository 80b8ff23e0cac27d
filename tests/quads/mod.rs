//! Quads: finite parallelograms in every backend, technique and gather method.

mod alike;
mod edges;
mod files;
mod formulas;
mod walls;

use photile::film::Image;
use photile::film::metrics::{self, measure};
use photile::scene::Scene;
use photile::settings::{Amount, GridForm, LightMode, Method, Settings};

use crate::common::scene;

/// An open box of quads with two coloured walls, a slanted quad that floats in it, and a sphere.
fn room() -> Scene {
    let quads = [
        ("[-1, 0, 1]", "[[2, 0, 0], [0, 0, -2]]", "white"),
        ("[-1, 2, -1]", "[[2, 0, 0], [0, 0, 2]]", "white"),
        ("[-1, 0, -1]", "[[2, 0, 0], [0, 2, 0]]", "white"),
        ("[-1, 0, 1]", "[[0, 0, -2], [0, 2, 0]]", "red"),
        ("[1, 0, -1]", "[[0, 0, 2], [0, 2, 0]]", "green"),
        ("[-0.6, 0.5, -0.2]", "[[0.6, 0, 0.2], [-0.2, 0.3, 0.5]]", "glossy"),
    ];
    let quads = quads.map(|(corner, edges, material)| quad(corner, edges, material));
    scene(&format!(
        "[camera]\nposition = [0, 1, 3.4]\nlook_at = [0, 1, 0]\nfov_y = 40\n\
         [materials.white]\ncolor = [0.75, 0.75, 0.75]\n[materials.red]\ncolor = [0.65, 0.06, 0.05]\n\
         [materials.green]\ncolor = [0.12, 0.45, 0.1]\n\
         [materials.glossy]\ncolor = [0.9, 0.8, 0.5]\ndiffuse = 0.6\nspecular = 0.4\nroughness = 0.3\n\
         [[lights]]\nposition = [0, 1.8, 0]\nintensity = [1.5, 1.4, 1.2]\n{}\
         [[spheres]]\ncenter = [0.45, 0.4, 0.1]\nradius = 0.4\nmaterial = \"white\"\n",
        quads.concat()
    ))
}

/// The same without the lobe, which final gathering refuses.
fn matte_room() -> Scene {
    let mut scene = room();
    let white = scene.materials.iter().position(|material| material.name == "white").unwrap();
    scene.shapes.quads.iter_mut().last().unwrap().material = white;
    scene.materials.retain(|material| material.name != "glossy");
    scene
}

fn quad(corner: &str, edges: &str, material: &str) -> String {
    format!("[[quads]]\ncorner = {corner}\nedges = {edges}\nmaterial = \"{material}\"\n")
}

/// The six walls of a cube of 2 m about the origin: as planes, and as quads that look inwards as well as outwards.
fn cubes() -> [String; 2] {
    let axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    let (mut planes, mut quads) = (String::new(), String::new());
    for axis in 0..3 {
        for side in [-1, 1] {
            let (normal, [u, v]) = (axes[axis], [axes[(axis + 1) % 3], axes[(axis + 2) % 3]]);
            planes += &format!("[[planes]]\nnormal = {normal:?}\noffset = {side}\nmaterial = \"grey\"\n");
            let corner: Vec<i32> = (0..3).map(|i| side * normal[i] - u[i] - v[i]).collect();
            let edges = [u, v].map(|edge| edge.map(|x| 2 * x));
            quads += &quad(&format!("{corner:?}"), &format!("{edges:?}"), "grey");
        }
    }
    [planes, quads]
}

/// Settings of a small picture whose photons are gathered by one method.
fn gathered(
    size: (u32, u32),
    light: LightMode,
    (method, form): (Method, GridForm),
    paths: u32,
    radius: f32,
) -> Settings {
    let mut settings = Settings { width: size.0, height: size.1, light, ..Settings::default() };
    settings.photons.amount = Amount::Paths(paths);
    settings.gather.method = method;
    settings.gather.form = form;
    settings.gather.radius = Some(radius);
    settings
}

fn mean(image: &Image) -> f64 {
    image.pixels.iter().flatten().map(|channel| f64::from(*channel)).sum::<f64>() / (3 * image.pixels.len()) as f64
}

/// The largest difference of any pixel, as a share of the second picture's mean.
fn apart(a: &Image, b: &Image) -> f64 {
    measure(a, b, &metrics::Settings::default()).unwrap().max_abs / mean(b)
}

fn rel_mse(image: &Image, reference: &Image) -> f64 {
    measure(image, reference, &metrics::Settings::default()).unwrap().rel_mse
}
