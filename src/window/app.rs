//! The window's events and its painting.

use std::io::Write as _;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use egui_glow::EguiGlow;
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::{ElementState, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::keyboard::{ModifiersState, NamedKey};
use winit::window::{Window, WindowId};

use super::hands::Hands;
use super::history::History;
use super::keys::{self, Action};
use super::pane::Pane;
use super::replay::{Counting, Replayed};
use super::request::Request;
use super::script::{Recorder, Script};
use super::state::{Effect, State};
use super::turn::Turn;
use super::watch::Watch;
use super::worker::{Job, News, Terms};
use super::{overlay, panel, save};
use crate::census::{Kind, alive};
use crate::error::{Error, Result};
use crate::film::write_beside;
use crate::gl::{Present, Shown, Windowed};
use crate::pace;
use crate::pipeline::Machine;
use crate::scene::{self, Scene};
use crate::settings::{Backend, Settings};

/// How the window begins.
pub struct Options {
    /// The scene file, which is watched.
    pub path: PathBuf,
    /// As read from it.
    pub scene: Scene,
    /// The size is the picture's at the beginning; the panel comes beside it.
    pub settings: Settings,
    /// Where pictures are made; without a backend OpenGL, or what works.
    pub machine: Machine,
    /// Milliseconds a frame while things move; `None`: 33 on a GPU, 100 in software.
    pub budget: Option<f64>,
    /// Passes until converged.
    pub passes: u32,
    /// The panel is there from the beginning.
    pub panel: bool,
    /// Where screenshots go: a path without extension.
    pub screenshot: PathBuf,
    /// Gone through instead of waiting for the user; then the window closes.
    pub script: Option<Script>,
    /// Where recorded paths go; recording begins at once where this is given.
    pub record: Option<PathBuf>,
    /// Full quality, however long a frame takes.
    pub full_quality: bool,
}

/// What a window was, for `--json`.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Summary {
    /// The scene's name.
    pub scene: String,
    /// GL_RENDERER of the window.
    pub renderer: String,
    /// Milliseconds a frame may take.
    pub budget_ms: Option<f64>,
    /// Milliseconds from the program's start to the first picture of the scene in the window.
    pub first_image_ms: Option<f64>,
    /// And to the first one by the backend that was asked for.
    pub first_backend_ms: Option<f64>,
    /// Pictures shown.
    pub frames: u64,
    /// Screenshots and other files written.
    pub written: Vec<PathBuf>,
    /// Times that the scene file was read again.
    pub reloads: u32,
    /// What was wrong with it at other times, with line and column.
    pub file_errors: Vec<String>,
    /// What keys and buttons asked for, in order.
    pub actions: Vec<String>,
    /// The longest that handling one event took, ms: input waits no longer than that, or than painting.
    pub longest_event_ms: f64,
    /// The longest that painting the window took, ms.
    pub longest_paint_ms: f64,
    /// What the script took.
    pub replayed: Option<Replayed>,
    /// GL objects that are left when all is closed.
    pub gl_objects_left: i64,
    /// OpenCL objects that are left when all is closed.
    pub cl_objects_left: i64,
}

/// A worker has something.
#[derive(Debug)]
struct Wake;

/// Frame budget on a GPU and in software, ms.
const BUDGETS: [f64; 2] = [33.0, 100.0];
/// Things rest when nothing has moved for so long.
const REST: Duration = Duration::from_millis(150);
/// What a piece of a picture should take, ms: less than a frame that waits for it.
const PIECE: f64 = 12.0;
/// A step of flight.
const TICK: Duration = Duration::from_millis(16);
/// The panel's width, points.
const PANEL: f32 = 290.0;

/// Opens the window and runs it until it is closed. `started` is when the program did.
///
/// # Errors
/// [`Error::Driver`] without a display or OpenGL; whatever ends the window early.
pub fn run(options: Options, started: Instant) -> Result<Summary> {
    let events = EventLoop::<Wake>::with_user_event()
        .build()
        .map_err(|error| Error::Driver(format!("window: no display: {error} (X11 or Wayland is needed)")))?;
    let mut app = App {
        summary: Summary { scene: options.scene.name.clone(), ..Summary::default() },
        options: Some(options),
        proxy: events.create_proxy(),
        open: None,
        failed: None,
        started,
    };
    events.run_app(&mut app).map_err(|error| Error::Driver(format!("window: {error}")))?;
    let App { failed, mut summary, .. } = app;
    (summary.gl_objects_left, summary.cl_objects_left) = (alive(Kind::OpenGl), alive(Kind::OpenCl));
    match failed {
        Some(error) => Err(error),
        None => Ok(summary),
    }
}

struct App {
    options: Option<Options>,
    proxy: EventLoopProxy<Wake>,
    open: Option<Open>,
    failed: Option<Error>,
    summary: Summary,
    started: Instant,
}

/// An open window and all that lives in it.
struct Open {
    // What owns GL objects or contexts goes before the window's context.
    panes: [Option<Pane>; 2],
    present: Present,
    egui: EguiGlow,
    windowed: Windowed,
    terms: Terms,
    state: State,
    hands: Hands,
    modifiers: ModifiersState,
    history: History,
    /// What was asked of each pane last.
    asked: [Option<(Request, bool)>; 2],
    markers_asked: super::markers::Wanted,
    /// Where the picture is, points.
    area: egui::Rect,
    moved: Instant,
    ticked: Instant,
    painted_at: Vec<Instant>,
    wants_paint: bool,
    visible: bool,
    screenshot: PathBuf,
    title: String,
    watch: Watch,
    recording: Option<(Recorder, Instant)>,
    record_to: PathBuf,
    player: Option<Player>,
}

/// A script under way.
struct Player {
    script: Script,
    counting: Counting,
    /// The picture that is waited for, and since when.
    awaited: Option<(Request, Instant)>,
    /// It is in the next painting.
    arrived: bool,
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
        let next = open.step(&mut self.summary, self.started);
        match next {
            Ok(next) => events.set_control_flow(ControlFlow::WaitUntil(next)),
            Err(error) => {
                self.failed = Some(error);
                events.exit();
            }
        }
        if open.player.as_ref().is_some_and(|player| player.counting.frames() >= player.script.frames()) {
            events.exit();
        }
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        if let Some(open) = self.open.take() {
            if let Some(player) = &open.player {
                self.summary.replayed = Some(player.counting.clone().finish(open.terms.budget));
            }
            self.summary.frames = open.panes.iter().flatten().map(|pane| pane.frames).sum();
            open.close();
        }
    }
}

impl Open {
    fn new(events: &ActiveEventLoop, options: Options, proxy: &EventLoopProxy<Wake>) -> Result<Open> {
        let beside = if options.panel { PANEL as u32 } else { 0 };
        let size = PhysicalSize::new(options.settings.width + beside, options.settings.height);
        let attributes = Window::default_attributes().with_title("Photile").with_inner_size(size);
        let windowed = Windowed::new(events, attributes)?;
        let software = windowed.current.is_software;
        // Others get their turn between two pieces of a picture, and so does a newer request.
        pace::set_aim(PIECE);
        let turn = Arc::new(Turn::new(software));
        let held = turn.take();
        let present = Present::new(&windowed.current.gl)?;
        let egui = EguiGlow::new(events, windowed.functions(), None, None, false);
        drop(held);
        let proxy = proxy.clone();
        let terms = Terms {
            machine: options.machine.clone(),
            budget: (!options.full_quality).then_some(options.budget.unwrap_or(BUDGETS[usize::from(software)])),
            turn,
            // An event loop that is gone needs no waking.
            wake: Arc::new(move || drop(proxy.send_event(Wake))),
        };
        let backend = options.machine.backend.unwrap_or(Backend::OpenGl);
        let watch = Watch::new(&options.path);
        let recording = options.record.is_some().then(|| (Recorder::default(), Instant::now()));
        let record_to = options.record.unwrap_or_else(|| PathBuf::from(format!("{}.path.toml", options.scene.name)));
        let (counting, awaited, arrived) = (Counting::default(), None, false);
        let player = options.script.map(|script| Player { script, counting, awaited, arrived });
        let mut state = State::new(options.path, options.scene, options.settings, backend);
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
            hands: Hands::default(),
            modifiers: ModifiersState::empty(),
            history: History::default(),
            asked: [None, None],
            markers_asked: super::markers::Wanted::default(),
            area: egui::Rect::NOTHING,
            moved: now,
            ticked: now,
            painted_at: Vec::new(),
            wants_paint: true,
            visible: true,
            screenshot: options.screenshot,
            title: String::new(),
            watch,
            recording,
            record_to,
            player,
        })
    }

    /// Lets go of everything in the order in which it depends on each other.
    fn close(mut self) {
        if self.recording.is_some() {
            self.record(&mut Summary::default());
        }
        self.panes = [None, None]; // waits for their threads
        let turn = Arc::clone(&self.terms.turn);
        let _held = turn.take();
        self.egui.destroy();
        drop(self);
    }

    /// Takes an event; whether the window shall close.
    fn handle(&mut self, event: &WindowEvent, summary: &mut Summary) -> bool {
        // Tab would give the panel's widgets the keyboard, one after the other.
        let tab = matches!(event, WindowEvent::KeyboardInput { event: key, .. } if key.logical_key == NamedKey::Tab);
        if !tab {
            self.wants_paint |= self.egui.on_window_event(&self.windowed.window, event).repaint;
        }
        let (over_panel, typing) =
            (self.egui.egui_ctx.egui_wants_pointer_input(), self.egui.egui_ctx.text_edit_focused());
        match event {
            WindowEvent::CloseRequested => return true,
            WindowEvent::Resized(size) => {
                self.windowed.resize(size.width, size.height);
                self.visible = size.width > 0 && size.height > 0;
                self.wants_paint = true;
            }
            WindowEvent::ScaleFactorChanged { .. } => self.wants_paint = true,
            WindowEvent::Occluded(hidden) => {
                self.visible = !hidden;
                self.wants_paint = true;
            }
            // Keys that go up elsewhere are not seen here.
            WindowEvent::Focused(false) => self.hands.release_all(),
            WindowEvent::ModifiersChanged(modifiers) => self.modifiers = modifiers.state(),
            WindowEvent::KeyboardInput { event: key, .. } => {
                let down = key.state == ElementState::Pressed;
                let control = self.modifiers.control_key();
                if let Some((axis, sign)) = keys::flight(key.physical_key).filter(|_| !control && (!typing || !down)) {
                    self.hands.key(axis, sign, down);
                }
                if down && !key.repeat && !typing {
                    let shift = self.modifiers.shift_key();
                    let action = keys::digit(key.physical_key).filter(|_| !control);
                    if let Some(action) = action.or_else(|| keys::action(&key.logical_key, control)) {
                        return self.act(action, shift, summary);
                    }
                }
            }
            WindowEvent::CursorMoved { position, .. } => {
                let scale = self.egui.egui_ctx.pixels_per_point();
                let at = egui::pos2(position.x as f32 / scale, position.y as f32 / scale);
                if self.hands.moved(at, self.area, &mut self.state) {
                    self.wants_paint = true;
                }
            }
            WindowEvent::MouseInput { state: ElementState::Pressed, button, .. } if !over_panel => {
                self.hands.pressed(*button, self.modifiers.shift_key(), self.area, &mut self.state);
            }
            WindowEvent::MouseInput { state: ElementState::Released, button, .. } => self.hands.released(*button),
            WindowEvent::MouseWheel { delta, .. } if !over_panel => {
                let notches = match delta {
                    MouseScrollDelta::LineDelta(_, y) => f64::from(*y),
                    MouseScrollDelta::PixelDelta(by) => by.y / 50.0,
                };
                self.state.hand.dolly(notches);
            }
            _ => {}
        }
        false
    }

    fn act(&mut self, action: Action, shift: bool, summary: &mut Summary) -> bool {
        self.wants_paint = true;
        summary.actions.push(format!("{action:?}"));
        match self.state.act(action, shift) {
            Effect::None => {}
            Effect::Quit => return true,
            Effect::Screenshot => {
                if let Some(pane) = &self.panes[0] {
                    pane.save(self.screenshot.clone(), self.state.exposure);
                }
            }
            Effect::Save => match self.save() {
                Ok(()) => {
                    self.state.notice = Some(format!("saved: {}", self.state.path.display()));
                    summary.written.push(self.state.path.clone());
                }
                Err(error) => self.state.failure = Some(error.to_string()),
            },
            Effect::Record => self.record(summary),
        }
        false
    }

    /// Writes the edits into the scene file.
    fn save(&mut self) -> Result<()> {
        let path = self.state.path.clone();
        let failed = |what: String| Error::File { path: path.clone(), what };
        let text = std::fs::read_to_string(&path).map_err(|error| failed(format!("cannot read: {error}")))?;
        // What somebody else wrote meanwhile must not be undone by what the window remembers.
        let on_disk = scene::load(&path)?;
        let new = self.state.to_save();
        let text = save::updated(&text, &on_disk, &new)?;
        let written = scene::parse(&text, &path.display().to_string())?;
        write_beside(&path, |file| file.write_all(text.as_bytes()))?;
        self.watch.acknowledge();
        self.state.saved = Arc::new(written.clone());
        // The numbers as they were written, so that nothing differs from the file.
        self.state.hand.camera = written.camera.clone();
        self.state.first_settings = self.state.settings.clone();
        self.state.scene = written;
        Ok(())
    }

    /// Begins to record, or ends and writes the file.
    fn record(&mut self, summary: &mut Summary) {
        let Some((recorder, _)) = self.recording.take() else {
            self.recording = Some((Recorder::default(), Instant::now()));
            return;
        };
        let Some(text) = recorder.finish(&self.state.scene) else { return };
        match write_beside(&self.record_to, |file| file.write_all(text.as_bytes())) {
            Ok(()) => {
                self.state.notice = Some(format!("recorded: {}", self.record_to.display()));
                summary.written.push(self.record_to.clone());
            }
            Err(error) => self.state.failure = Some(error.to_string()),
        }
    }

    /// The script's next picture, when the last one was seen.
    fn play(&mut self) {
        let ready = self.panes[0].as_ref().is_some_and(|pane| pane.shown().is_some() && !pane.is_building());
        let Some(player) = self.player.as_mut().filter(|player| ready && player.awaited.is_none()) else { return };
        if player.counting.frames() >= player.script.frames() {
            return;
        }
        let mut scene = self.state.scene_as_seen();
        player.script.apply(player.counting.frames(), &mut scene);
        self.state.hand.camera = scene.camera.clone();
        self.state.scene = scene;
        if let Some(request) = self.state.request(false) {
            // A picture that is there already is not made again.
            let shown = self.panes[0].as_ref().and_then(Pane::shown);
            player.arrived = shown.is_some_and(|frame| frame.request == request);
            self.wants_paint |= player.arrived;
            player.awaited = Some((request, Instant::now()));
        }
    }

    /// What happens between events; when to come back without any.
    fn step(&mut self, summary: &mut Summary, started: Instant) -> Result<Instant> {
        let now = Instant::now();
        let flying = !self.hands.flight().is_still();
        if flying && now - self.ticked >= TICK {
            let seconds = (now - self.ticked).min(Duration::from_millis(100)).as_secs_f64();
            self.state.hand.fly(self.hands.flight(), seconds, self.modifiers.shift_key());
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
        if let Some((recorder, since)) = &mut self.recording {
            recorder.see((now - *since).as_secs_f64(), &self.state.scene_as_seen());
        }
        self.play();
        self.submit(now)?;
        self.poll(summary, started);
        let mut next = now + Duration::from_millis(250);
        if self.wants_paint && self.visible {
            let start = Instant::now();
            if self.paint(summary)? {
                self.wants_paint = false;
                summary.longest_paint_ms = summary.longest_paint_ms.max(start.elapsed().as_secs_f64() * 1e3);
                if self.seen() {
                    next = now;
                }
            } else {
                next = now + Duration::from_millis(4); // a worker has the driver
            }
        }
        if flying {
            next = next.min(self.ticked + TICK);
        }
        if self.asked.iter().flatten().any(|(_, moving)| *moving) {
            next = next.min((self.moved + REST).max(now + Duration::from_millis(1)));
        }
        Ok(next)
    }

    /// The painted picture is the one that the script waits for.
    fn seen(&mut self) -> bool {
        let Some(player) = self.player.as_mut().filter(|player| player.arrived) else { return false };
        player.arrived = false;
        let frame = self.panes[0].as_ref().and_then(Pane::shown);
        if let (Some((_, since)), Some(frame)) = (player.awaited.take(), frame) {
            let photons = frame.made.photons.map_or(0, |photons| photons.stored);
            let ms = since.elapsed().as_secs_f64() * 1e3;
            player.counting.add(ms, frame.made.level, photons, player.script.frames());
        }
        true
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
            let other_markers = self.markers_asked != self.state.markers;
            if new || other_markers || self.asked[side].as_ref().is_some_and(|(_, was)| *was != moving) {
                let passes = self.state.passes;
                let job = Job { request: request.clone(), moving, passes, markers };
                let windowed = &self.windowed;
                pane.submit(job, || windowed.spare())?;
                self.asked[side] = Some((request, moving));
            }
        }
        self.markers_asked = self.state.markers;
        Ok(())
    }

    /// Picks up what workers have finished.
    fn poll(&mut self, summary: &mut Summary, started: Instant) {
        let elapsed = started.elapsed().as_secs_f64() * 1e3;
        for (side, pane) in self.panes.iter_mut().enumerate() {
            let Some(pane) = pane else { continue };
            if pane.poll() {
                self.wants_paint = true;
                self.painted_at.push(Instant::now());
                if let (0, Some(frame)) = (side, pane.shown()) {
                    if let Some(player) = &mut self.player {
                        player.arrived |= player.awaited.as_ref().is_some_and(|(wanted, _)| *wanted == frame.request);
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
    }

    /// Paints the window; false where a worker has the driver just now.
    fn paint(&mut self, summary: &mut Summary) -> Result<bool> {
        let turn = Arc::clone(&self.terms.turn);
        let Some(_held) = turn.try_take() else { return Ok(false) };
        let window = Arc::clone(&self.windowed.window);
        let PhysicalSize { width, height } = window.inner_size();
        let mut asked = None;
        let mut area = self.area;
        let (state, panes) = (&mut self.state, &self.panes);
        let facts = panel::Facts {
            frames: [0, 1].map(|side| panes[side].as_ref().and_then(Pane::shown)),
            building: [0, 1].map(|side| panes[side].as_ref().is_some_and(Pane::is_building)),
            history: &self.history,
            rate: self.painted_at.len() as f64,
            recording: self.recording.is_some(),
        };
        self.egui.run(&window, |ui| {
            if state.panel {
                egui::Panel::right("panel").exact_size(PANEL).resizable(false).show(ui, |ui| {
                    asked = asked.or(panel::show(ui, state, &facts));
                });
            }
            area = ui.available_rect_before_wrap();
            for frame in facts.frames.into_iter().flatten().take(1) {
                if let Some(markers) = &frame.markers {
                    overlay::draw(ui.painter(), area, &frame.request.scene.camera, markers, frame.made.size);
                }
            }
            if state.help {
                panel::help(ui, &mut state.help);
            }
        });
        self.area = area;
        self.present.clear(width, height);
        let scale = self.egui.egui_ctx.pixels_per_point();
        let [left, top, right, bottom] =
            [area.left(), area.top(), area.right(), area.bottom()].map(|x| (x * scale).round() as i32);
        let textures = [0, 1].map(|side| self.panes[side].as_ref().and_then(Pane::texture));
        if let [Some(texture), other] = textures {
            self.present.draw(&Shown {
                left: texture,
                right: other,
                heat: self.state.heat,
                divider: (self.state.divider * f64::from(right - left)).round() as f32,
                area: [left, height as i32 - bottom, right - left, bottom - top],
                exposure: self.state.exposure,
                tone_map: self.state.tone_map,
            });
        }
        self.egui.paint(&window);
        self.windowed.swap()?;
        let title = self.describe();
        if title != self.title {
            window.set_title(&title);
            self.title = title;
        }
        if let Some(action) = asked {
            self.act(action, false, summary);
        }
        Ok(true)
    }

    fn describe(&self) -> String {
        let mut title = format!("Photile: {} ({}", self.state.scene.name, self.state.backend.name());
        let frame = self.panes[0].as_ref().and_then(Pane::shown);
        if frame.is_some_and(|frame| frame.made.host_photons) {
            title += ", photons from the CPU: no OpenCL";
        }
        if self.state.paused {
            title += ", paused";
        }
        // Of what was asked for last, in all pictures.
        let done = self.panes.iter().zip(&self.asked).all(|(pane, asked)| match (pane, asked) {
            (Some(pane), Some((asked, _))) => {
                pane.shown().is_some_and(|frame| frame.converged && frame.request == *asked && !pane.is_building())
            }
            (pane, _) => pane.is_none(),
        });
        if done {
            title += ", converged";
        }
        title + ")"
    }
}
