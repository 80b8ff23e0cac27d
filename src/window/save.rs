//! Panel edits back into the scene file. Only values that differ are touched: comments, order and layout stay.

use glam::DVec3;
use toml_edit::{Array, DocumentMut, Item, TableLike};

use crate::error::{Error, Result};
use crate::lights::Light;
use crate::reading::{Saved, Value};
use crate::scene::Scene;
use crate::shapes::Shape;

/// The file's text with the values of `new` where they differ from those of `old`, which the text was read into.
///
/// # Errors
/// [`Error::Failed`] when the text is no longer what `old` was read from.
pub fn updated(text: &str, old: &Scene, new: &Scene) -> Result<String> {
    let mut document: DocumentMut =
        text.parse().map_err(|error| Error::Failed(format!("not saved, the file cannot be read: {error}")))?;
    let root = document.as_table_mut();
    let camera = (&old.camera, &new.camera);
    if let Some(table) = root.get_mut("camera").and_then(Item::as_table_like_mut) {
        vector(table, "position", camera.0.position, camera.1.position);
        vector(table, "look_at", camera.0.look_at, camera.1.look_at);
        vector(table, "up", camera.0.up, camera.1.up);
        number(table, "fov_y", camera.0.fov_y, camera.1.fov_y);
    }
    let moved = |what: &str| Error::Failed(format!("not saved: the file has other {what} than the window"));
    for (a, b) in old.materials.iter().zip(&new.materials) {
        if a == b {
            continue;
        }
        let all = root.get_mut("materials").and_then(Item::as_table_like_mut);
        let table = all.and_then(|all| all.get_mut(&a.name)).and_then(Item::as_table_like_mut);
        write(table.ok_or_else(|| moved("materials"))?, &a.saved(), &b.saved());
    }
    // The window moves and changes lights and shapes, but makes and deletes none.
    for (i, (a, b)) in old.lights.iter().map(Light::saved).zip(new.lights.iter().map(Light::saved)).enumerate() {
        if a != b {
            write(entry(root, "lights", i).ok_or_else(|| moved("lights"))?, &a, &b);
        }
    }
    for (a, b) in old.shapes.kinds().iter().zip(new.shapes.kinds()) {
        let list = a.name.plural;
        for (i, (a, b)) in a.iter().map(Shape::saved).zip(b.iter().map(Shape::saved)).enumerate() {
            if a != b {
                write(entry(root, list, i).ok_or_else(|| moved(list))?, &a, &b);
            }
        }
    }
    if old.render != new.render {
        let table = root.entry("render").or_insert_with(toml_edit::table);
        let table = table.as_table_like_mut().ok_or_else(|| moved("settings"))?;
        let (a, b) = (&old.render, &new.render);
        let mut put = |key: &str, differs: bool, value: Option<toml_edit::Value>| match (differs, value) {
            (false, _) => {}
            (true, Some(value)) => replace(table, key, value),
            (true, None) => drop(table.remove(key)),
        };
        put("photons", a.photons != b.photons, b.photons.map(|n| (n as i64).into()));
        put("radius", a.radius != b.radius, b.radius.map(|r| rounded(r).into()));
        put("gather", a.gather != b.gather, b.gather.map(|method| method.name().into()));
        put("light", a.light != b.light, b.light.map(|mode| mode.name().into()));
        put("exposure", a.exposure != b.exposure, b.exposure.map(|e| rounded(e).into()));
    }
    Ok(document.to_string())
}

/// The `i`-th of an array of tables, or of an array of inline tables.
fn entry<'a>(root: &'a mut toml_edit::Table, key: &str, i: usize) -> Option<&'a mut dyn TableLike> {
    match root.get_mut(key)? {
        Item::ArrayOfTables(tables) => tables.get_mut(i).map(|table| table as &mut dyn TableLike),
        Item::Value(toml_edit::Value::Array(values)) => {
            values.get_mut(i).and_then(toml_edit::Value::as_inline_table_mut).map(|table| table as &mut dyn TableLike)
        }
        _ => None,
    }
}

/// Seven digits: what float32 holds, and what people can read.
fn rounded(x: f64) -> f64 {
    format!("{x:.6e}").parse().unwrap_or(x)
}

/// A value in place of another, with the comments and spaces around it.
fn replace(table: &mut dyn TableLike, key: &str, mut value: toml_edit::Value) {
    if let Some(old) = table.get(key).and_then(Item::as_value) {
        *value.decor_mut() = old.decor().clone();
    }
    table.insert(key, Item::Value(value));
}

/// Writes what differs of a light, a shape or a material.
fn write(table: &mut dyn TableLike, old: &[Saved], new: &[Saved]) {
    for (old, new) in old.iter().zip(new) {
        match (old.value, new.value) {
            (Value::Number(a), Value::Number(b)) => {
                let is_implied = |saved: &Saved| saved.implied.is_some_and(|implied| (b - implied).abs() <= 1e-9);
                if table.contains_key(new.key) || !is_implied(new) {
                    number(table, new.key, a, b);
                }
            }
            (Value::Vector(a), Value::Vector(b)) => vector(table, new.key, a, b),
            _ => {}
        }
    }
}

fn number(table: &mut dyn TableLike, key: &str, old: f64, new: f64) {
    if old != new {
        replace(table, key, rounded(new).into());
    }
}

fn vector(table: &mut dyn TableLike, key: &str, old: DVec3, new: DVec3) {
    if old == new {
        return;
    }
    match table.get_mut(key).and_then(Item::as_array_mut) {
        Some(array) if array.len() == 3 => {
            for axis in (0..3).filter(|axis| old[*axis] != new[*axis]) {
                array.replace(axis, rounded(new[axis]));
            }
        }
        _ => {
            let array: Array = new.to_array().into_iter().map(rounded).collect();
            replace(table, key, array.into());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::parse;
    use crate::settings::Method;

    const TEXT: &str = "# A room.\n\n[camera] # where from\nposition = [0, 0.0, 9] # in front\nlook_at = [0, 0, 0]\n\n\
        [materials.white]\ncolor = [1, 1, 1] # paper\n\n# The lamp.\n[[lights]]\nposition = [0, 2.70, 0]\n\
        intensity = [40, 40, 40]\n\n[[spheres]]\nmaterial = \"white\"\nradius = 1 # a metre\ncenter = [ 1, 0, -7 ]\n";

    fn room() -> Scene {
        parse(TEXT, "room.toml").unwrap()
    }

    #[test]
    fn nothing_changed_writes_the_same_bytes() {
        assert_eq!(updated(TEXT, &room(), &room()).unwrap(), TEXT);
    }

    #[test]
    fn only_what_changed_is_touched() {
        let mut new = room();
        new.lights.points[0].position.x = 0.1 + 0.2;
        new.shapes.spheres[0].radius = 1.25;
        new.shapes.spheres[0].center.z = -6.5;
        let text = updated(TEXT, &room(), &new).unwrap();
        let expected = TEXT
            .replace("position = [0, 2.70, 0]", "position = [0.3, 2.70, 0]")
            .replace("radius = 1 # a metre", "radius = 1.25 # a metre")
            .replace("[ 1, 0, -7 ]", "[ 1, 0, -6.5 ]");
        assert_eq!(text, expected);
    }

    #[test]
    fn what_is_written_is_read_again() {
        let mut new = room();
        new.camera.fov_y = 60.0;
        new.camera.up = DVec3::new(0.0, 1.0, 0.25);
        new.materials[0].specular = 0.5;
        new.materials[0].diffuse = 0.5;
        new.materials[0].roughness = 0.2;
        new.render.exposure = Some(-1.5);
        new.render.gather = Some(Method::Tiles);
        let text = updated(TEXT, &room(), &new).unwrap();
        assert_eq!(parse(&text, "room.toml").unwrap(), new, "{text}");
        for comment in ["# A room.", "# where from", "# in front", "# paper", "# The lamp.", "# a metre"] {
            assert!(text.contains(comment), "{comment} in:\n{text}");
        }
        assert!(!text.contains("diffuse"), "the default does: {text}");
    }

    #[test]
    fn lists_of_inline_tables_are_kept_inline() {
        let text = "lights = [ { position = [0, 1, 0], intensity = [1, 1, 1] } ] # one\n\
                    [camera]\nposition = [0, 0, 9]\nlook_at = [0, 0, 0]\n";
        let old = parse(text, "x.toml").unwrap();
        let mut new = old.clone();
        new.lights.points[0].intensity = DVec3::new(2.0, 1.0, 1.0);
        assert_eq!(updated(text, &old, &new).unwrap(), text.replace("[1, 1, 1]", "[2.0, 1, 1]"));
    }

    #[test]
    fn a_quad_that_moved_is_written_by_its_corner() {
        let text = format!(
            "{TEXT}\n[[quads]] # a table\ncorner = [0, 1.0, 0] # here\nedges = [[2, 0, 0], [0, 0, 2]]\nmaterial = \"white\"\n"
        );
        let old = parse(&text, "x.toml").unwrap();
        let mut new = old.clone();
        let number = new.shapes.len() - 1;
        new.shapes.get_mut(number).unwrap().place(1.0, DVec3::new(0.0, -0.25, 1.5));
        let written = updated(&text, &old, &new).unwrap();
        assert_eq!(written, text.replace("[0, 1.0, 0] # here", "[0, 0.75, 1.5] # here"));
        assert_eq!(parse(&written, "x.toml").unwrap(), new);
    }

    #[test]
    fn a_file_that_became_another_is_refused() {
        let mut new = room();
        new.lights.points[0].position.x = 1.0;
        let other = "[camera]\nposition = [0, 0, 9]\nlook_at = [0, 0, 0]\n";
        assert!(matches!(updated(other, &room(), &new), Err(Error::Failed(_))));
        assert!(matches!(updated("[camera", &room(), &new), Err(Error::Failed(_))));
    }
}
