//! What can change between two pictures, and which stages that makes stale: one table, read top to bottom. Nothing else
//! decides what is rebuilt.

/// A set of kinds of change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Change(u32);

impl Change {
    /// Nothing.
    pub const NONE: Change = Change(0);
    /// The viewpoint, or the image's size or samples.
    pub const CAMERA: Change = Change(1);
    /// A light's position or intensity.
    pub const LIGHTS: Change = Change(2);
    /// Numbers of a material.
    pub const MATERIALS: Change = Change(4);
    /// Spheres or planes: place, number, or which material they have.
    pub const GEOMETRY: Change = Change(8);
    /// Which code is needed: the permutation of the programs.
    pub const FEATURES: Change = Change(16);
    /// How many photons, their seed or pass, or which of them are stored.
    pub const PHOTONS: Change = Change(32);
    /// How photons are gathered: radius, method, kernel, cells.
    pub const GATHER: Change = Change(64);
    /// Which technique makes radiance of photons.
    pub const TECHNIQUE: Change = Change(128);
    /// All of it: the first picture.
    pub const ALL: Change = Change(255);

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

/// A step of the pipeline that can be stale.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// Building programs for the permutation.
    Compile,
    /// Scene records to the device.
    Upload,
    /// Emission of photons.
    Photons,
    /// Photons into cells.
    Grid,
    /// Photons into screen-space tiles.
    Tiles,
    /// Photon map to where it is gathered.
    Textures,
    /// Primary rays, shading.
    Trace,
}

impl Stage {
    /// In the pipeline's order.
    pub const ALL: [Stage; 7] =
        [Stage::Compile, Stage::Upload, Stage::Photons, Stage::Grid, Stage::Tiles, Stage::Textures, Stage::Trace];
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
