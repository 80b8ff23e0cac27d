//! From a file, bytes or text to a [`Scene`].

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use toml::de::DeTable;

use super::{Scene, sections};
use crate::reading::{Position, SceneError, Table, Text};

/// The largest scene file that is read, bytes: 64 MiB, about 750,000 spheres. A larger one is more likely a mistake
/// (a mesh, a video). The reader takes some 35 times the file's size while it works, 2.4 GB for this one.
pub const MAX_FILE_BYTES: u64 = 64 << 20;

/// Reads a scene from a file.
///
/// # Errors
/// If the file is missing, a directory, over [`MAX_FILE_BYTES`] (found out before reading it where the system knows
/// its size), and for all of [`parse_bytes`]'s reasons.
pub fn load(path: &Path) -> Result<Scene, Box<SceneError>> {
    let file = path.display().to_string();
    let refused = |found: String, expected: &str| {
        Box::new(SceneError {
            file: file.clone(),
            position: None,
            found,
            expected: expected.to_owned(),
            did_you_mean: None,
        })
    };
    let unreadable = |error: std::io::Error| refused(error.to_string(), "a scene file (TOML) that can be read");
    let too_large = |found: String| {
        let expected = format!("a scene of at most {} MiB", MAX_FILE_BYTES >> 20);
        refused(found, &expected)
    };

    // The path first: opening a directory works on some systems and fails with a riddle on others.
    let metadata = std::fs::metadata(path).map_err(unreadable)?;
    if metadata.is_dir() {
        return Err(refused("a directory".into(), "a scene file (TOML)"));
    }
    if metadata.len() > MAX_FILE_BYTES {
        return Err(too_large(format!("{} MiB", metadata.len() >> 20)));
    }
    // A pipe has no size to ask for, and a file may grow: read no more than one byte too many.
    let mut bytes = Vec::with_capacity(metadata.len() as usize);
    let opened = File::open(path).map_err(unreadable)?;
    opened.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(too_large(format!("more than {} MiB", MAX_FILE_BYTES >> 20)));
    }
    parse_bytes(&bytes, &file)
}

/// Reads a scene from a file's content; `file` is its name in messages, and its stem the scene's name.
///
/// # Errors
/// If the bytes are not UTF-8, and for all of [`parse`]'s reasons.
pub fn parse_bytes(bytes: &[u8], file: &str) -> Result<Scene, Box<SceneError>> {
    let invalid = match std::str::from_utf8(bytes) {
        Ok(text) => return parse(text, file),
        Err(error) => error.valid_up_to(),
    };
    let valid = String::from_utf8_lossy(&bytes[..invalid]);
    let mut expected = "UTF-8 text".to_owned();
    if bytes.starts_with(b"\xFF\xFE") || bytes.starts_with(b"\xFE\xFF") {
        expected += " (this looks like UTF-16)";
    }
    Err(Box::new(SceneError {
        file: file.to_owned(),
        position: Some(Position::of(&valid, invalid)),
        found: format!("byte 0x{:02X} at offset {invalid}, which is not UTF-8", bytes[invalid]),
        expected,
        did_you_mean: None,
    }))
}

/// Reads a scene from text; `file` is its name in messages, and its stem the scene's name.
///
/// # Errors
/// With the place of the first thing that is wrong: TOML syntax, an unknown or duplicate key, a wrong type, a number
/// out of range, an unknown material, a camera that cannot see.
pub fn parse(text: &str, file: &str) -> Result<Scene, Box<SceneError>> {
    let source = Text { text, file };
    if text.trim_start_matches('\u{feff}').trim().is_empty() {
        return Err(source.error(0, "an empty file", "a scene with at least a [camera]"));
    }
    let tree = DeTable::parse(text).map_err(|error| syntax(&source, &error))?;
    let name = Path::new(file).file_stem().unwrap_or_default().to_string_lossy();
    let root = Table { text: &source, title: "the scene".into(), at: 0, entries: tree.get_ref() };
    sections::scene(&root, &name)
}

/// The TOML reader's error in this program's words and places.
fn syntax(source: &Text, error: &toml::de::Error) -> Box<SceneError> {
    let span = error.span().unwrap_or(0..0);
    let at = span.start;
    // An empty span is where something is missing: what stands there instead?
    let here = match source.quote(span) {
        quote if !quote.is_empty() => format!("`{quote}`"),
        _ => match source.text.get(at..).and_then(|rest| rest.chars().next()) {
            None => "the end of the file".to_owned(),
            Some('\r' | '\n') => "the end of the line".to_owned(),
            Some(next) => format!("`{}`", next.escape_debug()),
        },
    };
    // Its messages read "what is wrong, expected this, that".
    let (what, expected) = match error.message().split_once(", expected ") {
        Some((what, expected)) => (what, expected),
        None => (error.message(), "valid TOML"),
    };
    match (what, expected) {
        ("duplicate key", _) => source.error(at, format!("{here} a second time"), "each key and table once"),
        // Said of anything that cannot be a value, even of nothing at all.
        ("string values must be quoted", _) => {
            source.error(at, here, "a number, a \"string\" in quotes, an [array] or a {table}")
        }
        (_, "nothing") => source.error(at, format!("{here}: {what}"), "nothing here"),
        (_, expected) => {
            let expected = match expected.rsplit_once(", ") {
                Some((first, last)) => format!("{first} or {last}"),
                None => expected.to_owned(),
            };
            source.error(at, format!("{here}: {what}"), expected)
        }
    }
}
