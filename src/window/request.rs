//! What a pane of the window shall show.

use std::sync::Arc;

use crate::program::features::{Features, is_divided};
use crate::program::gathering::Gathering;
use crate::records::packing::Packed;
use crate::scene::{Camera, Scene};
use crate::settings::{Amount, Backend, DensityKernel, LightMode, Method, Settings, Technique};
use crate::techniques::Wish;

use super::level::Level;

/// A picture that is wanted, at full quality.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// What is seen, and from where.
    pub scene: Arc<Scene>,
    /// How, while things move; the size is the pane's, pixels.
    pub settings: Settings,
    /// How passes are made at rest. They may be of another technique and of fewer photons, each.
    pub passes: Settings,
    /// Where it is made.
    pub backend: Backend,
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

impl Request {
    /// What `settings` ask for, refined as `wish` says where that suits the scene.
    pub fn new(scene: Scene, settings: Settings, backend: Backend, wish: &Wish) -> Request {
        let mut passes = settings.clone();
        if wish.settle(&scene, &mut passes).is_err() {
            // What was asked for is not to be had in this scene: density estimates always are.
            passes = Settings { technique: Technique::Map, ..settings.clone() };
        }
        Request { scene: Arc::new(scene), settings, passes, backend }
    }

    /// Whether passes are of another technique than what moves: of other programs, then, and other tables.
    pub fn refines_apart(&self) -> bool {
        self.passes.technique != self.settings.technique
    }

    /// See [`Key`].
    pub fn key(&self) -> Key {
        let packed = Packed::new(&self.scene, self.scene.camera.position);
        Key {
            backend: self.backend,
            features: Features::of(&self.scene, &self.settings),
            method: self.settings.gather.method,
            density_kernel: self.settings.gather.density_kernel,
            light: self.settings.light,
            gathering: Gathering::of(&packed.shapes, packed.sphere_count, is_divided(&self.scene)),
        }
    }

    /// The same from another place.
    pub fn seen_from(&self, camera: &Camera, width: u32, height: u32) -> Request {
        let mut request = self.clone();
        if request.scene.camera != *camera {
            Arc::make_mut(&mut request.scene).camera = camera.clone();
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
