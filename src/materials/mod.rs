//! What surfaces do to light: a material is a mix of lobes, a file a kind, each with its keys, its checks and its share.

use glam::DVec3;

use crate::kinds::for_each_material_kind;
use crate::reading::rules::BRIGHTEST;
use crate::reading::{Field, RGB, Read, Rule, Saved, Table};
use crate::records;

/// Sum of shares. Decimals that add up to 1 on paper miss it by an ulp or two in binary.
const SHARES_SLACK: f64 = 1e-9;

const COLOR: Rule = Rule { holds: |x| (0.0..=1.0).contains(&x), expected: "a reflectance from 0 to 1" };
const SHARE: Rule = Rule { holds: |x| (0.0..=1.0).contains(&x), expected: "a share from 0 to 1" };
const IOR: Rule = Rule {
    // 1e4: Fresnel's terms square it; no material comes near.
    holds: |x| (1.0..=1e4).contains(&x),
    expected: "an index of refraction from 1 to 1e4",
};
const AMBIENT: Rule =
    Rule { holds: |x| (0.0..=BRIGHTEST).contains(&x), expected: "an ambient radiance from 0 to 1e30" };

/// A BSDF by its shares (DESIGN §2): `diffuse + specular + transmission ≤ 1`.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The table's name in the file.
    pub name: String,
    /// Albedo of the diffuse part, linear Rec. 709, each in [0, 1].
    pub color: DVec3,
    /// kd, share of the Lambertian lobe.
    pub diffuse: f64,
    /// ks, share of the GGX lobe (or of a perfect mirror where `roughness` is 0).
    pub specular: f64,
    /// GGX α, in [0, 1].
    pub roughness: f64,
    /// kt, share of the smooth dielectric.
    pub transmission: f64,
    /// Index of refraction of the dielectric, ≥ 1.
    pub ior: f64,
    /// `ambient · color` is added to the outgoing radiance.
    pub ambient: f64,
}

mod diffuse;
mod ggx;

/// A kind of lobe.
pub struct Kind {
    /// Keys of its own; the first is that of its share.
    pub keys: &'static [&'static str],
    /// Reads them; what the other kinds take of the light is known.
    read: fn(&Table, &mut Material) -> Read<()>,
    /// Refuses what the tracers cannot do yet: a wrong picture would be worse than none.
    supported: fn(&Table, &Material) -> Read<()>,
    /// Keys and values that the window may change.
    saved: fn(&Material) -> Vec<Saved>,
    /// Its share of what arrives.
    pub share: fn(&Material) -> f64,
}

macro_rules! lobes {
    ($($kind:ident,)*) => {
        /// All kinds of lobes. The first takes what the others leave.
        pub const KINDS: &[Kind] = &[$($kind::KIND,)*];
    };
}
for_each_material_kind!(lobes);

impl Material {
    /// Reads `[materials.NAME]`.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn read(name: &str, table: &Table) -> Read<Material> {
        let of_kinds = KINDS.iter().flat_map(|kind| kind.keys).copied();
        let keys: Vec<_> = ["color"].into_iter().chain(of_kinds).chain(["transmission", "ior", "ambient"]).collect();
        table.allow_only(&keys)?;
        let mut material = Material {
            name: name.to_owned(),
            color: DVec3::ZERO,
            diffuse: 0.0,
            specular: 0.0,
            roughness: 0.0,
            transmission: table.number_or("transmission", &SHARE, 0.0)?,
            ior: table.number_or("ior", &IOR, 1.5)?,
            ambient: table.number_or("ambient", &AMBIENT, 0.0)?,
        };
        material.color = table.need("color", "color = [r, g, b]")?.vector(RGB, &COLOR)?;
        for kind in KINDS.iter().rev() {
            (kind.read)(table, &mut material)?;
        }
        material.check_shares(table)?;
        KINDS.iter().try_for_each(|kind| (kind.supported)(table, &material))?;
        match table.get("transmission").filter(|_| material.transmission > 0.0) {
            Some(field) => Err(field.wrong("0: glass is not supported yet")),
            None => Ok(material),
        }
    }

    /// What the window may change of it and write back.
    pub fn saved(&self) -> Vec<Saved> {
        let common = [
            Saved::vector("color", self.color),
            Saved::number("transmission", self.transmission),
            Saved::number("ior", self.ior),
            Saved::number("ambient", self.ambient),
        ];
        common.into_iter().chain(KINDS.iter().flat_map(|kind| (kind.saved)(self))).collect()
    }

    /// Its record.
    pub fn pack(&self) -> records::Material {
        records::Material {
            color: self.color.as_vec3().to_array(),
            diffuse: self.diffuse as f32,
            specular: self.specular as f32,
            roughness: self.roughness as f32,
            ambient: self.ambient as f32,
            transmission: self.transmission as f32,
            ior: self.ior as f32,
        }
    }

    /// Light that no other share takes, for a material that does not say how much is diffuse.
    fn rest(&self) -> f64 {
        (1.0 - self.specular - self.transmission).max(0.0)
    }

    /// Refuses shares that add up to more light than arrives.
    fn check_shares(&self, table: &Table) -> Read<()> {
        let sum = KINDS.iter().map(|kind| (kind.share)(self)).sum::<f64>() + self.transmission;
        if sum <= 1.0 + SHARES_SLACK {
            return Ok(());
        }
        let keys: Vec<_> = KINDS.iter().map(|kind| kind.keys[0]).chain(["transmission"]).collect();
        let mut given: Vec<Field> = keys.iter().filter_map(|key| table.get(key)).collect();
        given.sort_by_key(Field::at);
        let quoted: Vec<String> = given.iter().map(Field::quote).collect();
        // The last one written is the one that broke the sum. There is one, as the defaults add up to 1.
        let at = given.last().map_or(table.at, Field::at);
        Err(table.text.error(at, quoted.join(", "), format!("{} to be at most 1", keys.join(" + "))))
    }
}
