//! Which key does what: one table for the keyboard and for F1.

use std::sync::LazyLock;

use winit::keyboard::{Key, KeyCode, NamedKey, PhysicalKey};

use crate::settings::{Backend, Choice, ChoiceRow, LightMode, Method};

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
    /// Show or hide the panel.
    Panel,
    /// Show or hide the list of keys.
    Help,
    /// End the program.
    Quit,
}

/// A key of the keyboard and its meaning.
#[derive(Clone, Debug)]
pub struct Binding {
    /// The key as F1 shows it.
    pub key: &'static str,
    /// What it does, in words.
    pub does: String,
    /// What happens when it goes down.
    pub action: Action,
}

/// Keys of the gather methods, then all others, for keys by letter.
pub static TABLE: LazyLock<Vec<Binding>> = LazyLock::new(|| {
    let gather = |row: &'static ChoiceRow<Method>| {
        let (key, does) = row.key?;
        Some(Binding { key, does: does.into(), action: Action::Gather(row.value) })
    };
    let mut table: Vec<_> = Method::offered().filter_map(gather).collect();
    let right = match &table[..] {
        [first, .., last] => format!("{}–{} or B", first.key, last.key),
        _ => "B".into(),
    };
    let others = [
        ("B", format!("backend: {}", titles::<Backend>()), Action::Backend),
        ("L", format!("light: {}", titles::<LightMode>()), Action::Light),
        ("Space", "pause refining".into(), Action::Pause),
        ("P", "screenshot: PNG and EXR".into(), Action::Screenshot),
        ("T", format!("split view; drag the divider; Shift with {right}: the right picture"), Action::Split),
        ("H", "difference of the two pictures as a heat map".into(), Action::HeatMap),
        ("F", "focus on what was moved last, or on all".into(), Action::Focus),
        ("R", "reset the camera".into(), Action::Reset),
        ("O", "overlay: photons, cells, tiles, nothing".into(), Action::Markers),
        ("K", "record the camera's path".into(), Action::Record),
        ("Ctrl+S", "save edits into the scene file".into(), Action::Save),
        ("Tab", "panel".into(), Action::Panel),
        ("F1", "this help".into(), Action::Help),
        ("Esc", "quit".into(), Action::Quit),
    ];
    table.extend(others.map(|(key, does, action)| Binding { key, does, action }));
    table
});

/// All ways of one kind, as users read them.
fn titles<T: Choice>() -> String {
    T::offered().map(|row| row.title).collect::<Vec<_>>().join(", ")
}

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
    bound(&name)
}

fn bound(key: &str) -> Option<Action> {
    TABLE.iter().find(|binding| binding.key == key).map(|binding| binding.action)
}

/// The gather method of a digit by the key's place, whatever sign Shift makes of it.
pub fn digit(key: PhysicalKey) -> Option<Action> {
    let name = match key {
        PhysicalKey::Code(KeyCode::Digit1) => "1",
        PhysicalKey::Code(KeyCode::Digit2) => "2",
        PhysicalKey::Code(KeyCode::Digit3) => "3",
        PhysicalKey::Code(KeyCode::Digit4) => "4",
        PhysicalKey::Code(KeyCode::Digit5) => "5",
        PhysicalKey::Code(KeyCode::Digit6) => "6",
        PhysicalKey::Code(KeyCode::Digit7) => "7",
        PhysicalKey::Code(KeyCode::Digit8) => "8",
        PhysicalKey::Code(KeyCode::Digit9) => "9",
        PhysicalKey::Code(KeyCode::Digit0) => "0",
        _ => return None,
    };
    bound(name)
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
        for (i, binding) in TABLE.iter().enumerate() {
            assert!(TABLE[i + 1..].iter().all(|other| other.key != binding.key), "{binding:?}");
        }
    }

    #[test]
    fn every_method_has_a_key_by_place() {
        let digits = [KeyCode::Digit1, KeyCode::Digit2, KeyCode::Digit3, KeyCode::Digit4, KeyCode::Digit5];
        let methods = Method::offered().map(|row| Some(Action::Gather(row.value)));
        assert!(methods.eq(digits.map(|code| digit(PhysicalKey::Code(code)))));
        let split = TABLE.iter().find(|binding| binding.action == Action::Split).expect("a key");
        assert!(split.does.contains("Shift with 1–5 or B"), "{split:?}");
    }
}
