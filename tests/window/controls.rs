//! Mouse and keys: each does what the help says.

use std::time::Duration;

use photile::film::Image;

use super::display::{Display, Window, share_changed};
use crate::common;

#[test]
fn it_opens_soon_follows_the_hand_and_leaves_nothing_behind() {
    let Some(display) = Display::open() else { return };
    let scene = common::scene_path("gi_ref");
    let mut window = Window::open(&display, &scene, &["--passes", "1"]);
    let first = window.converged();
    let lit = first.iter().filter(|pixel| pixel.iter().any(|c| *c > 60)).count();
    assert!(lit * 2 > first.len(), "the room is lit: {lit} of {} pixels", first.len());

    window.drag("1", [20, 220], [80, 200]);
    window.changed_from(&first);
    let turned = window.converged();
    window.key("r");
    window.until("the first picture again", |w| (share_changed(&first, &w.pixels()) < 0.01).then_some(()));
    for (button, what) in [("2", "pan"), ("3", "look around")] {
        window.drag(button, [160, 200], [190, 190]);
        window.changed_from(&first);
        println!("{what}: moved");
        window.key("r");
        window.converged();
    }
    display.xdotool(&["mousemove", "160", "120", "click", "4"]);
    window.changed_from(&first);
    window.key("r");
    window.converged();
    display.xdotool(&["keydown", "w"]);
    std::thread::sleep(Duration::from_millis(300));
    display.xdotool(&["keyup", "w"]);
    window.changed_from(&first);
    assert!(share_changed(&turned, &first) > 0.02, "two views, two pictures");

    display.xdotool(&["windowsize", "--sync", &window.id, "400", "300"]);
    (window.width, window.height) = (400, 300);
    window.converged();
    let resized = window.pixels();
    let corner: Vec<_> = (0..300).map(|y| resized[y * 400 + 399]).collect();
    assert!(corner.iter().filter(|p| p.iter().any(|c| *c > 40)).count() > 150, "the picture fills the window");

    // Hidden and shown again, it is painted again.
    display.xdotool(&["windowunmap", "--sync", &window.id]);
    window.until("empty screen", |w| (share_changed(&resized, &w.pixels()) > 0.5).then_some(()));
    display.xdotool(&["windowmap", "--sync", &window.id]);
    window.until("picture again", |w| (share_changed(&resized, &w.pixels()) < 0.01).then_some(()));
    display.xdotool(&["windowfocus", &window.id]);

    let mut soonest = window.quit()["first_image_ms"].as_f64().unwrap();
    if soonest > 2000.0 {
        // Another program may have had the machine: once more.
        let mut window = Window::open(&display, &scene, &["--passes", "1"]);
        window.converged();
        soonest = window.quit()["first_image_ms"].as_f64().unwrap().min(soonest);
    }
    assert!(soonest <= 2000.0, "the first picture takes {soonest} ms");
}

#[test]
fn every_key_does_what_the_help_says() {
    let Some(display) = Display::open() else { return };
    let args = ["--passes", "1", "--screenshot", "shot", "--photons", "500"];
    let mut window = Window::open(&display, &common::scene_path("gi_ref"), &args);
    let first = window.converged();
    // What shows at once in the picture, and goes again.
    for key in ["F1", "Tab", "o", "l"] {
        window.key_that_changes(key, &first);
        let presses = match key {
            "o" => 3,
            "l" => 2,
            _ => 1,
        };
        for _ in 0..presses {
            window.key(key);
        }
        let what = format!("the picture as before {key}");
        window.until(&what, |w| (share_changed(&first, &w.pixels()) < 0.01).then_some(()));
    }
    for key in ["2", "3", "4", "5", "1"] {
        window.key(key);
        let picture = window.converged();
        // The gathers estimate the same; k nearest photons of a small map are another estimate.
        let apart = share_changed(&first, &picture);
        assert!(apart < if key == "4" { 0.5 } else { 0.02 }, "gather {key}: {apart}");
    }
    for backend in ["opencl", "cpu", "opengl"] {
        window.key("b");
        window.until(backend, |w| w.title().contains(backend).then_some(()));
        let picture = window.converged();
        assert!(share_changed(&first, &picture) < 0.02, "{backend} shows the same room");
    }
    window.key("space");
    window.until("pause", |w| w.title().contains("paused").then_some(()));
    window.key("space");
    window.key("t");
    window.until("white divider", |w| {
        let divider = (0..240).filter(|y| w.pixels()[y * 320 + 160] == [255; 3]).count();
        (divider == 240).then_some(())
    });
    window.drag("1", [160, 20], [80, 20]);
    window.until("divider elsewhere", |w| (0..240).all(|y| w.pixels()[y * 320 + 80] == [255; 3]).then_some(()));
    window.key("h");
    // Two backends agree, so their difference is dark.
    window.until("heat map", |w| {
        let dark = w.pixels().iter().filter(|p| p.iter().all(|c| *c < 130)).count();
        (dark * 10 > 9 * 320 * 240).then_some(())
    });
    window.key("h");
    window.key("t");
    window.key("f");
    window.changed_from(&first);
    window.key("r");
    window.key("k");
    std::thread::sleep(Duration::from_millis(500));
    window.key("k");
    window.key("p");
    window.until("screenshot", |w| w.display.directory.path().join("shot.exr").exists().then_some(()));
    assert!(Image::load(&display.directory.path().join("shot.png")).is_ok());
    assert!(display.directory.path().join("gi_ref.path.toml").exists());
    let summary = window.quit();
    let done = summary["actions"].as_array().unwrap().iter().map(|a| a.as_str().unwrap()).collect::<Vec<_>>();
    for action in [
        "Gather(Grid)",
        "Gather(Tiles)",
        "Gather(TiledGrid)",
        "Gather(Knn)",
        "Gather(Brute)",
        "Backend",
        "Light",
        "Pause",
        "Screenshot",
        "Split",
        "HeatMap",
        "Focus",
        "Reset",
        "Markers",
        "Record",
        "Panel",
        "Help",
        "Quit",
    ] {
        assert!(done.contains(&action), "no key did {action}: {done:?}");
    }
}
