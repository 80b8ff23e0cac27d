//! Named sets of tables: what kernels and shaders are given together, declared once. OpenCL's parameter lists
//! (`SCENE_PARAMS`) and the lists that functions pass on (`SCENE`) are made from them; GLSL holds all of it as globals, so
//! that there both are empty. Launches give arguments by name (`device::cl::Arguments`), textures are bound by name: an
//! order is nowhere but here, and in a kernel's own text.

use std::fmt::Write;

use super::{
    Chart, Emitter, Face, Frame, Gather, LISTS, Light, LitPoint, Material, PhotonDirection, PhotonPosition,
    PhotonPower, Quad, RECORDS, Record, Region, Shape, Site, SiteLattice, SiteSurface, Texel, Tile,
};

/// Members that are given together.
#[derive(Debug)]
pub struct TableSet {
    /// `SCENE` gives the macros `SCENE_PARAMS` and `SCENE`.
    pub name: &'static str,
    /// All of these must hold, else the set is empty.
    pub when: &'static [When],
    /// In the order of parameters.
    pub members: &'static [Member],
}

/// A condition on a program's `#define`s.
#[derive(Clone, Copy, Debug)]
pub enum When {
    /// This is defined.
    Has(&'static str),
    /// This is not.
    Lacks(&'static str),
}

/// A member of a set.
#[derive(Clone, Copy, Debug)]
pub enum Member {
    /// A table of records, a single record or a list, by its name there.
    Table(&'static str),
    /// The same, to be written.
    Written(&'static str),
    /// A table of whole numbers of no record.
    Words(&'static str),
    /// Vectors of four floats in the memory of a work-group.
    Local(&'static str),
    /// A whole number.
    Number(&'static str),
    /// Another set, as far as its condition holds.
    Set(&'static TableSet),
}

use Member::{Local, Number, Set, Table, Words, Written};
use When::{Has, Lacks};

/// What packing makes of a scene (`packing::Packed::tables`).
pub static PACKED: TableSet = TableSet {
    name: "PACKED",
    when: &[],
    members: &[Table(Shape::TABLE), Table(Material::TABLE), Table(Light::TABLE), Set(&QUADS)],
};

/// What quads have besides their planes.
static QUADS: TableSet = TableSet { name: "QUADS", when: &[Has("HAS_QUADS")], members: &[Table(Quad::TABLE)] };

/// Photons in the cells of a grid, or as they were stored.
pub static PHOTON_GRID: TableSet = TableSet {
    name: "PHOTON_GRID",
    when: &[Has("HAS_PHOTONS"), Lacks("GATHER_TILES")],
    members: &[Table(Gather::TABLE), Table(Face::TABLE), Table("cell_starts"), Set(&PHOTONS)],
};

/// Lists of photons by tile.
pub static PHOTON_TILES: TableSet = TableSet {
    name: "PHOTON_TILES",
    when: &[Has("GATHER_TILES")],
    members: &[
        Table(Gather::TABLE),
        Table(Tile::TABLE),
        Table(Region::TABLE),
        Table("cell_starts"),
        Table("tile_photons"),
        Set(&PHOTONS),
    ],
};

/// The photons themselves, a table a property.
pub static PHOTONS: TableSet = TableSet {
    name: "PHOTONS",
    when: &[],
    members: &[
        Table(PhotonPosition::TABLE),
        Table(PhotonPower::TABLE),
        Table("photon_faces"),
        Table(PhotonDirection::TABLE),
    ],
};

/// Where a group's photons wait to be weighed (`group.cl`).
static QUEUE: TableSet = TableSet { name: "QUEUE", when: &[Has("GATHER_GROUP")], members: &[Local("queue")] };

/// How objects are cut into irradiance texels.
pub static CHARTS: TableSet = TableSet { name: "CHARTS", when: &[Has("HAS_CHARTS")], members: &[Table(Chart::TABLE)] };

/// What final gathering's rays look up.
pub static FINAL_GATHER: TableSet = TableSet {
    name: "FINAL_GATHER",
    when: &[Has("HAS_FINAL_GATHER")],
    members: &[Table(SiteLattice::TABLE), Table(Texel::TABLE), Table(LitPoint::TABLE)],
};

/// What pixels take irradiance from.
pub static SITES: TableSet =
    TableSet { name: "SITES", when: &[Has("HAS_SITES")], members: &[Table(Site::TABLE), Table(SiteSurface::TABLE)] };

/// All that the shared functions of `glsl/shared/` may ask for.
pub static SCENE: TableSet = TableSet {
    name: "SCENE",
    when: &[],
    members: &[
        Table(Frame::TABLE),
        Set(&PACKED),
        Set(&PHOTON_GRID),
        Set(&PHOTON_TILES),
        Set(&QUEUE),
        Set(&CHARTS),
        Set(&FINAL_GATHER),
        Set(&SITES),
    ],
};

/// How lights share the photons' paths: emitters, a record a light; emitter_counts, three numbers a light: its slots of a
/// round, its first cell of the emission map, its cells; slots: light << SLOTS_LOG2 | rank among the light's own slots.
pub static EMISSION: TableSet = TableSet {
    name: "EMISSION",
    when: &[],
    members: &[Table(Emitter::TABLE), Words("emitter_counts"), Words("slots"), Words("emission_cells")],
};

/// Paths [first_path, end_path) in runs of run_length; `stream` is the hash of seed and pass.
pub static WALK: TableSet = TableSet {
    name: "WALK",
    when: &[],
    members: &[
        Set(&SCENE),
        Set(&EMISSION),
        Number("first_path"),
        Number("end_path"),
        Number("run_length"),
        Number("stream"),
    ],
};

static MAP_DIRECTIONS: TableSet =
    TableSet { name: "MAP_DIRECTIONS", when: &[Has("HAS_GLOSSY")], members: &[Written(PhotonDirection::TABLE)] };

/// What a photon leaves in the map.
pub static MAP: TableSet = TableSet {
    name: "MAP",
    when: &[],
    members: &[
        Written(PhotonPosition::TABLE),
        Written(PhotonPower::TABLE),
        Written("photon_faces"),
        Set(&MAP_DIRECTIONS),
    ],
};

/// Texels of a stress suite's own (`stress.glsl`).
pub static CASES: TableSet = TableSet { name: "CASES", when: &[], members: &[Table("cases")] };

/// All sets, each after those that it contains.
static SETS: &[&TableSet] = &[
    &QUADS,
    &PACKED,
    &PHOTONS,
    &PHOTON_GRID,
    &PHOTON_TILES,
    &QUEUE,
    &CHARTS,
    &FINAL_GATHER,
    &SITES,
    &SCENE,
    &EMISSION,
    &WALK,
    &MAP_DIRECTIONS,
    &MAP,
    &CASES,
];

impl When {
    fn holds(&self, defines: &[String]) -> bool {
        let is_defined = |name: &str| defines.iter().any(|define| define.split(' ').next() == Some(name));
        match self {
            Has(name) => is_defined(name),
            Lacks(name) => !is_defined(name),
        }
    }

    fn text(&self) -> String {
        match self {
            Has(name) => format!("defined({name})"),
            Lacks(name) => format!("!defined({name})"),
        }
    }
}

impl Member {
    /// As a parameter, comma included.
    fn parameter(&self) -> String {
        match self {
            Table(name) => format!("__global const float *{name},"),
            Written(name) => format!("__global float *{name},"),
            Words(name) => format!("__global const uint *{name},"),
            Local(name) => format!("__local float4 *{name},"),
            Number(name) => format!("uint {name},"),
            Set(set) => format!("{}_PARAMS", set.name),
        }
    }

    /// As it is passed on, comma included.
    fn argument(&self) -> String {
        match self {
            Table(name) | Written(name) | Words(name) | Local(name) | Number(name) => format!("{name},"),
            Set(set) => set.name.into(),
        }
    }
}

impl TableSet {
    /// Names of all tables that shaders read from textures in a program of these `#define`s; none: in any program.
    pub fn textures(&self, defines: Option<&[String]>) -> Vec<&'static str> {
        if defines.is_some_and(|defines| !self.when.iter().all(|condition| condition.holds(defines))) {
            return Vec::new();
        }
        let of_member = |member: &Member| match member {
            Table(name) if !is_single(name) => vec![*name],
            Set(set) => set.textures(defines),
            _ => Vec::new(),
        };
        self.members.iter().flat_map(of_member).collect()
    }

    /// The macros of this set.
    fn macros(&self) -> String {
        let parts = |part: fn(&Member) -> String| self.members.iter().map(part).collect::<Vec<_>>().join(" ");
        let name = self.name;
        let full =
            format!("#define {name}_PARAMS {}\n#define {name} {}\n", parts(Member::parameter), parts(Member::argument));
        if self.when.is_empty() {
            return full;
        }
        let condition = self.when.iter().map(When::text).collect::<Vec<_>>().join(" && ");
        format!("#if {condition}\n{full}#else\n{}#endif\n", self.no_macros())
    }

    /// The same where there is nothing to pass on.
    fn no_macros(&self) -> String {
        format!("#define {0}_PARAMS\n#define {0}\n", self.name)
    }
}

/// Whether this is a single record, which shaders have in uniforms.
fn is_single(table: &str) -> bool {
    RECORDS.iter().any(|record| record.table == table && record.single)
}

/// Whether records or lists have a table of this name.
pub fn is_table(name: &str) -> bool {
    RECORDS.iter().any(|record| record.table == name) || LISTS.iter().any(|(list, _)| *list == name)
}

/// The macros of all sets, for OpenCL C or for GLSL.
pub fn macros(is_glsl: bool) -> String {
    let mut text = String::new();
    for set in SETS {
        let own = if is_glsl { set.no_macros() } else { set.macros() };
        write!(text, "{own}").expect("writing to a string");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn defined(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| name.to_string()).collect()
    }

    #[test]
    fn every_member_is_declared_once_and_before_who_contains_it() {
        for (number, set) in SETS.iter().enumerate() {
            for member in set.members {
                match member {
                    Table(name) | Written(name) => assert!(is_table(name) || *name == "cases", "{name}"),
                    Set(inner) => {
                        assert!(SETS[..number].iter().any(|known| std::ptr::eq(*known, *inner)), "{}", inner.name);
                    }
                    _ => {}
                }
            }
        }
    }

    #[test]
    fn textures_are_those_of_the_program() {
        let plain = SCENE.textures(Some(&[]));
        assert_eq!(plain, ["shapes", "materials", "lights"]);
        assert_eq!(SCENE.textures(Some(&defined(&["HAS_QUADS"]))), PACKED.textures(None));
        let tiles = SCENE.textures(Some(&defined(&["HAS_PHOTONS", "GATHER_TILES"])));
        assert!(tiles.contains(&"regions") && !tiles.contains(&"faces") && !tiles.contains(&"gather"), "{tiles:?}");
        let grid = SCENE.textures(Some(&defined(&["HAS_PHOTONS"])));
        assert!(grid.contains(&"faces") && !grid.contains(&"regions"), "{grid:?}");
    }

    #[test]
    fn shaders_pass_nothing_on() {
        assert!(macros(true).lines().all(|line| line.split(' ').count() == 2));
        assert!(macros(false).contains("#define SCENE frame, PACKED PHOTON_GRID"));
    }
}
