//! A display without a screen, a window in it, and a hand on its mouse and keys.

use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::common;

pub const BINARY: &str = env!("CARGO_BIN_EXE_photile");
/// Longer than anything takes on a busy machine; a test that waits so long has failed.
pub const PATIENCE: Duration = Duration::from_secs(40);

/// A display of its own, whose pixels lie in a file.
pub struct Display {
    server: Child,
    pub name: String,
    pub directory: tempfile::TempDir,
    /// One window at a time: software drivers are slow enough.
    _alone: MutexGuard<'static, ()>,
}

impl Display {
    pub fn open() -> Option<Display> {
        static ALONE: Mutex<()> = Mutex::new(());
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let directory = tempfile::tempdir().unwrap();
        let found = Command::new("xdotool").arg("version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        if let Err(error) = found {
            common::missing("xdotool", &error);
            return None;
        }
        // The server names a free display by itself. Without -noreset it begins anew when its last client goes, as each
        // xdotool does, and refuses whoever comes just then.
        let server = Command::new("Xvfb")
            .args(["-noreset", "-displayfd", "1", "-screen", "0", "1100x800x24", "-fbdir"])
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
    pub fn pixels(&self, width: usize, height: usize) -> Vec<[u8; 3]> {
        let file = std::fs::read(self.directory.path().join("Xvfb_screen0")).unwrap();
        let word = |i: usize| u32::from_be_bytes(file[4 * i..4 * i + 4].try_into().unwrap()) as usize;
        let (header, line, colors) = (word(0), word(12), word(19));
        let pixel = |x: usize, y: usize| {
            let at = header + 12 * colors + y * line + 4 * x;
            [file[at + 2], file[at + 1], file[at]]
        };
        (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect()
    }

    pub fn xdotool(&self, args: &[&str]) -> String {
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
pub struct Window<'a> {
    pub display: &'a Display,
    program: Child,
    pub id: String,
    pub width: usize,
    pub height: usize,
}

impl<'a> Window<'a> {
    /// Opens a scene of 320 × 240 pixels, refined by density estimates of few photons.
    pub fn open(display: &'a Display, scene: &Path, args: &[&str]) -> Window<'a> {
        // Brute force asks every photon at every pixel: a test that shows it takes few.
        let photons: &[&str] = if args.contains(&"--photons") { &[] } else { &["--photons", "20k"] };
        Window::start(display, scene, &[&["--size", "320x240", "--radius", "0.5"][..], photons, args].concat())
    }

    /// Opens a scene with nothing but these options, without a panel.
    pub fn start(display: &'a Display, scene: &Path, args: &[&str]) -> Window<'a> {
        let program = view(display, scene, args).env("DISPLAY", &display.name).spawn().unwrap();
        Window::of(display, program)
    }

    /// The window of a program that was started.
    pub fn of(display: &'a Display, program: Child) -> Window<'a> {
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
    pub fn until<T>(&mut self, what: &str, mut look: impl FnMut(&Window) -> Option<T>) -> T {
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

    pub fn title(&self) -> String {
        self.display.xdotool(&["getwindowname", &self.id])
    }

    #[track_caller]
    pub fn converged(&mut self) -> Vec<[u8; 3]> {
        // A request needs a moment to be on its way; until then the title tells of the last one.
        std::thread::sleep(Duration::from_millis(250));
        self.until("converged picture", |w| w.title().contains("converged").then_some(()));
        self.pixels()
    }

    pub fn pixels(&self) -> Vec<[u8; 3]> {
        self.display.pixels(self.width, self.height)
    }

    #[track_caller]
    pub fn changed_from(&mut self, before: &[[u8; 3]]) {
        self.until("change in the picture", |w| (share_changed(before, &w.pixels()) > 0.02).then_some(()));
    }

    /// Presses a key that changes what is there. On a busy machine the server may deliver a press before the window has
    /// the focus: where nothing comes of it for long, once more.
    #[track_caller]
    pub fn key_that_changes(&mut self, key: &str, before: &[[u8; 3]]) {
        self.key(key);
        let start = Instant::now();
        while share_changed(before, &self.pixels()) <= 0.02 && start.elapsed() < PATIENCE / 3 {
            std::thread::sleep(Duration::from_millis(20));
        }
        if share_changed(before, &self.pixels()) <= 0.02 {
            self.key(key);
        }
        self.changed_from(before);
    }

    pub fn key(&self, key: &str) {
        self.display.xdotool(&["key", key]);
    }

    pub fn drag(&self, button: &str, from: [i32; 2], to: [i32; 2]) {
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
    pub fn quit(mut self) -> Value {
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

/// The program with a scene, without a panel, and told of no display.
pub fn view(display: &Display, scene: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(BINARY);
    command.arg("view").arg(scene).args(["--json", "--no-panel"]).args(args);
    command.current_dir(display.directory.path()).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Share of pixels that differ visibly.
pub fn share_changed(a: &[[u8; 3]], b: &[[u8; 3]]) -> f64 {
    assert_eq!(a.len(), b.len());
    let differs = |(a, b): (&[u8; 3], &[u8; 3])| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > 12);
    a.iter().zip(b).filter(|pair| differs(*pair)).count() as f64 / a.len() as f64
}

#[test]
fn the_comparator_sees_a_difference() {
    let black = vec![[0u8; 3]; 100];
    let mut other = black.clone();
    assert_eq!(share_changed(&black, &other), 0.0);
    other[7] = [0, 40, 0];
    assert_eq!(share_changed(&black, &other), 0.01);
}
