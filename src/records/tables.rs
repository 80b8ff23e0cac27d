//! All tables: every record by name, and lists of plain numbers.

use super::record::{Field, Record};
use super::{
    Chart, Emitter, Face, Frame, Gather, Light, LitPoint, Material, PhotonDirection, PhotonPosition, PhotonPower, Quad,
    Region, Shape, Site, SiteLattice, SiteSurface, Texel, Tile,
};

/// Indices travel as float values; from here on neighbours are no longer told apart (2²⁴).
pub const MAX_EXACT_INDEX: u64 = 1 << 24;

/// Lists of plain numbers, three to a texel: the table's name and its accessor. `cell_starts[c]` is the first sorted
/// photon of cell c; a cell ends where the next one begins. `photon_faces[i]` is what stored photon i landed on, as
/// 2·sheet + (0 the side that the object's normal points to | 1 the other). `tile_photons[i]` is the number of the photon at place i of
/// the tiles' lists, which `cell_starts` divides into cells where photons are gathered by tiles.
pub const LISTS: &[(&str, &str)] =
    &[("cell_starts", "cell_start"), ("photon_faces", "photon_face"), ("tile_photons", "tile_photon")];

/// A record's declaration without its type, for lists of all records.
#[derive(Clone, Copy, Debug)]
pub struct Declaration {
    /// See [`Record::NAME`].
    pub name: &'static str,
    /// See [`Record::TABLE`].
    pub table: &'static str,
    /// See [`Record::FIELDS`].
    pub fields: &'static [Field],
    /// See [`Record::TEXELS`].
    pub texels: usize,
    /// A single record in uniforms rather than a table in a texture.
    pub single: bool,
    /// Tables of at most so many records may travel in uniforms instead (see [`SHAPES_IN_UNIFORMS`]); 0: never.
    pub in_uniforms: usize,
}

/// A scene of at most so many objects and [`LIGHTS_IN_UNIFORMS`] lights goes to GL in uniforms: every ray asks for
/// every object, and llvmpipe fetches a texel lane by lane (measured on gi_ref: 4× faster trace). Together with the
/// frame this stays below the 1024 components that every GL 3.3 driver has.
pub const SHAPES_IN_UNIFORMS: usize = 32;

/// See [`SHAPES_IN_UNIFORMS`].
pub const LIGHTS_IN_UNIFORMS: usize = 16;

/// See [`SHAPES_IN_UNIFORMS`]: 32 shapes, of them 12 quads, and 16 lights take 230 of the 256 vectors.
pub const QUADS_IN_UNIFORMS: usize = 12;

const fn declare<R: Record>(single: bool, in_uniforms: usize) -> Declaration {
    Declaration { name: R::NAME, table: R::TABLE, fields: R::FIELDS, texels: R::TEXELS, single, in_uniforms }
}

/// All records, in the order of the prelude.
pub const RECORDS: &[Declaration] = &[
    declare::<Frame>(true, 0),
    declare::<Shape>(false, SHAPES_IN_UNIFORMS),
    declare::<Material>(false, SHAPES_IN_UNIFORMS),
    declare::<Light>(false, LIGHTS_IN_UNIFORMS),
    declare::<Quad>(false, QUADS_IN_UNIFORMS),
    declare::<Gather>(true, 0),
    declare::<Face>(false, 0),
    declare::<Tile>(false, 0),
    declare::<Region>(false, 0),
    declare::<Emitter>(false, 0),
    declare::<PhotonPosition>(false, 0),
    declare::<PhotonPower>(false, 0),
    declare::<PhotonDirection>(false, 0),
    declare::<Chart>(false, 0),
    declare::<Texel>(false, 0),
    declare::<SiteLattice>(true, 0),
    declare::<LitPoint>(false, 0),
    declare::<Site>(false, 0),
    declare::<SiteSurface>(false, 0),
];
