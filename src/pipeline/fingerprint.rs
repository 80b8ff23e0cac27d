//! By what a checkpoint knows scene and settings again.

use crate::film::fnv1a;
use crate::lights::Lights;
use crate::scene::Scene;
use crate::settings::{FinalGather, Gather, Photons, Settings, Technique};
use crate::shapes::Shapes;

/// Of all that decides a render's pixels. Where anything is added to what is asked for, it has to be said here, too:
/// nothing is left out by `..`.
pub fn fingerprint(scene: &Scene, settings: &Settings) -> u64 {
    let Scene { name: _, camera, materials, lights, shapes, render: _ } = scene;
    let (Lights { points }, Shapes { spheres, planes, quads }) = (lights, shapes);
    // Said only where there are any: the first checkpoints knew none.
    let quads = if quads.is_empty() { String::new() } else { format!("{quads:?}") };
    // Debug prints every float in full, and any change of a type's fields changes it too.
    let settings = in_words(settings);
    fnv1a(format!("passes {camera:?}{materials:?}{points:?}{spheres:?}{planes:?}{quads}{settings}").as_bytes())
}

/// Settings in the words of the first checkpoints, which must stay good: then they said of a pass, too, where it begins.
fn in_words(settings: &Settings) -> String {
    let Settings { width, height, samples, seed, light, photons, gather, technique } = settings;
    let Photons { amount, sampler } = photons;
    let Gather { method, density_kernel, radius, nearest, cells, form, lattice, tile } = gather;
    // The cells' lattice had another name.
    let lattice = format!("{lattice:?}").replace("CellLattice", "Lattice");
    let gather = format!(
        "Gather {{ method: {method:?}, kernel: {density_kernel:?}, radius: {radius:?}, nearest: {nearest}, cells: \
         {cells:?}, form: {form:?}, lattice: {lattice}, tile: {tile:?} }}"
    );
    let technique = match technique {
        Technique::Map => "Map".to_string(),
        Technique::FinalGather(FinalGather { rays, own_rays, spacing, texels, points }) => format!(
            "FinalGather(FinalGather {{ rays: {rays}, own_rays: {own_rays}, spacing: {spacing}, texels: {texels}, \
             points: {points}, turn: 0 }})"
        ),
    };
    format!(
        "Settings {{ width: {width}, height: {height}, samples: {samples}, first_sample: 0, jittered: false, \
         seed: {seed}, light: {light:?}, photons: Photons {{ amount: {amount:?}, pass: 0, sampler: {sampler:?} }}, \
         gather: {gather}, technique: {technique} }}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_said_as_the_first_checkpoints_said_them() {
        let mut settings = Settings::default();
        let begins = "Settings { width: 640, height: 480, samples: 1, first_sample: 0, jittered: false, seed: 0, light: \
                      Hybrid, photons: Photons { amount: Paths(200000), pass: 0, sampler: Sequence }, gather: Gather { \
                      method: Auto, kernel: Epanechnikov, radius: None, nearest: 50, cells: None, form: Auto, lattice: \
                      None, tile: None }, technique: ";
        assert_eq!(in_words(&settings), format!("{begins}Map }}"));
        settings.technique = Technique::FinalGather(FinalGather::default());
        let gather =
            "FinalGather(FinalGather { rays: 64, own_rays: 16, spacing: 4, texels: 24576, points: 32, turn: 0 })";
        assert_eq!(in_words(&settings), format!("{begins}{gather} }}"));
    }
}
