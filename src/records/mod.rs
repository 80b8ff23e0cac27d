//! Every record that crosses to a device, declared once: the host struct, its texels, and the accessors that
//! shaders and kernels see. This is the only file with an offset in it.
//!
//! A record is a whole number of RGB texels. A three-component field fills a texel; scalars share one. The
//! [`prelude`] turns the declarations into `#define`s that GLSL and OpenCL C both understand, on top of a few
//! fetch macros that the two shims define (`glsl/shim.glsl`, `kernels/shim.cl`).

pub mod packed_scene;
pub mod packing;

use std::fmt::Write;

use bytemuck::{Pod, Zeroable};

/// Floats in a texel: RGB32F.
pub const TEXEL: usize = 3;

/// Indices travel as float values; from here on neighbours are no longer told apart (2²⁴).
pub const MAX_EXACT_INDEX: u64 = 1 << 24;

/// One field of a record: where it lies, in floats from the record's start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// The field's name, as in the host struct and in the accessor.
    pub name: &'static str,
    /// Floats from the start of the record.
    pub offset: usize,
    /// 1 or 3 floats.
    pub floats: usize,
}

/// A record that is uploaded as RGB texels.
pub trait Record: Pod {
    /// Singular, prefix of the accessors: `object` gives `object_color(i)`.
    const NAME: &'static str;
    /// Plural, the table's name on the device: `objects`.
    const TABLE: &'static str;
    /// In the order of declaration.
    const FIELDS: &'static [Field];
    /// Texels a record takes.
    const TEXELS: usize = size_of::<Self>() / (4 * TEXEL);
}

/// Declares a [`Record`]; a field that would straddle two texels does not compile.
macro_rules! record {
    ($(#[$doc:meta])* $name:ident, $singular:literal in $table:literal {
        $($(#[$field_doc:meta])* $field:ident: $type:ty,)*
    }) => {
        $(#[$doc])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
        pub struct $name { $($(#[$field_doc])* pub $field: $type,)* }

        impl Record for $name {
            const NAME: &'static str = $singular;
            const TABLE: &'static str = $table;
            const FIELDS: &'static [Field] = &[$(Field {
                name: stringify!($field),
                offset: core::mem::offset_of!($name, $field) / 4,
                floats: size_of::<$type>() / 4,
            },)*];
        }

        const _: () = {
            assert!(size_of::<$name>() % (4 * TEXEL) == 0, "a record is a whole number of texels");
            let mut i = 0;
            while i < <$name as Record>::FIELDS.len() {
                let field = <$name as Record>::FIELDS[i];
                assert!(field.floats == 1 || (field.floats == 3 && field.offset % TEXEL == 0),
                    "a field is one float, or a texel of its own");
                i += 1;
            }
        };
    };
}

record! {
    /// A sphere or a plane with its material: 12 floats in four texels. Spheres come first in the table.
    Object, "object" in "objects" {
        /// Sphere: centre; plane: unit normal. Scene space (metres from the pack's origin).
        anchor: [f32; 3],
        /// Sphere: radius; plane: `dot(normal, p)` of its points. Metres.
        extent: f32,
        /// [`SPHERE`] or [`PLANE`].
        kind: f32,
        /// GGX α.
        roughness: f32,
        /// Albedo of the diffuse part, linear Rec. 709.
        color: [f32; 3],
        /// `ambient · color` is added to the outgoing radiance.
        ambient: f32,
        /// kd.
        diffuse: f32,
        /// ks.
        specular: f32,
    }
}

/// [`Object::kind`] of a sphere.
pub const SPHERE: f32 = 0.0;
/// [`Object::kind`] of a plane.
pub const PLANE: f32 = 1.0;

record! {
    /// The fifth texel of an object, in a table of its own that only a scene with glass has.
    Glass, "glass" in "glasses" {
        /// kt.
        transmission: f32,
        /// Index of refraction.
        ior: f32,
        /// Zero.
        reserved: f32,
    }
}

record! {
    /// A point light: two texels.
    Light, "light" in "lights" {
        /// Scene space, metres.
        position: [f32; 3],
        /// Radiant intensity, W/sr per channel.
        intensity: [f32; 3],
    }
}

record! {
    /// What one picture needs besides the scene: camera, counts, sampling. Uniforms in GL, a small buffer in OpenCL.
    Frame, "frame" in "frame" {
        /// Camera, scene space, metres.
        position: [f32; 3],
        /// Half the image plane's width at distance 1, pointing to the image's right.
        right: [f32; 3],
        /// Half the image plane's height at distance 1, pointing to the image's top.
        up: [f32; 3],
        /// Unit viewing direction.
        forward: [f32; 3],
        /// Pixels.
        width: f32,
        /// Pixels.
        height: f32,
        /// Samples per pixel in this picture.
        samples: f32,
        /// Number of spheres in the object table.
        sphere_count: f32,
        /// Number of planes after them.
        plane_count: f32,
        /// Number of lights.
        light_count: f32,
        /// Low 16 bits of the seed.
        seed_low: f32,
        /// High 16 bits of the seed.
        seed_high: f32,
        /// Number of the first sample: passes go on where the last one stopped.
        first_sample: f32,
    }
}

record! {
    /// A light as the photon paths leave it.
    Emitter, "emitter" in "emitters" {
        /// Scene space, metres.
        position: [f32; 3],
        /// Throughput that a path begins with: the light's colour, its largest channel 1. Walks depend on this alone,
        /// so that the same path is walked however many others there are.
        color: [f32; 3],
        /// Power of one path in its largest channel, watts.
        power: f32,
        /// Zero.
        reserved: f32,
        /// Zero.
        unused: f32,
    }
}

record! {
    /// Where a photon landed. Photon tables are separate, one texel a property: a rejected candidate costs one fetch.
    PhotonPosition, "photon" in "photon_positions" {
        /// Scene space, metres.
        position: [f32; 3],
    }
}

record! {
    /// What a photon brought.
    PhotonPower, "photon" in "photon_powers" {
        /// Flux ΔΦ, watts per channel.
        power: [f32; 3],
    }
}

record! {
    /// How a photon came; only where a glossy surface needs it.
    PhotonDirection, "photon" in "photon_directions" {
        /// Unit, towards where the photon came from.
        direction: [f32; 3],
    }
}

record! {
    /// One side of one object (2·object + 0 | 1) as the photon grid sees it. See `cell.glsl` for u, v, w.
    Face, "face" in "faces" {
        /// Lowest corner of the face's cells along u, v, w; scene space, metres. Zero in the hashed form.
        origin: [f32; 3],
        /// Cells along u, v, w; zero where the face has no photons, and in the hashed form.
        counts: [f32; 3],
        /// The face's first cell in the table; in the hashed form how far its rows are moved along the table.
        base: f32,
        /// 1: u is y and v is x; 0: u, v, w are x, y, z.
        flipped: f32,
        /// First bucket of the hashed table that its rows wrap in; zero in the dense form.
        table: f32,
    }
}

record! {
    /// What gathering needs besides the tables.
    Gather, "gather" in "gather" {
        /// R, metres.
        radius: f32,
        /// 1/R.
        inverse_radius: f32,
        /// Photons in the map.
        photon_count: f32,
        /// A cell's size along x, y, z (but see `by_rows`); metres.
        cell: [f32; 3],
        /// 1 / `cell`, rounded once, here: build and query must divide alike.
        inverse_cell: [f32; 3],
        /// Length of a hashed table − 1.
        bucket_mask: f32,
        /// k of the k nearest.
        nearest: f32,
        /// Every how many-th candidate is gathered in one draw; 1 but for drivers that end long loops.
        slices: f32,
        /// Which of them this draw gathers, below `slices`.
        slice: f32,
        /// Tiles in a row of them.
        tiles_across: f32,
        /// A tile's width and, below, its height; pixels.
        tile_width: f32,
        /// Pixels.
        tile_height: f32,
        /// 1 where `cell` is a size along u, v, w of every face, whichever axes those are; 0 where along x, y, z.
        by_rows: f32,
        /// Zero.
        spare: f32,
    }
}

record! {
    /// A rectangle of pixels: which regions it sees.
    Tile, "tile" in "tiles" {
        /// Its first region.
        first: f32,
        /// Regions.
        count: f32,
        /// Zero.
        reserved: f32,
    }
}

record! {
    /// What a tile sees of one face, and the cells that the photons around it are sorted into. See `tile.glsl`.
    Region, "region" in "regions" {
        /// Lowest corner of the box of the tile's visible points on the face; scene space, metres.
        low: [f32; 3],
        /// Highest corner.
        high: [f32; 3],
        /// Lowest corner of the cells along u, v, w; scene space, metres.
        origin: [f32; 3],
        /// Cells along u, v, w.
        counts: [f32; 3],
        /// A cell's size along x, y, z; metres.
        cell: [f32; 3],
        /// 1 / `cell`, rounded once, here.
        inverse_cell: [f32; 3],
        /// 2·object + (0 | 1).
        face: f32,
        /// The region's first cell in the table.
        base: f32,
        /// 1: u is y and v is x; 0: u, v, w are x, y, z.
        flipped: f32,
        /// Squared distance from the box within which photons are on the list, m²: R², and what coordinates round.
        margin2: f32,
        /// Zero.
        reserved: f32,
        /// Zero.
        spare: f32,
    }
}

record! {
    /// How an object's surface is cut into irradiance texels. See `texels.glsl`.
    Chart, "chart" in "charts" {
        /// Plane: its first coordinate is `dot(axis_u, p) + offset_u`; scene space, 1/m. Sphere: zero.
        axis_u: [f32; 3],
        /// The second one's.
        axis_v: [f32; 3],
        /// See `axis_u`.
        offset_u: f32,
        /// See `axis_v`.
        offset_v: f32,
        /// 1: coordinates x are bent to x/(1 + |x|), for planes without an end; 0: they lie in [−1, 1] already.
        bend: f32,
        /// The first texel, of the side that the object's own normal points to; the other side's follow.
        first: f32,
        /// Texels along the first coordinate.
        columns: f32,
        /// Texels along the second one.
        rows: f32,
    }
}

record! {
    /// What an irradiance texel knows.
    Texel, "texel" in "texels" {
        /// Irradiance by photons of at least one bounce, W/m².
        irradiance: [f32; 3],
    }
}

record! {
    /// The lattice of sites at which irradiance is gathered for the pixels around. See `final.glsl`.
    SiteLattice, "lattice" in "lattice" {
        /// Where the lattice begins on the image plane, pixels, below `spacing`.
        offset_x: f32,
        /// Below.
        offset_y: f32,
        /// Pixels from site to site.
        spacing: f32,
        /// Sites in a row.
        columns: f32,
        /// Rows of sites.
        rows: f32,
        /// Rays of a site.
        rays: f32,
        /// Rays of a sample that gathers for itself.
        own_rays: f32,
        /// How many passes have gone on in the same sequences before.
        turn: f32,
        /// Low 16 bits of the key of all sites' sequences.
        key_low: f32,
        /// Its high 16 bits.
        key_high: f32,
        /// Lit points.
        points: f32,
        /// Density of lit points for each ray of a site and for the irradiance there, summed over the channels; 1/W.
        points_per_watt: f32,
        /// How far sites count, as a share of what is usual.
        reach: f32,
        /// Zero.
        reserved: f32,
        /// Zero.
        spare: f32,
    }
}

record! {
    /// A point that light from a point light reaches first. See `final.glsl`.
    LitPoint, "lit_point" in "lit_points" {
        /// Scene space.
        position: [f32; 3],
        /// Unit, towards the side that is lit.
        normal: [f32; 3],
        /// What it brings to a site where rays have no share in it, W/m².
        irradiance: [f32; 3],
        /// Density of such points for each ray of a site, 1/m².
        density: f32,
        /// What it lies on.
        object: f32,
        /// Zero.
        reserved: f32,
    }
}

record! {
    /// A site's irradiance.
    Site, "site" in "sites" {
        /// Indirect irradiance, W/m².
        irradiance: [f32; 3],
    }
}

record! {
    /// What a site lies on.
    SiteSurface, "site_surface" in "site_surfaces" {
        /// 2·object + (0 | 1), −1 where the site's ray hit nothing.
        face: f32,
        /// From the camera, metres.
        distance: f32,
        /// Zero.
        reserved: f32,
    }
}

/// Lists of plain numbers, three to a texel: the table's name and its accessor. `cell_starts[c]` is the first sorted
/// photon of cell c; a cell ends where the next one begins. `photon_faces[i]` is what stored photon i landed on, as
/// 2·object + (0 the side that the object's normal points to | 1 the other). `tile_photons[i]` is the number of the photon at place i of
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
    /// Tables of at most so many records may travel in uniforms instead (see [`OBJECTS_IN_UNIFORMS`]); 0: never.
    pub in_uniforms: usize,
}

/// A scene of at most so many objects and [`LIGHTS_IN_UNIFORMS`] lights goes to GL in uniforms: every ray asks for
/// every object, and llvmpipe fetches a texel lane by lane (measured on gi_ref: 4× faster trace). Together with the
/// frame this stays below the 1024 components that every GL 3.3 driver has.
pub const OBJECTS_IN_UNIFORMS: usize = 32;

/// See [`OBJECTS_IN_UNIFORMS`].
pub const LIGHTS_IN_UNIFORMS: usize = 16;

const fn declare<R: Record>(single: bool, in_uniforms: usize) -> Declaration {
    Declaration { name: R::NAME, table: R::TABLE, fields: R::FIELDS, texels: R::TEXELS, single, in_uniforms }
}

/// All records, in the order of the prelude.
pub const RECORDS: &[Declaration] = &[
    declare::<Frame>(true, 0),
    declare::<Object>(false, OBJECTS_IN_UNIFORMS),
    declare::<Light>(false, LIGHTS_IN_UNIFORMS),
    declare::<Glass>(false, 0),
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

/// The accessors as `#define`s: `object_color(i)` where lanes may ask for different records, and
/// `object_color_same(i)` where all ask for the same; `object_color_scalar(i)` is that one value, not yet spread over
/// the lanes; `frame_width()` for single records, whose triples have a `_scalar` form too.
///
/// `inject` shifts that field (`object.color`) by one channel or texel, so that a test can see the checks fail.
pub fn prelude(inject: Option<&str>) -> String {
    let mut text = String::new();
    for record in RECORDS {
        let Declaration { name, table, texels, .. } = record;
        // Scene tables have macros of their own: they may be uniforms.
        let (declaration, fetch) = match (record.single, record.in_uniforms) {
            (true, _) => (format!("PARAMS({table}, {texels})"), "PARAM"),
            (false, 0) => (format!("TABLE({table})"), "FETCH"),
            (false, most) => (format!("SCENE_TABLE({table}, {})", most * texels), "SCENE"),
        };
        writeln!(text, "{declaration}").expect("writing to a string");
        for field in record.fields {
            let shift = if inject == Some(&format!("{name}.{}", field.name)) { field.floats } else { 0 };
            let offset = (field.offset + shift) % (record.texels * TEXEL);
            let (texel, channel) = (offset / TEXEL, offset % TEXEL);
            let field_name = field.name;
            let line = match (record.single, field.floats) {
                (true, 1) => format!("#define {name}_{field_name}() PARAM1({table}, {texel}, {channel})"),
                (true, _) => format!(
                    "#define {name}_{field_name}() PARAM3({table}, {texel})\n\
                     #define {name}_{field_name}_scalar() PARAM3_SCALAR({table}, {texel})"
                ),
                (false, 1) => format!(
                    "#define {name}_{field_name}(i) {fetch}1({table}, i, {texels}, {texel}, {channel})\n\
                     #define {name}_{field_name}_same(i) {fetch}1_SAME({table}, i, {texels}, {texel}, {channel})\n\
                     #define {name}_{field_name}_scalar(i) {fetch}1_SCALAR({table}, i, {texels}, {texel}, {channel})"
                ),
                (false, _) => format!(
                    "#define {name}_{field_name}(i) {fetch}3({table}, i, {texels}, {texel})\n\
                     #define {name}_{field_name}_same(i) {fetch}3_SAME({table}, i, {texels}, {texel})\n\
                     #define {name}_{field_name}_scalar(i) {fetch}3_SCALAR({table}, i, {texels}, {texel})"
                ),
            };
            writeln!(text, "{line}").expect("writing to a string");
        }
    }
    for (list, accessor) in LISTS {
        writeln!(text, "LIST({list})\n#define {accessor}(i) ENTRY({list}, i)").expect("writing to a string");
    }
    text
}

/// Reads of every field of a table's records by its accessor, `FIELD3(0, object_anchor(i))`, for `validate`'s programs, which
/// define `FIELD1` and `FIELD3`. `same` takes the accessors that load one record for all lanes.
///
/// # Panics
/// When no table has this name.
pub fn field_reads(table: &str, same: bool) -> String {
    let record = RECORDS.iter().find(|r| r.table == table).unwrap_or_else(|| panic!("no table named {table}"));
    let argument = if record.single { "()" } else { "(i)" };
    let suffix = if same && !record.single { "_same" } else { "" };
    let mut text = String::new();
    for (number, field) in record.fields.iter().enumerate() {
        writeln!(text, "FIELD{}({number}, {}_{}{suffix}{argument})", field.floats, record.name, field.name)
            .expect("writing to a string");
    }
    text
}

/// Whether `name` is a field as `--inject` names it, `record.field`.
pub fn is_field(name: &str) -> bool {
    RECORDS.iter().any(|r| r.fields.iter().any(|f| format!("{}.{}", r.name, f.name) == name))
}

/// A table's shape as a texture: records wrap into rows of a power-of-two width.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Texels, a power of two.
    pub width: u32,
    /// Rows; at least 1, since GL has no empty texture.
    pub height: u32,
}

impl Shape {
    /// The smallest texture of rows of `1 << width_log2` texels that holds `texels`; narrower if one row suffices.
    pub fn of(texels: usize, width_log2: u32) -> Shape {
        let full = 1usize << width_log2;
        let width = texels.max(1).next_power_of_two().min(full);
        Shape { width: width as u32, height: texels.div_ceil(width).max(1) as u32 }
    }

    /// Texels in all, padding included.
    pub fn texels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

/// Texture width used everywhere but in `validate`, as a power of two: 4M texels fit in 2048 rows, and every GL 3.3
/// driver takes at least 1024 × 1024 (in practice 8192).
pub const TEXTURE_WIDTH_LOG2: u32 = 11;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_object_is_twelve_floats_in_four_texels() {
        assert_eq!(Object::TEXELS, 4);
        assert_eq!(size_of::<Object>(), 48);
        assert_eq!(Light::TEXELS, 2);
        assert_eq!(Glass::TEXELS, 1);
    }

    #[test]
    fn accessors_point_where_the_host_struct_puts_the_field() {
        let text = prelude(None);
        assert!(text.contains("#define object_color(i) SCENE3(objects, i, 4, 2)"), "{text}");
        assert!(text.contains("#define object_kind(i) SCENE1(objects, i, 4, 1, 1)"), "{text}");
        assert!(text.contains("#define frame_height() PARAM1(frame, 4, 1)"), "{text}");
    }

    #[test]
    fn an_injected_fault_moves_one_accessor_only() {
        let (sound, broken) = (prelude(None), prelude(Some("object.kind")));
        let changed: Vec<_> = sound.lines().zip(broken.lines()).filter(|(a, b)| a != b).collect();
        assert_eq!(changed.len(), 3);
        assert!(changed.iter().all(|(a, _)| a.contains("object_kind")));
        assert!(is_field("object.kind") && !is_field("object.colour"));
    }

    #[test]
    fn shapes_hold_all_texels_in_power_of_two_rows() {
        for texels in [0, 1, 2, 3, 2047, 2048, 2049, 4_000_012] {
            let shape = Shape::of(texels, TEXTURE_WIDTH_LOG2);
            assert!(shape.width.is_power_of_two() && shape.texels() >= texels);
            assert!(shape.texels() - texels <= shape.width as usize);
        }
        assert_eq!(Shape::of(5, 11), Shape { width: 8, height: 1 });
        assert_eq!(Shape::of(4096, 11), Shape { width: 2048, height: 2 });
    }
}
