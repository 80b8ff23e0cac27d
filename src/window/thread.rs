//! The thread of a worker: it takes the latest job, draws it within the budget while things move, and refines it when
//! they rest.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::{Arc, PoisonError};
use std::time::Instant;

use super::engine::{Engine, Until};
use super::exchange::{Frame, FrameLease, News, Shared, Terms, lock};
use super::job::{Doing, Goal, Job, Step};
use super::ladder::Ladder;
use super::markers::Markers;
use super::request::Request;
use crate::device::gl::{Picture, Spare};
use crate::error::Result;
use crate::film::SaveOptions;
use crate::pipeline::progressive;

/// Pictures in flight: one shown, one waiting to be, one in the making.
const SLOTS: usize = 3;

/// Draws until the worker is dropped.
///
/// # Errors
/// What the drivers say to another context.
pub fn work(spare: Spare, terms: &Terms, shared: &Arc<Shared>) -> Result<()> {
    let held = terms.driver_lock.take();
    let aside = spare.open()?;
    drop(held);
    let notices = Arc::clone(shared);
    let notice = Box::new(move |line: &str| lock(&notices.outbox).news.push(News::Notice(line.into())));
    let inbox = Arc::clone(shared);
    let doing = Rc::new(RefCell::new(None));
    let current = Rc::clone(&doing);
    let wanted = Rc::new(move || {
        let inbox = lock(&inbox.inbox);
        // The same picture again is no reason to stop.
        let other = inbox.job.as_ref().is_some_and(|job: &Job| current.borrow().as_ref() != Some(&job.request));
        !inbox.quit && !inbox.halt && !other
    });
    let engine = Engine::new(aside.current(), terms.machine.clone(), Arc::clone(&terms.driver_lock), wanted, notice)?;
    lock(&shared.outbox).free = (0..SLOTS).collect();
    let mut thread = Thread {
        engine,
        slots: std::array::from_fn(|_| Picture::empty()),
        ladder: terms.budget.map(Ladder::new),
        doing: None,
        drawing: doing,
        terms,
        shared,
    };
    thread.run();
    let Thread { engine, slots, .. } = thread;
    let held = terms.driver_lock.take();
    drop(slots);
    drop(held);
    engine.close();
    let _held = terms.driver_lock.take();
    drop(aside);
    Ok(())
}

struct Thread<'a> {
    engine: Engine,
    slots: [Picture; SLOTS],
    ladder: Option<Ladder>,
    doing: Option<Doing>,
    /// The request that is being drawn, for those who ask whether it is still wanted.
    drawing: Rc<RefCell<Option<Request>>>,
    terms: &'a Terms,
    shared: &'a Arc<Shared>,
}

impl Thread<'_> {
    fn run(&mut self) {
        loop {
            let idle = self.doing.as_ref().is_none_or(Doing::is_idle);
            let (job, save) = {
                let mut inbox = lock(&self.shared.inbox);
                while (idle || inbox.halt) && inbox.job.is_none() && inbox.save.is_none() && !inbox.quit {
                    inbox = self.shared.arrived.wait(inbox).unwrap_or_else(PoisonError::into_inner);
                }
                if inbox.quit {
                    return;
                }
                (inbox.job.take(), inbox.save.take())
            };
            if let Some((stem, exposure)) = save {
                let news = match self.save(&stem, exposure) {
                    Ok(paths) => News::Saved(paths),
                    Err(error) => News::Failed(error.to_string()),
                };
                lock(&self.shared.outbox).news.push(news);
                (self.terms.wake)();
                if job.is_none() {
                    continue; // perhaps nothing else is wanted
                }
            }
            if let Some(job) = job {
                self.doing = Some(Doing::begin(job, self.doing.take()));
            }
            self.step();
        }
    }

    /// One picture or pass of what is being done.
    fn step(&mut self) {
        let Some(doing) = &mut self.doing else { return };
        if doing.take_again() {
            return self.publish();
        }
        let known = lock(&self.shared.outbox).known.contains(&doing.key);
        let Some(step) = doing.next(self.ladder.as_ref().map(Ladder::level), known) else { return };
        // What moves is within the budget and shown in any case: else nothing would be seen of a long motion.
        let moving = doing.job.goal == Goal::Draft;
        *self.drawing.borrow_mut() = Some(doing.job.request.clone());
        let made = match step {
            Step::Draft(level) => self.engine.draft(
                &doing.job.request,
                level,
                match self.ladder.as_ref() {
                    Some(ladder) if known && moving => Until::Late(Instant::now() + ladder.time()),
                    _ if known && !moving => Until::Unwanted,
                    _ => Until::Done,
                },
            ),
            Step::Pass => doing.pass(&mut self.engine),
        };
        let made = match made {
            Ok(Some(made)) => made,
            Ok(None) => return,
            Err(error) => {
                doing.failed = true;
                lock(&self.shared.outbox).news.push(News::Failed(error.to_string()));
                return (self.terms.wake)();
            }
        };
        if let Some(ladder) = &mut self.ladder {
            // The first frame of new programs holds their building, which is no frame's fault.
            if known && moving {
                ladder.measured(made.cost());
            } else if !moving {
                ladder.rested();
            }
        }
        doing.learn(made);
        if doing.is_shown() {
            self.publish();
        }
    }

    /// Input the mean to the window, with what is drawn over it.
    fn publish(&mut self) {
        let Some((doing, made)) = self.doing.as_ref().and_then(|doing| Some((doing, doing.made.clone()?))) else {
            return;
        };
        let request = doing.job.request.clone();
        let markers = match (&doing.job.markers, self.engine.pipeline()) {
            (Some(wanted), Some(pipeline)) => {
                let _held = self.terms.driver_lock.take();
                Markers::collect(pipeline, &request.scene, wanted).ok().map(Arc::new)
            }
            _ => None,
        };
        let (key, converged) = (doing.key.clone(), doing.is_converged());
        // A frame that the window has not picked up is replaced.
        let missed = lock(&self.shared.outbox).frame.take();
        drop(missed);
        let Some(slot) = lock(&self.shared.outbox).free.pop() else { return };
        let _lease = FrameLease { slot, owner: Arc::downgrade(self.shared) };
        if let Err(error) = self.engine.copy_to(&mut self.slots[slot]) {
            lock(&self.shared.outbox).news.push(News::Failed(error.to_string()));
        } else if let Some((texture, ..)) = self.slots[slot].texture() {
            let mut outbox = lock(&self.shared.outbox);
            outbox.known.insert(key);
            outbox.frame = Some(Frame { request, texture, made, converged, markers, _lease });
        }
        (self.terms.wake)();
    }

    /// Writes the picture as it is.
    fn save(&mut self, stem: &Path, exposure: f32) -> Result<Vec<PathBuf>> {
        let Some(doing) = &mut self.doing else { return Ok(Vec::new()) };
        let request = &doing.job.request;
        let (passes, settings) = (doing.passes(), &request.settings);
        let note = |name: &str, value: String| (name.to_string(), value);
        let provenance = [
            note("scene", request.scene.name.clone()),
            note("backend", request.backend.name().into()),
            note("samples", settings.samples.to_string()),
            note("passes", passes.max(1).to_string()),
            note("seed", settings.seed.to_string()),
        ];
        let (image, estimate) = match &mut doing.passes {
            Some(sums) if passes > 0 => (sums.image()?, sums.estimate()),
            _ => (self.engine.read()?, None),
        };
        let channels = estimate.as_ref().map(progressive::channels).unwrap_or_default();
        let mut paths = Vec::new();
        for extension in ["png", "exr"] {
            let path = stem.with_extension(extension);
            image.save(&path, &SaveOptions { exposure, settings: &provenance, channels: &channels })?;
            paths.push(path);
        }
        Ok(paths)
    }
}
