//! What a camera and the render defaults may hold.

use glam::DVec3;

use super::Camera;
use crate::reading::rules::unit;
use crate::reading::{Read, Rule, Table};

/// Sine of the angle between view and up: below it, float32 (spacing 1.2e-7) has no digit left for the image's
/// horizontal.
const PARALLEL: f64 = 1e-6;
/// Distance from position to look_at over their coordinates: below it, f64 (spacing 2.2e-16) has fewer than four
/// digits left for the direction.
const SAME_POINT: f64 = 1e-12;

pub(super) const FOV: Rule =
    Rule { holds: |x| x > 0.0 && x < 180.0, expected: "an angle in degrees, more than 0 and less than 180" };
pub(super) const EXPOSURE: Rule = Rule {
    // 2^±120 are normal float32 numbers.
    holds: |x| x.abs() <= 120.0,
    expected: "an exposure value from -120 to 120",
};

/// Refuses a camera without a direction, or without a horizontal.
pub(super) fn camera(table: &Table, camera: &Camera) -> Read<()> {
    let look_at = table.need("look_at", "")?;
    let view = camera.look_at - camera.position;
    let scale = camera.position.abs().max(camera.look_at.abs()).max_element();
    if view.length() <= SAME_POINT * scale {
        let expected = format!("a point other than the camera's position {}", shown(camera.position));
        return Err(look_at.wrong(expected));
    }
    let up = table.get("up");
    let Some(direction) = unit(camera.up) else {
        return Err(up.unwrap_or(look_at).wrong("a direction, not all zeros"));
    };
    if direction.cross(view.normalize()).length() < PARALLEL {
        return Err(match up {
            Some(up) => up.wrong(format!("a direction not parallel to the view {}", shown(view))),
            None => {
                let mut error = look_at.wrong("an up = [x, y, z] that is not parallel to the view");
                error.found += " straight above or below position, parallel to the default up = [0, 1, 0]";
                error
            }
        });
    }
    Ok(())
}

fn shown(v: DVec3) -> String {
    format!("[{}, {}, {}]", v.x, v.y, v.z)
}
