//! One picture of the window. A front worker shows; a back worker builds what needs new programs meanwhile, and comes
//! to the front with its first frame: nothing blocks while drivers compile.

use super::request::Request;
use super::worker::{Frame, Job, News, Terms, Worker};
use crate::error::Result;
use crate::gl::{Spare, Texture};
use crate::settings::Backend;

/// A picture and those who make it.
pub struct Pane {
    terms: Terms,
    front: Worker,
    /// What the front does.
    fronts: Option<Request>,
    back: Option<Worker>,
    /// What the back builds.
    awaited: Option<Request>,
    shown: Option<Frame>,
    /// Every picture so far.
    pub frames: u64,
}

impl Pane {
    /// With one worker, which gets this context.
    pub fn new(spare: Spare, terms: Terms) -> Pane {
        let front = Worker::new(spare, terms.clone());
        Pane { terms, front, fronts: None, back: None, awaited: None, shown: None, frames: 0 }
    }

    /// Wants a picture. `spare` gives a context where another worker is needed.
    ///
    /// # Errors
    /// [`crate::error::Error::Driver`] when the driver gives no further context.
    pub fn submit(&mut self, job: Job, spare: impl FnOnce() -> Result<Spare>) -> Result<()> {
        let key = job.request.key();
        if self.fronts.is_none() && job.request.backend != Backend::Cpu && self.terms.budget.is_some() {
            // The very first picture: the CPU needs no programs and shows something while they are built.
            let mut preview = job.clone();
            preview.request.backend = Backend::Cpu;
            (preview.passes, preview.moving) = (1, true);
            self.hand_to_front(preview);
        }
        if self.fronts.is_none() || self.front.knows(&key) {
            self.awaited = None;
            self.hand_to_front(job);
            return Ok(());
        }
        // What is known goes on, from where the camera is now.
        let settings = &job.request.settings;
        let known = self
            .fronts
            .as_ref()
            .map(|shown| shown.seen_from(&job.request.scene.camera, settings.width, settings.height));
        if let Some(request) = known.filter(|request| self.front.knows(&request.key())) {
            // Within the budget: the builder needs the rest of the machine.
            self.hand_to_front(Job { request, moving: true, ..job.clone() });
        }
        let back = match &self.back {
            Some(back) => back,
            None => self.back.insert(Worker::new(spare()?, self.terms.clone())),
        };
        self.awaited = Some(job.request.clone());
        back.submit(job);
        Ok(())
    }

    fn hand_to_front(&mut self, job: Job) {
        self.fronts = Some(job.request.clone());
        self.front.submit(job);
    }

    /// Takes up what is finished; whether there is a new picture.
    pub fn poll(&mut self) -> bool {
        if let (Some(_), Some(back)) = (&self.awaited, &mut self.back)
            && back.has_frame()
        {
            // Frames belong to the worker that made them: the old front gets its own back.
            self.front.give_back(&mut self.shown);
            std::mem::swap(&mut self.front, back);
            self.fronts = self.awaited.take();
        }
        let new = self.front.take(&mut self.shown);
        self.frames += u64::from(new);
        new
    }

    /// The picture to show.
    pub fn shown(&self) -> Option<&Frame> {
        self.shown.as_ref()
    }

    /// Its texture.
    pub fn texture(&self) -> Option<Texture> {
        self.shown.as_ref().map(|frame| frame.texture)
    }

    /// Programs are being built.
    pub fn is_building(&self) -> bool {
        self.awaited.is_some()
    }

    /// Writes the picture to files, when it is its turn.
    pub fn save(&self, stem: std::path::PathBuf, exposure: f32) {
        self.front.save(stem, exposure);
    }

    /// What the workers have to say.
    pub fn news(&mut self) -> Vec<News> {
        let mut news = self.front.news();
        if let Some(back) = &self.back {
            let from_back = back.news();
            // What cannot be built is awaited no longer.
            if from_back.iter().any(|news| matches!(news, News::Failed(_))) {
                self.awaited = None;
            }
            news.extend(from_back);
        }
        news
    }
}
