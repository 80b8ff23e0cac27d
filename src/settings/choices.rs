//! Ways that users choose among by name. Each enum is its own table: a row says the way's name in commands, files and
//! JSON, and the line that `--help` prints of it. The command line, the scene file, the panel and the keys of the window
//! all read the rows, so that a new way is one row here.

/// What users read of one way.
#[derive(Clone, Copy, Debug)]
pub struct ChoiceRow<T: 'static> {
    /// The enum's variant.
    pub value: T,
    /// As users write it, in commands, scene files and JSON.
    pub name: &'static str,
    /// As users read it where there is room for more than its name.
    pub title: &'static str,
    /// The line of `--help`.
    pub help: &'static str,
    /// The window's key for it, and what F1 says of that key.
    pub key: Option<(&'static str, &'static str)>,
    /// Whether users can name it; if not, it is what settings hold as long as nobody chose.
    pub is_offered: bool,
}

impl<T> ChoiceRow<T> {
    /// A row of which nothing particular is to be said.
    const fn new(value: T, name: &'static str, help: &'static str) -> ChoiceRow<T> {
        ChoiceRow { value, name, title: name, help, key: None, is_offered: true }
    }
}

/// An enum of ways that users choose among.
pub trait Choice: Copy + Eq + Send + Sync + 'static {
    /// A row for each variant, in the order in which lists show them.
    const TABLE: &'static [ChoiceRow<Self>];

    /// What users read of this way.
    fn row(self) -> &'static ChoiceRow<Self> {
        Self::TABLE.iter().find(|row| row.value == self).expect("the macro writes a row for each variant")
    }

    /// The rows of the ways that users can name.
    fn offered() -> impl Iterator<Item = &'static ChoiceRow<Self>> {
        Self::TABLE.iter().filter(|row| row.is_offered)
    }

    /// The way that users write as `name`.
    fn named(name: &str) -> Option<Self> {
        Self::offered().find(|row| row.name == name).map(|row| row.value)
    }
}

/// Declares enums together with their tables: `Variant = "name", "line of help", field: value …;`, where the fields are
/// those of [`ChoiceRow`] that differ from [`ChoiceRow::new`]'s.
macro_rules! choices {
    ($(
        $(#[$about:meta])*
        $choice:ident {
            $($(#[$note:meta])* $way:ident = $name:literal, $help:literal $(, $field:ident: $value:expr)*;)+
        }
    )+) => {$(
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum $choice {
            $(
                #[doc = concat!($help, ".")]
                $(#[$note])*
                $way,
            )+
        }

        impl $choice {
            /// Every variant, in the order of the table.
            pub const ALL: [$choice; [$($name),+].len()] = [$($choice::$way),+];

            /// As users write it, in commands, files and JSON.
            pub const fn name(self) -> &'static str {
                match self {
                    $($choice::$way => $name,)+
                }
            }
        }

        impl Choice for $choice {
            const TABLE: &'static [ChoiceRow<$choice>] =
                &[$(ChoiceRow { $($field: $value,)* ..ChoiceRow::new($choice::$way, $name, $help) }),+];
        }

        impl serde::Serialize for $choice {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.name())
            }
        }
    )+};
}

choices! {
    /// Who carries direct light.
    #[derive(Default)]
    LightMode {
        #[default]
        Hybrid = "hybrid", "Shadow rays for direct light, photons for the rest";
        /// As in the 2016 report.
        Photons = "photons", "All light from the photon map";
        Direct = "direct", "No photons at all";
    }

    /// Which machine traces and gathers; in the order in which one is chosen when none is asked for.
    Backend {
        OpenGl = "opengl", "A fragment shader on a full-screen quad", title: "OpenGL";
        OpenCl = "opencl", "Kernels alone", title: "OpenCL";
        Cpu = "cpu", "The twins in Rust", title: "CPU";
    }

    /// How the photons around a point are found.
    #[derive(Default)]
    Method {
        Auto = "auto", "Whichever of grid, tiles and tiled grid should be the fastest", is_offered: false;
        #[default]
        Grid = "grid", "The cells of a grid around the point", key: Some(("1", "gather by grid"));
        Tiles = "tiles", "The list of the point's screen-space tile", key: Some(("2", "gather by tiles"));
        TiledGrid = "tiled-grid", "The cells around the point in a grid of its tile",
            key: Some(("3", "gather by tiled grid"));
        /// The distance to the next one is the radius.
        Knn = "knn", "The k nearest photons within the radius", key: Some(("4", "gather k nearest photons"));
        Brute = "brute", "All photons: slow, the truth for tests", key: Some(("5", "gather by brute force"));
    }

    /// The kernel K of the density estimate; each integrates to 1 over the unit disc.
    #[derive(Default)]
    DensityKernel {
        Constant = "constant", "1/π";
        /// The least variance for its bias (Epanechnikov 1969).
        #[default]
        Epanechnikov = "epanechnikov", "2/π · (1 − t²)";
        /// Jensen's (1996).
        Cone = "cone", "3/π · (1 − t)";
        /// Smooth at its rim.
        Biweight = "biweight", "3/π · (1 − t²)²";
    }

    /// Which of the grid's two forms is wanted.
    #[derive(Default)]
    GridForm {
        #[default]
        Auto = "auto", "The dense one where it takes no more memory than the photons themselves", is_offered: false;
        Dense = "dense", "Every face's box filled with cells";
        Hashed = "hashed", "A table of hashed rows";
    }

    /// Where the numbers of emission and first bounce come from.
    #[derive(Default)]
    Sampler {
        /// Roberts' R₄ sequence.
        #[default]
        Sequence = "sequence", "A low-discrepancy sequence";
        /// Hashes, as all later bounces take.
        Random = "random", "Plain random numbers";
    }

    /// How indirect light becomes radiance, by name; [`super::Technique`] has each one's settings beside it.
    TechniqueKind {
        Map = "map", "Density estimates of the photon map at visible points", title: "density estimates";
        FinalGather = "final-gather", "A bounce of rays, which see the rest in irradiance texels",
            title: "final gathering";
    }
}

impl Method {
    /// Whether photons are sorted into screen-space tiles.
    pub fn is_tiled(self) -> bool {
        matches!(self, Method::Tiles | Method::TiledGrid)
    }

    /// Whether photons are read in the order in which they were stored: no grid is built.
    pub fn reads_stored(self) -> bool {
        self == Method::Brute || self.is_tiled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check<T: Choice + std::fmt::Debug>() {
        for (i, row) in T::TABLE.iter().enumerate() {
            assert_eq!(row.value.row().name, row.name);
            assert_eq!(T::named(row.name), row.is_offered.then_some(row.value), "{row:?}");
            assert!(T::TABLE[..i].iter().all(|other| other.name != row.name), "{row:?} is there twice");
            let word = |c: char| c.is_ascii_lowercase() || c == '-';
            assert!(row.name.chars().all(word) && !row.help.ends_with('.'), "{row:?}");
        }
        assert_eq!(T::named("nothing of the kind"), None);
    }

    #[test]
    fn ways_are_found_by_their_names() {
        check::<LightMode>();
        check::<Backend>();
        check::<Method>();
        check::<DensityKernel>();
        check::<GridForm>();
        check::<Sampler>();
        check::<TechniqueKind>();
        assert_eq!(serde_json::to_value(Method::TiledGrid).expect("a string"), "tiled-grid");
        assert_eq!(Method::named("auto"), None, "what nobody chose has no name to choose it by");
    }
}
