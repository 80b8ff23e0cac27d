//! Damaged files: never a panic, and every error names a place that is in the file.

use super::GOOD;
use photile::scene::{Scene, SceneError, parse_bytes};
use proptest::prelude::*;

/// Checks what every error promises, whatever the bytes.
fn check(bytes: &[u8]) -> Result<(), TestCaseError> {
    let error = match parse_bytes(bytes, "x.toml") {
        Ok(scene) => return sound(&scene),
        Err(error) => error,
    };
    in_file(bytes, &error)?;
    prop_assert!(!error.found.is_empty() && !error.expected.is_empty(), "{error}");
    let printed = error.to_string();
    prop_assert!(!printed.contains(|c: char| c.is_control()), "{printed:?}");
    prop_assert!(printed.chars().count() < 500, "{printed:?}");
    Ok(())
}

/// Checks what the renderer relies on in every scene that was accepted.
fn sound(scene: &Scene) -> Result<(), TestCaseError> {
    let view = scene.camera.look_at - scene.camera.position;
    prop_assert!(view.cross(scene.camera.up).length() > 0.0);
    for light in &scene.lights.points {
        prop_assert!(light.intensity.as_vec3().is_finite() && light.intensity.min_element() >= 0.0);
    }
    for sphere in &scene.shapes.spheres {
        let radius = sphere.radius as f32;
        prop_assert!((radius * radius).is_normal() && sphere.material < scene.materials.len());
        prop_assert!(sphere.center.as_vec3().length_squared().is_finite());
    }
    for plane in &scene.shapes.planes {
        prop_assert!((plane.normal.length() - 1.0).abs() < 1e-15 && plane.offset.is_finite());
        prop_assert!(plane.material < scene.materials.len());
    }
    for material in &scene.materials {
        let shares = material.diffuse + material.specular + material.transmission;
        prop_assert!((0.0..=1.0 + 1e-9).contains(&shares), "{material:?}");
        prop_assert!(material.color.max_element() <= 1.0 && material.color.min_element() >= 0.0);
    }
    Ok(())
}

fn in_file(bytes: &[u8], error: &SceneError) -> Result<(), TestCaseError> {
    let place = error.position;
    prop_assert!(place.is_some(), "{error} has no place");
    let Some(place) = place else { return Ok(()) };
    let line = bytes.split(|&byte| byte == b'\n').nth(place.line - 1);
    prop_assert!(line.is_some(), "{error} is after the last line");
    // One past the line's end is where something is missing.
    let columns = String::from_utf8_lossy(line.unwrap_or_default()).chars().count() + 1;
    prop_assert!((1..=columns).contains(&place.column), "{error}: the line has {columns} columns");
    Ok(())
}

/// Bytes that mean something to TOML, so that damage reaches further than the lexer.
fn telling_byte() -> impl Strategy<Value = u8> {
    prop_oneof![any::<u8>(), prop::sample::select(b"[]{}=.,\"'#\n\r\t _-+0129einfaxX\\\xEF\xC3".to_vec()),]
}

#[test]
fn every_truncation_is_handled() {
    let text = GOOD.replace("one of", "eins von äöü €");
    for length in 0..=text.len() {
        check(&text.as_bytes()[..length]).unwrap();
    }
}

#[test]
fn a_place_outside_the_file_would_be_noticed() {
    let mut error = *parse_bytes(b"x", "x.toml").unwrap_err();
    in_file(b"x", &error).unwrap();
    error.position.as_mut().unwrap().line = 2;
    assert!(in_file(b"x", &error).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn damaged_bytes_are_handled(damage in prop::collection::vec((0..GOOD.len(), telling_byte()), 1..5)) {
        let mut bytes = GOOD.as_bytes().to_vec();
        for (at, byte) in damage {
            bytes[at] = byte;
        }
        check(&bytes)?;
    }

    #[test]
    fn moved_pieces_are_handled(from in 0..GOOD.len(), length in 0..60usize, to in 0..GOOD.len(), cut in any::<bool>()) {
        let mut bytes = GOOD.as_bytes().to_vec();
        let end = (from + length).min(bytes.len());
        let piece = bytes[from..end].to_vec();
        if cut {
            bytes.drain(from..end);
        }
        let to = to.min(bytes.len());
        bytes.splice(to..to, piece);
        check(&bytes)?;
    }

    #[test]
    fn other_values_are_handled(
        line in 0..GOOD.lines().count(),
        value in prop::sample::select(vec![
            "nan", "-inf", "1e999", "-0.0", "1e-320", "[]", "[[]]", "{}", "[{}]", "''", "true", "1979-05-27",
            "[1, 2, 3]", "[0, 0, 0]", "[1e300, 1e300, 1e300]", "-9223372036854775808", "0xFFFFFFFFFFFFFFFFFFFF",
            "\"\"\"\nab\ncd\"\"\"", "\"\\u0000\"", "[\n\n1,\n2,\n3\n]",
        ]),
    ) {
        let text: Vec<String> = GOOD.lines().enumerate().map(|(index, text)| match text.split_once('=') {
            Some((key, _)) if index == line => format!("{key}= {value}"),
            _ => text.to_owned(),
        }).collect();
        check(text.join("\n").as_bytes())?;
    }

    #[test]
    fn noise_is_handled(bytes in prop::collection::vec(telling_byte(), 0..200)) {
        check(&bytes)?;
    }
}
