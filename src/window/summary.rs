//! How a window begins, and what it was.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::ladder::Budget;
use super::replay::Replayed;
use super::script::Script;
use crate::pipeline::Machine;
use crate::scene::Scene;
use crate::settings::Settings;
use crate::techniques::Wish;

/// How the window begins.
pub struct Options {
    /// The scene file, which is watched.
    pub path: PathBuf,
    /// As read from it.
    pub scene: Scene,
    /// The size is the picture's at the beginning; the panel comes beside it.
    pub settings: Settings,
    /// Where pictures are made; without a backend OpenGL, or what works.
    pub machine: Machine,
    /// How long a frame may take while things move.
    pub budget: Budget,
    /// Passes until converged.
    pub passes: u32,
    /// How they are made: what was asked for, the rest open.
    pub wish: Wish,
    /// The panel is there from the beginning.
    pub panel: bool,
    /// Where screenshots go: a path without extension.
    pub screenshot: PathBuf,
    /// Gone through instead of waiting for the user; then the window closes.
    pub script: Option<Script>,
    /// Where recorded paths go; recording begins at once where this is given.
    pub record: Option<PathBuf>,
    /// Keep a table of all the script's pictures.
    pub table: bool,
    /// Set from outside: the window closes, and keeps the edits that were not saved.
    pub stop: Arc<AtomicBool>,
}

/// What a window was, for `--json`.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Summary {
    /// The scene's name.
    pub scene: String,
    /// GL_RENDERER of the window.
    pub renderer: String,
    /// Milliseconds a frame may take.
    pub budget_ms: Option<f64>,
    /// Milliseconds from the program's start to the first picture of the scene in the window.
    pub first_image_ms: Option<f64>,
    /// And to the first one by the backend that was asked for.
    pub first_backend_ms: Option<f64>,
    /// How many pictures were shown.
    pub frames: u64,
    /// It was closed from outside, by a signal.
    pub interrupted: bool,
    /// Where edits are that were not saved by then.
    pub unsaved: Option<PathBuf>,
    /// Screenshots and other files written.
    pub written: Vec<PathBuf>,
    /// Times that the scene file was read again.
    pub reloads: u32,
    /// What was wrong with it at other times, with line and column.
    pub file_errors: Vec<String>,
    /// What keys and buttons asked for, in order.
    pub actions: Vec<String>,
    /// The longest that handling one event took, ms: input waits no longer than that, or than painting.
    pub longest_event_ms: f64,
    /// The longest that painting the window took, ms.
    pub longest_paint_ms: f64,
    /// What the script took.
    pub replayed: Option<Replayed>,
    /// GL objects that are left when all is closed.
    pub gl_objects_left: i64,
    /// OpenCL objects that are left when all is closed.
    pub cl_objects_left: i64,
}
