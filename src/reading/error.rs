//! What is wrong with a scene file, where it is, and what would have been right.

use std::fmt;

/// A place in a scene file. Both count from 1; columns count characters, not bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Position {
    /// Line, as an editor shows it.
    pub line: usize,
    /// Character within the line; a tab is one, a byte order mark none.
    pub column: usize,
}

impl Position {
    /// Line and column of the byte `offset` in `text`; the end where `offset` is past it.
    pub fn of(text: &str, offset: usize) -> Position {
        let boundary = (0..=offset.min(text.len())).rev().find(|&at| text.is_char_boundary(at));
        let before = &text[..boundary.unwrap_or(0)];
        let start_of_line = before.rfind('\n').map_or(0, |newline| newline + 1);
        Position {
            line: before.bytes().filter(|&byte| byte == b'\n').count() + 1,
            column: before[start_of_line..].trim_start_matches('\u{feff}').chars().count() + 1,
        }
    }
}

/// A scene file that cannot be rendered as it stands.
///
/// Prints as `scenes/x.toml:12:10: found radius = -1.0, expected a radius > 0`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneError {
    /// The file as the user named it.
    pub file: String,
    /// Where in the file; none if it could not be read at all (missing, a directory, too large).
    pub position: Option<Position>,
    /// What stands there, quoted from the file where that helps.
    pub found: String,
    /// What would have been accepted.
    pub expected: String,
    /// A name near to one that is not known.
    pub did_you_mean: Option<String>,
}

impl fmt::Display for SceneError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}:", self.file)?;
        if let Some(Position { line, column }) = self.position {
            write!(out, "{line}:{column}:")?;
        }
        write!(out, " found {}, expected {}", self.found, self.expected)?;
        match &self.did_you_mean {
            Some(name) => write!(out, " (did you mean `{name}`?)"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for SceneError {}

/// The one of `known` that `name` was most likely meant to be, if any is near.
pub(super) fn near<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    // Edit distance takes the product of the lengths; no name that a person types is longer than this.
    const LONGEST: usize = 64;
    if name.len() > LONGEST {
        return None;
    }
    let lower = name.to_lowercase();
    known
        .into_iter()
        .filter(|known| known.len() <= LONGEST)
        .map(|known| (strsim::osa_distance(&lower, &known.to_lowercase()), known))
        // A third of the letters wrong is still a misspelling; more is another word.
        .filter(|(distance, known)| *distance <= known.chars().count().max(3) / 3)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, known)| known.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_count_characters_from_one() {
        let text = "\u{feff}a = 1\nünï = 2\r\n";
        let at = |needle| {
            let Position { line, column } = Position::of(text, text.find(needle).unwrap());
            (line, column)
        };
        assert_eq!(at("a"), (1, 1));
        assert_eq!(at("1"), (1, 5));
        assert_eq!(at("2"), (2, 7));
        // Inside a character, and past the end: no panic.
        assert_eq!(Position::of("ü", 1), Position { line: 1, column: 1 });
        assert_eq!(Position::of("a\nb", 99), Position { line: 2, column: 2 });
    }

    #[test]
    fn near_names_are_found_and_far_ones_are_not() {
        let keys = ["center", "radius", "material"];
        assert_eq!(near("centre", keys).as_deref(), Some("center"));
        assert_eq!(near("RADIUS", keys).as_deref(), Some("radius"));
        assert_eq!(near("x", ["y"]).as_deref(), Some("y"));
        assert_eq!(near("emission", keys), None);
        assert_eq!(near(&"r".repeat(1 << 20), keys), None);
    }
}
