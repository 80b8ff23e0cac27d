//! Twin of `kernels/photons.cl`: paths from the lights, a photon stored at each diffuse or glossy surface.

use rayon::prelude::*;

use super::grid::PhotonSurface;
use crate::error::{Error, Result};
use crate::rays::emission::{Amount, Emission, EmissionPlan};
use crate::rays::random::hash2_u;
use crate::rays::scene::{SceneTables, Surface};
use crate::rays::walk::{Photon, emit_photon, scatter};
use crate::records::{Emitter, PhotonDirection, PhotonPosition, PhotonPower};

/// A photon map in path order, then bounce order, a table a property.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhotonTables {
    /// Scene space.
    pub positions: Vec<PhotonPosition>,
    /// Watts per channel.
    pub powers: Vec<PhotonPower>,
    /// Shape, side, bounce.
    pub surfaces: Vec<PhotonSurface>,
    /// Towards where the photon came from; empty unless some surface is glossy.
    pub directions: Vec<PhotonDirection>,
    /// Paths emitted.
    pub emitted: u32,
}

/// Key of all numbers of a pass.
pub fn stream_of(seed: u32, pass: u32) -> u32 {
    hash2_u(seed, pass)
}

/// Emission gives up when so many paths have stored nothing.
pub const FRUITLESS_PATHS: u32 = 1 << 20;

/// The error of [`Amount::Stored`] where nothing can be stored.
pub fn fruitless(wanted: u32, stored: u64, paths: u32) -> Error {
    Error::Usage(format!(
        "--stored {wanted}: {stored} photons after {paths} paths; in this scene hardly any light, or none, reaches a \
         diffuse or glossy surface (in the light mode 'hybrid' only after a bounce)"
    ))
}

/// Walks one path and shows every photon that it deposits, with the surface that it lies on.
pub fn walk_photons(
    scene: &SceneTables,
    plan: &EmissionPlan,
    emitters: &[Emitter],
    emission: &Emission,
    path: u32,
    stream: u32,
    mut deposit: impl FnMut(&Photon, &Surface),
) {
    let mut next = Some(emit_photon(plan, emitters, emission.sampler, path, stream));
    while let Some(photon) = next {
        let Some(hit) = scene.closest_hit(photon.position, photon.direction, photon.face) else { break };
        let surface = scene.surface_at(photon.position, photon.direction, hit);
        let material = scene.material_of(surface.shape);
        let keeps = material.diffuse > 0.0 || (material.specular > 0.0 && material.roughness > 0.0);
        if keeps && (emission.store_direct || photon.bounce > 0) {
            deposit(&photon, &surface);
        }
        next = scatter(scene, &photon, &surface);
    }
}

/// Walks paths `[first, end)` and stores.
pub fn walk_paths(
    scene: &SceneTables,
    plan: &EmissionPlan,
    emitters: &[Emitter],
    emission: &Emission,
    first: u32,
    end: u32,
) -> PhotonTables {
    let mut map = PhotonTables { emitted: end - first, ..PhotonTables::default() };
    let stream = stream_of(emission.seed, emission.pass);
    for path in first..end {
        walk_photons(scene, plan, emitters, emission, path, stream, |photon, surface| {
            map.positions.push(PhotonPosition { position: surface.position.into() });
            map.powers.push(PhotonPower { power: (photon.throughput * photon.power).into() });
            let (shape, side) = (surface.shape as f32, surface.side);
            map.surfaces.push(PhotonSurface { shape, side, bounce: photon.bounce as f32 });
            if scene.features.glossy {
                map.directions.push(PhotonDirection { direction: (-photon.direction).into() });
            }
        });
    }
    map
}

impl PhotonTables {
    fn append(&mut self, mut other: PhotonTables) {
        self.positions.append(&mut other.positions);
        self.powers.append(&mut other.powers);
        self.surfaces.append(&mut other.surfaces);
        self.directions.append(&mut other.directions);
        self.emitted += other.emitted;
    }

    /// The map as the grid and the gathering take it.
    pub fn view(&self) -> super::grid::PhotonTables<'_> {
        super::grid::PhotonTables {
            positions: &self.positions,
            powers: &self.powers,
            surfaces: &self.surfaces,
            directions: &self.directions,
        }
    }

    /// Photons stored.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether nothing was stored.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }
}

/// All paths of a pass on the calling thread's rayon pool, in path order.
fn walk_all(
    scene: &SceneTables,
    plan: &EmissionPlan,
    emission: &Emission,
    first: u32,
    end: u32,
    paths: u32,
) -> PhotonTables {
    let emitters = plan.emitters(paths);
    const CHUNK: u32 = 4096;
    let chunks: Vec<u32> = (first..end).step_by(CHUNK as usize).collect();
    let parts: Vec<PhotonTables> = chunks
        .into_par_iter()
        .map(|at| walk_paths(scene, plan, &emitters, emission, at, end.min(at.saturating_add(CHUNK))))
        .collect();
    let mut map = PhotonTables::default();
    parts.into_iter().for_each(|part| map.append(part));
    map
}

/// The photon map of one pass.
///
/// # Errors
/// [`Error::Usage`] when photons are to be stored where nothing can be hit.
pub fn photons(scene: &SceneTables, plan: &EmissionPlan, emission: &Emission) -> Result<PhotonTables> {
    let wanted = match emission.amount {
        Amount::Paths(paths) if plan.is_empty() => return Ok(PhotonTables { emitted: paths, ..Default::default() }),
        Amount::Paths(paths) => return Ok(walk_all(scene, plan, emission, 0, paths, paths)),
        Amount::Stored(wanted) => wanted,
    };
    // Batch after batch until the slots are filled; then the path that filled the last one is looked for.
    let (mut stored, mut first) = (0u64, 0u32);
    let batch = wanted.clamp(1 << 16, 1 << 22);
    while !plan.is_empty() {
        let end = first.saturating_add(batch);
        let found = walk_all(scene, plan, emission, first, end, end).len() as u64;
        if stored + found >= u64::from(wanted) {
            let emitters = plan.emitters(end);
            let last = (first..end).find(|path| {
                stored += walk_paths(scene, plan, &emitters, emission, *path, path + 1).len() as u64;
                stored >= u64::from(wanted)
            });
            let emitted = last.expect("the batch fills the slots") + 1;
            let mut map = walk_all(scene, plan, emission, 0, emitted, emitted);
            map.positions.truncate(wanted as usize);
            map.powers.truncate(wanted as usize);
            map.surfaces.truncate(wanted as usize);
            map.directions.truncate(wanted as usize);
            return Ok(map);
        }
        (stored, first) = (stored + found, end);
        if (stored == 0 && first >= FRUITLESS_PATHS) || first >= 1 << 31 {
            break;
        }
    }
    Err(fruitless(wanted, stored, first))
}
