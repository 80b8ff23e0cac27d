//! Which technique makes radiance of a pass's photons, and with which settings, where the user leaves it open.

use crate::error::{Error, Result};
use crate::program::features::Features;
use crate::rays::emission::{Amount, is_closed};
use crate::records::packing::Packed;
use crate::scene::Scene;
pub use crate::settings::TechniqueKind as Kind;
use crate::settings::{FinalGather, LightMode, Settings, Technique};

/// What the user asked for of what decides the technique; the rest is left open.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wish {
    /// The technique itself.
    pub kind: Option<Kind>,
    /// Rays of a site of final gathering in one pass.
    pub rays: Option<u32>,
    /// Rays of a sample of it that gathers for itself.
    pub own_rays: Option<u32>,
    /// Lit points of a pass of it.
    pub points: Option<u32>,
    /// Pixels from site to site of final gathering.
    pub spacing: Option<u32>,
    /// A gather method, radius, kernel, grid or tiles: who asks for one of them asks for density estimates.
    pub estimates: bool,
    /// A number of photons.
    pub photons: bool,
    /// A number of samples.
    pub samples: bool,
    /// Not a wish: a GPU renders, for which a pass of few rays is over before it has begun.
    pub on_gpu: bool,
}

impl Wish {
    /// Settles the technique of passes, and what it changes about photons and samples.
    ///
    /// # Errors
    /// [`Error::Usage`] for wishes that contradict each other or the scene.
    pub fn settle(&self, scene: &Scene, settings: &mut Settings) -> Result<()> {
        let suitable = default_technique(scene, settings);
        settings.technique = match (self.kind, suitable) {
            (Some(Kind::FinalGather), Technique::Map) => {
                return Err(Error::Usage(
                    "--technique final-gather: wants --light hybrid, --photons rather than --stored, and no glossy \
                     surface, whose view of the texels has no direction"
                        .into(),
                ));
            }
            (Some(Kind::Map), _) => Technique::Map,
            (None, _) if self.estimates => Technique::Map,
            _ => suitable,
        };
        let usual = Usual::of(scene, settings, self.on_gpu);
        match &mut settings.technique {
            Technique::FinalGather(gather) => {
                gather.rays = self.rays.unwrap_or(usual.gather.rays);
                gather.own_rays = self.own_rays.unwrap_or(usual.gather.own_rays);
                gather.points = self.points.unwrap_or(usual.gather.points);
                gather.spacing = self.spacing.unwrap_or(usual.gather.spacing);
                if !self.photons {
                    settings.photons.amount = Amount::Paths(usual.paths);
                }
                if !self.samples {
                    settings.samples = usual.samples;
                }
                Ok(())
            }
            Technique::Map if self.rays.or(self.own_rays).or(self.points).or(self.spacing).is_some() => Err(
                Error::Usage("--rays, --own-rays, --points and --spacing belong to --technique final-gather".into()),
            ),
            Technique::Map => Ok(()),
        }
    }
}

/// What suits a scene where the settings leave it open: final gathering wherever it is right.
pub fn default_technique(scene: &Scene, settings: &Settings) -> Technique {
    let suits = settings.light == LightMode::Hybrid
        && !Features::of(scene, settings).glossy
        && matches!(settings.photons.amount, Amount::Paths(_));
    if suits { Technique::FinalGather(FinalGather::default()) } else { Technique::Map }
}

/// Settings of final gathering that buy the least error a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Usual {
    /// Rays, lit points, spacing, texels.
    pub gather: FinalGather,
    /// Paths of a pass.
    pub paths: u32,
    /// Samples of a pixel in a pass.
    pub samples: u32,
}

impl Usual {
    /// Measured on the report's scenes, see the README. Where light leaves the scene, little comes from a second bounce;
    /// on a GPU a pass costs as much in launches as all the rays of a CPU's pass. Paths go with the pixels: then
    /// emission stays the same share of a pass.
    pub fn of(scene: &Scene, settings: &Settings, on_gpu: bool) -> Usual {
        let gather = FinalGather::default();
        let rays = |rays, own_rays, points| FinalGather { rays, own_rays, points, ..gather };
        let (gather, paths, samples) = match (is_closed(&Packed::new(scene, scene.camera.position)), on_gpu) {
            (true, false) => (gather, 65_536, 2),
            (false, false) => (rays(16, 8, 16), 16_384, 2),
            (true, true) => (rays(256, 32, 256), 524_288, 4),
            (false, true) => (rays(64, 16, 64), 131_072, 4),
        };
        // Of the 320 × 240 pixels that this was measured with.
        let share = f64::from(settings.width) * f64::from(settings.height) / 76_800.0;
        let paths = (f64::from(paths) * share).clamp(4096.0, 2_097_152.0) as u32;
        Usual { gather, paths, samples }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_suit_scene_size_and_device() {
        let load = |name: &str| crate::scene::load(std::path::Path::new(&format!("scenes/{name}.toml"))).expect("ours");
        let size = |width, height| Settings { width, height, ..Settings::default() };
        let (room, open) = (load("gi_ref"), load("sphere_and_plane"));
        let usual = Usual::of(&room, &size(320, 240), false);
        assert_eq!((usual.gather, usual.paths), (FinalGather::default(), 65_536));
        // Where light leaves the scene there is less to gather; a GPU does more in a pass.
        assert!(Usual::of(&open, &size(320, 240), false).paths < usual.paths);
        assert!(Usual::of(&room, &size(320, 240), true).paths > usual.paths);
        assert_eq!(Usual::of(&room, &size(640, 480), false).paths, 4 * usual.paths);
        assert_eq!(Usual::of(&room, &size(1, 1), false).paths, 4096);
        assert_eq!(Usual::of(&room, &size(65_000, 65_000), true).paths, 2_097_152);

        // What is asked for stays.
        let wish = Wish { rays: Some(3), photons: true, ..Wish::default() };
        let mut settings = size(320, 240);
        let asked = settings.photons.amount;
        wish.settle(&room, &mut settings).expect("no contradiction");
        let Technique::FinalGather(gather) = settings.technique else { panic!("{:?}", settings.technique) };
        assert_eq!((gather.rays, settings.photons.amount, settings.samples), (3, asked, usual.samples));
        assert!(
            Wish { kind: Some(Kind::Map), ..wish }.settle(&room, &mut settings).is_err(),
            "rays belong to the other"
        );
    }
}
