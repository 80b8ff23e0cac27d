//! Which key does what: one table for the keyboard and for F1.

use winit::keyboard::{Key, KeyCode, NamedKey, PhysicalKey};

use crate::settings::Method;

/// What a key does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Another gather method; of the right picture with Shift.
    Gather(Method),
    /// The next backend.
    Backend,
    /// The next light mode.
    Light,
    /// Stop or go on refining.
    Pause,
    /// Write PNG and EXR.
    Screenshot,
    /// Two pictures side by side, or one.
    Split,
    /// The difference of two pictures.
    HeatMap,
    /// Look at what was held last, or at all.
    Focus,
    /// The camera as in the file.
    Reset,
    /// Photons, then cells, then tiles, then nothing over the picture.
    Markers,
    /// Start or end recording the camera.
    Record,
    /// Write the panel's edits into the scene file.
    Save,
    /// The panel.
    Panel,
    /// This list.
    Help,
    /// End.
    Quit,
}

/// Key as shown, what it does in words, and the action, for keys by letter.
pub const TABLE: &[(&str, &str, Action)] = &[
    ("1", "gather by grid", Action::Gather(Method::Grid)),
    ("2", "gather by tiles", Action::Gather(Method::Tiles)),
    ("3", "gather by tiled grid", Action::Gather(Method::TiledGrid)),
    ("4", "gather k nearest photons", Action::Gather(Method::Knn)),
    ("5", "gather by brute force", Action::Gather(Method::Brute)),
    ("B", "backend: OpenGL, OpenCL, CPU", Action::Backend),
    ("L", "light: hybrid, photons, direct", Action::Light),
    ("Space", "pause refining", Action::Pause),
    ("P", "screenshot: PNG and EXR", Action::Screenshot),
    ("T", "split view; drag the divider; Shift with 1–5 or B: the right picture", Action::Split),
    ("H", "difference of the two pictures as a heat map", Action::HeatMap),
    ("F", "focus on what was moved last, or on all", Action::Focus),
    ("R", "reset the camera", Action::Reset),
    ("O", "overlay: photons, cells, tiles, nothing", Action::Markers),
    ("K", "record the camera's path", Action::Record),
    ("Ctrl+S", "save edits into the scene file", Action::Save),
    ("Tab", "panel", Action::Panel),
    ("F1", "this help", Action::Help),
    ("Esc", "quit", Action::Quit),
];

/// What the mouse and the keys of flight do, for F1.
pub const GESTURES: &[(&str, &str)] = &[
    ("left drag", "orbit; on a light or a sphere: move it"),
    ("middle drag, Shift + left drag", "pan"),
    ("wheel", "nearer, farther"),
    ("right drag", "look around"),
    ("W A S D, Q E", "fly, down and up; Shift: faster"),
];

/// The action of a key that went down.
pub fn action(key: &Key, control: bool) -> Option<Action> {
    let name = match key {
        Key::Named(NamedKey::Space) => "Space".into(),
        Key::Named(NamedKey::Tab) => "Tab".into(),
        Key::Named(NamedKey::F1) => "F1".into(),
        Key::Named(NamedKey::Escape) => "Esc".into(),
        Key::Character(text) if control => format!("Ctrl+{}", text.to_uppercase()),
        // Shift and a digit give another sign on every keyboard; see `digit`.
        Key::Character(text) => text.to_uppercase(),
        _ => return None,
    };
    TABLE.iter().find(|(key, ..)| *key == name).map(|(.., action)| *action)
}

/// The gather method of a digit by the key's place, whatever sign Shift makes of it.
pub fn digit(key: PhysicalKey) -> Option<Action> {
    let name = match key {
        PhysicalKey::Code(KeyCode::Digit1) => "1",
        PhysicalKey::Code(KeyCode::Digit2) => "2",
        PhysicalKey::Code(KeyCode::Digit3) => "3",
        PhysicalKey::Code(KeyCode::Digit4) => "4",
        PhysicalKey::Code(KeyCode::Digit5) => "5",
        _ => return None,
    };
    TABLE.iter().find(|(key, ..)| *key == name).map(|(.., action)| *action)
}

/// Axis and sign of a key of flight, by its place on the keyboard: right, up, forward.
pub fn flight(key: PhysicalKey) -> Option<(usize, f64)> {
    Some(match key {
        PhysicalKey::Code(KeyCode::KeyD) => (0, 1.0),
        PhysicalKey::Code(KeyCode::KeyA) => (0, -1.0),
        PhysicalKey::Code(KeyCode::KeyE) => (1, 1.0),
        PhysicalKey::Code(KeyCode::KeyQ) => (1, -1.0),
        PhysicalKey::Code(KeyCode::KeyW) => (2, 1.0),
        PhysicalKey::Code(KeyCode::KeyS) => (2, -1.0),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_found_by_letter_and_place() {
        assert_eq!(action(&Key::Character("b".into()), false), Some(Action::Backend));
        assert_eq!(action(&Key::Character("B".into()), false), Some(Action::Backend), "with Shift or Caps Lock");
        assert_eq!(action(&Key::Character("s".into()), true), Some(Action::Save));
        assert_eq!(action(&Key::Character("s".into()), false), None, "flies");
        assert_eq!(action(&Key::Named(NamedKey::F1), false), Some(Action::Help));
        assert_eq!(digit(PhysicalKey::Code(KeyCode::Digit3)), Some(Action::Gather(Method::TiledGrid)));
        assert_eq!(flight(PhysicalKey::Code(KeyCode::KeyQ)), Some((1, -1.0)));
    }

    #[test]
    fn no_key_is_in_the_table_twice() {
        for (i, (key, ..)) in TABLE.iter().enumerate() {
            assert!(TABLE[i + 1..].iter().all(|(other, ..)| other != key), "{key}");
        }
    }
}
