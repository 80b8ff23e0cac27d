//! What a table may name by its `material` key.

use std::collections::HashMap;

use super::error::{SceneError, near};
use super::table::{Field, Read, Table};

const NAME: &str = "a material's name in quotes";

/// The file's materials by name.
pub struct Names<'a>(HashMap<&'a str, usize>);

impl<'a> Names<'a> {
    /// Of materials in the file's order.
    pub fn new(names: impl Iterator<Item = &'a str>) -> Self {
        Names(names.zip(0..).collect())
    }

    /// Index of the material that a table names.
    pub fn material(&self, table: &Table) -> Read<usize> {
        let field = table.need("material", "material = \"NAME\"")?;
        let name = field.string(NAME)?;
        self.0.get(name).copied().ok_or_else(|| self.unknown(&field, name))
    }

    fn unknown(&self, field: &Field, name: &str) -> Box<SceneError> {
        const MOST_LISTED: usize = 8;
        let mut known: Vec<&str> = self.0.keys().copied().collect();
        // A hash map's order differs from run to run; messages shall not.
        known.sort_by_key(|name| self.0[name]);
        let mut error = field.wrong(match known.len() {
            0 => format!("a material of this file, which has none: add [materials.{name}]"),
            1..=MOST_LISTED => format!("one of the materials {}", known.join(", ")),
            more => format!("one of the file's {more} materials"),
        });
        error.did_you_mean = near(name, known);
        error
    }
}
