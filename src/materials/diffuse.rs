//! The Lambertian lobe.

use super::{Kind, SHARE};
use crate::reading::Saved;

/// See [`Kind`].
pub const KIND: Kind = Kind {
    keys: &["diffuse"],
    read: |table, material| {
        // Where the others take more than 1 already, the sum of shares says so; this must not hide it.
        material.diffuse = table.number_or("diffuse", &SHARE, material.rest())?;
        Ok(())
    },
    supported: |_, _| Ok(()),
    saved: |material| {
        // Without this key, it is what the other shares leave; then it changes with them.
        vec![Saved { implied: Some(material.rest()), ..Saved::number("diffuse", material.diffuse) }]
    },
    share: |material| material.diffuse,
};
