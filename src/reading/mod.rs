//! Typed reading of scene files: tables and values of the TOML tree, the rules that numbers obey, and errors that know
//! line and column. What keys a camera, a shape, a material or a light has is theirs to say.

mod error;
mod names;
pub mod rules;
mod table;

pub use error::{Position, SceneError};
pub use names::Names;
pub use table::{Field, Read, Rule, Table, Text};

use glam::DVec3;

/// How a point or a direction is written.
pub const XYZ: &str = "three numbers [x, y, z]";
/// How a colour is written.
pub const RGB: &str = "three numbers [r, g, b]";

/// A value of a table that may be changed and written back, by its key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Saved {
    /// The scene file's name for it.
    pub key: &'static str,
    /// What it is now.
    pub value: Value,
    /// What the file means where the key is missing and this depends on other keys.
    pub implied: Option<f64>,
}

/// What a key may hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A number.
    Number(f64),
    /// Three of them.
    Vector(DVec3),
}

impl Saved {
    /// A number under its key.
    pub fn number(key: &'static str, number: f64) -> Saved {
        Saved { key, value: Value::Number(number), implied: None }
    }

    /// Three numbers under their key.
    pub fn vector(key: &'static str, vector: DVec3) -> Saved {
        Saved { key, value: Value::Vector(vector), implied: None }
    }
}
