//! Pixels on an edge: where the last bits of a ray decide which surface it hits, or whether a light reaches it. Two right
//! renderers may differ there by the whole contrast of the edge.

use glam::Vec3;

use crate::program::features::Lights;
use crate::rays::camera::{camera_direction, sample_point};
use crate::rays::scene::SceneTables;
use crate::records::Frame;

/// How far a ray is moved to see whether it sits on an edge, in pixels. Float32 leaves 1e-4 of a pixel to chance on the
/// image plane, and some ten times that where a shadow falls at a grazing angle.
const NUDGE: f32 = 0.01;

/// Whether some sample of a pixel sits on an edge of an object or of a hard shadow.
pub fn is_on_edge(scene: &SceneTables, frame: &Frame, column: u32, row: u32) -> bool {
    let one_sample = scene.features.one_sample;
    let samples = if one_sample { 1 } else { frame.samples as u32 };
    (0..samples).map(|number| sample_point(frame, one_sample, column, row, number)).any(|(x, y, _)| {
        let here = seen(scene, frame, x, y);
        let around = [(-NUDGE, -NUDGE), (NUDGE, -NUDGE), (-NUDGE, NUDGE), (NUDGE, NUDGE)];
        around.into_iter().any(|(dx, dy)| seen(scene, frame, x + dx, y + dy) != here)
    })
}

/// What a ray meets: object, side, and which lights shine on the point.
fn seen(scene: &SceneTables, frame: &Frame, x: f32, y: f32) -> Option<(usize, bool, Vec<bool>)> {
    let (origin, direction) = (Vec3::from(frame.position), camera_direction(frame, x, y));
    let hit = scene.closest_hit(origin, direction, None)?;
    let surface = scene.surface_at(origin, direction, hit);
    let shines = |light: Vec3| {
        let towards = light - surface.position;
        let distance = towards.length();
        !scene.occluded(surface.position, light, towards / distance, distance, surface.face_left(), None)
    };
    let lights = if scene.features.lights == Lights::None { &[] } else { scene.lights };
    let lit = lights.iter().map(|light| shines(light.position.into())).collect();
    Some((surface.shape, surface.side > 0.0, lit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packing::Packed;
    use crate::program::features::Features;
    use crate::settings::{Pass, Settings};

    #[test]
    fn edges_are_found_where_they_are_and_nowhere_else() {
        // A sphere of radius 1 at distance 4 before a camera of 90°: its limb is a circle of 1/√15 of the half-height.
        let text = "[camera]\nposition = [0, 0, 4]\nlook_at = [0, 0, 0]\nfov_y = 90.0\n\
                    [materials.m]\ncolor = [1, 1, 1]\n[[spheres]]\ncenter = [0, 0, 0]\nradius = 1.0\nmaterial = \"m\"\n";
        let scene = crate::scene::parse(text, "limb").unwrap();
        let settings = Settings { width: 400, height: 400, ..Settings::default() };
        let (features, packed) = (Features::of(&scene, &settings), Packed::new(&scene, scene.camera.position));
        let (tables, frame) =
            (SceneTables::new(&packed, &features), packed.frame(&scene.camera, &settings, &Pass::single(&settings)));
        let limb = 200.0 / 15f64.sqrt();
        let mut found = 0;
        for (column, row) in (0..400).flat_map(|row| (0..400).map(move |column| (column, row))) {
            let from_limb = (f64::from(column) + 0.5 - 200.0).hypot(f64::from(row) + 0.5 - 200.0) - limb;
            if is_on_edge(&tables, &frame, column, row) {
                found += 1;
                assert!(from_limb.abs() < 0.02, "({column}, {row}) is {from_limb} pixels off the limb");
            } else {
                assert!(from_limb.abs() > 0.005, "({column}, {row}) is {from_limb} pixels off the limb");
            }
        }
        assert!(found > 0);
    }
}
