//! Kinds of screens: more pixels a point, Wayland, none.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use photile::film::Image;
use serde_json::Value;

use super::display::{BINARY, Display, PATIENCE, Window, share_changed, view};
use crate::common;

#[test]
fn at_twice_the_scale_a_picture_still_has_its_pixels() {
    let Some(display) = Display::open() else { return };
    let scene = common::scene_path("gi_ref");
    let args = ["--size", "320x240", "--radius", "0.5", "--photons", "20k", "--passes", "1", "--screenshot", "shot"];
    let program =
        view(&display, &scene, &args).env("DISPLAY", &display.name).env("WINIT_X11_SCALE_FACTOR", "2").spawn().unwrap();
    let mut window = Window::of(&display, program);
    let first = window.converged();
    let lit = first.iter().filter(|pixel| pixel.iter().any(|c| *c > 60)).count();
    assert!(lit * 2 > first.len(), "the room fills the window: {lit} of {} pixels", first.len());
    // The hand is where the mouse is: the sphere right of the middle follows it.
    window.drag("1", [190, 120], [150, 120]);
    window.changed_from(&first);
    window.key("r");
    window.converged();
    window.key("p");
    let shot = display.directory.path().join("shot.exr");
    window.until("screenshot", |_| shot.exists().then_some(()));
    let shot = Image::load(&shot).unwrap();
    assert_eq!((shot.width, shot.height), (320, 240));
    window.quit();
}

#[test]
fn without_opencl_photons_come_from_the_cpu_and_the_title_says_so() {
    let Some(display) = Display::open() else { return };
    let scene = common::scene_path("gi_ref");
    let args = ["--size", "320x240", "--radius", "0.5", "--photons", "5k", "--passes", "1"];
    let program = view(&display, &scene, &args)
        .env("DISPLAY", &display.name)
        .env("OCL_ICD_VENDORS", display.directory.path()) // where no driver is
        .spawn()
        .unwrap();
    let mut window = Window::of(&display, program);
    window.until("title", |w| w.title().contains("photons from the CPU: no OpenCL").then_some(()));
    let picture = window.converged();
    let lit = picture.iter().filter(|pixel| pixel.iter().any(|c| *c > 60)).count();
    assert!(lit * 2 > picture.len(), "the room is lit: {lit} of {} pixels", picture.len());
    window.quit();
}

/// A Wayland compositor in a window of the display, whose mouse and keys it takes.
struct Compositor {
    server: Child,
    directory: tempfile::TempDir,
}

impl Compositor {
    fn open(display: &Display, scale: &str) -> Option<Compositor> {
        let directory = tempfile::tempdir().unwrap();
        let settings = directory.path().join("weston.ini");
        std::fs::write(&settings, "[core]\nidle-time=0\n[shell]\npanel-position=none\nstartup-animation=none\n")
            .unwrap();
        // It draws with OpenGL: weston 10's pixman renderer ended in most runs, in the middle of composing.
        let server = Command::new("weston")
            .args(["--backend=x11-backend.so", "--socket=test", "--width=500", "--height=350"])
            .arg(format!("--scale={scale}"))
            .arg(format!("--config={}", settings.display()))
            .env("XDG_RUNTIME_DIR", directory.path())
            .env("DISPLAY", &display.name)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        match server {
            Ok(server) => Some(Compositor { server, directory }),
            Err(error) => {
                // One more way to a screen: where the compositor is not installed, X11 has been tested all the same.
                eprintln!("SKIPPED: weston: {error}");
                None
            }
        }
    }
}

impl Drop for Compositor {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

#[test]
fn it_runs_on_wayland_at_any_scale() {
    for scale in ["1", "2"] {
        let Some(display) = Display::open() else { return };
        let blank = display.pixels(1000, 700);
        let Some(compositor) = Compositor::open(&display, scale) else { return };
        let socket = compositor.directory.path().join("test");
        let start = Instant::now();
        while !socket.exists() {
            assert!(start.elapsed() < PATIENCE, "weston has no socket");
            std::thread::sleep(Duration::from_millis(20));
        }
        // It takes clients before it has drawn its desktop, which would pass for the picture.
        while share_changed(&blank, &display.pixels(1000, 700)) < 0.05 {
            assert!(start.elapsed() < PATIENCE, "weston has no desktop");
            std::thread::sleep(Duration::from_millis(20));
        }
        let screen = display.xdotool(&["search", "--class", "weston"]);
        display.xdotool(&["windowfocus", screen.lines().next().unwrap_or_default()]);
        let scene = common::scene_path("gi_ref");
        let before = display.pixels(1000, 700);
        let shot = display.directory.path().join("shot.exr");
        let args =
            ["--size", "320x240", "--radius", "0.5", "--photons", "20k", "--passes", "1", "--screenshot", "shot"];
        let mut program = view(&display, &scene, &args)
            .env("XDG_RUNTIME_DIR", compositor.directory.path())
            .env("WAYLAND_DISPLAY", "test")
            .spawn()
            .unwrap();
        // The compositor shows a picture. No title tells when it has all its pixels: P is pressed until a file has them.
        let whole = || Image::load(&shot).is_ok_and(|shot| (shot.width, shot.height) == (320, 240));
        let start = Instant::now();
        while share_changed(&before, &display.pixels(1000, 700)) < 0.05 || !whole() {
            assert!(start.elapsed() < PATIENCE, "scale {scale}: no picture, or no screenshot of it by P");
            if program.try_wait().unwrap().is_some() {
                let out = program.wait_with_output().unwrap();
                panic!("scale {scale}: it ended, {}: {}", out.status, String::from_utf8_lossy(&out.stderr));
            }
            std::thread::sleep(Duration::from_millis(500));
            display.xdotool(&["key", "p"]);
        }
        display.xdotool(&["key", "Escape"]);
        let out = program.wait_with_output().unwrap();
        assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stderr));
        let summary: Value = serde_json::from_slice(&out.stdout).unwrap();
        assert_eq!((&summary["gl_objects_left"], &summary["cl_objects_left"]), (&0.into(), &0.into()), "{summary}");
    }
}

#[test]
fn without_a_display_it_says_so() {
    let scene = common::scene_path("gi_ref");
    let out = Command::new(BINARY)
        .arg("view")
        .arg(&scene)
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .output()
        .unwrap();
    assert_eq!(out.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&out.stderr).contains("display"), "{}", String::from_utf8_lossy(&out.stderr));
    let out = Command::new(BINARY).arg("view").arg(&scene).args(["--script", "/nowhere.toml"]).output().unwrap();
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains("/nowhere.toml"));
}
