//! The GGX lobe.

use super::{Kind, SHARE};
use crate::reading::{Rule, Saved};

/// pbrt's bound below which a GGX lobe counts as a mirror ("effectively smooth"): its square is near the spacing of
/// float32 numbers around cosθ = 1, so the lobe's shape is lost.
const NARROWEST_LOBE: f64 = 1e-3;

const ROUGHNESS: Rule = Rule {
    holds: |x| x == 0.0 || (NARROWEST_LOBE..=1.0).contains(&x),
    expected: "a roughness from 0.001 to 1, or 0 for a perfect mirror",
};

/// See [`Kind`].
pub const KIND: Kind = Kind {
    keys: &["specular", "roughness"],
    read: |table, material| {
        material.specular = table.number_or("specular", &SHARE, 0.0)?;
        material.roughness = table.number_or("roughness", &ROUGHNESS, 0.0)?;
        Ok(())
    },
    supported: |table, material| match table.get("specular") {
        Some(field) if material.specular > 0.0 && material.roughness == 0.0 => {
            let mut error = field.wrong("roughness > 0: perfect mirrors are not supported yet");
            error.found += " with roughness 0";
            Err(error)
        }
        _ => Ok(()),
    },
    saved: |material| {
        vec![Saved::number("specular", material.specular), Saved::number("roughness", material.roughness)]
    },
    share: |material| material.specular,
};
