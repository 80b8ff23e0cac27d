//! Scripts in a window: one is replayed, or one is recorded.

use std::io::Write as _;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use super::exchange::Frame;
use super::pane::Pane;
use super::replay::{Counting, Replayed};
use super::request::Request;
use super::script::{Recorder, Script};
use super::state::State;
use crate::error::Result;
use crate::film::write_beside;
use crate::scene::Scene;

/// A script under way.
pub struct Player {
    script: Script,
    counting: Counting,
    /// The picture that is waited for, and since when.
    awaited: Option<(Request, Instant)>,
    /// It is in the next painting.
    arrived: bool,
}

impl Player {
    /// At its beginning; with a `table` of all pictures or without.
    pub fn new(script: Script, table: bool) -> Player {
        Player { script, counting: Counting::new(table), awaited: None, arrived: false }
    }

    /// All pictures were seen.
    pub fn is_done(&self) -> bool {
        self.counting.frames() >= self.script.frames()
    }

    /// Goes on to the next picture once the last one was seen; whether it is there already.
    pub fn play(&mut self, state: &mut State, pane: &Pane) -> bool {
        let ready = pane.shown().is_some() && !pane.is_building();
        if !ready || self.awaited.is_some() || self.is_done() {
            return false;
        }
        let mut scene = (*state.scene_as_seen()).clone();
        self.script.apply(self.counting.frames(), &mut scene);
        state.hand.camera = scene.camera.clone();
        state.edit(|edited| *edited = scene);
        let Some(request) = state.request(false) else { return false };
        // A picture that is there already is not made again.
        self.arrived = pane.shown().is_some_and(|frame| frame.request == request);
        self.awaited = Some((request, Instant::now()));
        self.arrived
    }

    /// A picture is there, and will be painted.
    pub fn arrived(&mut self, frame: &Frame) {
        self.arrived |= self.awaited.as_ref().is_some_and(|(wanted, _)| *wanted == frame.request);
    }

    /// The window was painted; whether that showed the picture that was waited for.
    pub fn seen(&mut self, shown: Option<&Frame>) -> bool {
        if !std::mem::take(&mut self.arrived) {
            return false;
        }
        if let (Some((_, since)), Some(frame)) = (self.awaited.take(), shown) {
            self.counting.add(since.elapsed().as_secs_f64() * 1e3, &frame.made, self.script.frames());
        }
        true
    }

    /// How long the pictures shown so far took, as a replay's result.
    pub fn finish(&self, budget: Option<f64>) -> Replayed {
        self.counting.clone().finish(budget)
    }
}

/// A recording of so long may be lost when something ends the program.
const KEEP_EVERY: Duration = Duration::from_secs(2);

/// A path that is recorded, when it is.
pub struct Recording {
    recorder: Option<(Recorder, Instant)>,
    path: PathBuf,
    kept: Instant,
}

impl Recording {
    /// Into a file; `now`: from the beginning on.
    pub fn new(path: PathBuf, now: bool) -> Recording {
        Recording { recorder: now.then(|| (Recorder::default(), Instant::now())), path, kept: Instant::now() }
    }

    /// Whether key frames are being recorded.
    pub fn is_on(&self) -> bool {
        self.recorder.is_some()
    }

    /// Remembers what is seen.
    pub fn see(&mut self, now: Instant, state: &State) {
        if let Some((recorder, since)) = &mut self.recorder {
            recorder.see((now - *since).as_secs_f64(), &state.scene_as_seen());
            if now - self.kept >= KEEP_EVERY {
                self.kept = now;
                // What cannot be written is told at the end.
                let text = recorder.clone().finish(&state.scene);
                drop(text.map(|text| write_beside(&self.path, |file| file.write_all(text.as_bytes()))));
            }
        }
    }

    /// Begins, or ends and writes the file; the file that was written.
    ///
    /// # Errors
    /// [`crate::error::Error::File`] when it cannot be.
    pub fn toggle(&mut self, scene: &Scene) -> Result<Option<PathBuf>> {
        let Some((recorder, _)) = self.recorder.take() else {
            self.recorder = Some((Recorder::default(), Instant::now()));
            return Ok(None);
        };
        let Some(text) = recorder.finish(scene) else { return Ok(None) };
        write_beside(&self.path, |file| file.write_all(text.as_bytes()))?;
        Ok(Some(self.path.clone()))
    }
}
