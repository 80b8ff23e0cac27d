//! What a pane of the window shall show.

use std::sync::Arc;

use crate::packing::Packed;
use crate::program::features::{Features, is_divided};
use crate::program::gathering::Gathering;
use crate::scene::{Camera, Scene};
use crate::settings::{Amount, Backend, DensityKernel, LightMode, Method, Settings, Technique};
use crate::techniques::Wish;

use super::level::Level;

/// A picture that is wanted, at full quality. It is made anew rather than changed, since its key goes with it.
#[derive(Clone, Debug)]
pub struct Request {
    /// What is seen, and from where.
    pub scene: Arc<Scene>,
    /// How, while things move; the size is the pane's, pixels.
    pub settings: Settings,
    /// How passes are made at rest. They may be of another technique and of fewer photons, each.
    pub passes: Settings,
    /// Where it is made.
    pub backend: Backend,
    key: Key,
}

impl PartialEq for Request {
    fn eq(&self, other: &Request) -> bool {
        let same_scene = Arc::ptr_eq(&self.scene, &other.scene) || self.scene == other.scene;
        (self.backend, &self.settings, &self.passes) == (other.backend, &other.settings, &other.passes) && same_scene
    }
}

/// Which programs a request needs: two requests with the same key need no compilation in between.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Key {
    backend: Backend,
    features: Features,
    method: Method,
    density_kernel: DensityKernel,
    light: LightMode,
    gathering: Gathering,
}

impl Key {
    /// `gathering`: what the scene's objects need, from wherever they are seen.
    fn new(scene: &Scene, settings: &Settings, backend: Backend, gathering: Gathering) -> Key {
        Key {
            backend,
            features: Features::of(scene, settings),
            method: settings.gather.method,
            density_kernel: settings.gather.density_kernel,
            light: settings.light,
            gathering: gathering.divided(is_divided(scene)),
        }
    }
}

impl Request {
    /// What `settings` ask for, refined as `wish` says where that suits the scene.
    pub fn new(scene: Arc<Scene>, settings: Settings, backend: Backend, wish: &Wish) -> Request {
        let mut passes = settings.clone();
        if wish.settle(&scene, &mut passes).is_err() {
            // What was asked for is not to be had in this scene: density estimates always are.
            passes = Settings { technique: Technique::Map, ..settings.clone() };
        }
        let packed = Packed::new(&scene, scene.camera.position);
        let gathering = Gathering::of(&packed.shapes, packed.sphere_count, is_divided(&scene));
        let key = Key::new(&scene, &settings, backend, gathering);
        Request { scene, settings, passes, backend, key }
    }

    /// Whether passes are of another technique than what moves: of other programs, then, and other tables.
    pub fn refines_apart(&self) -> bool {
        self.passes.technique != self.settings.technique
    }

    /// See [`Key`].
    pub fn key(&self) -> &Key {
        &self.key
    }

    /// The same made elsewhere.
    pub fn on(&self, backend: Backend) -> Request {
        Request { backend, key: Key { backend, ..self.key.clone() }, ..self.clone() }
    }

    /// Another view of the same scene: all that differs is the camera. Nothing has to be packed for that.
    pub fn of_view(&self, scene: Arc<Scene>) -> Request {
        let key = Key::new(&scene, &self.settings, self.backend, self.key.gathering);
        Request { scene, key, ..self.clone() }
    }

    /// The same from another place, in another size.
    pub fn seen_from(&self, camera: &Camera, width: u32, height: u32) -> Request {
        let mut request = self.clone();
        if request.scene.camera != *camera {
            request = self.of_view(Arc::new(Scene { camera: camera.clone(), ..(*self.scene).clone() }));
        }
        for settings in [&mut request.settings, &mut request.passes] {
            (settings.width, settings.height) = (width, height);
        }
        request
    }

    /// Settings of a single picture at a level.
    pub fn draft(&self, level: Level) -> Settings {
        let mut settings = self.settings.clone();
        settings.width = level.side(settings.width);
        settings.height = level.side(settings.height);
        settings.photons.amount = match settings.photons.amount {
            Amount::Paths(paths) => Amount::Paths(level.paths(paths)),
            Amount::Stored(stored) => Amount::Stored(level.paths(stored)),
        };
        if level.no_gathering && settings.light == LightMode::Hybrid {
            settings.light = LightMode::Direct;
        }
        settings
    }
}
