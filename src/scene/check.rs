//! What numbers a scene may hold: each key's rule, and the checks that look at several keys at once.
//!
//! Scenes are kept in f64 but rendered in float32, whose largest number is 3.4e38. The rules refuse what would
//! overflow or vanish there, so that no image can turn into NaN because of its file.

use glam::DVec3;

use super::table::{Field, Read, Rule, Table};
use super::{Camera, Material};

/// Metres. Intersection squares distances and sums three squares: (1e15)² · 12 stays far below 3.4e38. It is a
/// tenth of a light year.
const FARTHEST: f64 = 1e15;
/// Metres. Its square, 1e-30, still is a normal float32.
const SMALLEST: f64 = 1e-15;
/// W/sr, and radiance where a surface shines by itself. Leaves eight digits for 4π, the BSDF, 1/r² and many lights.
const BRIGHTEST: f64 = 1e30;
/// pbrt's bound below which a GGX lobe counts as a mirror ("effectively smooth"): its square is near the spacing of
/// float32 numbers around cosθ = 1, so the lobe's shape is lost.
const NARROWEST_LOBE: f64 = 1e-3;
/// Sum of shares. Decimals that add up to 1 on paper miss it by an ulp or two in binary.
const SHARES_SLACK: f64 = 1e-9;
/// Sine of the angle between view and up: below it, float32 (spacing 1.2e-7) has no digit left for the image's
/// horizontal.
const PARALLEL: f64 = 1e-6;
/// Distance from position to look_at over their coordinates: below it, f64 (spacing 2.2e-16) has fewer than four
/// digits left for the direction.
const SAME_POINT: f64 = 1e-12;

pub(super) const COORDINATE: Rule =
    Rule { holds: |x| x.abs() <= FARTHEST, expected: "a coordinate in metres between -1e15 and 1e15" };
pub(super) const DIRECTION: Rule = Rule { holds: |x| x.abs() <= FARTHEST, expected: "a number between -1e15 and 1e15" };
pub(super) const RADIUS: Rule =
    Rule { holds: |x| (SMALLEST..=FARTHEST).contains(&x), expected: "a radius > 0 (in metres, 1e-15 to 1e15)" };
pub(super) const FOV: Rule =
    Rule { holds: |x| x > 0.0 && x < 180.0, expected: "an angle in degrees, more than 0 and less than 180" };
pub(super) const INTENSITY: Rule =
    Rule { holds: |x| (0.0..=BRIGHTEST).contains(&x), expected: "an intensity in W/sr from 0 to 1e30" };
pub(super) const COLOR: Rule = Rule { holds: |x| (0.0..=1.0).contains(&x), expected: "a reflectance from 0 to 1" };
pub(super) const SHARE: Rule = Rule { holds: |x| (0.0..=1.0).contains(&x), expected: "a share from 0 to 1" };
pub(super) const ROUGHNESS: Rule = Rule {
    holds: |x| x == 0.0 || (NARROWEST_LOBE..=1.0).contains(&x),
    expected: "a roughness from 0.001 to 1, or 0 for a perfect mirror",
};
pub(super) const IOR: Rule = Rule {
    // 1e4: Fresnel's terms square it; no material comes near.
    holds: |x| (1.0..=1e4).contains(&x),
    expected: "an index of refraction from 1 to 1e4",
};
pub(super) const AMBIENT: Rule =
    Rule { holds: |x| (0.0..=BRIGHTEST).contains(&x), expected: "an ambient radiance from 0 to 1e30" };
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

/// Refuses a material whose shares add up to more light than arrives.
pub(super) fn shares(table: &Table, material: &Material) -> Read<()> {
    let Material { diffuse, specular, transmission, .. } = *material;
    if diffuse + specular + transmission <= 1.0 + SHARES_SLACK {
        return Ok(());
    }
    let mut given: Vec<Field> =
        ["diffuse", "specular", "transmission"].into_iter().filter_map(|key| table.get(key)).collect();
    given.sort_by_key(Field::at);
    let quoted: Vec<String> = given.iter().map(Field::quote).collect();
    // The last one written is the one that broke the sum. There is one, as the defaults add up to 1.
    let at = given.last().map_or(table.at, Field::at);
    let expected = "diffuse + specular + transmission to be at most 1";
    Err(table.text.error(at, quoted.join(", "), expected))
}

/// Refuses what the tracers cannot do yet: a wrong picture would be worse than none.
pub(super) fn not_supported_yet(table: &Table, material: &Material) -> Read<()> {
    let mirror = material.specular > 0.0 && material.roughness == 0.0;
    let refused = [
        (mirror, "specular", " with roughness 0", "roughness > 0: perfect mirrors are not supported yet"),
        (material.transmission > 0.0, "transmission", "", "0: glass is not supported yet"),
    ];
    for (present, key, detail, expected) in refused {
        if let (true, Some(field)) = (present, table.get(key)) {
            let mut error = field.wrong(expected);
            error.found += detail;
            return Err(error);
        }
    }
    Ok(())
}

/// A plane's normal and offset with the normal at unit length; the points that it contains stay the same.
pub(super) fn plane(normal: (Field, DVec3), offset: (Field, f64)) -> Read<(DVec3, f64)> {
    let Some(unit) = unit(normal.1) else {
        return Err(normal.0.wrong("a direction, not all zeros"));
    };
    let distance = offset.1 / normal.1.dot(unit);
    if distance.is_finite() && (COORDINATE.holds)(distance) {
        return Ok((unit, distance));
    }
    let mut error = offset.0.wrong("a plane within 1e15 m of the origin (offset / length of normal)");
    error.found += &format!(" with {}", normal.0.quote());
    Err(error)
}

/// `v` at length 1, however short or long it is; none if it is zero.
fn unit(v: DVec3) -> Option<DVec3> {
    // Scaled first: the squares of 1e-200 would vanish even in f64.
    let scale = v.abs().max_element();
    (scale > 0.0).then(|| (v / scale).normalize())
}

fn shown(v: DVec3) -> String {
    format!("[{}, {}, {}]", v.x, v.y, v.z)
}
