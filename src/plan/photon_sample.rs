//! A few of a map's photons, by which radius, cells and method are chosen.

use crate::records::PhotonPosition;

/// The first photons of a map, from which the rest is judged.
pub struct Sample {
    /// Scene space, metres.
    pub positions: Vec<PhotonPosition>,
    /// The face that each lies on: 2·object + (0 | 1).
    pub faces: Vec<u32>,
}
