//! What integration tests share: every backend that is there, scenes from text, and a camera of their own.

use std::cell::RefCell;
use std::sync::{Mutex, MutexGuard, PoisonError};

use glam::DVec3;
use photile::film::Image;
use photile::pipeline::{Machine, Pipeline};
use photile::scene::{self, Camera, Scene};
use photile::settings::{Backend, LightMode, Settings};

/// The report's scenes, of which there are references.
pub const REPORT: [&str; 4] = ["gi_ref", "gi_two_lights", "sphere_and_plane", "color_bleeding"];

/// Until this test ends, no other of this process has the drivers, nor what a process has once: the pace of its submissions. PoCL
/// and llvmpipe share one LLVM and crash now and then when several threads compile at once. To be called before anything
/// of a driver is opened, by the test's own thread, any number of times.
pub fn one_at_a_time() {
    static ALONE: Mutex<()> = Mutex::new(());
    thread_local! {
        /// Every test has a thread of its own, which drops this behind whatever the test itself holds.
        static HELD: RefCell<Option<MutexGuard<'static, ()>>> = const { RefCell::new(None) };
    }
    HELD.with_borrow_mut(|held| {
        held.get_or_insert_with(|| ALONE.lock().unwrap_or_else(PoisonError::into_inner));
    });
}

/// Every backend that is there, OpenGL and OpenCL first. With PHOTILE_REQUIRE_DRIVERS=1 a missing driver fails the
/// test; else it is said on stderr, and the test goes on with the rest.
pub fn backends() -> Vec<Pipeline> {
    Backend::ALL.into_iter().filter_map(open).collect()
}

/// One backend, if it is there; see [`backends`].
pub fn open(backend: Backend) -> Option<Pipeline> {
    one_at_a_time();
    let machine = Machine { backend: Some(backend), threads: 2, ..Machine::default() };
    match Pipeline::open(&machine, |line| eprintln!("{line}")) {
        Ok(pipeline) => {
            // What answers must be what was asked for: a name that only this driver can give.
            let name = match backend {
                Backend::OpenGl => pipeline.devices.opengl.clone(),
                Backend::OpenCl => pipeline.devices.opencl.clone(),
                Backend::Cpu => Some("twins".into()),
            };
            assert_eq!(pipeline.backend, backend);
            assert!(name.is_some_and(|name| !name.is_empty()), "{} has no device", backend.name());
            Some(pipeline)
        }
        Err(error) => {
            missing(backend.name(), &error);
            None
        }
    }
}

/// Says that a driver is missing, or fails where all must be there.
pub fn missing(what: &str, error: &dyn std::fmt::Display) {
    let required = std::env::var("PHOTILE_REQUIRE_DRIVERS").is_ok_and(|value| value == "1");
    assert!(!required, "PHOTILE_REQUIRE_DRIVERS=1, but {what} is missing: {error}");
    eprintln!("SKIPPED: {what}: {error}");
}

/// A shipped scene.
pub fn shipped(name: &str) -> Scene {
    scene::load(&scene_path(name)).unwrap_or_else(|error| panic!("{error}"))
}

/// Where a shipped scene lies.
pub fn scene_path(name: &str) -> std::path::PathBuf {
    format!("{}/scenes/{name}.toml", env!("CARGO_MANIFEST_DIR")).into()
}

/// Names of all shipped scenes that can be rendered with direct light, sorted.
pub fn all_shipped() -> Vec<String> {
    let entries = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes")).unwrap();
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert!(names.len() >= 7, "{names:?}");
    names
}

/// A reference image of `tests/golden/`.
pub fn golden(name: &str) -> Image {
    let path = format!("{}/tests/golden/{name}.exr", env!("CARGO_MANIFEST_DIR"));
    Image::load(path.as_ref()).unwrap_or_else(|error| panic!("{error}"))
}

/// A scene from text.
#[track_caller]
pub fn scene(text: &str) -> Scene {
    scene::parse(text, "test.toml").unwrap_or_else(|error| panic!("{error}\nin:\n{text}"))
}

/// Direct light only.
pub fn direct(width: u32, height: u32, samples: u32) -> Settings {
    Settings { width, height, samples, light: LightMode::Direct, ..Settings::default() }
}

/// A picture, all of whose pixels are numbers.
#[track_caller]
pub fn render(pipeline: &mut Pipeline, scene: &Scene, settings: &Settings) -> Image {
    let image = pipeline.render(scene, settings).unwrap_or_else(|error| panic!("{error}")).image;
    assert_eq!((image.width, image.height), (settings.width, settings.height));
    assert_eq!(image.non_finite(), 0, "{}", pipeline.backend.name());
    image
}

/// The camera by its definition, in double precision: rays through points of the image plane.
pub struct Pinhole {
    /// World space.
    pub position: DVec3,
    forward: DVec3,
    right: DVec3,
    up: DVec3,
    tan_half_y: f64,
    width: f64,
    height: f64,
}

impl Pinhole {
    pub fn new(camera: &Camera, settings: &Settings) -> Pinhole {
        let forward = (camera.look_at - camera.position).normalize();
        let right = forward.cross(camera.up).normalize();
        Pinhole {
            position: camera.position,
            forward,
            right,
            up: right.cross(forward),
            tan_half_y: (camera.fov_y.to_radians() / 2.0).tan(),
            width: settings.width.into(),
            height: settings.height.into(),
        }
    }

    /// Unit direction through a pixel's centre; row 0 is the top.
    pub fn through(&self, column: u32, row: u32) -> DVec3 {
        // Square pixels: both axes in units of the image's half height.
        let x = (2.0 * (f64::from(column) + 0.5) - self.width) / self.height * self.tan_half_y;
        let y = (self.height - 2.0 * (f64::from(row) + 0.5)) / self.height * self.tan_half_y;
        (self.forward + self.right * x + self.up * y).normalize()
    }
}

/// Nearest distance > 0 to a sphere.
pub fn to_sphere(origin: DVec3, direction: DVec3, center: DVec3, radius: f64) -> Option<f64> {
    let along = (center - origin).dot(direction);
    let beside = (center - origin - direction * along).length_squared();
    let half_chord = (radius * radius - beside).sqrt(); // NaN where the ray misses
    [along - half_chord, along + half_chord].into_iter().find(|t| *t > 0.0)
}

/// Distance to a plane in front.
pub fn to_plane(origin: DVec3, direction: DVec3, normal: DVec3, offset: f64) -> Option<f64> {
    let t = (offset - normal.dot(origin)) / normal.dot(direction);
    (t > 0.0 && t.is_finite()).then_some(t)
}

/// All columns of all rows.
pub fn pixels(image: &Image) -> impl Iterator<Item = (u32, u32)> + use<> {
    let width = image.width;
    (0..image.height).flat_map(move |y| (0..width).map(move |x| (x, y)))
}
