//! The window itself, in a display without a screen (Xvfb), with a hand on mouse and keyboard (xdotool). The tests see
//! what a person would: pixels, titles, files; and the summary that the program prints when it closes.
//!
//! Without Xvfb or xdotool they are skipped; with PHOTILE_REQUIRE_DRIVERS=1, as in CI, they fail instead.

mod common;

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use photile::film::Image;
use serde_json::Value;

const BINARY: &str = env!("CARGO_BIN_EXE_photile");
/// Longer than anything takes on a busy machine; a test that waits so long has failed.
const PATIENCE: Duration = Duration::from_secs(40);

/// A display of its own, whose pixels lie in a file.
struct Display {
    server: Child,
    name: String,
    directory: tempfile::TempDir,
    /// One window at a time: software drivers are slow enough.
    _alone: MutexGuard<'static, ()>,
}

impl Display {
    fn open() -> Option<Display> {
        static ALONE: Mutex<()> = Mutex::new(());
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let directory = tempfile::tempdir().unwrap();
        let found = Command::new("xdotool").arg("version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        if let Err(error) = found {
            common::missing("xdotool", &error);
            return None;
        }
        // The server names a free display by itself.
        let server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1100x800x24", "-fbdir"])
            .arg(directory.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let mut server = match server {
            Ok(server) => server,
            Err(error) => {
                common::missing("Xvfb", &error);
                return None;
            }
        };
        let mut number = Vec::new();
        let out = server.stdout.as_mut().unwrap();
        let mut byte = [0];
        while out.read(&mut byte).unwrap() == 1 && byte[0] != b'\n' {
            number.push(byte[0]);
        }
        let name = format!(":{}", String::from_utf8(number).unwrap());
        let display = Display { server, name, directory, _alone: alone };
        // It has a number before it takes connections.
        let start = Instant::now();
        while display.xdotool(&["getmouselocation"]).is_empty() {
            assert!(start.elapsed() < PATIENCE, "Xvfb takes no connections");
            std::thread::sleep(Duration::from_millis(20));
        }
        Some(display)
    }

    /// Pixels of the screen from its top left corner, three bytes each: an XWD file that the server keeps up to date.
    fn pixels(&self, width: usize, height: usize) -> Vec<[u8; 3]> {
        let file = std::fs::read(self.directory.path().join("Xvfb_screen0")).unwrap();
        let word = |i: usize| u32::from_be_bytes(file[4 * i..4 * i + 4].try_into().unwrap()) as usize;
        let (header, line, colors) = (word(0), word(12), word(19));
        let pixel = |x: usize, y: usize| {
            let at = header + 12 * colors + y * line + 4 * x;
            [file[at + 2], file[at + 1], file[at]]
        };
        (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect()
    }

    fn xdotool(&self, args: &[&str]) -> String {
        let out = Command::new("xdotool").args(args).env("DISPLAY", &self.name).output().unwrap();
        String::from_utf8_lossy(&out.stdout).trim().to_owned()
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// A running program and its window.
struct Window<'a> {
    display: &'a Display,
    program: Child,
    id: String,
    width: usize,
    height: usize,
}

impl<'a> Window<'a> {
    /// Opens a scene of 320 × 240 pixels, refined by density estimates of few photons.
    fn open(display: &'a Display, scene: &Path, args: &[&str]) -> Window<'a> {
        // Brute force asks every photon at every pixel: a test that shows it takes few.
        let photons: &[&str] = if args.contains(&"--photons") { &[] } else { &["--photons", "20k"] };
        Window::start(display, scene, &[&["--size", "320x240", "--radius", "0.5"], photons, args].concat())
    }

    /// Opens a scene with nothing but these options, without a panel.
    fn start(display: &'a Display, scene: &Path, args: &[&str]) -> Window<'a> {
        let program = Command::new(BINARY)
            .arg("view")
            .arg(scene)
            .args(["--json", "--no-panel"])
            .args(args)
            .current_dir(display.directory.path())
            .env("DISPLAY", &display.name)
            .env_remove("WAYLAND_DISPLAY")
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut window = Window { display, program, id: String::new(), width: 320, height: 240 };
        window.until("a window", |w| {
            let found = w.display.xdotool(&["search", "--name", "Photile"]);
            let id = found.lines().next().unwrap_or_default().to_owned();
            (!id.is_empty()).then_some(id)
        });
        window.id = display.xdotool(&["search", "--name", "Photile"]).lines().next().unwrap().to_owned();
        display.xdotool(&["windowmove", &window.id, "0", "0"]);
        display.xdotool(&["windowfocus", &window.id]);
        window
    }

    /// Waits for something to be there.
    #[track_caller]
    fn until<T>(&mut self, what: &str, mut look: impl FnMut(&Window) -> Option<T>) -> T {
        let start = Instant::now();
        loop {
            if let Some(found) = look(self) {
                return found;
            }
            if let Some(status) = self.program.try_wait().unwrap() {
                let mut err = String::new();
                self.program.stderr.take().unwrap().read_to_string(&mut err).unwrap();
                panic!("ended ({status}) before {what}: {err}");
            }
            assert!(start.elapsed() < PATIENCE, "no {what} after {PATIENCE:?}; title: {}", self.title());
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn title(&self) -> String {
        self.display.xdotool(&["getwindowname", &self.id])
    }

    #[track_caller]
    fn converged(&mut self) -> Vec<[u8; 3]> {
        // A request needs a moment to be on its way; until then the title tells of the last one.
        std::thread::sleep(Duration::from_millis(250));
        self.until("converged picture", |w| w.title().contains("converged").then_some(()));
        self.pixels()
    }

    fn pixels(&self) -> Vec<[u8; 3]> {
        self.display.pixels(self.width, self.height)
    }

    #[track_caller]
    fn changed_from(&mut self, before: &[[u8; 3]]) {
        self.until("change in the picture", |w| (share_changed(before, &w.pixels()) > 0.02).then_some(()));
    }

    fn key(&self, key: &str) {
        self.display.xdotool(&["key", key]);
    }

    fn drag(&self, button: &str, from: [i32; 2], to: [i32; 2]) {
        let [x, y, u, v] = [from[0], from[1], to[0], to[1]].map(|n| n.to_string());
        let [mid_x, mid_y] = [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2].map(|n| n.to_string());
        for step in [
            &["mousemove", &x, &y][..],
            &["mousedown", button],
            &["mousemove", &mid_x, &mid_y],
            &["mousemove", &u, &v],
            &["mouseup", button],
        ] {
            self.display.xdotool(step);
        }
    }

    /// Quits by key and takes the summary; nothing may be left behind.
    #[track_caller]
    fn quit(mut self) -> Value {
        self.key("Escape");
        let start = Instant::now();
        let status = loop {
            if let Some(status) = self.program.try_wait().unwrap() {
                break status;
            }
            assert!(start.elapsed() < PATIENCE, "Escape does not close the window");
            std::thread::sleep(Duration::from_millis(20));
        };
        let (mut out, mut err) = (String::new(), String::new());
        self.program.stdout.take().unwrap().read_to_string(&mut out).unwrap();
        self.program.stderr.take().unwrap().read_to_string(&mut err).unwrap();
        assert_eq!(status.code(), Some(0), "{err}");
        let summary: Value = serde_json::from_str(&out).unwrap_or_else(|error| panic!("{error}: {out}{err}"));
        assert_eq!((&summary["gl_objects_left"], &summary["cl_objects_left"]), (&0.into(), &0.into()), "{out}");
        println!(
            "first image after {} ms, longest event {} ms",
            summary["first_image_ms"], summary["longest_event_ms"]
        );
        summary
    }
}

impl Drop for Window<'_> {
    fn drop(&mut self) {
        let _ = self.program.kill(); // it has ended already, unless a test failed
        let _ = self.program.wait();
    }
}

/// Share of pixels that differ visibly.
fn share_changed(a: &[[u8; 3]], b: &[[u8; 3]]) -> f64 {
    assert_eq!(a.len(), b.len());
    let differs = |(a, b): (&[u8; 3], &[u8; 3])| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > 12);
    a.iter().zip(b).filter(|pair| differs(*pair)).count() as f64 / a.len() as f64
}

fn copied(display: &Display, name: &str) -> PathBuf {
    let path = display.directory.path().join(format!("{name}.toml"));
    std::fs::copy(common::scene_path(name), &path).unwrap();
    path
}

#[test]
fn the_comparator_sees_a_difference() {
    let black = vec![[0u8; 3]; 100];
    let mut other = black.clone();
    assert_eq!(share_changed(&black, &other), 0.0);
    other[7] = [0, 40, 0];
    assert_eq!(share_changed(&black, &other), 0.01);
}

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
        window.key(key);
        window.changed_from(&first);
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

/// Opens a window with these options, waits until it has converged, presses P, and renders the same without a window.
fn shot_and_rendered(options: &[&str], passes: &str) -> Option<[Image; 2]> {
    let display = Display::open()?;
    let scene = common::scene_path("gi_two_lights");
    let shared = ["--size", "320x240", "--backend", "opengl", "--passes", passes];
    let mut window = Window::start(&display, &scene, &[&shared, options, &["--screenshot", "shot"]].concat());
    window.converged();
    window.key("p");
    let shot = display.directory.path().join("shot.exr");
    window.until("screenshot", |_| shot.exists().then_some(()));
    let summary = window.quit();
    assert_eq!(summary["written"].as_array().map(Vec::len), Some(2), "PNG and EXR: {summary}");
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
        (&[][..], "10"), // final gathering
        (&["--technique", "map", "--photons", "20k"], "2"),
        (&["--gather", "tiles", "--radius", "0.5", "--photons", "20k", "--spp", "2"], "1"),
        (&["--light", "direct"], "9"),
    ] {
        let Some([shot, headless]) = shot_and_rendered(options, passes) else { return };
        let apart = shot.pixels.iter().zip(&headless.pixels).filter(|(a, b)| a != b).count();
        assert!(shot == headless, "{options:?}: {apart} pixels differ");
    }
}

#[test]
fn at_rest_it_refines_to_the_converged_picture() {
    let Some(display) = Display::open() else { return };
    let scene = common::scene_path("gi_ref");
    let mut window = Window::start(&display, &scene, &["--size", "320x240", "--passes", "100"]);
    let refined = window.converged();
    // It is what 100 passes without a window give, and that is nearer to the reference than what moves.
    let rendered = display.directory.path().join("rendered.png");
    let args = ["--size", "320x240", "--passes", "100", "--backend", "opencl"];
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
    assert!(scene.spheres[0].center.x < before.spheres[0].center.x - 0.5, "{:?}", scene.spheres[0]);
    assert_eq!(scene.spheres[1], before.spheres[1]);
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

#[test]
fn scripts_run_in_a_window_and_without() {
    let Some(display) = Display::open() else { return };
    let script = display.directory.path().join("path.toml");
    let keys = "step = 0.1\n[[keys]]\ntime = 0\nposition = [0, 0, 1]\nlook_at = [0, 0, 0]\n\
                [[keys]]\ntime = 2.9\nposition = [0.5, 0, 0]\nlook_at = [0, 0, -5]\nlight = [1, 2, -7]\n";
    std::fs::write(&script, keys).unwrap();
    let scene = common::scene_path("gi_ref");
    for headless in [false, true] {
        let mut command = Command::new(BINARY);
        command.arg("view").arg(&scene).arg("--script").arg(&script);
        command.args(["--json", "--size", "160x120", "--photons", "5k", "--no-panel"]);
        if headless {
            command.arg("--headless").env_remove("DISPLAY");
        } else {
            command.env("DISPLAY", &display.name);
        }
        let out = command.env_remove("WAYLAND_DISPLAY").output().unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let summary: Value = serde_json::from_slice(&out.stdout).unwrap();
        let replayed = if headless { &summary } else { &summary["replayed"] };
        assert_eq!(replayed["frame_ms"]["frames"], 30, "{summary}");
        let [p50, p99] = ["p50", "p99"].map(|p| replayed["frame_ms"][p].as_f64().unwrap());
        assert!(p50 > 0.0 && p99 >= p50, "{summary}");
        for objects in ["gl_objects", "cl_objects"] {
            assert!(replayed[objects][0].as_i64() >= Some(1), "{summary}");
        }
        // The grid's capacity may grow with a photon more; textures and programs may not.
        assert_eq!(replayed["gl_objects"][0], replayed["gl_objects"][1], "{summary}");
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
