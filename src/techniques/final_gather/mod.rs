//! Final gathering: photons leave irradiance in texels, and visible points take radiance from a bounce of rays, which end
//! in those, and from points that the lights reach first. Sites on a lattice over the picture share their rays.

mod pass;

use std::rc::Rc;

use super::{Made, Place, Row, Stages, Task, Wish};
use crate::error::Result;
use crate::packing::Packed;
use crate::program::features::Features;
use crate::rays::emission::{Emission, is_closed};
use crate::rays::scene::SceneTables;
use crate::records::table_sets::{CHARTS, FINAL_GATHER, SITES};
use crate::scene::Scene;
use crate::settings::{Amount, FinalGather, LightMode, Settings, Technique, TechniqueKind};
use crate::stage::Stage;
use crate::stage::irradiance::IrradianceStage;
use crate::stage::map::MapCounts;
use crate::stage::trace::{FinalPass, Indirect, Permutation, Trace};

/// What it says of itself. Its texels blur, too, but by less than passes can tell: no bias is estimated.
pub static ROW: Row = Row {
    name: TechniqueKind::FinalGather.name(),
    stages: &[Stage::Upload, Stage::Photons, Stage::Compile, Stage::Textures, Stage::Trace],
    tables: &[&CHARTS, &FINAL_GATHER, &SITES],
    settle,
    of_pass,
    bias: None,
    open: |place: &Place| Ok(Box::new(FinalGathering::open(place))),
};

/// Whether it is right for a scene: texels have no direction, which glossy surfaces would need, and neither direct light
/// nor single photons.
pub fn suits(scene: &Scene, settings: &Settings) -> bool {
    settings.light == LightMode::Hybrid
        && !Features::of(scene, settings).glossy
        && matches!(settings.photons.amount, Amount::Paths(_))
}

/// Its own settings among others.
fn own(settings: &Settings) -> FinalGather {
    match settings.technique {
        Technique::FinalGather(gather) => gather,
        Technique::Map => FinalGather::default(),
    }
}

fn settle(wish: &Wish, scene: &Scene, settings: &mut Settings) -> Result<()> {
    let usual = Usual::of(scene, settings, wish.on_gpu);
    settings.technique = Technique::FinalGather(FinalGather {
        rays: wish.rays.unwrap_or(usual.gather.rays),
        own_rays: wish.own_rays.unwrap_or(usual.gather.own_rays),
        points: wish.points.unwrap_or(usual.gather.points),
        spacing: wish.spacing.unwrap_or(usual.gather.spacing),
        ..own(settings)
    });
    if !wish.photons {
        settings.photons.amount = Amount::Paths(usual.paths);
    }
    if !wish.samples {
        settings.samples = usual.samples;
    }
    Ok(())
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

/// How often texels are halved in pass `index`: what they blur falls with the passes, as the noise does.
fn texel_level(index: u64) -> u32 {
    match index {
        0..512 => 0,
        512..8192 => 1,
        _ => 2,
    }
}

/// Finer texels in later passes. Where the lattice lies, and which rays are next, follows from the pass itself.
fn of_pass(settings: &mut Settings, index: u64, _: &[f64]) {
    let mut gather = own(settings);
    gather.texels <<= 2 * texel_level(index);
    settings.technique = Technique::FinalGather(gather);
    // As many photons a texel as before: their noise is that of every ray.
    if let Amount::Paths(paths) = &mut settings.photons.amount {
        *paths = paths.saturating_mul(1 << (2 * texel_level(index)));
    }
}

/// The last texels.
struct FinalGathering {
    irradiance: IrradianceStage,
    counts: MapCounts,
}

impl FinalGathering {
    fn open(place: &Place) -> FinalGathering {
        let irradiance = match place {
            Place::Device(context) => IrradianceStage::on_device(Rc::clone(context)),
            Place::Host(pool) => IrradianceStage::on_host(Rc::clone(pool)),
        };
        FinalGathering { irradiance, counts: MapCounts::default() }
    }

    fn emit(&mut self, task: &mut Task) -> Result<bool> {
        let emission = Emission::of(task.settings, task.pass);
        let features = task.features.of_photons(task.scene);
        self.irradiance.upload(&task.packed, &features, &emission, own(task.settings).texels)?;
        task.times.compile += task.stopwatch.lap();
        self.counts = self.irradiance.emit(&emission)?;
        task.times.emit = task.stopwatch.lap();
        Ok(true)
    }

    fn copy(&mut self, task: &mut Task, tracer: &mut dyn Trace) -> Result<bool> {
        let Some(view) = self.irradiance.view() else { return Ok(false) };
        let uploads = tracer.upload_irradiance(&view)?;
        if uploads > 0 {
            task.times.upload += task.stopwatch.lap();
        }
        task.uploads += uploads;
        Ok(true)
    }
}

impl Stages for FinalGathering {
    fn run(&mut self, stage: Stage, task: &mut Task, tracer: &mut dyn Trace) -> Result<bool> {
        match stage {
            Stage::Photons => self.emit(task),
            Stage::Textures => self.copy(task, tracer),
            Stage::Upload | Stage::Grid | Stage::Tiles | Stage::Compile | Stage::Trace => Ok(false),
        }
    }

    fn permutation(&self, task: &Task) -> Permutation {
        // Without sites every sample of a pixel does their work.
        let has_sites = own(task.settings).spacing > 1;
        Permutation { features: task.features, gathering: None, final_gather: Some(has_sites) }
    }

    fn trace(&self, task: &Task, tracer: &mut dyn Trace) -> Result<()> {
        let (Some(view), Some(plan)) = (self.irradiance.view(), self.irradiance.plan()) else {
            return tracer.trace(&task.frame, Indirect::None);
        };
        let scene = SceneTables::new(&task.packed, &task.features);
        let pass: FinalPass = pass::prepare(&scene, plan, task.settings, &own(task.settings), task.pass);
        tracer.trace(&task.frame, Indirect::Final(&view, &pass))
    }

    fn made(&self) -> Made {
        Made { photons: Some(self.counts), ..Made::default() }
    }

    fn bytes(&self) -> usize {
        self.irradiance.bytes()
    }
}
