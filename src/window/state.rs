//! What the user has set: scene, camera, settings, what is shown. Keys and panel change it; the app draws it.

use std::cell::RefCell;
use std::path::PathBuf;
use std::sync::Arc;

use super::keys::Action;
use super::markers;
use super::orbit::Controller;
use super::pick::{self, Thing};
use super::request::Request;
use crate::device::gl::ToneMap;
use crate::scene::Scene;
use crate::settings::{Backend, LightMode, Method, Settings, TechniqueKind};
use crate::techniques::Wish;

/// The right picture of two: what differs from the left one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Right {
    /// Where it is made.
    pub backend: Backend,
    /// How its photons are found.
    pub method: Method,
}

/// All that the user can change.
pub struct State {
    /// The scene file.
    pub path: PathBuf,
    /// As the file has it: the last one that could be read.
    pub saved: Arc<Scene>,
    /// As it is shown, but for the camera. Changed by [`State::edit`]: as long as it is the same one, nobody has to look
    /// into it.
    pub scene: Arc<Scene>,
    seen: RefCell<Seen>,
    /// What was made of all this last, of the left picture and of the right one.
    asked: RefCell<[Option<Asked>; 2]>,
    /// The camera.
    pub hand: Controller,
    /// Of the left picture; the size is the pane's.
    pub settings: Settings,
    /// As the window began, for what the panel calls changed.
    pub first_settings: Settings,
    /// Of the left picture.
    pub backend: Backend,
    /// Split view.
    pub right: Option<Right>,
    /// Divider, share of the picture's width.
    pub divider: f64,
    /// The difference instead of two halves.
    pub heat: bool,
    /// Exposure value.
    pub exposure: f32,
    /// From radiance to display.
    pub tone_map: ToneMap,
    /// Drawn over the picture.
    pub markers: markers::ShownMarkers,
    /// No refining.
    pub paused: bool,
    /// Passes until converged.
    pub passes: u32,
    /// How passes are made: what was asked for, the rest open.
    pub wish: Wish,
    /// The panel is there.
    pub panel: bool,
    /// The help is there.
    pub help: bool,
    /// What was held last.
    pub held: Option<Thing>,
    /// What is wrong with the scene file, with line and column.
    pub file_error: Option<String>,
    /// The last thing to tell.
    pub notice: Option<String>,
    /// What cannot be drawn.
    pub failure: Option<String>,
}

/// The scene with the camera where it is.
struct Seen {
    of: Arc<Scene>,
    scene: Arc<Scene>,
}

/// A request, and what it was made of.
struct Asked {
    scene: Arc<Scene>,
    settings: Settings,
    backend: Backend,
    wish: Wish,
    request: Request,
}

/// What the app has to do after an action, beyond drawing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Nothing more.
    None,
    /// Write the picture.
    Screenshot,
    /// Write the scene file.
    Save,
    /// Start or end recording.
    Record,
    /// End.
    Quit,
}

impl State {
    /// A scene at its own camera.
    pub fn new(path: PathBuf, scene: Scene, settings: Settings, backend: Backend, wish: Wish) -> State {
        let mut settings = settings;
        if settings.gather.method == Method::Auto {
            settings.gather.method = Method::Grid; // choosing anew for every frame would swap programs as one moves
        }
        let scene = Arc::new(scene);
        State {
            path,
            hand: Controller::new(scene.camera.clone(), size_of(&scene)),
            saved: Arc::clone(&scene),
            exposure: scene.render.exposure.unwrap_or(0.0) as f32,
            seen: RefCell::new(Seen { of: Arc::clone(&scene), scene: Arc::clone(&scene) }),
            asked: RefCell::default(),
            scene,
            first_settings: settings.clone(),
            settings,
            backend,
            right: None,
            divider: 0.5,
            heat: false,
            tone_map: ToneMap::default(),
            markers: markers::ShownMarkers::default(),
            paused: false,
            passes: 256,
            wish,
            panel: true,
            help: false,
            held: None,
            file_error: None,
            notice: None,
            failure: None,
        }
    }

    /// Edits the scene, but for the camera, which is the hand's. One that comes out as it was is the same one as before.
    pub fn edit(&mut self, edit: impl FnOnce(&mut Scene)) {
        let mut scene = (*self.scene).clone();
        edit(&mut scene);
        scene.camera.clone_from(&self.scene.camera);
        if scene != *self.scene {
            self.scene = Arc::new(scene);
        }
    }

    /// What the left picture is, or the right one. As long as nothing changes this is asked at every event: then it is
    /// what it was, and no scene is looked into.
    pub fn request(&self, right: bool) -> Option<Request> {
        let (mut settings, mut backend) = (self.settings.clone(), self.backend);
        if right {
            let other = self.right?;
            (backend, settings.gather.method) = (other.backend, other.method);
        }
        // The twins are slow wherever the window is.
        let wish = Wish { on_gpu: self.wish.on_gpu && backend != Backend::Cpu, ..self.wish };
        let seen = self.scene_as_seen();
        let last = &mut self.asked.borrow_mut()[usize::from(right)];
        let same = |last: &Asked| {
            Arc::ptr_eq(&last.scene, &self.scene)
                && (last.backend, last.wish) == (backend, wish)
                && last.settings == settings
        };
        let request = match last.take().filter(same) {
            Some(last) if Arc::ptr_eq(&last.request.scene, &seen) => last.request,
            Some(last) => last.request.of_view(seen),
            None => Request::new(seen, settings.clone(), backend, &wish),
        };
        let scene = Arc::clone(&self.scene);
        *last = Some(Asked { scene, settings, backend, wish, request: request.clone() });
        Some(request)
    }

    /// The user changed how photons are gathered: passes do it that way, too.
    pub fn gather_asked(&mut self) {
        self.wish.kind = Some(TechniqueKind::Map);
    }

    /// The file was read again: what the user changed gives way, but the camera stays unless the file moved it.
    pub fn reload(&mut self, scene: Scene) {
        if scene.camera != self.saved.camera {
            self.hand.rehome(scene.camera.clone());
        }
        self.saved = Arc::new(scene);
        self.scene = Arc::clone(&self.saved);
        self.file_error = None;
    }

    /// Does what a key asks for. `shift` means the right picture.
    pub fn act(&mut self, action: Action, shift: bool) -> Effect {
        match action {
            Action::Gather(method) => {
                match (&mut self.right, shift) {
                    (Some(right), true) => right.method = method,
                    _ => self.settings.gather.method = method,
                }
                self.gather_asked();
            }
            Action::Backend => match (&mut self.right, shift) {
                (Some(right), true) => right.backend = next(right.backend, &Backend::ALL),
                _ => self.backend = next(self.backend, &Backend::ALL),
            },
            Action::Light => {
                self.settings.light = next(self.settings.light, &LightMode::ALL);
            }
            Action::Pause => self.paused = !self.paused,
            Action::Split => {
                self.right = match self.right {
                    Some(_) => None,
                    None => Some(self.other()),
                };
                self.heat = false;
            }
            Action::HeatMap => {
                self.heat = !self.heat;
                if self.heat && self.right.is_none() {
                    self.right = Some(self.other());
                }
            }
            Action::Focus => {
                let (center, radius) = pick::focus_of(&self.scene_as_seen(), self.held);
                self.hand.focus(center, radius);
            }
            Action::Reset => self.hand.reset(),
            Action::Markers => self.markers = next_markers(self.markers),
            Action::Panel => self.panel = !self.panel,
            Action::Help => self.help = !self.help,
            Action::Screenshot => return Effect::Screenshot,
            Action::Save => return Effect::Save,
            Action::Record => return Effect::Record,
            Action::Quit => return Effect::Quit,
        }
        Effect::None
    }

    /// The scene with the camera where it is: the same one as long as neither changes.
    pub fn scene_as_seen(&self) -> Arc<Scene> {
        let mut seen = self.seen.borrow_mut();
        if !Arc::ptr_eq(&seen.of, &self.scene) || seen.scene.camera != self.hand.camera {
            let scene = Scene { camera: self.hand.camera.clone(), ..(*self.scene).clone() };
            *seen = Seen { of: Arc::clone(&self.scene), scene: Arc::new(scene) };
        }
        Arc::clone(&seen.scene)
    }

    /// What a split first compares with: another backend, the same method.
    fn other(&self) -> Right {
        Right { backend: next(self.backend, &Backend::ALL), method: self.settings.gather.method }
    }

    /// Whether there is something to save.
    pub fn is_changed(&self) -> bool {
        *self.saved != self.to_save()
    }

    /// The scene as it would be written: the camera where it is, and the settings that differ from the file's.
    pub fn to_save(&self) -> Scene {
        let mut scene = (*self.scene_as_seen()).clone();
        let (now, then) = (&self.settings, &self.first_settings);
        let render = &mut scene.render;
        if now.light != then.light {
            render.light = Some(now.light);
        }
        if now.gather.method != then.gather.method {
            render.gather = Some(now.gather.method);
        }
        if now.gather.radius != then.gather.radius {
            render.radius = now.gather.radius.map(f64::from);
        }
        if let (true, crate::settings::Amount::Paths(paths)) =
            (now.photons.amount != then.photons.amount, now.photons.amount)
        {
            render.photons = Some(paths.into());
        }
        if self.exposure != self.saved.render.exposure.unwrap_or(0.0) as f32 {
            render.exposure = Some(f64::from(self.exposure));
        }
        scene
    }
}

/// The one after `now`, around.
fn next<T: Copy + PartialEq>(now: T, all: &[T]) -> T {
    let at = all.iter().position(|one| *one == now).unwrap_or(0);
    all[(at + 1) % all.len()]
}

fn next_markers(now: markers::ShownMarkers) -> markers::ShownMarkers {
    let none = markers::ShownMarkers::default();
    match (now.photons, now.cells, now.tiles) {
        (false, false, false) => markers::ShownMarkers { photons: true, ..none },
        (true, false, false) => markers::ShownMarkers { cells: true, ..none },
        (false, true, false) => markers::ShownMarkers { tiles: true, ..none },
        _ => none,
    }
}

/// A length that flying speed goes by: how far things are from the camera, metres.
fn size_of(scene: &Scene) -> f64 {
    let eye = scene.camera.position;
    let to_target = (scene.camera.look_at - eye).length();
    let farthest = scene.shapes.iter().filter_map(|s| s.bounds()).map(|(center, radius)| center.distance(eye) + radius);
    let farthest = farthest.chain(scene.lights.iter().map(|l| l.origin().distance(eye))).fold(0.0, f64::max);
    farthest.max(to_target)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packing::packings;

    fn without_spheres(scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        scene.shapes.spheres.clear();
        scene
    }

    fn state() -> State {
        let text = "[camera]\nposition = [0, 0, 9]\nlook_at = [0, 0, 0]\n";
        let scene = crate::scene::parse(text, "empty.toml").unwrap();
        State::new("empty.toml".into(), scene, Settings::default(), Backend::OpenGl, Wish::default())
    }

    #[test]
    fn keys_change_the_picture_that_they_mean() {
        let mut state = state();
        assert_eq!(state.settings.gather.method, Method::Grid);
        assert!(state.request(true).is_none());
        state.act(Action::Split, false);
        state.act(Action::Gather(Method::Tiles), true);
        assert_eq!(state.request(true).unwrap().settings.gather.method, Method::Tiles);
        assert_eq!(state.request(false).unwrap().settings.gather.method, Method::Grid);
        assert_eq!(state.request(true).unwrap().backend, Backend::OpenCl);
        for _ in 0..3 {
            state.act(Action::Backend, false);
            state.act(Action::Light, false);
        }
        assert_eq!((state.backend, state.settings.light), (Backend::OpenGl, LightMode::Hybrid));
        for _ in 0..4 {
            state.act(Action::Markers, false);
        }
        assert!(state.markers.is_empty());
        assert_eq!(state.act(Action::Quit, false), Effect::Quit);
    }

    fn lit() -> State {
        let text = "[camera]\nposition = [0, 0, 9]\nlook_at = [0, 0, 0]\n[materials.m]\ncolor = [1, 1, 1]\n\
                    [[lights]]\nposition = [0, 3, 0]\nintensity = [9, 9, 9]\n\
                    [[spheres]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"m\"\n\
                    [[planes]]\nnormal = [0, 1, 0]\noffset = -1\nmaterial = \"m\"\n";
        let scene = crate::scene::parse(text, "lit.toml").unwrap();
        State::new("lit.toml".into(), scene, Settings::default(), Backend::OpenGl, Wish::default())
    }

    #[test]
    fn idle_events_pack_nothing_and_a_moved_camera_packs_nothing_either() {
        let mut state = lit();
        state.act(Action::Split, false);
        let before = packings();
        let first = [false, true].map(|right| state.request(right).unwrap());
        assert!(packings() > before, "the first request knows nothing yet");
        let (before, saved) = (packings(), Arc::clone(&state.scene));
        for _ in 0..100 {
            // What no event changed, and what was edited to what it was.
            state.edit(|scene| scene.lights.points[0].position.y = 3.0);
            for (right, first) in [false, true].into_iter().zip(&first) {
                let request = state.request(right).unwrap();
                assert!(Arc::ptr_eq(&request.scene, &first.scene) && request == *first);
            }
            assert!(Arc::ptr_eq(&state.scene_as_seen(), &first[0].scene), "picking looks at the same one");
        }
        assert!(Arc::ptr_eq(&state.scene, &saved));
        state.hand.orbit(0.1, 0.0);
        assert!(state.request(false).unwrap().scene.camera != first[0].scene.camera);
        assert_eq!(packings() - before, 0, "scenes packed to learn that nothing changed");
        state.edit(|scene| scene.lights.points[0].position.y = 2.0);
        state.request(false);
        assert!(packings() > before, "what changed has to be looked into");
    }

    /// A change, and whether it asks for other programs.
    type Case = (&'static str, fn(&mut State), bool);

    #[test]
    fn every_change_makes_another_request_and_the_key_is_the_one_of_a_fresh_start() {
        const CASES: &[Case] = &[
            ("camera", |state| state.hand.orbit(0.1, 0.0), false),
            ("camera below the floor", |state| state.hand.camera.position.y = -5.0, true),
            ("light's place", |state| state.edit(|scene| scene.lights.points[0].position.x = 1.0), false),
            ("light below the floor", |state| state.edit(|scene| scene.lights.points[0].position.y = -3.0), true),
            ("light's intensity", |state| state.edit(|scene| scene.lights.points[0].intensity.x = 1.0), false),
            (
                "second light",
                |state| state.edit(|scene| scene.lights.points.push(scene.lights.points[0].clone())),
                true,
            ),
            ("sphere", |state| state.edit(|scene| scene.shapes.spheres[0].center.x = 1.0), false),
            ("no sphere", |state| state.edit(|scene| scene.shapes.spheres.clear()), true),
            ("colour", |state| state.edit(|scene| scene.materials[0].color.x = 0.5), false),
            ("gloss", |state| state.edit(|scene| scene.materials[0].specular = 0.5), true),
            ("photons", |state| state.settings.photons.amount = crate::settings::Amount::Paths(77), false),
            ("size", |state| state.settings.width = 99, false),
            ("method", |state| state.settings.gather.method = Method::Knn, true),
            ("light mode", |state| state.settings.light = LightMode::Photons, true),
            ("backend", |state| state.backend = Backend::Cpu, true),
            ("rays", |state| state.wish.rays = Some(3), false),
            ("technique", |state| state.gather_asked(), false),
            ("another file", |state| state.reload(without_spheres(&state.scene)), true),
        ];
        for (what, change, other_programs) in CASES {
            let mut state = lit();
            let before = state.request(false).unwrap();
            change(&mut state);
            let request = state.request(false).unwrap();
            assert!(request != before, "{what}: nothing new is drawn");
            assert_eq!(request.key() != before.key(), *other_programs, "{what}");
            // As by a window that never saw what was before.
            let fresh = Request::new(state.scene_as_seen(), state.settings.clone(), state.backend, &state.wish);
            assert!(request == fresh && request.key() == fresh.key(), "{what}");
        }
    }

    #[test]
    fn a_reload_keeps_the_view_unless_the_file_moved_it() {
        let mut state = state();
        state.hand.orbit(0.1, 0.0);
        let view = state.hand.camera.clone();
        assert!(state.is_changed());
        let mut scene = (*state.saved).clone();
        scene.name = "renamed".into();
        state.reload(scene.clone());
        assert_eq!(state.hand.camera, view);
        scene.camera.fov_y = 60.0;
        state.reload(scene.clone());
        assert_eq!(state.hand.camera, scene.camera);
        assert!(!state.is_changed());
    }
}
