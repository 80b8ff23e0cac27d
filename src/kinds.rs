//! The names of all kinds: of shapes, in the order in which tables hold them, of the lobes of materials, and of lights. Each
//! layer expands its own dispatch from this list (scene file, packing, shaders and kernels, twins, reference, window), so that a
//! new kind is one row here and a file of its own in each layer, and imports still point down.

/// Hands the rows of all kinds of shape to a macro, in packing order: module, type, plural.
macro_rules! for_each_shape_kind {
    ($call:ident $(, $argument:expr)*) => {
        $call! { ($($argument),*) sphere Sphere spheres, plane Plane planes, quad Quad quads, }
    };
}
pub(crate) use for_each_shape_kind;

/// The same for the lobes that a material is mixed of: module.
macro_rules! for_each_material_kind {
    ($call:ident) => {
        $call! { diffuse, ggx, }
    };
}
pub(crate) use for_each_material_kind;

/// The same for lights: module, and word of the `kind` key; type, plural.
macro_rules! for_each_light_kind {
    ($call:ident) => {
        $call! { point PointLight points, }
    };
}
pub(crate) use for_each_light_kind;

/// A kind's names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KindName {
    /// As its functions and files begin: `sphere`.
    pub singular: &'static str,
    /// As its list in a scene file is called: `spheres`.
    pub plural: &'static str,
}

impl KindName {
    /// The `#define` of a scene that has any.
    pub fn has(&self) -> String {
        format!("HAS_{}", self.plural.to_uppercase())
    }

    /// The `#define` of a scene in which some may come between a visible point and a light.
    pub fn shadows(&self) -> String {
        format!("HAS_{}_SHADOWS", self.singular.to_uppercase())
    }

    /// The `#define` of how many there are, where they are few.
    pub fn count(&self) -> String {
        format!("{}_COUNT", self.singular.to_uppercase())
    }
}

macro_rules! names {
    (() $($module:ident $type:ident $plural:ident,)*) => {
        /// The kind of a shape, numbered as in records.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum ShapeKind {
            $(#[doc = concat!("See the scene file's `", stringify!($plural), "`.")] $type,)*
        }

        impl ShapeKind {
            /// In packing order.
            pub const ALL: [ShapeKind; [$(stringify!($module)),*].len()] = [$(ShapeKind::$type),*];

            /// The kind that a record's number stands for.
            ///
            /// # Panics
            /// When no kind has this number.
            #[inline]
            pub fn of(number: f32) -> ShapeKind {
                match number as u8 {
                    $(number if number == ShapeKind::$type as u8 => ShapeKind::$type,)*
                    _ => panic!("no kind of shape has number {number}"),
                }
            }

            /// What it is called.
            pub fn name(self) -> &'static KindName {
                &SHAPE_KINDS[self as usize]
            }

            /// Its number in records.
            pub const fn number(self) -> f32 {
                self as u8 as f32
            }
        }

        /// All kinds of shape.
        pub const SHAPE_KINDS: [KindName; [$(stringify!($module)),*].len()] =
            [$(KindName { singular: stringify!($module), plural: stringify!($plural) }),*];
    };
}
for_each_shape_kind!(names);

/// Some kinds of shape.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ShapeSet(u32);

impl ShapeSet {
    /// None of them.
    pub const NONE: ShapeSet = ShapeSet(0);

    /// Just this one.
    pub const fn of(kind: ShapeKind) -> ShapeSet {
        ShapeSet(1 << kind as u8)
    }

    /// Those for which a condition holds.
    pub fn those(is_in: impl Fn(ShapeKind) -> bool) -> ShapeSet {
        let kinds = ShapeKind::ALL.into_iter().filter(|kind| is_in(*kind));
        kinds.map(ShapeSet::of).fold(ShapeSet::NONE, ShapeSet::and)
    }

    /// The kinds of both.
    pub const fn and(self, other: ShapeSet) -> ShapeSet {
        ShapeSet(self.0 | other.0)
    }

    /// Whether it has a kind.
    pub const fn has(self, kind: ShapeKind) -> bool {
        self.0 & ShapeSet::of(kind).0 != 0
    }

    /// Whether it has none.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// All sets there are.
    pub fn all() -> impl Iterator<Item = ShapeSet> + Clone {
        (0..1 << ShapeKind::ALL.len()).map(ShapeSet)
    }
}
