//! What the user wishes of a technique, and what is settled for him.

use super::{asked, final_gather};
use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::settings::{FinalGather, Settings, Technique, TechniqueKind};

/// What the user asked for of what decides the technique; the rest is left open.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wish {
    /// The technique itself.
    pub kind: Option<TechniqueKind>,
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
            (Some(TechniqueKind::FinalGather), Technique::Map) => {
                return Err(Error::Usage(
                    "--technique final-gather: wants --light hybrid, --photons rather than --stored, and no glossy \
                     surface, whose view of the texels has no direction"
                        .into(),
                ));
            }
            (Some(TechniqueKind::Map), _) => Technique::Map,
            (None, _) if self.estimates => Technique::Map,
            _ => suitable,
        };
        (asked(settings).settle)(self, scene, settings)
    }
}

/// What suits a scene where the settings leave it open: final gathering wherever it is right.
pub fn default_technique(scene: &Scene, settings: &Settings) -> Technique {
    let suits = final_gather::suits(scene, settings);
    if suits { Technique::FinalGather(FinalGather::default()) } else { Technique::Map }
}

#[cfg(test)]
mod tests {
    use super::super::Usual;
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
            Wish { kind: Some(TechniqueKind::Map), ..wish }.settle(&room, &mut settings).is_err(),
            "rays belong to the other"
        );
    }
}
