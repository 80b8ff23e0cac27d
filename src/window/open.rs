//! An open window: what lives in it, and what happens between events.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use egui_glow::EguiGlow;
use winit::dpi::PhysicalSize;
use winit::event_loop::{ActiveEventLoop, EventLoopProxy};
use winit::keyboard::ModifiersState;
use winit::window::Window;

use super::driver_lock::DriverLock;
use super::engine::PIECE;
use super::exchange::{News, Terms};
use super::history::History;
use super::input::Input;
use super::job::{Goal, Job};
use super::journal::Journal;
use super::markers::ShownMarkers;
use super::pane::Pane;
use super::panel;
use super::player::{Player, Recording};
use super::request::Request;
use super::state::State;
use super::summary::{Options, Summary};
use super::watch::Watch;
use crate::device::gl::{Present, Windowed};
use crate::device::submissions;
use crate::error::Result;
use crate::settings::{Backend, TechniqueKind};

/// A worker has something.
#[derive(Debug)]
pub struct Wake;

/// Things rest when nothing has moved for so long.
const REST: Duration = Duration::from_millis(150);
/// A step of flight.
const TICK: Duration = Duration::from_millis(16);
/// An open window and all that lives in it.
pub struct Open {
    // What owns GL objects or contexts goes before the window's context.
    /// The picture, or the left and the right one.
    pub panes: [Option<Pane>; 2],
    /// Draws finished pictures into the window, tone-mapped.
    pub present: Present,
    /// Shows the panel.
    pub egui: EguiGlow,
    /// The window and its context.
    pub windowed: Windowed,
    /// What all workers share.
    pub terms: Terms,
    /// What the user has set.
    pub state: State,
    /// What the mouse and the keys of flight are doing.
    pub input: Input,
    /// Shift, control and their like.
    pub modifiers: ModifiersState,
    /// Times of the last frames.
    pub history: History,
    /// What was asked of each pane last.
    pub asked: [Option<(Request, Goal)>; 2],
    markers_asked: ShownMarkers,
    /// Where the picture is, points.
    pub area: egui::Rect,
    moved: Instant,
    ticked: Instant,
    /// When pictures came in the last second.
    pub painted_at: Vec<Instant>,
    /// Something on the screen is out of date.
    pub wants_paint: bool,
    /// Somebody may see the window.
    pub visible: bool,
    /// The window has a picture's size beside a panel of this scale, until the user gives it another.
    pub fitted: Option<Fitted>,
    /// Where screenshots go.
    pub screenshot: PathBuf,
    /// As the window has it.
    pub title: String,
    /// Notices when the scene file changes.
    pub watch: Watch,
    /// Edits that are not in it.
    pub journal: Journal,
    /// The path that is recorded.
    pub recording: Recording,
    /// The script that is replayed.
    pub player: Option<Player>,
}

/// The size with which a window opens.
#[derive(Clone, Copy, Debug)]
pub struct Fitted {
    /// Of the picture, pixels.
    pub picture: [u32; 2],
    /// There is a panel beside it.
    pub panel: bool,
}

impl Fitted {
    /// The window's size at a scale: the picture has its pixels, the panel its points.
    pub fn size(self, scale: f64) -> PhysicalSize<u32> {
        let beside = if self.panel { (f64::from(panel::WIDTH) * scale).round() as u32 } else { 0 };
        PhysicalSize::new(self.picture[0] + beside, self.picture[1])
    }
}

impl Open {
    /// Opens it.
    ///
    /// # Errors
    /// [`crate::error::Error::Driver`] without OpenGL.
    pub fn new(events: &ActiveEventLoop, options: Options, proxy: &EventLoopProxy<Wake>) -> Result<Open> {
        let fitted = Fitted { picture: [options.settings.width, options.settings.height], panel: options.panel };
        let monitor = events.primary_monitor().or_else(|| events.available_monitors().next());
        let size = fitted.size(monitor.map_or(1.0, |monitor| monitor.scale_factor()));
        let attributes = Window::default_attributes().with_title("Photile").with_inner_size(size);
        let windowed = Windowed::new(events, attributes)?;
        let software = windowed.current.is_software;
        // Others get their turn between two pieces of a picture, and so does a newer request.
        submissions::set_aim(PIECE);
        let driver_lock = Arc::new(DriverLock::new(software));
        let held = driver_lock.take();
        let present = Present::new(&windowed.current.gl)?;
        let egui = EguiGlow::new(events, windowed.functions(), None, None, false);
        // Nothing is painted anew without a reason, so what fades in would stay half faded.
        egui.egui_ctx.all_styles_mut(|style| style.animation_time = 0.0);
        drop(held);
        let proxy = proxy.clone();
        let terms = Terms {
            machine: options.machine.clone(),
            budget: options.budget.ms(software),
            driver_lock,
            // An event loop that is gone needs no waking.
            wake: Arc::new(move || drop(proxy.send_event(Wake))),
        };
        let backend = options.machine.backend.unwrap_or(Backend::OpenGl);
        let (watch, journal) = (Watch::new(&options.path), Journal::new(&options.path));
        let (now, named) = (options.record.is_some(), format!("{}.path.toml", options.scene.name));
        let recording = Recording::new(options.record.unwrap_or_else(|| PathBuf::from(named)), now);
        let player = options.script.map(|script| Player::new(script, options.table));
        let mut wish = options.wish;
        wish.on_gpu = !software;
        if wish.estimates {
            wish.kind.get_or_insert(TechniqueKind::Map); // until the user asks for something else
        }
        let mut state = State::new(options.path, options.scene, options.settings, backend, wish);
        (state.panel, state.passes) = (options.panel, options.passes);
        let left = Pane::new(windowed.spare()?, terms.clone());
        let now = Instant::now();
        Ok(Open {
            panes: [Some(left), None],
            present,
            egui,
            windowed,
            terms,
            state,
            input: Input::default(),
            modifiers: ModifiersState::empty(),
            history: History::default(),
            asked: [None, None],
            markers_asked: ShownMarkers::default(),
            area: egui::Rect::NOTHING,
            moved: now,
            ticked: now,
            painted_at: Vec::new(),
            wants_paint: true,
            visible: true,
            fitted: Some(fitted),
            screenshot: options.screenshot,
            title: String::new(),
            watch,
            journal,
            recording,
            player,
        })
    }

    /// Lets go of everything in the order in which it depends on each other.
    /// Edits that are not saved are kept where nobody closed the window, but something did, or something `failed`.
    pub fn close(mut self, summary: &mut Summary, failed: bool) {
        if self.recording.is_on() {
            self.record(summary);
        }
        match summary.interrupted || failed {
            true => summary.unsaved = self.journal.keep(&self.state),
            false => self.journal.close(),
        }
        self.panes = [None, None]; // waits for their threads
        let driver_lock = Arc::clone(&self.terms.driver_lock);
        let _held = driver_lock.take();
        self.egui.destroy();
        drop(self);
    }

    /// What happens between events; when to come back without any.
    ///
    /// # Errors
    /// What ends the window: the display is gone, or the driver gives no context.
    pub fn step(&mut self, summary: &mut Summary, started: Instant) -> Result<Instant> {
        let now = Instant::now();
        let flying = !self.input.flight().is_still();
        if flying && now - self.ticked >= TICK {
            let seconds = (now - self.ticked).min(Duration::from_millis(100)).as_secs_f64();
            self.state.hand.fly(self.input.flight(), seconds, self.modifiers.shift_key());
            self.ticked = now;
        } else if !flying {
            self.ticked = now;
        }
        match self.watch.poll(now) {
            Some(Ok(scene)) => {
                self.state.reload(scene);
                summary.reloads += 1;
                self.wants_paint = true;
            }
            Some(Err(error)) => {
                summary.file_errors.push(error.to_string());
                self.state.file_error = Some(error.to_string());
                self.wants_paint = true;
            }
            None => {}
        }
        self.recording.see(now, &self.state);
        self.journal.see(now, &self.state);
        if let (Some(player), Some(pane)) = (&mut self.player, &self.panes[0]) {
            self.wants_paint |= player.play(&mut self.state, pane);
        }
        self.submit(now)?;
        self.poll(summary, started)?;
        let mut next = now + Duration::from_millis(250);
        if self.wants_paint && self.visible {
            let start = Instant::now();
            if self.paint(summary)? {
                self.wants_paint = false;
                summary.longest_paint_ms = summary.longest_paint_ms.max(start.elapsed().as_secs_f64() * 1e3);
                let shown = self.panes[0].as_ref().and_then(Pane::shown);
                if self.player.as_mut().is_some_and(|player| player.seen(shown)) {
                    next = now;
                }
            } else {
                next = now + Duration::from_millis(4); // a worker has the driver
            }
        }
        if flying {
            next = next.min(self.ticked + TICK);
        }
        if self.asked.iter().flatten().any(|(_, goal)| *goal == Goal::Draft) {
            next = next.min((self.moved + REST).max(now + Duration::from_millis(1)));
        }
        Ok(next)
    }

    /// Tells the workers what is wanted now, where that is new.
    fn submit(&mut self, now: Instant) -> Result<()> {
        let scale = self.egui.egui_ctx.pixels_per_point();
        let [width, height] = [self.area.width(), self.area.height()].map(|side| (side * scale).round());
        if !(width >= 1.0 && height >= 1.0) {
            return Ok(());
        }
        (self.state.settings.width, self.state.settings.height) = (width as u32, height as u32);
        if self.state.right.is_none() {
            (self.panes[1], self.asked[1]) = (None, None);
        } else if self.panes[1].is_none() {
            self.panes[1] = Some(Pane::new(self.windowed.spare()?, self.terms.clone()));
        }
        let markers = (!self.state.markers.is_empty()).then_some(self.state.markers);
        for side in 0..2 {
            let (Some(pane), Some(request)) = (&mut self.panes[side], self.state.request(side == 1)) else { continue };
            let first = self.asked[side].is_none();
            let new = self.asked[side].as_ref().is_none_or(|(asked, _)| *asked != request);
            if new && !first {
                self.moved = now;
                self.state.failure = None;
            }
            // The very first request need not wait for more of its kind.
            let moving = self.state.paused || self.player.is_some() || !first && now - self.moved < REST;
            let goal = if moving { Goal::Draft } else { Goal::Passes(self.state.passes) };
            let other_markers = self.markers_asked != self.state.markers;
            if new || other_markers || self.asked[side].as_ref().is_some_and(|(_, was)| *was != goal) {
                let job = Job { request: request.clone(), goal, markers };
                let windowed = &self.windowed;
                pane.submit(job, || windowed.spare())?;
                self.asked[side] = Some((request, goal));
            }
        }
        self.markers_asked = self.state.markers;
        Ok(())
    }

    /// Picks up what workers have finished.
    fn poll(&mut self, summary: &mut Summary, started: Instant) -> Result<()> {
        let elapsed = started.elapsed().as_secs_f64() * 1e3;
        for (side, pane) in self.panes.iter_mut().enumerate() {
            let Some(pane) = pane else { continue };
            let windowed = &self.windowed;
            if pane.poll(|| windowed.spare())? {
                self.wants_paint = true;
                self.painted_at.push(Instant::now());
                if let (0, Some(frame)) = (side, pane.shown()) {
                    if let Some(player) = &mut self.player {
                        player.arrived(frame);
                    }
                    self.history.push(&frame.made);
                    summary.first_image_ms.get_or_insert(elapsed);
                    if frame.made.backend == Some(self.state.backend) {
                        summary.first_backend_ms.get_or_insert(elapsed);
                    }
                }
            }
            for news in pane.news() {
                self.wants_paint = true;
                match news {
                    News::Notice(line) => self.state.notice = Some(line),
                    News::Failed(line) => self.state.failure = Some(line),
                    News::Saved(paths) if paths.is_empty() => {}
                    News::Saved(paths) => {
                        let names: Vec<_> = paths.iter().map(|path| path.display().to_string()).collect();
                        self.state.notice = Some(format!("written: {}", names.join(", ")));
                        summary.written.extend(paths);
                    }
                }
            }
        }
        let second_ago = Instant::now() - Duration::from_secs(1);
        self.painted_at.retain(|at| *at > second_ago);
        Ok(())
    }
}
