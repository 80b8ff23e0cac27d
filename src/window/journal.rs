//! Edits that are not saved yet, kept beside the scene file while the window is open: whatever ends it, a signal, a display
//! that goes away, a driver, they are not lost. Whoever closes the window wants no more of them, and takes the file away.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::save;
use super::state::State;
use crate::film::write_beside;
use crate::scene;

/// Edits of so long may be lost.
const EVERY: Duration = Duration::from_secs(1);

/// The file of edits.
pub struct Journal {
    /// `NAME.unsaved.toml` beside the scene.
    path: PathBuf,
    /// What it holds.
    text: Option<String>,
    seen: Instant,
}

impl Journal {
    /// Of a scene file. What another window has left is not written over.
    pub fn new(scene: &Path) -> Journal {
        let path = (1..).map(|number| path_of(scene, number)).find(|path| !path.exists()).expect("numbers do not end");
        Journal { path, text: None, seen: Instant::now() }
    }

    /// Looks once in a while whether there are other edits than the file has.
    pub fn see(&mut self, now: Instant, state: &State) {
        if now - self.seen < EVERY {
            return;
        }
        self.seen = now;
        let text = edited(state);
        if text != self.text {
            match &text {
                // A directory that cannot be written keeps no edits: there is nothing that could be done about it here.
                Some(text) => drop(write_beside(&self.path, |file| file.write_all(text.as_bytes()))),
                None => drop(fs::remove_file(&self.path)),
            }
            self.text = text;
        }
    }

    /// The user closed the window: edits that were not saved are not wanted.
    pub fn close(&mut self) {
        if self.text.take().is_some() {
            drop(fs::remove_file(&self.path)); // gone already: just as well
        }
    }

    /// Something else closed it: where the edits are, if there are any.
    pub fn keep(&mut self, state: &State) -> Option<PathBuf> {
        self.see(self.seen + EVERY, state);
        (self.text.is_some() && self.path.exists()).then(|| self.path.clone())
    }
}

/// The file of edits of a window that ended early, if there is one.
pub fn left_over(scene: &Path) -> Option<PathBuf> {
    Some(path_of(scene, 1)).filter(|path| path.exists())
}

fn path_of(scene: &Path, number: u32) -> PathBuf {
    scene.with_extension(if number == 1 { "unsaved.toml".into() } else { format!("unsaved-{number}.toml") })
}

/// The scene file's text with the edits; none where there are none but the camera's, which moves all the time.
fn edited(state: &State) -> Option<String> {
    let mut new = state.to_save();
    let camera = std::mem::replace(&mut new.camera, state.saved.camera.clone());
    if new == *state.saved {
        return None;
    }
    new.camera = camera;
    let text = fs::read_to_string(&state.path).ok()?;
    let on_disk = scene::load(&state.path).ok()?;
    save::updated(&text, &on_disk, &new).ok()
}
