//! The window: a display that is not there, another one, one that goes away; edits that were not saved.

use std::io::Read as _;
use std::path::Path;
use std::process::{Child, Stdio};

use photile::scene;
use photile::settings::LightMode;
use serde_json::Value;

use super::{ends, gi_ref, photile, send, text, until};
use crate::window::display::Display;

/// A window of a room of its own, which is there, and whose light somebody has changed.
fn edited(display: &Display, folder: &Path) -> Child {
    std::fs::copy(gi_ref(), folder.join("room.toml")).unwrap();
    let arguments = ["view", "room.toml", "--size", "160x120", "--photons", "2k", "--record", "path.toml", "--json"];
    let mut command = photile(folder, &arguments);
    // A variable of a session that has ended, beside a display that works.
    command.env("DISPLAY", &display.name).env("WAYLAND_DISPLAY", "wayland-of-a-session-that-ended");
    let program = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    until("window", || !display.xdotool(&["search", "--name", "Photile"]).is_empty());
    let id = display.xdotool(&["search", "--name", "Photile"]).lines().next().unwrap().to_owned();
    display.xdotool(&["windowfocus", &id]);
    until("edits beside the scene", || {
        // A press may come before the window has the focus.
        display.xdotool(&["key", "l"]);
        std::thread::sleep(std::time::Duration::from_millis(1500));
        folder.join("room.unsaved.toml").exists()
    });
    until("recorded path", || folder.join("path.toml").exists());
    program
}

fn light(path: &Path) -> Option<LightMode> {
    scene::load(path).unwrap().render.light
}

#[test]
fn a_window_that_a_signal_closes_keeps_edits_and_path() {
    let Some(display) = Display::open() else { return };
    let folder = tempfile::tempdir().unwrap();
    let program = edited(&display, folder.path());
    send("TERM", &program);
    let output = program.wait_with_output().unwrap();
    ends(&output, 1, &["SIGTERM", "interrupted; room.unsaved.toml has the edits"]);
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&summary["interrupted"], &summary["unsaved"]), (&true.into(), &"room.unsaved.toml".into()));
    let [saved, unsaved] = ["room.toml", "room.unsaved.toml"].map(|name| light(&folder.path().join(name)));
    assert!(unsaved.is_some() && saved != unsaved, "{saved:?} {unsaved:?}");
    assert!(photile::window::script::Script::load(&folder.path().join("path.toml")).is_ok());
}

#[test]
fn a_display_that_goes_away_takes_no_edits_with_it() {
    let Some(display) = Display::open() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut program = edited(&display, folder.path());
    drop(display);
    let mut status = None;
    until("end", || {
        status = program.try_wait().unwrap();
        status.is_some()
    });
    let mut said = String::new();
    program.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!(status.unwrap().code(), Some(1), "{said}");
    assert!(light(&folder.path().join("room.unsaved.toml")).is_some());
    assert!(photile::window::script::Script::load(&folder.path().join("path.toml")).is_ok());
    // The next one says so, whatever becomes of it.
    let mut next = photile(folder.path(), &["view", "room.toml"]);
    next.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    ends(&next.output().unwrap(), 1, &["room.unsaved.toml has the edits of a window that ended early"]);
}

#[test]
fn without_a_display_it_says_so_and_names_no_place_of_its_own_making() {
    let folder = tempfile::tempdir().unwrap();
    let scene = gi_ref();
    for (wayland, x11) in [("", ""), ("wayland-none", ""), ("", ":4095"), ("wayland-none", ":4095")] {
        let mut command = photile(folder.path(), &["view", &scene]);
        let output = command.env("WAYLAND_DISPLAY", wayland).env("DISPLAY", x11).output().unwrap();
        ends(&output, 1, &["window: no display", "X11 or Wayland is needed"]);
        let said = text(&output.stderr);
        assert!(!said.contains(".rs") && !said.contains("registry"), "{said}");
    }
}
