//! What the settings leave open about a map's gathering, settled from a sample of the map.

use glam::DVec3;

use super::Task;
use crate::error::Result;
use crate::plan::cells::{CellSize, Form};
use crate::plan::choice::{self, Question};
use crate::plan::{radius, tiling};
use crate::rays::scene::SceneTables;
use crate::settings::{CellLattice, Gather, GridForm, Method};
use crate::stage::grid::GridSettings;
use crate::stage::map::MapStage;

/// What was chosen for a map where the settings leave it open.
#[derive(Clone, Copy, Debug, Default)]
pub struct Chosen {
    /// R, metres.
    pub radius: f32,
    /// The grid is hashed.
    pub hashed: bool,
    /// How photons are found.
    pub method: Method,
    /// Size of tiles, pixels.
    pub tile: [u32; 2],
}

/// Chooses for a map of so many photons.
///
/// # Errors
/// [`crate::error::Error::Device`] when the sample cannot be read.
pub fn choose(map: &MapStage, stored: u64, task: &Task) -> Result<Chosen> {
    let Gather { method, tile, cells, form, radius, .. } = task.settings.gather;
    // Who asks for cells asks for a grid.
    let wants_grid = cells.is_some() || form != GridForm::Auto;
    let method = if method == Method::Auto && wants_grid { Method::Grid } else { method };
    // What is left open is judged by a sample of the map.
    let sample = match (radius, method) {
        (Some(_), method) if method != Method::Auto => None,
        _ => Some(map.sample(radius::SAMPLE)?),
    };
    let tables = SceneTables::new(&task.packed, &task.features);
    let radius = match (radius, &sample) {
        (None, Some(sample)) => radius::choose(&tables, &task.frame, sample, stored),
        (radius, _) => radius.unwrap_or_default(),
    };
    let asked = Chosen { radius, hashed: false, method, tile: tile.unwrap_or(tiling::TILE) };
    let Some(sample) = sample.filter(|_| method == Method::Auto) else { return Ok(asked) };
    let question = Question { stored, radius, tile, class: task.class };
    let estimates = choice::estimates(&tables, &task.frame, &sample, &question);
    let Some(best) = estimates.first() else { return Ok(Chosen { method: Method::Grid, ..asked }) };
    Ok(Chosen { method: best.method, tile: best.tile.unwrap_or(asked.tile), ..asked })
}

/// The grid that a picture's settings ask for, with cells of the machine's usual size where they ask for none.
pub fn grid_wanted(task: &Task, radius: f32) -> GridSettings {
    let gather = &task.settings.gather;
    let size = match (gather.lattice, gather.cells) {
        (Some(CellLattice { corner, cell }), _) => {
            CellSize::Lattice { corner: (DVec3::from(corner) - task.packed.origin).as_vec3().to_array(), cell }
        }
        (None, Some(counts)) => CellSize::Counts(counts),
        (None, None) => task.class.cell_size(),
    };
    let form = match gather.form {
        GridForm::Auto => Form::Auto,
        GridForm::Dense => Form::Dense,
        GridForm::Hashed => Form::Hashed(None),
    };
    GridSettings { radius, size, form, nearest: gather.nearest }
}
