//! What is shown at rest, and what is written: the pictures of a render without a window.

use std::process::Command;

use photile::film::Image;

use super::display::{BINARY, Display, Window, share_changed};
use crate::common;

/// Opens a window with these options, waits until it has converged, presses P, and renders the same without a window.
fn shot_and_rendered(options: &[&str], passes: &str) -> Option<[Image; 2]> {
    let display = Display::open()?;
    let scene = common::scene_path("gi_two_lights");
    let shared = ["--size", "320x240", "--backend", "opengl", "--passes", passes];
    let mut window = Window::start(&display, &scene, &[&shared[..], options, &["--screenshot", "shot"]].concat());
    window.converged();
    window.key("p");
    let shot = display.directory.path().join("shot.exr");
    window.until("screenshot", |_| shot.exists().then_some(()));
    window.quit();
    let headless = display.directory.path().join("headless.exr");
    let rendered =
        Command::new(BINARY).arg("render").arg(&scene).args(shared).args(options).arg("-o").arg(&headless).output();
    let rendered = rendered.unwrap();
    assert!(rendered.status.success(), "{}", String::from_utf8_lossy(&rendered.stderr));
    Some([Image::load(&shot).unwrap(), Image::load(&headless).unwrap()])
}

#[test]
fn a_screenshot_is_the_headless_picture() {
    // The same program on the same driver: the same bits. Ten passes: every replicate has one, some have two.
    for (options, passes) in [
        ("", "10"), // final gathering
        ("--technique map --photons 20k", "2"),
        ("--gather tiles --radius 0.5 --photons 20k --spp 2", "1"),
        ("--light direct", "9"),
    ] {
        let options: Vec<&str> = options.split_whitespace().collect();
        let Some([shot, headless]) = shot_and_rendered(&options, passes) else { return };
        let apart = shot.pixels.iter().zip(&headless.pixels).filter(|(a, b)| a != b).count();
        assert!(shot == headless, "{options:?}: {apart} pixels differ");
    }
}

#[test]
fn at_rest_it_refines_to_the_converged_picture() {
    let Some(display) = Display::open() else { return };
    let scene = common::scene_path("gi_ref");
    let mut window = Window::start(&display, &scene, &["--size", "320x240", "--passes", "16"]);
    let refined = window.converged();
    // It is what 16 passes without a window give, on another backend.
    let rendered = display.directory.path().join("rendered.png");
    let args = ["--size", "320x240", "--passes", "16", "--backend", "opencl"];
    let out = Command::new(BINARY).arg("render").arg(&scene).args(args).arg("-o").arg(&rendered).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let rendered: Vec<[u8; 3]> = shown(&Image::load(&rendered).unwrap());
    assert!(share_changed(&refined, &rendered) < 0.002, "{}", share_changed(&refined, &rendered));
    // A turn is drawn at once, coarsely, and then refined again.
    window.drag("1", [20, 220], [60, 210]);
    window.changed_from(&refined);
    let turned = window.converged();
    window.key("space");
    window.until("pause", |w| w.title().contains("paused").then_some(()));
    assert!(share_changed(&turned, &window.pixels()) < 0.002, "a pause keeps what is there");
    window.key("space");
    window.key("r");
    window.changed_from(&turned);
    let again = window.converged();
    assert_eq!(share_changed(&refined, &again), 0.0, "the same passes, the same picture");
    window.quit();
}

/// As a display shows it, eight bits a channel.
fn shown(image: &Image) -> Vec<[u8; 3]> {
    image.pixels.iter().map(|pixel| pixel.map(|c| (photile::film::display_value(c) * 255.0).round() as u8)).collect()
}
