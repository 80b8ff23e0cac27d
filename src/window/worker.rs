//! The window's end of a thread that renders: jobs go in, and finished pictures are picked up.

use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;

use super::exchange::{Frame, News, Shared, Terms, lock};
use super::job::Job;
use super::request::Key;
use super::thread::work;
use crate::device::gl::Spare;

/// The window's end of a worker. Dropping it ends the thread and waits for it.
pub struct Worker {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
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
