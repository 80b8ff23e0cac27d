//! How many paths, chosen from the scene where the user names no number; and a beginning of the photon map, made by
//! the CPU, from which that and `photile plan` judge it.

use std::rc::Rc;

use crate::error::{Error, Result};
use crate::packing::Packed;
use crate::packing::packed_scene::PackedScene;
use crate::plan::photon_sample::Sample;
use crate::plan::radius;
use crate::program::features::Features;
use crate::rays::emission::Emission;
use crate::rays::scene::SceneTables;
use crate::scene::Scene;
use crate::settings::{Amount, LightMode, Pass, Photons, Settings};
use crate::stage::map::{MapCounts, MapStage};
use crate::techniques::wants_photons;

/// Photons that a map should hold. A density estimate of them at the radius that is chosen for them rests on some
/// 1,400 photons: 2 to 3% of noise a pixel, about as much as its bias.
const STORED: f64 = 500_000.0;

/// What a path takes, in rays of the picture, and what each photon that it stores adds: a step of its walk, its
/// place in the grid. Measured on two cores with OpenCL: 3.4 where hardly anything is stored, 41 in gi_ref.
const RAYS_OF_A_PATH: f64 = 3.0;
const RAYS_OF_A_PHOTON: f64 = 13.0;

/// Fewest paths, and most, that are chosen.
const FEWEST: f64 = 50_000.0;
const MOST: f64 = 2_000_000.0;

/// Where few paths store anything, at least so many.
const USUAL: f64 = 200_000.0;

/// How much more or less a radius of the user's own may ask for.
const OF_RADIUS: f64 = 4.0;

/// A beginning of the map.
pub struct Beginning {
    /// In numbers.
    pub counts: MapCounts,
    /// Its photons.
    pub sample: Sample,
}

impl Beginning {
    /// Emits the first `paths` paths of a picture's map, or stores so many photons where a number of those is asked
    /// for.
    ///
    /// # Errors
    /// [`Error::Usage`] where photons shall be stored and nothing can be hit; [`Error::Device`] without a thread.
    pub fn new(
        scene: &Scene,
        settings: &Settings,
        packed: &PackedScene,
        features: &Features,
        paths: u32,
    ) -> Result<Beginning> {
        debug_assert!(wants_photons(scene, settings));
        let amount = match settings.photons.amount {
            Amount::Paths(all) => Amount::Paths(all.min(paths)),
            Amount::Stored(all) => Amount::Stored(all.min(paths)),
        };
        let shortened = Settings { photons: Photons { amount, ..settings.photons }, ..settings.clone() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pool = Rc::new(pool.map_err(|error| Error::Device(format!("a thread: {error}")))?);
        let mut map = MapStage::on_host(pool);
        let emission = Emission::of(&shortened, &Pass::single(settings));
        map.upload(packed, &features.of_photons(scene), &emission)?;
        let counts = map.emit(&emission)?;
        Ok(Beginning { counts, sample: map.sample(radius::SAMPLE)? })
    }

    /// Photons that a path stores.
    pub fn of_a_path(&self) -> f64 {
        self.counts.stored as f64 / self.counts.emitted.max(1) as f64
    }

    /// Photons that the whole map will hold.
    pub fn stored(&self, amount: Amount) -> u64 {
        match amount {
            Amount::Paths(paths) => (self.of_a_path() * f64::from(paths)) as u64,
            Amount::Stored(photons) => photons.into(),
        }
    }
}

/// A number of paths, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// Paths of a picture.
    pub paths: u32,
    /// In the scene's own numbers.
    pub why: String,
}

/// Paths that are looked at.
const LOOKED_AT: u32 = 1 << 12;

/// A number of paths near the best for its time; none where there are no photons.
///
/// The error of a density estimate at its best radius falls with n^(−2/3) (Silverman 1986, ch. 4.3), while paths cost
/// in proportion. In rooms gathering takes nearly all of the time and grows with n^(2/3) too: any number is as good for
/// its time as another, and half a million stored photons are a picture without visible noise. Where hardly any path
/// stores a photon, paths are what is paid for: error × time is then least where they take twice as long as the
/// picture's own rays. A radius of the user's own moves that to the number for which it would have been chosen.
///
/// The choice rests on the scene, the picture's size, samples, light and radius, not on the machine: every backend
/// makes the same picture.
///
/// # Errors
/// [`Error::Usage`] for too many lights, [`Error::Device`] without a thread.
pub fn choose(scene: &Scene, settings: &Settings) -> Result<Option<Chosen>> {
    if !wants_photons(scene, settings) {
        return Ok(None);
    }
    let features = Features::of(scene, settings);
    let packed = PackedScene::new(Packed::new(scene, scene.camera.position));
    let amount = Amount::Paths(LOOKED_AT);
    // Of every seed's picture the same number.
    let looking = Settings { seed: 0, photons: Photons { amount, ..settings.photons }, ..settings.clone() };
    let beginning = Beginning::new(scene, &looking, &packed, &features, LOOKED_AT)?;
    let of_a_path = beginning.of_a_path();
    if of_a_path == 0.0 {
        let why = format!("none of {LOOKED_AT} paths stores a photon");
        return Ok(Some(Chosen { paths: USUAL as u32, why }));
    }
    let mut wanted = STORED;
    let mut of_radius = String::new();
    if let Some(radius) = settings.gather.radius {
        let (tables, frame) =
            (SceneTables::new(&packed, &features), packed.frame(&scene.camera, settings, &Pass::single(settings)));
        let own = radius::choose(&tables, &frame, &beginning.sample, STORED as u64);
        wanted *= f64::from(own / radius).powi(6).clamp(1.0 / OF_RADIUS, OF_RADIUS);
        of_radius = format!(" at R = {radius} m");
    }
    let shadow_rays = if settings.light == LightMode::Hybrid { scene.lights.len() } else { 0 };
    let pixels = f64::from(settings.width) * f64::from(settings.height);
    let rays = pixels * f64::from(settings.samples) * (1 + shadow_rays) as f64;
    let worth = 2.0 * rays / (RAYS_OF_A_PATH + RAYS_OF_A_PHOTON * of_a_path);
    let paths = round((wanted / of_a_path).min(worth.max(USUAL)).clamp(FEWEST, MOST));
    let why = if wanted / of_a_path <= worth.max(USUAL) {
        format!("a path stores {of_a_path:.2} photons, {wanted:.0} are wanted{of_radius}")
    } else {
        format!("a path stores {of_a_path:.3} photons only, the picture has {:.1} M rays", rays * 1e-6)
    };
    Ok(Some(Chosen { paths, why }))
}

/// To 1, 2 or 5 times a power of ten, whichever is nearest by ratio.
fn round(paths: f64) -> u32 {
    let decade = 10f64.powf(paths.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * decade);
    let ratio = |step: &f64| (step / paths).ln().abs();
    steps.into_iter().min_by(|a, b| ratio(a).total_cmp(&ratio(b))).unwrap_or(paths) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lights::Lights;
    use crate::scene;

    fn shipped(name: &str) -> Scene {
        scene::load(std::path::Path::new(&format!("scenes/{name}.toml"))).unwrap()
    }

    fn chosen(scene: &Scene, settings: &Settings) -> u32 {
        choose(scene, settings).unwrap().unwrap().paths
    }

    #[test]
    fn numbers_are_round() {
        let rounded = [1e4, 1.3e4, 1.5e4, 3.1e4, 3.3e4, 7.0e4, 7.2e4, 176e3].map(round);
        assert_eq!(rounded, [10_000, 10_000, 20_000, 20_000, 50_000, 50_000, 100_000, 200_000]);
    }

    #[test]
    fn rooms_get_half_a_million_photons_and_open_scenes_as_many_paths_as_the_picture_is_worth() {
        let room = shipped("gi_ref");
        assert_eq!(chosen(&room, &Settings::default()), 200_000);
        assert_eq!(chosen(&room, &Settings { samples: 64, ..Settings::default() }), 200_000);
        let open = shipped("sphere_and_plane");
        let small = Settings { width: 64, height: 48, ..Settings::default() };
        let numbers = [small.clone(), Settings::default(), Settings { samples: 16, ..Settings::default() }];
        let numbers = numbers.map(|settings| chosen(&open, &settings));
        assert_eq!(numbers, [200_000, 500_000, 2_000_000]);
        // Whatever lies in its light, the number is within bounds.
        let photons = Settings { light: LightMode::Photons, ..Settings::default() };
        for scene in [&room, &open, &shipped("glossy"), &shipped("furnace")] {
            assert!((50_000..=2_000_000).contains(&chosen(scene, &photons)));
        }
    }

    #[test]
    fn a_radius_of_the_users_own_asks_for_the_number_it_suits() {
        let room = shipped("gi_ref");
        let with = |radius| {
            let mut settings = Settings::default();
            settings.gather.radius = Some(radius);
            chosen(&room, &settings)
        };
        assert!(with(2.0) < with(0.62) && with(0.62) <= with(0.3), "{} {} {}", with(2.0), with(0.62), with(0.3));
    }

    #[test]
    fn without_photons_there_is_no_number() {
        let direct = Settings { light: LightMode::Direct, ..Settings::default() };
        assert_eq!(choose(&shipped("gi_ref"), &direct).unwrap(), None);
        let mut dark = shipped("gi_ref");
        dark.lights = Lights::default();
        assert_eq!(choose(&dark, &Settings::default()).unwrap(), None);
    }
}
