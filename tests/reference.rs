//! The reference renderer against images that another program made: its own errors must explain what is between them.

#[cfg(unix)]
use std::io::{BufRead, BufReader, Read};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
#[cfg(unix)]
use std::process::{Command, Stdio};

use glam::DVec3;
use photile::film::Image;
use photile::reference::agreement::{Agreement, Measured, compare};
use photile::reference::{Reference, ReferenceLight, ReferenceSettings, render};
use photile::scene::{self, Scene};

/// Golden pixels, along each axis, to one of ours: with a box filter both then have the same expectation.
const BOX: u32 = 4;

/// Noise of the full images as the golden images' README states it: mean((a−m)²/(m²+0.01)).
const FLOORS: [(&str, f64); 4] =
    [("gi_ref", 2.3e-6), ("gi_two_lights", 2.0e-6), ("sphere_and_plane", 8.3e-7), ("color_bleeding", 1.1e-6)];

/// The same of the direct images.
const DIRECT_FLOOR: f64 = 1e-7;

/// Relative difference of a golden image's mean to the same tracer without its irradiance texels, from the same README:
/// what pixels have in common does not average out.
const COMMON: f64 = 4e-5;

/// An image shrunk to 80×60, its pixels' errors and that of its mean.
struct Golden {
    values: Vec<DVec3>,
    errors: Vec<DVec3>,
    overall_error: DVec3,
}

fn path(relative: String) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(relative)
}

fn golden(name: &str, floor: f64) -> Golden {
    let image = Image::load(&path(format!("tests/golden/{name}.exr"))).unwrap();
    assert_eq!((image.width, image.height), (320, 240), "{name}");
    let (width, height) = (image.width / BOX, image.height / BOX);
    let inside = || (0..BOX).flat_map(|y| (0..BOX).map(move |x| (x, y)));
    let mean = |x: u32, y: u32| -> DVec3 {
        let values = inside().map(|(i, j)| DVec3::from(image.at(x * BOX + i, y * BOX + j).map(f64::from)));
        values.sum::<DVec3>() / f64::from(BOX * BOX)
    };
    let values: Vec<_> = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| mean(x, y)).collect();
    let scale = (floor / f64::from(BOX * BOX)).sqrt();
    let errors: Vec<_> = values.iter().map(|v| (v * v + 0.01).map(f64::sqrt) * scale).collect();
    let count = values.len() as f64;
    let by_pixel = errors.iter().map(|e| e * e).sum::<DVec3>().map(f64::sqrt) / count;
    let in_common = values.iter().sum::<DVec3>() / count * COMMON;
    Golden { overall_error: (by_pixel * by_pixel + in_common * in_common).map(f64::sqrt), values, errors }
}

fn rendered(scene: &Scene, light: ReferenceLight) -> Reference {
    let settings = ReferenceSettings { size: (320 / BOX, 240 / BOX), light, spp: Some(64), ..Default::default() };
    render(scene, &settings, &mut |_| ControlFlow::Continue(())).unwrap()
}

fn judge(image: &Reference, golden: &Golden) -> Agreement {
    let golden = Measured { values: &golden.values, errors: &golden.errors, overall_error: golden.overall_error };
    compare(image.into(), golden)
}

fn load(name: &str) -> Scene {
    scene::load(&path(format!("scenes/{name}.toml"))).unwrap()
}

#[test]
fn all_light_is_that_of_the_golden_images() {
    for (name, floor) in FLOORS {
        let agreement = judge(&rendered(&load(name), ReferenceLight::Full), &golden(name, floor));
        assert!(agreement.mostly_holds(), "{name}: {agreement:?}");
    }
}

#[test]
fn direct_light_is_that_of_the_golden_images() {
    for (name, _) in FLOORS {
        let golden = golden(&format!("{name}_direct"), DIRECT_FLOOR);
        let agreement = judge(&rendered(&load(name), ReferenceLight::Direct), &golden);
        assert!(agreement.mostly_holds(), "{name}: {agreement:?}");
    }
}

/// Lights 2% too strong are seen at the same low cost: by 10 to 300 standard errors of the mean.
#[test]
fn light_that_is_too_strong_is_flagged() {
    for (name, floor) in [FLOORS[0], FLOORS[2]] {
        let mut scene = load(name);
        scene.lights.points.iter_mut().for_each(|light| light.intensity *= 1.02);
        let full = judge(&rendered(&scene, ReferenceLight::Full), &golden(name, floor));
        assert!(!full.means_hold(), "{name}: {full:?}");
        let golden = golden(&format!("{name}_direct"), DIRECT_FLOOR);
        let direct = judge(&rendered(&scene, ReferenceLight::Direct), &golden);
        assert!(!direct.means_hold() && direct.outliers > 0.3, "{name}: {direct:?}");
    }
}

/// A sphere 14 cm from its place, 2% of the room's width, hardly changes the mean, but many pixels.
#[test]
fn a_sphere_out_of_place_is_flagged() {
    let mut scene = load("gi_ref");
    scene.shapes.spheres[0].center.x += 0.14;
    let agreement = judge(&rendered(&scene, ReferenceLight::Direct), &golden("gi_ref_direct", DIRECT_FLOOR));
    assert!(!agreement.mostly_holds() && agreement.outliers > 0.04, "{agreement:?}"); // in its place: 0.005
}

/// Ctrl-C keeps the sums, says how to go on and fails; going on gives the bytes of a render that nobody stopped.
#[cfg(unix)]
#[test]
fn an_interrupted_render_goes_on_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let photile = |output: &str, spp: &str, further: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_photile"));
        command.args(["reference", "--size", "160x120", "--json", "--spp", spp, "-o", output]).args(further);
        command.arg(path("scenes/gi_ref.toml".into())).current_dir(&folder);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    let mut running = photile("part.exr", "1000000", &["--checkpoint", "sums"]).spawn().unwrap();
    let mut stderr = BufReader::new(running.stderr.take().unwrap());
    let mut said = String::new();
    while !said.contains("Ctrl-C") {
        assert!(stderr.read_line(&mut said).unwrap() > 0, "ended before it was stopped: {said}");
    }
    // The shell's own kill: the program of that name is no part of a minimal system.
    let kill = Command::new("sh").args(["-c", &format!("kill -INT {}", running.id())]).status().unwrap();
    assert!(kill.success());
    stderr.read_to_string(&mut said).unwrap();
    assert_eq!(running.wait().unwrap().code(), Some(1), "{said}");
    assert!(said.contains("interrupted after") && said.contains("go on with --checkpoint sums"), "{said}");

    let done = |mut command: Command| {
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!((&report["spp"], &report["interrupted"]), (&24.into(), &false.into()));
    };
    done(photile("part.exr", "24", &["--checkpoint", "sums", "--threads", "1"]));
    done(photile("whole.exr", "24", &[]));
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert!(bytes("part.exr") == bytes("whole.exr"));

    // For another seed the sums are bad input.
    let refused = photile("other.exr", "24", &["--checkpoint", "sums"]).args(["--seed", "1"]).output().unwrap();
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("sums: found 160x120 pixels after 24 samples each"));
}
