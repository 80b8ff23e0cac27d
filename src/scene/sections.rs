//! The scene file's tables, one function each: keys, defaults and checks of DESIGN §3.

use std::collections::HashMap;

use glam::DVec3;

use super::check::{self, *};
use super::error::near;
use super::table::{Field, Read, Table};
use super::{Camera, MAX_IMAGE_SIDE, Material, Plane, PointLight, RenderDefaults, Scene, Sphere};

const XYZ: &str = "three numbers [x, y, z]";
const RGB: &str = "three numbers [r, g, b]";
const NAME: &str = "a material's name in quotes";

/// Reads the whole file from its root table; `name` becomes the scene's.
pub(super) fn scene(root: &Table, name: &str) -> Read<Scene> {
    root.allow_only(&["camera", "materials", "lights", "spheres", "planes", "render"])?;
    let camera = camera(&root.need("camera", "[camera] with position and look_at")?.table("[camera]")?)?;
    let materials = materials(root)?;
    let names = Names::new(&materials);
    Ok(Scene {
        name: name.to_owned(),
        camera,
        lights: list(root, "lights", "[[lights]]", light)?,
        spheres: list(root, "spheres", "[[spheres]]", |table| sphere(table, &names))?,
        planes: list(root, "planes", "[[planes]]", |table| plane(table, &names))?,
        render: match root.get("render") {
            Some(field) => render(&field.table("[render]")?)?,
            None => RenderDefaults::default(),
        },
        materials,
    })
}

/// Reads every table of an array of tables; an absent one is empty.
fn list<'a, T>(
    root: &Table<'a>,
    key: &'static str,
    title: &'static str,
    read: impl Fn(&Table<'a>) -> Read<T>,
) -> Read<Vec<T>> {
    match root.get(key) {
        Some(field) => field.tables(title)?.map(|table| read(&table?)).collect(),
        None => Ok(Vec::new()),
    }
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
            material(name.get_ref(), &all.entry("materials", value).table(title)?)
        })
        .collect()
}

fn material(name: &str, table: &Table) -> Read<Material> {
    table.allow_only(&["color", "diffuse", "specular", "roughness", "transmission", "ior", "ambient"])?;
    let specular = table.number_or("specular", &SHARE, 0.0)?;
    let transmission = table.number_or("transmission", &SHARE, 0.0)?;
    // Where specular and transmission take more than 1 already, `shares` says so; diffuse must not hide it.
    let rest = (1.0 - specular - transmission).max(0.0);
    let material = Material {
        name: name.to_owned(),
        color: table.need("color", "color = [r, g, b]")?.vector(RGB, &COLOR)?,
        diffuse: table.number_or("diffuse", &SHARE, rest)?,
        specular,
        roughness: table.number_or("roughness", &ROUGHNESS, 0.0)?,
        transmission,
        ior: table.number_or("ior", &IOR, 1.5)?,
        ambient: table.number_or("ambient", &AMBIENT, 0.0)?,
    };
    check::shares(table, &material)?;
    check::not_supported_yet(table, &material)?;
    Ok(material)
}

fn light(table: &Table) -> Read<PointLight> {
    table.allow_only(&["position", "intensity"])?;
    Ok(PointLight {
        position: table.need("position", "position = [x, y, z]")?.vector(XYZ, &COORDINATE)?,
        intensity: table.need("intensity", "intensity = [r, g, b]")?.vector(RGB, &INTENSITY)?,
    })
}

fn sphere(table: &Table, names: &Names) -> Read<Sphere> {
    table.allow_only(&["center", "radius", "material"])?;
    Ok(Sphere {
        center: table.need("center", "center = [x, y, z]")?.vector(XYZ, &COORDINATE)?,
        radius: table.need("radius", "radius = a number > 0")?.number(&RADIUS)?,
        material: names.index(&table.need("material", "material = \"NAME\"")?)?,
    })
}

fn plane(table: &Table, names: &Names) -> Read<Plane> {
    table.allow_only(&["normal", "offset", "material"])?;
    let normal = table.need("normal", "normal = [x, y, z]")?;
    let offset = table.need("offset", "offset = a number: dot(normal, p) = offset")?;
    let (normal, offset) =
        check::plane((normal, normal.vector(XYZ, &DIRECTION)?), (offset, offset.number(&COORDINATE)?))?;
    Ok(Plane { normal, offset, material: names.index(&table.need("material", "material = \"NAME\"")?)? })
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

/// The materials by name.
struct Names<'a>(HashMap<&'a str, usize>);

impl<'a> Names<'a> {
    fn new(materials: &'a [Material]) -> Self {
        let names = materials.iter().map(|material| material.name.as_str());
        Names(names.zip(0..).collect())
    }

    /// Index of the material that `field` names.
    fn index(&self, field: &Field) -> Read<usize> {
        let name = field.string(NAME)?;
        self.0.get(name).copied().ok_or_else(|| self.unknown(field, name))
    }

    fn unknown(&self, field: &Field, name: &str) -> Box<super::SceneError> {
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
