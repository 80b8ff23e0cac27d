//! The window's end of a thread that renders: jobs go in, and finished pictures are picked up.

use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak};
use std::thread::JoinHandle;

use super::engine::Made;
use super::job::Job;
use super::markers::Markers;
use super::request::{Key, Request};
use super::thread::work;
use super::turn::Turn;
use crate::gl::{Spare, Texture};
use crate::pipeline::Machine;

/// A finished picture. It stays as it is until dropped: then its worker may draw into it again.
#[derive(Debug)]
pub struct Frame {
    /// The request that it answers, as submitted.
    pub request: Request,
    /// Shared with the window's context.
    pub texture: Texture,
    /// How it came about.
    pub made: Made,
    /// No further pass will follow.
    pub converged: bool,
    /// What to draw over it.
    pub markers: Option<Arc<Markers>>,
    /// Goes back to the worker with the frame.
    pub _lent: Lent,
}

/// A picture that is out of its worker's hands.
#[derive(Debug)]
pub struct Lent {
    /// Which of the worker's pictures.
    pub slot: usize,
    /// The worker, while there is one.
    pub owner: Weak<Shared>,
}

impl Drop for Lent {
    fn drop(&mut self) {
        if let Some(owner) = self.owner.upgrade() {
            lock(&owner.outbox).free.push(self.slot);
        }
    }
}

/// What a worker has to say.
#[derive(Debug)]
pub enum News {
    /// Something that the user should know.
    Notice(String),
    /// The request cannot be drawn.
    Failed(String),
    /// Files were written.
    Saved(Vec<PathBuf>),
}

/// What is wanted of a worker.
#[derive(Debug, Default)]
pub struct Inbox {
    /// The latest job.
    pub job: Option<Job>,
    /// Write files, by a path without extension, at an exposure.
    pub save: Option<(PathBuf, f32)>,
    /// Nothing more for now.
    pub halt: bool,
    /// Never again.
    pub quit: bool,
}

/// What a worker has made.
#[derive(Debug, Default)]
pub struct Outbox {
    /// The latest picture, until it is picked up.
    pub frame: Option<Frame>,
    /// Pictures that may be drawn into.
    pub free: Vec<usize>,
    /// What there is to tell.
    pub news: Vec<News>,
    /// Programs that are built.
    pub known: HashSet<Key>,
}

/// Where the window and a worker meet.
#[derive(Debug, Default)]
pub struct Shared {
    /// Window to worker.
    pub inbox: Mutex<Inbox>,
    /// Something came in.
    pub arrived: Condvar,
    /// Worker to window.
    pub outbox: Mutex<Outbox>,
}

/// A lock; what a thread that panicked left is whole.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
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
        let mut inbox = lock(&self.shared.inbox);
        (inbox.job, inbox.halt) = (Some(job), false);
        self.shared.arrived.notify_all();
    }

    /// Nothing more is wanted for now. What is done stays, and the same job goes on from there.
    pub fn halt(&self) {
        let mut inbox = lock(&self.shared.inbox);
        (inbox.job, inbox.halt) = (None, true);
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

    /// The newest picture, if there is one that was not taken yet.
    pub fn take(&self) -> Option<Frame> {
        lock(&self.shared.outbox).frame.take()
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
