//! Where the window and its workers meet: jobs go in, frames and news come out. No thread in here.

use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak};

use super::driver_lock::DriverLock;
use super::engine::FrameReport;
use super::job::Job;
use super::markers::Markers;
use super::request::{Key, Request};
use crate::device::gl::Texture;
use crate::pipeline::Machine;

/// A finished picture. It stays as it is until dropped: then its worker may draw into it again.
#[derive(Debug)]
pub struct Frame {
    /// The request that it answers, as submitted.
    pub request: Request,
    /// Shared with the window's context.
    pub texture: Texture,
    /// How it came about.
    pub made: FrameReport,
    /// No further pass will follow.
    pub converged: bool,
    /// What to draw over it.
    pub markers: Option<Arc<Markers>>,
    /// Goes back to the worker with the frame.
    pub _lease: FrameLease,
}

/// A picture that is out of its worker's hands.
#[derive(Debug)]
pub struct FrameLease {
    /// Which of the worker's pictures.
    pub slot: usize,
    /// The worker, while there is one.
    pub owner: Weak<Shared>,
}

impl Drop for FrameLease {
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
    /// The latest job: a newer one takes the place of one that was not begun.
    pub job: Option<Job>,
    /// Write files, by a path without extension, at an exposure.
    pub save: Option<(PathBuf, f32)>,
    /// Nothing more for now.
    pub halt: bool,
    /// The worker's thread ends: nothing will be wanted any more.
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

/// What all workers of a window share.
#[derive(Clone)]
pub struct Terms {
    /// Where pictures are made.
    pub machine: Machine,
    /// Milliseconds a frame while things move; `None`: full quality, however long it takes.
    pub budget: Option<f64>,
    /// Software drivers take turns.
    pub driver_lock: Arc<DriverLock>,
    /// Tells the window that there is something to pick up.
    pub wake: Arc<dyn Fn() + Send + Sync>,
}
