//! What a record is, and the macro that declares one: a host struct whose fields lie in whole RGB texels.

use bytemuck::Pod;

/// Floats in a texel: RGB32F.
pub const TEXEL: usize = 3;

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

pub(crate) use record;
