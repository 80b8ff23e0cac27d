//! Where float32 has limits that a picture may show, said before somebody takes it for the truth.
//!
//! What the renderer can avoid it avoids (scenes are packed about the camera, rays know what they start on); what is
//! left is the spacing of float32 numbers itself, 1.2·10⁻⁷ of a length.

use crate::scene::Scene;
use crate::settings::{Amount, LightMode, Settings};
use crate::shapes::{ULP, View};

/// Each limit that this scene meets at these settings, a sentence each; `radius` is the one that was gathered with.
pub fn of(scene: &Scene, settings: &Settings, radius: Option<f32>) -> Vec<String> {
    let camera = scene.camera.position;
    // What is looked at: lights and what is not huge stand as far away as the scene is large.
    let near = scene.camera.look_at.distance(camera);
    let lights = scene.lights.origins();
    let size = lights.iter().map(|light| light.distance(camera)).fold(near, f64::max);
    let view = View { camera, lights: &lights, size };
    let mut warnings: Vec<String> = scene.shapes.kinds().iter().flat_map(|kind| kind.warnings(&view)).collect();
    if settings.light != LightMode::Direct
        && let Some(radius) = radius
    {
        let rounding = 4.0 * ULP * size / f64::from(radius);
        if rounding > 1e-2 {
            warnings.push(format!(
                "gather radius {radius:.1e} m in a scene of {size:.1e} m: float32 knows photons' places to {:.1e} of it",
                rounding / 2.0
            ));
        }
        let paths = match settings.photons.amount {
            Amount::Paths(paths) | Amount::Stored(paths) => f64::from(paths),
        };
        let dim = |power: &f64| *power > 0.0 && *power < 1e-34;
        if let Some(power) = scene.lights.iter().map(|light| light.flux().max_element() / paths).find(dim) {
            warnings.push(format!("a photon carries {power:.1e} W: below 1e-38 float32 loses digits, then the light"));
        }
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::parse;

    fn scene(sphere: &str, light: &str) -> Scene {
        let text = format!(
            "[camera]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\n[materials.m]\ncolor = [1, 1, 1]\n[[lights]]\nposition = [0, 3, 0]\n\
             intensity = {light}\n[[spheres]]\n{sphere}\nmaterial = \"m\"\n"
        );
        parse(&text, "x.toml").unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn usual_scenes_are_not_warned_of() {
        let usual = scene("center = [0, 0, 0]\nradius = 1", "[5, 5, 5]");
        assert_eq!(of(&usual, &Settings::default(), Some(0.1)), [""; 0]);
        // The walls of a room that are spheres of radius 10⁵.
        let wall = scene("center = [0, -100003, 0]\nradius = 1e5", "[5, 5, 5]");
        assert_eq!(of(&wall, &Settings::default(), Some(0.1)), [""; 0]);
    }

    #[test]
    fn a_room_seen_from_very_far_is_said() {
        let room = |away: f64| {
            let mut text = format!(
                "[camera]\nposition = [0, 0, {away}]\nlook_at = [0, 0, 0]\n[materials.m]\ncolor = [1, 1, 1]\n\
                 [[lights]]\nposition = [0, 0.4, 0]\nintensity = [5, 5, 5]\n"
            );
            for normal in ["1, 0, 0", "0, 1, 0", "0, 0, 1"] {
                for offset in [-1, 1] {
                    text += &format!("[[planes]]\nnormal = [{normal}]\noffset = {offset}\nmaterial = \"m\"\n");
                }
            }
            parse(&text, "x.toml").unwrap_or_else(|error| panic!("{error}"))
        };
        assert_eq!(of(&room(20.0), &Settings::default(), Some(0.1)), [""; 0], "ten sizes away");
        let warnings = of(&room(2000.0), &Settings::default(), Some(10.0));
        assert!(warnings.len() == 1 && warnings[0].contains("from a room"), "{warnings:?}");
    }

    #[test]
    fn each_limit_is_said() {
        let settings = Settings::default();
        let cases = [
            (scene("center = [0, -1e7, 0]\nradius = 1e7", "[5, 5, 5]"), 0.1, "radius of"),
            (scene("center = [0, 0, -1e6]\nradius = 1", "[5, 5, 5]"), 0.1, "normals"),
            (scene("center = [0, 0, 0]\nradius = 1", "[5, 5, 5]"), 1e-5, "photons' places"),
            (scene("center = [0, 0, 0]\nradius = 1", "[0, 1e-33, 0]"), 0.1, "a photon carries"),
        ];
        for (scene, radius, said) in cases {
            let warnings = of(&scene, &settings, Some(radius));
            assert!(warnings.len() == 1 && warnings[0].contains(said), "{said}: {warnings:?}");
        }
    }
}
