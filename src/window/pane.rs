//! One picture of the window, and those who make it. The *front* worker draws what moves. A *back* worker builds what
//! needs new programs meanwhile, and comes to the front with its first frame: nothing blocks while drivers compile. Where
//! passes are of another technique than what moves, a *refiner* makes them, with programs and tables of its own: neither
//! waits for the other's, and the first passes are shown once they are better than what moved.

use std::sync::Arc;

use super::exchange::{Frame, News, Terms};
use super::job::{Goal, Job};
use super::level::Level;
use super::markers::Markers;
use super::request::Request;
use super::worker::Worker;
use crate::device::gl::{Spare, Texture};
use crate::error::Result;
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
    refiner: Option<Worker>,
    /// What the refiner is to do once the front has settled.
    to_refine: Option<Job>,
    shown: Option<Frame>,
    /// The picture shown is the refiner's.
    refined: bool,
    /// Over the picture, and the size of the one they belong to; the front's, who has a photon map.
    markers: Option<(Arc<Markers>, [u32; 2])>,
    /// Every picture so far.
    pub frames: u64,
}

impl Pane {
    /// With one worker, which gets this context.
    pub fn new(spare: Spare, terms: Terms) -> Pane {
        let front = Worker::new(spare, terms.clone());
        Pane {
            terms,
            front,
            fronts: None,
            back: None,
            awaited: None,
            refiner: None,
            to_refine: None,
            shown: None,
            refined: false,
            markers: None,
            frames: 0,
        }
    }

    /// Wants a picture. `spare` gives a context where another worker is needed.
    ///
    /// # Errors
    /// [`crate::error::Error::Driver`] when the driver gives no further context.
    pub fn submit(&mut self, mut job: Job, spare: impl FnOnce() -> Result<Spare>) -> Result<()> {
        self.to_refine = None;
        if let Some(refiner) = &self.refiner {
            refiner.halt();
        }
        if job.request.refines_apart() && matches!(job.goal, Goal::Passes(_)) {
            self.to_refine = Some(job.clone());
            job.goal = Goal::Settled;
        }
        let key = job.request.key().clone();
        if self.fronts.is_none() && job.request.backend != Backend::Cpu && self.terms.budget.is_some() {
            // The very first picture: the CPU needs no programs and shows something while they are built.
            let mut preview = job.clone();
            (preview.request, preview.goal) = (job.request.on(Backend::Cpu), Goal::Draft);
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
        if let Some(request) = known.filter(|request| self.front.knows(request.key())) {
            // Within the budget: the builder needs the rest of the machine.
            self.hand_to_front(Job { request, goal: Goal::Draft, ..job.clone() });
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

    /// Takes up what is finished; whether there is a new picture. `spare` as for [`Pane::submit`].
    ///
    /// # Errors
    /// As [`Pane::submit`].
    pub fn poll(&mut self, spare: impl FnOnce() -> Result<Spare>) -> Result<bool> {
        if let (Some(_), Some(back)) = (&self.awaited, &mut self.back)
            && back.has_frame()
        {
            std::mem::swap(&mut self.front, back);
            self.fronts = self.awaited.take();
        }
        let mut new = false;
        if let Some(frame) = self.front.take() {
            self.markers = frame.markers.clone().map(|markers| (markers, frame.made.size));
            let settled = frame.made.level == Level::FULL;
            let job = self.to_refine.take_if(|job| settled && job.request == frame.request);
            if let Some(job) = job {
                let refiner = match &self.refiner {
                    Some(refiner) => refiner,
                    None => self.refiner.insert(Worker::new(spare()?, self.terms.clone())),
                };
                refiner.submit(Job { markers: None, ..job });
            }
            // A refined picture stands until another one is wanted.
            if !(self.refined && self.shown.as_ref().is_some_and(|shown| shown.request == frame.request)) {
                (self.shown, self.refined) = (Some(frame), false);
            }
            new = true;
        }
        // What belongs to another request came too late.
        let refined = self.refiner.as_ref().and_then(Worker::take);
        if let Some(frame) = refined.filter(|frame| Some(&frame.request) == self.fronts.as_ref()) {
            (self.shown, self.refined) = (Some(frame), true);
            new = true;
        }
        self.frames += u64::from(new);
        Ok(new)
    }

    /// The picture to show.
    pub fn shown(&self) -> Option<&Frame> {
        self.shown.as_ref()
    }

    /// What to draw over it, and the size in pixels of the picture that it was made with.
    pub fn markers(&self) -> Option<(&Markers, [u32; 2])> {
        self.markers.as_ref().map(|(markers, size)| (&**markers, *size))
    }

    /// The texture of the picture shown, where there is one.
    pub fn texture(&self) -> Option<Texture> {
        self.shown.as_ref().map(|frame| frame.texture)
    }

    /// Programs are being built.
    pub fn is_building(&self) -> bool {
        self.awaited.is_some()
    }

    /// Writes the picture to files, when it is its turn.
    pub fn save(&self, stem: std::path::PathBuf, exposure: f32) {
        let maker = self.refiner.as_ref().filter(|_| self.refined).unwrap_or(&self.front);
        maker.save(stem, exposure);
    }

    /// What the workers have to say.
    pub fn news(&mut self) -> Vec<News> {
        let mut news = self.front.news();
        news.extend(self.refiner.iter().flat_map(Worker::news));
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
