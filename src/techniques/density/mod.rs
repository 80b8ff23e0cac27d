//! Density estimates: photons are stored where they land and sorted, and every visible point takes its radiance from
//! those around it.

mod choose;
pub mod passes;

use std::rc::Rc;

use super::{Bias, Made, Place, Row, Stages, Task, Wish};
use crate::error::{Error, Result};
use crate::plan::tiling;
use crate::program::gathering::Gathering;
use crate::rays::emission::Emission;
use crate::records::table_sets::{PHOTON_GRID, PHOTON_TILES};
use crate::scene::Scene;
use crate::settings::{GridForm, Settings, TechniqueKind};
use crate::stage::Stage;
use crate::stage::map::{MapCounts, MapStage, MapView};
use crate::stage::trace::{Indirect, Permutation, Trace};
use choose::Chosen;

/// What it says of itself.
pub static ROW: Row = Row {
    name: TechniqueKind::Map.name(),
    stages: &[Stage::Upload, Stage::Photons, Stage::Grid, Stage::Compile, Stage::Textures, Stage::Tiles, Stage::Trace],
    tables: &[&PHOTON_GRID, &PHOTON_TILES],
    settle,
    of_pass: passes::of_pass,
    bias: Some(Bias { sums: passes::sums, add: passes::add, estimate: passes::bias }),
    open: |place: &Place| Ok(Box::new(Density::open(place)?)),
};

/// Bytes of OpenCL's buffers beyond which they are given back as soon as OpenGL has a copy: of half a million photons.
const TWO_COPIES: usize = 32_000_000;

/// A pass takes what a picture of its own takes; settings of final gathering say nothing here.
fn settle(wish: &Wish, _: &Scene, _: &mut Settings) -> Result<()> {
    match wish.rays.or(wish.own_rays).or(wish.points).or(wish.spacing) {
        None => Ok(()),
        Some(_) => {
            Err(Error::Usage("--rays, --own-rays, --points and --spacing belong to --technique final-gather".into()))
        }
    }
}

/// The last map, and what was chosen for it.
struct Density {
    map: MapStage,
    counts: MapCounts,
    /// It stands until the map changes.
    chosen: Chosen,
}

impl Density {
    fn open(place: &Place) -> Result<Density> {
        let map = match place {
            Place::Device(context) => MapStage::on_device(Rc::clone(context))?,
            Place::Host(pool) => MapStage::on_host(Rc::clone(pool)),
        };
        Ok(Density { map, counts: MapCounts::default(), chosen: Chosen::default() })
    }

    fn gathering(&self, task: &Task) -> Gathering {
        Gathering {
            method: self.chosen.method,
            density_kernel: task.settings.gather.density_kernel,
            hashed: self.chosen.hashed,
            ..Gathering::of(&task.packed.shapes, task.packed.sphere_count, task.is_divided)
        }
    }

    fn emit(&mut self, task: &mut Task) -> Result<bool> {
        let emission = Emission::of(task.settings, task.pass);
        self.map.upload(&task.packed, &task.features.of_photons(task.scene), &emission)?;
        task.times.compile += task.stopwatch.lap();
        self.counts = self.map.emit(&emission)?;
        task.times.emit = task.stopwatch.lap();
        Ok(true)
    }

    /// Chooses what is left open, and sorts the map into a grid; tiles take photons as they were stored.
    fn sort(&mut self, task: &mut Task) -> Result<bool> {
        self.map.restore()?;
        self.chosen = choose::choose(&self.map, self.counts.stored, task)?;
        let is_sorted = !self.chosen.method.is_tiled();
        if is_sorted {
            let wanted = choose::grid_wanted(task, self.chosen.radius);
            self.chosen.hashed = self.map.sort(&wanted, self.chosen.method)?;
        }
        task.times.grid = task.stopwatch.lap();
        Ok(is_sorted)
    }

    fn copy(&mut self, task: &mut Task, tracer: &mut dyn Trace) -> Result<bool> {
        let gathering = self.gathering(task);
        let Some(view) = self.map.view() else { return Ok(false) };
        let uploads = tracer.upload_map(&view, &gathering)?;
        if uploads > 0 {
            // Two copies of a small map are quicker to change; of a large one they are too much.
            self.map.copied(TWO_COPIES)?;
            task.times.upload += task.stopwatch.lap();
        }
        task.uploads += uploads;
        Ok(true)
    }

    fn tile(&mut self, task: &mut Task, tracer: &mut dyn Trace) -> Result<bool> {
        let Chosen { method, radius, tile, .. } = self.chosen;
        if !method.is_tiled() {
            return Ok(false);
        }
        let wanted = tiling::TileSettings { radius, tile, cells: method == crate::settings::Method::TiledGrid };
        self.map.tile(&task.frame, &task.features, &wanted)?;
        task.times.tiles = task.stopwatch.lap();
        let Some(view) = self.map.view() else { return Ok(true) };
        task.uploads += tracer.upload_tiles(&view)?;
        task.times.upload += task.stopwatch.lap();
        Ok(true)
    }
}

impl Stages for Density {
    fn run(&mut self, stage: Stage, task: &mut Task, tracer: &mut dyn Trace) -> Result<bool> {
        match stage {
            Stage::Photons => self.emit(task),
            Stage::Grid => self.sort(task),
            Stage::Textures => self.copy(task, tracer),
            Stage::Tiles => self.tile(task, tracer),
            Stage::Upload | Stage::Compile | Stage::Trace => Ok(false),
        }
    }

    fn permutation(&self, task: &Task) -> Permutation {
        Permutation { features: task.features, gathering: Some(self.gathering(task)), final_gather: None }
    }

    fn trace(&self, task: &Task, tracer: &mut dyn Trace) -> Result<()> {
        match &self.map.view() {
            Some(view) => tracer.trace(&task.frame, Indirect::Map(view)),
            None => tracer.trace(&task.frame, Indirect::None),
        }
    }

    fn made(&self) -> Made {
        let Chosen { radius, hashed, method, tile } = self.chosen;
        Made {
            photons: Some(self.counts),
            method: Some(method),
            tile: method.is_tiled().then_some(tile),
            radius: Some(radius),
            form: (!method.reads_stored()).then_some(if hashed { GridForm::Hashed } else { GridForm::Dense }),
        }
    }

    fn map(&self) -> Option<MapView<'_>> {
        self.map.view()
    }

    fn bytes(&self) -> usize {
        self.map.bytes()
    }
}
