//! What a pane of the window shall show.

use std::sync::Arc;

use crate::features::{Features, is_divided};
use crate::gathering::Gathering;
use crate::pack::Packed;
use crate::scene::{Camera, Scene};
use crate::settings::{Amount, Backend, DensityKernel, LightMode, Method, Settings};

use super::ladder::Level;

/// A picture that is wanted, at full quality.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// What is seen, and from where.
    pub scene: Arc<Scene>,
    /// How; the size is the pane's, pixels.
    pub settings: Settings,
    /// Where it is made.
    pub backend: Backend,
}

/// Which programs a request needs: two requests with the same key need no compilation in between.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Key {
    backend: Backend,
    features: Features,
    method: Method,
    kernel: DensityKernel,
    light: LightMode,
    gathering: Gathering,
}

impl Request {
    /// See [`Key`].
    pub fn key(&self) -> Key {
        let packed = Packed::new(&self.scene, self.scene.camera.position);
        Key {
            backend: self.backend,
            features: Features::of(&self.scene, &self.settings),
            method: self.settings.gather.method,
            kernel: self.settings.gather.kernel,
            light: self.settings.light,
            gathering: Gathering::of(&packed.objects, packed.sphere_count, is_divided(&self.scene)),
        }
    }

    /// The same from another place.
    pub fn seen_from(&self, camera: &Camera, width: u32, height: u32) -> Request {
        let mut request = self.clone();
        if request.scene.camera != *camera {
            Arc::make_mut(&mut request.scene).camera = camera.clone();
        }
        (request.settings.width, request.settings.height) = (width, height);
        request
    }

    /// Settings of one pass at a level.
    pub fn pass(&self, level: Level, pass: u32) -> Settings {
        let mut settings = self.settings.clone();
        settings.width = level.side(settings.width);
        settings.height = level.side(settings.height);
        settings.first_sample += pass * settings.samples;
        settings.photons.pass += pass;
        settings.photons.amount = match settings.photons.amount {
            Amount::Paths(paths) => Amount::Paths(level.paths(paths)),
            Amount::Stored(stored) => Amount::Stored(level.paths(stored)),
        };
        if level.no_gathering && settings.light == LightMode::Hybrid {
            settings.light = LightMode::Direct;
        }
        settings
    }

    /// Whether further passes would give another picture.
    pub fn has_passes(&self) -> bool {
        let lit = !self.scene.lights.is_empty();
        self.settings.samples > 1 || (lit && self.settings.light != LightMode::Direct)
    }
}
