//! Emission: energy, uniformity, storage, and the device against its twin.

mod device;
mod energy;
mod open_scene;
mod speed;

use photile::cpu::photons::{PhotonTables, photons};
use photile::error::Result;
use photile::packing::Packed;
use photile::program::features::Features;
use photile::rays::emission::{Amount, Emission, EmissionPlan, Sampler};
use photile::rays::scene::SceneTables;
use photile::scene::{Scene, parse};
use photile::settings::Settings;

/// A scene packed around the world's origin.
pub struct Case {
    pub packed: Packed,
    pub features: Features,
    pub plan: EmissionPlan,
}

impl Case {
    pub fn new(scene: &Scene) -> Case {
        let packed = Packed::new(scene, glam::DVec3::ZERO);
        let plan = EmissionPlan::new(&packed).unwrap();
        Case { features: Features::of(scene, &Settings::default()), plan, packed }
    }

    pub fn parse(text: &str) -> Case {
        let camera = "[camera]\nposition = [0, 0, 0]\nlook_at = [0, 0, -1]\nfov_y = 50.0\n";
        Case::new(&parse(&format!("{camera}{text}"), "test.toml").unwrap())
    }

    pub fn shipped(name: &str) -> Case {
        let path = format!("{}/scenes/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        Case::new(&photile::scene::load(path.as_ref()).unwrap())
    }

    pub fn twin(&self, emission: &Emission) -> PhotonTables {
        self.try_twin(emission).unwrap()
    }

    pub fn try_twin(&self, emission: &Emission) -> Result<PhotonTables> {
        photons(&SceneTables::new(&self.packed, &self.features), &self.plan, emission)
    }
}

pub fn paths(number: u32) -> Emission {
    Emission { amount: Amount::Paths(number), seed: 1, pass: 0, sampler: Sampler::Sequence, store_direct: true }
}

/// The inside of a 2 × 2 × 2 box of one albedo, with one light of flux 4π beside its middle.
pub fn grey_box(albedo: f64) -> Case {
    let mut text = format!("[materials.grey]\ncolor = [{albedo}, {albedo}, {albedo}]\n");
    text += "[[lights]]\nposition = [0.3, 0.2, 0.1]\nintensity = [1, 1, 1]\n";
    for (axis, offset) in
        [("1, 0, 0", 1), ("1, 0, 0", -1), ("0, 1, 0", 1), ("0, 1, 0", -1), ("0, 0, 1", 1), ("0, 0, 1", -1)]
    {
        text += &format!("[[planes]]\nnormal = [{axis}]\noffset = {offset}\nmaterial = \"grey\"\n");
    }
    Case::parse(&text)
}

/// Power stored, by bounce, sum over channels.
pub fn power_by_bounce(map: &PhotonTables) -> Vec<f64> {
    let mut power = vec![0.0; 64];
    for (photon, surface) in map.powers.iter().zip(&map.surfaces) {
        let total: f32 = photon.power.iter().sum();
        power[(surface.bounce as usize).min(63)] += f64::from(total);
    }
    power
}
