//! The benchmark's own scenes, which come with the program: it runs from any directory.

use crate::error::Result;
use crate::scene::{Scene, parse};

/// Name and file of each.
const FILES: [(&str, &str); 5] = [
    ("gi_ref", include_str!("../../scenes/gi_ref.toml")),
    ("gi_two_lights", include_str!("../../scenes/gi_two_lights.toml")),
    ("sphere_and_plane", include_str!("../../scenes/sphere_and_plane.toml")),
    ("color_bleeding", include_str!("../../scenes/color_bleeding.toml")),
    ("box", include_str!("../../scenes/box.toml")),
];

/// The scene of that name; `None` where the program brings none.
///
/// # Errors
/// Never: the files are compiled in, and a test reads them all.
pub fn built_in(name: &str) -> Option<Result<Scene>> {
    let (name, text) = FILES.iter().find(|(known, _)| *known == name)?;
    Some(parse(text, &format!("{name}.toml")).map_err(Into::into))
}

/// Their names, for messages.
pub fn names() -> impl Iterator<Item = &'static str> {
    FILES.iter().map(|(name, _)| *name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_are_read_under_their_names() {
        for name in names() {
            assert_eq!(built_in(name).unwrap().unwrap().name, name);
        }
        assert!(built_in("nowhere").is_none());
    }
}
