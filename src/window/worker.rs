//! A thread that renders: it takes the latest request, draws it within the budget while things move, and refines it
//! pass by pass when they rest. The window only picks up what is finished.

use std::cell::RefCell;
use std::collections::HashSet;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use super::engine::{Engine, Made};
use super::ladder::{Ladder, Level};
use super::markers::Markers;
use super::request::{Key, Request};
use super::turn::Turn;
use crate::error::Result;
use crate::film::SaveOptions;
use crate::gl::{Picture, Spare, Texture};
use crate::pipeline::Machine;

/// What a worker is to do next.
#[derive(Clone, Debug)]
pub struct Job {
    /// What to show.
    pub request: Request,
    /// More of the kind is to come: stay within the budget rather than be exact.
    pub moving: bool,
    /// Passes until the picture counts as converged.
    pub passes: u32,
    /// Photons or cells that are drawn over the picture.
    pub markers: Option<super::markers::Wanted>,
}

/// A finished picture.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The request that it answers, as submitted.
    pub request: Request,
    /// Shared with the window's context; stays as it is until the window takes a newer frame.
    pub texture: Texture,
    /// How it came about.
    pub made: Made,
    /// No further pass will follow.
    pub converged: bool,
    /// What to draw over it.
    pub markers: Option<Arc<Markers>>,
    slot: usize,
}

/// What a worker has to say.
pub enum News {
    /// Something that the user should know.
    Notice(String),
    /// The request cannot be drawn.
    Failed(String),
    /// Files were written.
    Saved(Vec<PathBuf>),
}

#[derive(Default)]
struct Inbox {
    job: Option<Job>,
    save: Option<(PathBuf, f32)>,
    quit: bool,
}

#[derive(Default)]
struct Outbox {
    frame: Option<Frame>,
    free: Vec<usize>,
    news: Vec<News>,
    known: HashSet<Key>,
}

#[derive(Default)]
struct Shared {
    inbox: Mutex<Inbox>,
    arrived: Condvar,
    outbox: Mutex<Outbox>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The window's end of a worker. Dropping it ends the thread and waits for it.
pub struct Worker {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

/// What all workers of a window share.
#[derive(Clone)]
pub struct Terms {
    /// Where pictures are made.
    pub machine: Machine,
    /// Milliseconds a frame while things move; `None`: full quality, however long it takes.
    pub budget: Option<f64>,
    /// Software drivers take turns.
    pub turn: Arc<Turn>,
    /// Tells the window that there is something to pick up.
    pub wake: Arc<dyn Fn() + Send + Sync>,
}

/// Pictures in flight: one shown, one waiting to be, one in the making.
const SLOTS: usize = 3;

impl Worker {
    /// Starts a thread with a context of its own.
    pub fn new(spare: Spare, terms: Terms) -> Worker {
        let shared = Arc::new(Shared::default());
        let theirs = Arc::clone(&shared);
        let thread = std::thread::spawn(move || {
            if let Err(error) = work(spare, &terms, &theirs) {
                lock(&theirs.outbox).news.push(News::Failed(error.to_string()));
            }
            (terms.wake)();
        });
        Worker { shared, thread: Some(thread) }
    }

    /// Replaces what the worker is to do.
    pub fn submit(&self, job: Job) {
        lock(&self.shared.inbox).job = Some(job);
        self.shared.arrived.notify_all();
    }

    /// Asks for the picture as it is: PNG at an exposure and EXR, by the path without its extension.
    pub fn save(&self, stem: PathBuf, exposure: f32) {
        lock(&self.shared.inbox).save = Some((stem, exposure));
        self.shared.arrived.notify_all();
    }

    /// Whether this worker has built the programs already.
    pub fn knows(&self, key: &Key) -> bool {
        lock(&self.shared.outbox).known.contains(key)
    }

    /// The newest picture, in exchange for the one shown so far.
    pub fn take(&self, shown: &mut Option<Frame>) -> bool {
        let mut outbox = lock(&self.shared.outbox);
        let Some(frame) = outbox.frame.take() else { return false };
        outbox.free.extend(shown.as_ref().map(|frame| frame.slot));
        *shown = Some(frame);
        true
    }

    /// Returns the picture shown so far, which is shown no longer.
    pub fn give_back(&self, shown: &mut Option<Frame>) {
        lock(&self.shared.outbox).free.extend(shown.take().map(|frame| frame.slot));
    }

    /// A frame is waiting.
    pub fn has_frame(&self) -> bool {
        lock(&self.shared.outbox).frame.is_some()
    }

    /// What there is to tell.
    pub fn news(&self) -> Vec<News> {
        std::mem::take(&mut lock(&self.shared.outbox).news)
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        lock(&self.shared.inbox).quit = true;
        self.shared.arrived.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join(); // its panic was reported when it happened
        }
    }
}

fn work(spare: Spare, terms: &Terms, shared: &Arc<Shared>) -> Result<()> {
    let held = terms.turn.take();
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
        !inbox.quit && !other
    });
    let engine = Engine::new(aside.current(), terms.machine.clone(), Arc::clone(&terms.turn), wanted, notice)?;
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
    let held = terms.turn.take();
    drop(slots);
    drop(held);
    engine.close();
    let _held = terms.turn.take();
    drop(aside);
    Ok(())
}

/// What is being refined.
struct Doing {
    job: Job,
    key: Key,
    /// Passes at full quality that are in the mean; `None`: nothing at full quality yet.
    passes: Option<u32>,
    /// A picture of half the resolution and all photons was there.
    halved: bool,
    failed: bool,
    /// What is in the mean.
    made: Option<Made>,
    /// The picture is right, but it has to be shown once more.
    again: bool,
}

/// Half the resolution, all photons.
const HALF: Level = Level { coarse: 3, fewer: 0, no_gathering: false };

impl Doing {
    fn is_done(&self) -> bool {
        let wanted = if self.job.request.has_passes() { self.job.passes } else { 1 };
        self.failed || self.passes.is_some_and(|passes| passes >= wanted)
    }
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
            let idle = self.doing.as_ref().is_none_or(|doing| (doing.is_done() || doing.job.moving) && !doing.again);
            let (job, save) = {
                let mut inbox = lock(&self.shared.inbox);
                while idle && inbox.job.is_none() && inbox.save.is_none() && !inbox.quit {
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
            }
            if let Some(job) = job {
                self.begin(job);
            }
            self.step();
        }
    }

    /// Takes a job over; one that asks for the same picture goes on where the last one was.
    fn begin(&mut self, job: Job) {
        let last = self.doing.take().filter(|doing| doing.job.request == job.request);
        let failed = last.as_ref().is_some_and(|doing| doing.failed);
        let (passes, made) = last.filter(|_| !failed).map_or((None, None), |doing| (doing.passes, doing.made));
        let key = job.request.key();
        // What is there already is shown anew: other markers may be wanted over it, and a worker that comes back to the
        // front has no other picture to come with.
        self.doing = Some(Doing { job, key, passes, halved: false, failed, again: made.is_some(), made });
    }

    /// One pass of what is being done.
    fn step(&mut self) {
        let Some(doing) = &mut self.doing else { return };
        if std::mem::take(&mut doing.again)
            && let Some(made) = doing.made.clone()
        {
            return self.publish(made);
        }
        if doing.is_done() || doing.job.moving && doing.passes.is_some() {
            return;
        }
        let known = lock(&self.shared.outbox).known.contains(&doing.key);
        // The first picture of new programs is coarse, to be there soon; so is what moves.
        let level = match &self.ladder {
            Some(ladder) if doing.job.moving || !known => ladder.level(),
            // Where a whole picture takes long, one of half the resolution comes before it.
            Some(ladder) if doing.passes.is_none() && !doing.halved && ladder.level().coarse > HALF.coarse => HALF,
            _ => Level::FULL,
        };
        let pass = if level == Level::FULL { doing.passes.unwrap_or(0) } else { 0 };
        // What moves is within the budget and shown in any case: else nothing would be seen of a long motion.
        let stoppable = known && !doing.job.moving;
        *self.drawing.borrow_mut() = Some(doing.job.request.clone());
        let made = match self.engine.pass(&doing.job.request, level, pass, stoppable) {
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
            if known && doing.job.moving {
                ladder.measured(made.cost());
            } else if !doing.job.moving {
                ladder.rested();
            }
        }
        match level {
            Level::FULL => doing.passes = Some(pass + 1),
            level => doing.halved |= level == HALF,
        }
        doing.made = Some(made.clone());
        self.publish(made);
    }

    /// Hands the mean to the window, with what is drawn over it.
    fn publish(&mut self, made: Made) {
        let Some(doing) = &self.doing else { return };
        let request = doing.job.request.clone();
        let markers = match (&doing.job.markers, self.engine.pipeline()) {
            (Some(wanted), Some(pipeline)) => {
                let _held = self.terms.turn.take();
                Markers::collect(pipeline, &request.scene, &request.settings, wanted).ok().map(Arc::new)
            }
            _ => None,
        };
        let (key, converged) = (doing.key.clone(), doing.is_done());
        let slot = {
            let mut outbox = lock(&self.shared.outbox);
            // A frame that the window has not picked up is replaced.
            let missed = outbox.frame.take().map(|frame| frame.slot);
            missed.or_else(|| outbox.free.pop())
        };
        let Some(slot) = slot else { return };
        if let Err(error) = self.engine.copy_to(&mut self.slots[slot]) {
            let mut outbox = lock(&self.shared.outbox);
            outbox.free.push(slot);
            outbox.news.push(News::Failed(error.to_string()));
        } else if let Some((texture, ..)) = self.slots[slot].texture() {
            let mut outbox = lock(&self.shared.outbox);
            outbox.known.insert(key);
            outbox.frame = Some(Frame { request, texture, made, converged, markers, slot });
        }
        (self.terms.wake)();
    }

    fn save(&self, stem: &std::path::Path, exposure: f32) -> Result<Vec<PathBuf>> {
        let image = self.engine.read()?;
        let Some(doing) = &self.doing else { return Ok(Vec::new()) };
        let settings = &doing.job.request.settings;
        let note = |name: &str, value: String| (name.to_string(), value);
        let provenance = [
            note("scene", doing.job.request.scene.name.clone()),
            note("backend", doing.job.request.backend.name().into()),
            note("samples", settings.samples.to_string()),
            note("seed", settings.seed.to_string()),
            note("passes", doing.passes.unwrap_or(0).to_string()),
        ];
        let mut paths = Vec::new();
        for extension in ["png", "exr"] {
            let path = stem.with_extension(extension);
            image.save(&path, &SaveOptions { exposure, settings: &provenance, channels: &[] })?;
            paths.push(path);
        }
        Ok(paths)
    }
}
