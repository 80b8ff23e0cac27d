//! The scene file: read again, told of, and written.

use std::path::PathBuf;
use std::time::Duration;

use super::display::{Display, Window, share_changed};
use crate::common;

fn copied(display: &Display, name: &str) -> PathBuf {
    let path = display.directory.path().join(format!("{name}.toml"));
    std::fs::copy(common::scene_path(name), &path).unwrap();
    path
}

#[test]
fn the_file_is_read_again_errors_are_told_and_edits_saved() {
    let Some(display) = Display::open() else { return };
    let path = copied(&display, "gi_ref");
    let text = std::fs::read_to_string(&path).unwrap();
    let mut window = Window::open(&display, &path, &["--passes", "1"]);
    let first = window.converged();
    std::fs::write(&path, text.replace("color = [1.0, 0.2, 0.2]", "color = [0.1, 0.1, 1.0]")).unwrap();
    window.changed_from(&first);
    let blue = window.converged();

    std::fs::write(&path, text.replace("radius = 1.0", "radius = -1.0")).unwrap();
    std::thread::sleep(Duration::from_secs(1));
    assert!(share_changed(&blue, &window.pixels()) < 0.01, "the last good scene stays");
    std::fs::write(&path, &text).unwrap();
    window.until("the good scene again", |w| (share_changed(&first, &w.pixels()) < 0.01).then_some(()));
    window.converged();

    // The sphere at (1, 0, −7) of radius 1 appears in the middle of the height, right of the middle.
    window.drag("1", [190, 120], [150, 120]);
    window.changed_from(&first);
    window.key("ctrl+s");
    window.until("saved file", |_| (std::fs::read_to_string(&path).unwrap() != text).then_some(()));
    let saved = std::fs::read_to_string(&path).unwrap();
    let scene = photile::scene::parse(&saved, "saved.toml").unwrap();
    let before = photile::scene::parse(&text, "saved.toml").unwrap();
    assert!(
        scene.shapes.spheres[0].center.x < before.shapes.spheres[0].center.x - 0.5,
        "{:?}",
        scene.shapes.spheres[0]
    );
    assert_eq!(scene.shapes.spheres[1], before.shapes.spheres[1]);
    for comment in text.lines().filter(|line| line.starts_with('#')) {
        assert!(saved.contains(comment), "{comment} is lost");
    }
    let summary = window.quit();
    assert_eq!(summary["reloads"], 2, "{summary}");
    let errors = summary["file_errors"].as_array().unwrap();
    let line = text.lines().position(|line| line == "radius = 1.0").unwrap() + 1;
    let place = format!("gi_ref.toml:{line}:10: found radius = -1.0");
    assert!(errors.len() == 1 && errors[0].as_str().unwrap().contains(&place), "{errors:?}");
}
