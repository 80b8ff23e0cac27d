//! The window's life: it opens, takes events, and closes.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::window::WindowId;

use super::open::{Open, Wake};
use super::player::Player;
use super::screen;
use super::summary::{Options, Summary};
use crate::device::gl::plain;
use crate::device::live_objects::{Api, alive};
use crate::error::{Error, Result};

/// Opens the window and runs it until it is closed. `started` is when the program did.
///
/// # Errors
/// [`Error::Driver`] without a display or OpenGL; whatever ends the window early.
pub fn run(options: Options, started: Instant) -> Result<Summary> {
    say_own_panics_only();
    let mut builder = EventLoop::<Wake>::with_user_event();
    screen::choose(&mut builder);
    let events = builder
        .build()
        .map_err(|error| Error::Driver(format!("window: no display: {} (X11 or Wayland is needed)", plain(error))))?;
    let mut app = App {
        summary: Summary { scene: options.scene.name.clone(), ..Summary::default() },
        stop: Arc::clone(&options.stop),
        options: Some(options),
        proxy: events.create_proxy(),
        open: None,
        failed: None,
        started,
    };
    events.run_app(&mut app).map_err(|error| Error::Driver(format!("window: {}", plain(error))))?;
    let App { failed, mut summary, .. } = app;
    (summary.gl_objects_left, summary.cl_objects_left) = (alive(Api::OpenGl), alive(Api::OpenCl));
    match failed {
        Some(error) => match summary.unsaved {
            Some(path) => Err(Error::Failed(format!("{error}; {} has the edits that were not saved", path.display()))),
            None => Err(error),
        },
        None => Ok(summary),
    }
}

/// Panics of the window library become errors (see `about_to_wait`), which say all that a user can do about them.
fn say_own_panics_only() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !panic.location().is_some_and(|at| at.file().contains("/winit-")) {
            usual(panic);
        }
    }));
}

struct App {
    stop: Arc<AtomicBool>,
    options: Option<Options>,
    proxy: EventLoopProxy<Wake>,
    open: Option<Open>,
    failed: Option<Error>,
    summary: Summary,
    started: Instant,
}

impl ApplicationHandler<Wake> for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if let (None, Some(options)) = (&self.open, self.options.take()) {
            match Open::new(events, options, &self.proxy) {
                Ok(open) => {
                    self.summary.renderer = open.windowed.current.renderer.clone();
                    self.summary.budget_ms = open.terms.budget;
                    self.open = Some(open);
                }
                Err(error) => {
                    self.failed = Some(error);
                    events.exit();
                }
            }
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, _: Wake) {
        if let Some(open) = &mut self.open {
            open.wants_paint = true;
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        let start = Instant::now();
        if matches!(event, WindowEvent::RedrawRequested) {
            open.wants_paint = true; // painted when all events are in
        } else if open.handle(&event, &mut self.summary) {
            events.exit();
        }
        self.summary.longest_event_ms = self.summary.longest_event_ms.max(start.elapsed().as_secs_f64() * 1e3);
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        let Some(open) = &mut self.open else { return };
        let (summary, started) = (&mut self.summary, self.started);
        // The window library panics where it asks a display that has gone away for a size. Nothing is built on what it
        // left: the window closes, and keeps what is unsaved.
        let next = catch_unwind(AssertUnwindSafe(|| open.step(summary, started)))
            .unwrap_or_else(|_| Err(Error::Driver("window: the display went away".into())));
        match next {
            Ok(next) => events.set_control_flow(ControlFlow::WaitUntil(next)),
            Err(error) => {
                self.failed = Some(error);
                events.exit();
            }
        }
        if open.player.as_ref().is_some_and(Player::is_done) {
            events.exit();
        }
        // Looked at four times a second, when nothing else happens.
        if self.stop.load(Ordering::Relaxed) {
            self.summary.interrupted = true;
            events.exit();
        }
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        if let Some(open) = self.open.take() {
            if let Some(player) = &open.player {
                self.summary.replayed = Some(player.finish(open.terms.budget));
            }
            self.summary.frames = open.panes.iter().flatten().map(|pane| pane.frames).sum();
            open.close(&mut self.summary, self.failed.is_some());
        }
    }
}
