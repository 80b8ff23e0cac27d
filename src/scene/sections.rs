//! The scene file's tables that no kind of shape, material or light has for itself: keys, defaults and checks.

use glam::DVec3;

use super::check::{self, *};
use super::{Camera, MAX_IMAGE_SIDE, RenderDefaults, Scene};
use crate::lights::Lights;
use crate::materials::Material;
use crate::reading::rules::{COORDINATE, DIRECTION, RADIUS};
use crate::reading::{Field, Names, Read, Table, XYZ};
use crate::shapes::Shapes;

/// Reads the whole file from its root table; `name` becomes the scene's.
pub(super) fn scene(root: &Table, name: &str) -> Read<Scene> {
    root.allow_only(&[&["camera", "materials", "lights"], Shapes::KEYS, &["render"]].concat())?;
    let camera = camera(&root.need("camera", "[camera] with position and look_at")?.table("[camera]")?)?;
    let materials = materials(root)?;
    let names = Names::new(materials.iter().map(|material| material.name.as_str()));
    Ok(Scene {
        name: name.to_owned(),
        camera,
        lights: Lights::read(root)?,
        shapes: Shapes::read(root, &names)?,
        render: match root.get("render") {
            Some(field) => render(&field.table("[render]")?)?,
            None => RenderDefaults::default(),
        },
        materials,
    })
}

fn camera(table: &Table) -> Read<Camera> {
    table.allow_only(&["position", "look_at", "up", "fov_y"])?;
    let camera = Camera {
        position: table.need("position", "position = [x, y, z]")?.vector(XYZ, &COORDINATE)?,
        look_at: table.need("look_at", "look_at = [x, y, z]")?.vector(XYZ, &COORDINATE)?,
        up: table.get("up").map_or(Ok(DVec3::Y), |up| up.vector(XYZ, &DIRECTION))?,
        fov_y: table.number_or("fov_y", &FOV, 45.0)?,
    };
    check::camera(table, &camera)?;
    Ok(camera)
}

fn materials(root: &Table) -> Read<Vec<Material>> {
    let Some(field) = root.get("materials") else {
        return Ok(Vec::new());
    };
    let all = field.table("[materials.NAME]")?;
    let mut entries: Vec<_> = all.entries.iter().collect();
    // The tree is sorted by name; materials keep the file's order.
    entries.sort_by_key(|(name, _)| name.span().start);
    entries
        .into_iter()
        .map(|(name, value)| {
            let title = format!("[materials.{}]", all.text.quote(name.span()));
            Material::read(name.get_ref(), &all.entry("materials", value).table(title)?)
        })
        .collect()
}

fn render(table: &Table) -> Read<RenderDefaults> {
    table.allow_only(&["size", "photons", "radius", "gather", "light", "passes", "exposure"])?;
    let get = |key| table.get(key);
    Ok(RenderDefaults {
        size: get("size").map(|field| size(&field)).transpose()?,
        photons: get("photons")
            .map(|field| field.integer(1..=i64::MAX as u64, "a whole number of photons > 0"))
            .transpose()?,
        radius: get("radius").map(|field| field.number(&RADIUS)).transpose()?,
        gather: get("gather").map(|field| field.choice()).transpose()?,
        light: get("light").map(|field| field.choice()).transpose()?,
        passes: get("passes")
            .map(|field| field.integer(1..=u32::MAX.into(), "a whole number of passes > 0"))
            .transpose()?
            .map(|passes| passes as u32),
        exposure: get("exposure").map(|field| field.number(&EXPOSURE)).transpose()?,
    })
}

fn size(field: &Field) -> Read<(u32, u32)> {
    let [width, height] = field.array("size = [width, height]")?;
    let side = |field: Field| {
        let range = 1..=u64::from(MAX_IMAGE_SIDE);
        field.integer(range, "a whole number of pixels from 1 to 65536")
    };
    Ok((side(width)? as u32, side(height)? as u32))
}
