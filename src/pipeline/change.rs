//! What can change between two pictures, and which stages that makes stale: one table, read top to bottom. Nothing else
//! decides what is rebuilt.
//!
//! A stage that runs may find that what it keeps of the scene still stands: then the scene is of the generation that it
//! was made from (`packing::packed_scene`). Programs that were built before are found again.

pub use crate::stage::Stage;

use crate::scene::Scene;
use crate::settings::{Pass, Settings, Technique};

/// A set of kinds of change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Change(u32);

impl Change {
    /// Nothing.
    pub const NONE: Change = Change(0);
    /// The viewpoint, the image's size or samples, or which pass it is.
    pub const CAMERA: Change = Change(1);
    /// A light's position or intensity.
    pub const LIGHTS: Change = Change(2);
    /// Numbers of a material.
    pub const MATERIALS: Change = Change(4);
    /// Spheres or planes: place, number, or which material they have.
    pub const GEOMETRY: Change = Change(8);
    /// Which code is needed: the permutation of the programs. Told by the technique, once its map is sorted.
    pub const FEATURES: Change = Change(16);
    /// How many photons, their seed or pass, or which of them are stored.
    pub const PHOTONS: Change = Change(32);
    /// How photons are gathered: radius, method, kernel, cells.
    pub const GATHER: Change = Change(64);
    /// Which technique makes radiance of photons.
    pub const TECHNIQUE: Change = Change(128);
    /// All of it: the first picture.
    pub const ALL: Change = Change(255);

    /// What differs between two pictures, but for the code that they need: that is known once the map is sorted.
    pub fn between(
        (before, was, then): (&Scene, &Settings, &Pass),
        (scene, settings, pass): (&Scene, &Settings, &Pass),
    ) -> Change {
        let size = |s: &Settings| (s.width, s.height, s.samples);
        let emitted = |s: &Settings, pass: &Pass| (s.photons, s.light, pass.index, pass.seed);
        // What a technique's own tables are made from.
        let technique = |s: &Settings| match s.technique {
            Technique::Map => None,
            Technique::FinalGather(gather) => Some((gather.spacing > 1, gather.texels)),
        };
        Change::CAMERA
            .when(before.camera != scene.camera || size(was) != size(settings) || then != pass)
            .and(Change::LIGHTS.when(before.lights != scene.lights))
            .and(Change::MATERIALS.when(before.materials != scene.materials))
            .and(Change::GEOMETRY.when(before.shapes != scene.shapes))
            .and(Change::PHOTONS.when(emitted(was, then) != emitted(settings, pass)))
            .and(Change::GATHER.when(was.gather != settings.gather))
            .and(Change::TECHNIQUE.when(technique(was) != technique(settings)))
            // Rays and points are asked for anew by every picture.
            .and(Change::CAMERA.when(was.technique != settings.technique))
    }

    /// Both sets together.
    pub fn and(self, other: Change) -> Change {
        Change(self.0 | other.0)
    }

    /// `self` where the condition holds, else nothing.
    pub fn when(self, condition: bool) -> Change {
        if condition { self } else { Change::NONE }
    }

    /// Whether the two sets share a kind of change.
    pub fn touches(self, other: Change) -> bool {
        self.0 & other.0 != 0
    }
}

/// For each kind of change, the stages that it makes stale.
const TABLE: &[(Change, &[Stage])] = &[
    (Change::FEATURES, &[Stage::Compile, Stage::Trace]),
    (Change::GEOMETRY, &[Stage::Upload, Stage::Photons, Stage::Grid, Stage::Tiles, Stage::Textures, Stage::Trace]),
    (Change::MATERIALS, &[Stage::Upload, Stage::Photons, Stage::Grid, Stage::Tiles, Stage::Textures, Stage::Trace]),
    (Change::LIGHTS, &[Stage::Upload, Stage::Photons, Stage::Grid, Stage::Tiles, Stage::Textures, Stage::Trace]),
    (Change::PHOTONS, &[Stage::Photons, Stage::Grid, Stage::Tiles, Stage::Textures, Stage::Trace]),
    (Change::GATHER, &[Stage::Compile, Stage::Grid, Stage::Tiles, Stage::Textures, Stage::Trace]),
    (Change::TECHNIQUE, &[Stage::Compile, Stage::Photons, Stage::Grid, Stage::Tiles, Stage::Textures, Stage::Trace]),
    (Change::CAMERA, &[Stage::Tiles, Stage::Trace]),
];

/// Whether a change makes a stage stale.
pub fn is_stale(stage: Stage, change: Change) -> bool {
    TABLE.iter().any(|(kind, stages)| kind.touches(change) && stages.contains(&stage))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moved_camera_uploads_nothing() {
        assert!(is_stale(Stage::Trace, Change::CAMERA));
        assert!(!is_stale(Stage::Upload, Change::CAMERA));
        assert!(!is_stale(Stage::Compile, Change::GEOMETRY));
    }

    #[test]
    fn every_kind_of_change_shows_in_the_picture() {
        for (kind, _) in TABLE {
            assert!(is_stale(Stage::Trace, *kind), "{kind:?}");
        }
        assert!(!is_stale(Stage::Trace, Change::NONE));
    }
}
