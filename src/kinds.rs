//! The names of all kinds: of shapes, in the order in which tables hold them. Each layer expands its own dispatch from
//! this list (scene file, packing, shaders and kernels, twins, reference, window), so that a new kind is one row here and
//! a file of its own in each layer, and imports still point down.

/// Hands the rows of all kinds of shape to a macro, in packing order: module, type, plural.
macro_rules! for_each_shape_kind {
    ($call:ident $(, $argument:expr)*) => {
        $call! { ($($argument),*) sphere Sphere spheres, plane Plane planes, }
    };
}
pub(crate) use for_each_shape_kind;

/// A kind's names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KindName {
    /// As its functions and files begin: `sphere`.
    pub singular: &'static str,
    /// As its list in a scene file is called: `spheres`.
    pub plural: &'static str,
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
