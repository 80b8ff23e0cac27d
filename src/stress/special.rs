//! Suite: special values through the whole pipeline. A picture of finite numbers, or a clear refusal.

use super::{Bench, Fault, Found, Row, Spread, Suite};
use crate::error::{Error, Result};
use crate::scene::parse;
use crate::settings::{Amount, FinalGather, LightMode, Settings, Technique};

/// A scene with a hole: what each case puts there.
struct Parts {
    camera: &'static str,
    material: &'static str,
    light: &'static str,
    more: &'static str,
    radius: Option<f32>,
}

const USUAL: Parts = Parts {
    camera: "position = [0, 0, 2.5]\nlook_at = [0, 0, 0]\nfov_y = 60",
    material: "color = [0.7, 0.7, 0.7]",
    light: "position = [0, 1.5, 0.5]\nintensity = [5, 5, 5]",
    more: "",
    radius: Some(0.3),
};

/// Scenes with special values, each under a name that says what is special.
fn cases() -> Vec<(&'static str, Parts)> {
    let light = |light| Parts { light, ..USUAL };
    let camera = |camera| Parts { camera, ..USUAL };
    let material = |material| Parts { material, ..USUAL };
    let more = |more| Parts { more, ..USUAL };
    vec![
        ("nothing special", USUAL),
        ("black light", light("position = [0, 1.5, 0.5]\nintensity = [0, 0, 0]")),
        ("light of one channel", light("position = [0, 1.5, 0.5]\nintensity = [5, 0, 0]")),
        ("intensity 1e30", light("position = [0, 1.5, 0.5]\nintensity = [1e30, 1e30, 1e30]")),
        ("intensity 1e-30", light("position = [0, 1.5, 0.5]\nintensity = [1e-30, 1e-30, 1e-30]")),
        ("intensity 1e-45", light("position = [0, 1.5, 0.5]\nintensity = [1e-45, 1e-45, 1e-45]")),
        (
            "lights of 1e30 and 1e-30",
            light(
                "position = [0, 1.5, 0.5]\nintensity = [1e30, 1e30, 1e30]\n[[lights]]\nposition = [0, 1, 1]\n\
                 intensity = [1e-30, 0, 1e-30]",
            ),
        ),
        ("light inside a sphere", light("position = [0, 0, 0]\nintensity = [5, 5, 5]")),
        ("light on a sphere", light("position = [0, 0.75, 0]\nintensity = [5, 5, 5]")),
        ("light on a wall", light("position = [0, 2, 0]\nintensity = [5, 5, 5]")),
        ("light in a corner", light("position = [2, 2, -3]\nintensity = [5, 5, 5]")),
        ("light outside the room", light("position = [0, 9, 0]\nintensity = [5, 5, 5]")),
        ("light at the camera", light("position = [0, 0, 2.5]\nintensity = [5, 5, 5]")),
        ("light 1e-6 m off a wall", light("position = [0, 1.999999, 0]\nintensity = [5, 5, 5]")),
        ("light 1e14 m away", light("position = [0, 1e14, 0]\nintensity = [1e28, 1e28, 1e28]")),
        ("albedo 0", material("color = [0, 0, 0]")),
        ("albedo 1", material("color = [1, 1, 1]")),
        ("albedo 1e-40", material("color = [1e-40, 1e-40, 1e-40]")),
        ("no diffuse part", material("color = [1, 1, 1]\ndiffuse = 0")),
        ("all specular, roughness 1", material("color = [1, 1, 1]\nspecular = 1\nroughness = 1")),
        ("all specular, roughness 0.001", material("color = [1, 1, 1]\nspecular = 1\nroughness = 0.001")),
        ("half specular, roughness 0.001", material("color = [1, 1, 1]\nspecular = 0.5\nroughness = 0.001")),
        ("specular 1e-40", material("specular = 1e-40\nroughness = 0.5")),
        ("ambient 1e30", material("color = [1, 1, 1]\nambient = 1e30")),
        ("fov 0.01", camera("position = [0, 0, 2.5]\nlook_at = [0, 0, 0]\nfov_y = 0.01")),
        ("fov 179.9", camera("position = [0, 0, 2.5]\nlook_at = [0, 0, 0]\nfov_y = 179.9")),
        ("fov 179.999999", camera("position = [0, 0, 2.5]\nlook_at = [0, 0, 0]\nfov_y = 179.999999")),
        ("camera inside a sphere", camera("position = [0, 0, 0]\nlook_at = [0, 0, 1]")),
        ("camera on a sphere, inwards", camera("position = [0, 0, 0.75]\nlook_at = [0, 0, 0]")),
        ("camera on a sphere, outwards", camera("position = [0, 0, 0.75]\nlook_at = [0, 0, 2]")),
        ("camera on a wall", camera("position = [0, 0, 3]\nlook_at = [0, 0, 0]")),
        ("camera along a wall", camera("position = [0, -2, 3]\nlook_at = [0, -2, 0]")),
        ("camera in a corner", camera("position = [2, 2, 3]\nlook_at = [0, 0, 0]")),
        ("camera outside the room", camera("position = [0, 0, 50]\nlook_at = [0, 0, 0]\nfov_y = 10")),
        ("camera 1e14 m away", camera("position = [0, 0, 1e14]\nlook_at = [0, 0, 0]\nfov_y = 10")),
        ("coincident planes", more("[[planes]]\nnormal = [0, 1, 0]\noffset = -2\nmaterial = \"m\"")),
        ("opposite coincident planes", more("[[planes]]\nnormal = [0, -1, 0]\noffset = 2\nmaterial = \"m\"")),
        ("planes 1e-7 m apart", more("[[planes]]\nnormal = [0, 1, 0]\noffset = -1.9999999\nmaterial = \"m\"")),
        ("planes at 1e-7 rad", more("[[planes]]\nnormal = [1e-7, 1, 0]\noffset = -2\nmaterial = \"m\"")),
        ("coincident spheres", more("[[spheres]]\ncenter = [0, 0, 0]\nradius = 0.75\nmaterial = \"m\"")),
        ("touching spheres", more("[[spheres]]\ncenter = [1.5, 0, 0]\nradius = 0.75\nmaterial = \"m\"")),
        ("sphere of 1e-15 m", more("[[spheres]]\ncenter = [1, 0, 0]\nradius = 1e-15\nmaterial = \"m\"")),
        ("sphere of 1e-6 m", more("[[spheres]]\ncenter = [1, 0, 0]\nradius = 1e-6\nmaterial = \"m\"")),
        ("room in a sphere of 1e5 m", more("[[spheres]]\ncenter = [0, 0, 0]\nradius = 1e5\nmaterial = \"m\"")),
        ("room in a sphere of 1e15 m", more("[[spheres]]\ncenter = [0, 0, 0]\nradius = 1e15\nmaterial = \"m\"")),
        ("radius 1e-15", Parts { radius: Some(1e-15), ..USUAL }),
        ("radius 1e-4", Parts { radius: Some(1e-4), ..USUAL }),
        ("radius 1e3", Parts { radius: Some(1e3), ..USUAL }),
        ("radius 1e15", Parts { radius: Some(1e15), ..USUAL }),
        ("chosen radius", Parts { radius: None, ..USUAL }),
    ]
}

fn text(parts: &Parts) -> String {
    let Parts { camera, material, light, more, .. } = parts;
    let mut text = format!("[camera]\n{camera}\n[materials.m]\n{material}\n[[lights]]\n{light}\n");
    for (normal, offset) in
        [("1, 0, 0", -2), ("1, 0, 0", 2), ("0, 1, 0", -2), ("0, 1, 0", 2), ("0, 0, 1", -3), ("0, 0, 1", 3)]
    {
        text += &format!("[[planes]]\nnormal = [{normal}]\noffset = {offset}\nmaterial = \"m\"\n");
    }
    text + "[[spheres]]\ncenter = [0, 0, 0]\nradius = 0.75\nmaterial = \"m\"\n" + more
}

/// How a case ended.
enum End {
    /// Pixels that are no finite, non-negative numbers, of how many.
    Picture(u64, u64),
    /// An error of the user's kind.
    Refused,
}

pub(super) fn run(bench: &mut Bench) -> Result<Found> {
    let (width, height) = bench.options.by_size((16, 12), (16, 12), (64, 48));
    let gather = Technique::FinalGather(FinalGather { rays: 8, ..FinalGather::default() });
    let all = [
        (LightMode::Hybrid, Technique::Map),
        (LightMode::Photons, Technique::Map),
        (LightMode::Hybrid, gather),
        (LightMode::Direct, Technique::Map),
    ];
    let modes = &all[..bench.options.by_size(1, 3, 4)];
    let every = bench.options.by_size(11, 3, 1);
    let mut found = Found::default();
    for backend in bench.backends() {
        let mut pipeline = bench.pipeline(backend)?;
        let (mut pixels, mut bad, mut refused, mut worst) = (0, 0, 0u64, String::new());
        for (name, parts) in cases().into_iter().step_by(every) {
            for (light, technique) in modes {
                bench.step(&format!("special: {name}, {}", backend.name()))?;
                let mut settings =
                    Settings { width, height, light: *light, technique: *technique, ..Settings::default() };
                settings.photons.amount = Amount::Paths(bench.options.by_size(500, 1_000, 10_000));
                settings.gather.radius = parts.radius;
                let end = match parse(&text(&parts), name) {
                    Err(_) => End::Refused,
                    Ok(scene) => match pipeline.render(&scene, &settings) {
                        Ok(rendering) => {
                            let mut image = rendering.image;
                            if bench.options.fault == Some(Fault::NotANumber) {
                                image.pixels[0][1] = f32::NAN;
                            }
                            let sound = |p: &&[f32; 3]| !p.iter().all(|c| c.is_finite() && *c >= 0.0);
                            End::Picture(image.pixels.iter().filter(sound).count() as u64, image.pixels.len() as u64)
                        }
                        Err(Error::Usage(_) | Error::Scene(_)) => End::Refused,
                        Err(error) => return Err(error),
                    },
                };
                match end {
                    End::Refused => refused += 1,
                    End::Picture(wrong, of) => {
                        (bad, pixels) = (bad + wrong, pixels + of);
                        if wrong > 0 && worst.is_empty() {
                            worst = format!(", first in '{name}' ({light:?}, {technique:?})");
                        }
                    }
                }
            }
        }
        let case = format!(
            "{} scenes, {} ways of light, {refused} refused{worst}",
            cases().len().div_ceil(every),
            modes.len()
        );
        let (measure, spread) = ("pixels not finite or negative", Spread::events(bad, pixels));
        found.rows.push(Row::new(Suite::Special, case, backend, measure, spread, 0.0));
    }
    Ok(found)
}
