//! `photile plan`: what is run for a scene, what is skipped, and why.

use std::collections::BTreeMap;

use serde::Serialize;

use super::options::RenderOptions;
use super::{output, print_json};
use crate::device::memory;
use crate::error::{Error, Result};
use crate::packing::Packed;
use crate::packing::packed_scene::PackedScene;
use crate::pipeline::class_of;
use crate::pipeline::path_count::Beginning;
use crate::plan::choice::{self, Class, Estimate, Question};
use crate::plan::radius;
use crate::program::features::{Features, Reason};
use crate::program::source::{Options, assemble, units};
use crate::rays::emission::EmissionPlan;
use crate::rays::scene::SceneTables;
use crate::records::{Frame, Light, Material, Record, Shape, TEXEL, TEXTURE_WIDTH_LOG2, TextureShape};
use crate::scene::Scene;
use crate::settings::{Amount, Backend, LightMode, Pass, Settings};
use crate::techniques::wants_photons;

/// Show which stages and features a scene needs, what is skipped and why
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    options: RenderOptions,
    /// Print a shader or kernel as the driver gets it, such as trace.frag or trace.cl
    #[arg(long, value_name = "UNIT")]
    source: Option<String>,
    /// Lanes of a work-item in a printed kernel: 1 as for GPUs, 4, 8 or 16 as for CPUs
    #[arg(long, value_name = "N", default_value_t = 1, requires = "source")]
    lanes: u32,
    /// Print one JSON object on stdout
    #[arg(long)]
    json: bool,
}

/// A table on the device.
#[derive(Serialize)]
struct Table {
    table: &'static str,
    records: usize,
    texels: usize,
    texture: [u32; 2],
    bytes: usize,
}

#[derive(Serialize)]
struct Report {
    scene: String,
    permutation: Vec<String>,
    stages: Vec<Reason>,
    features: Vec<Reason>,
    uploads: Vec<Table>,
    bytes: usize,
    gather: Option<Gathering>,
    memory: Option<Memory>,
}

/// Most bytes that the photon map takes, sorted into a grid, all scratch included.
#[derive(Serialize)]
struct Memory {
    photons: u64,
    /// In OpenCL's buffers.
    opencl_bytes: usize,
    /// In OpenGL's textures, where that is the backend.
    opengl_bytes: usize,
}

/// How photons would be gathered where `--gather` is not given.
#[derive(Serialize)]
struct Gathering {
    radius: f32,
    stored: u64,
    /// For fragments of a GPU: the cheapest first.
    opengl: Vec<Estimate>,
    /// The same for OpenCL on a GPU.
    opencl: Vec<Estimate>,
    /// Fragments of a software rasteriser.
    opengl_software: Vec<Estimate>,
    /// OpenCL on a CPU, whose pixels gather in blocks.
    opencl_cpu: Vec<Estimate>,
    /// The twins in Rust.
    cpu: Vec<Estimate>,
    /// Which of these each backend is on this machine; one without a driver is none.
    here: BTreeMap<&'static str, &'static str>,
}

/// Paths that are emitted to judge the map by.
const PATHS: u32 = 1 << 14;

/// A beginning of the map, made by the CPU, and what follows from it.
fn gathering(
    options: &RenderOptions,
    scene: &Scene,
    settings: &Settings,
    features: &Features,
    packed: &PackedScene,
) -> Result<Option<Gathering>> {
    if !wants_photons(scene, settings) {
        return Ok(None);
    }
    let beginning = Beginning::new(scene, settings, packed, features, PATHS)?;
    let stored = beginning.stored(settings.photons.amount);
    let (tables, frame) =
        (SceneTables::new(packed, features), packed.frame(&scene.camera, settings, &Pass::single(settings)));
    let radius = settings.gather.radius.unwrap_or_else(|| radius::choose(&tables, &frame, &beginning.sample, stored));
    let weigh = |class| {
        let question = Question { stored, radius, tile: settings.gather.tile, class };
        choice::estimates(&tables, &frame, &beginning.sample, &question)
    };
    let here = |backend: Backend| {
        let class = class_of(backend, &options.machine(Some(backend))).ok()?;
        Some((backend.name(), class.name()))
    };
    Ok(Some(Gathering {
        radius,
        stored,
        opengl: weigh(Class::OpenGlGpu),
        opencl: weigh(Class::OpenClGpu),
        opengl_software: weigh(Class::OpenGlSoftware),
        opencl_cpu: weigh(Class::OpenClLanes),
        cpu: weigh(Class::Cpu),
        here: Backend::ALL.into_iter().filter_map(here).collect(),
    }))
}

/// What paths are spared by leaving out directions in which nothing can be hit; empty where there are none.
fn aimed(packed: &Packed, settings: &Settings) -> Result<String> {
    let plan = EmissionPlan::of(packed, settings.light == LightMode::Photons)?;
    let wasted = 100.0 * (1.0 - plan.useful_share(packed));
    Ok(match plan.cells.is_empty() {
        true => String::new(),
        false => format!("{wasted:.1}% of the light can hit nothing: no paths go there"),
    })
}

/// Which stages a first picture runs, in the pipeline's order.
fn stages(scene: &Scene, settings: &Settings, chosen: Option<String>, aimed: String) -> Vec<Reason> {
    let shapes = scene.shapes.len();
    let no_photons = match (settings.light, scene.lights.len(), shapes) {
        (LightMode::Direct, ..) => Some("direct light only"),
        (_, 0, _) => Some("no lights"),
        (_, _, 0) => Some("no objects"),
        _ => None,
    };
    let mode = if settings.light == LightMode::Photons { "all" } else { "those of at least one bounce" };
    let amount = match settings.photons.amount {
        Amount::Paths(_) if chosen.is_some() => chosen.unwrap_or_default(),
        Amount::Paths(paths) => format!("{paths} paths, {mode} stored"),
        Amount::Stored(photons) => format!("{photons} photons, {mode} stored"),
    };
    let of_photons = |stage: &str, why: &str| Reason {
        feature: stage.into(),
        used: no_photons.is_none(),
        why: no_photons.unwrap_or(why).to_string(),
    };
    let always = |stage: &str, why: String| Reason { feature: stage.into(), used: true, why };
    vec![
        always("compile", "trace.frag in OpenGL, trace.cl in OpenCL, for the features below".into()),
        always("upload", format!("{shapes} objects, {} lights", scene.lights.len())),
        of_photons("photons", &amount),
        Reason {
            feature: "emission map".into(),
            used: no_photons.is_none() && !aimed.is_empty(),
            why: match no_photons {
                Some(why) => why.into(),
                None if aimed.is_empty() => "something can be hit in all directions".into(),
                None => aimed,
            },
        },
        of_photons("grid or tiles", "photons into the cells that gathering walks through"),
        of_photons("textures", "in OpenGL: the photon map as RGB32F tables"),
        always("trace", format!("{} × {} pixels, {} samples each", settings.width, settings.height, settings.samples)),
    ]
}

pub fn run(args: &Args) -> Result<()> {
    let scene = args.options.load()?;
    let mut settings = args.options.settings(&scene);
    let chosen = args.options.choose_paths(&scene, &mut settings)?;
    if let Some(unit) = &args.source {
        return print_source(unit, args.lanes, &Features::of(&scene, &settings));
    }
    let report = report(&args.options, &scene, &settings, chosen)?;
    match args.json {
        true => print_json(&report),
        false => report.print(),
    }
    Ok(())
}

fn print_source(unit: &str, lanes: u32, features: &Features) -> Result<()> {
    if !units().contains(&unit) {
        return Err(Error::Usage(format!("found --source {unit}, expected one of {}", units().join(", "))));
    }
    if ![1, 4, 8, 16].contains(&lanes) {
        return Err(Error::Usage(format!("found --lanes {lanes}, expected 1, 4, 8 or 16")));
    }
    output::print(assemble(unit, Some(features), &Options { lanes, ..Options::default() }).text);
    Ok(())
}

fn report(options: &RenderOptions, scene: &Scene, settings: &Settings, chosen: Option<String>) -> Result<Report> {
    let (features, reasons) = Features::explain(scene, settings);
    let packed = PackedScene::new(Packed::new(scene, scene.camera.position));
    let uploads = vec![
        table::<Frame>(1),
        table::<Shape>(packed.shapes.len()),
        table::<Material>(packed.materials.len()),
        table::<Light>(packed.lights.len()),
    ];
    let gather = gathering(options, scene, settings, &features, &packed)?;
    let memory = gather.as_ref().map(|gather| {
        let stored = gather.stored as usize;
        let opengl_bytes = memory::texture_bytes(features.glossy, stored);
        Memory { photons: gather.stored, opencl_bytes: memory::opencl_bytes(features.glossy, stored), opengl_bytes }
    });
    Ok(Report {
        scene: scene.name.clone(),
        permutation: features.defines(),
        stages: stages(scene, settings, chosen, aimed(&packed, settings)?),
        features: reasons,
        bytes: uploads.iter().map(|t| t.bytes).sum(),
        uploads,
        gather,
        memory,
    })
}

impl Report {
    fn print(&self) {
        say!("scene {}: {}", self.scene, self.permutation.join(" "));
        for reason in self.stages.iter().chain(&self.features) {
            say!("  {} {:<20} {}", if reason.used { "used   " } else { "skipped" }, reason.feature, reason.why);
        }
        say!("uploads");
        for Table { table, records, texels, texture, bytes } in &self.uploads {
            say!(
                "  {table:<9} {records:>7} records {texels:>8} texels {bytes:>10} bytes, texture {} × {}",
                texture[0],
                texture[1]
            );
        }
        say!("  {} bytes in all", self.bytes);
        if let Some(memory) = &self.memory {
            let megabytes = |bytes: usize| bytes as f64 / 1e6;
            say!(
                "memory: {} photons take at most {:.1} MB in OpenCL, sorting included, and {:.1} MB in OpenGL's textures",
                memory.photons,
                megabytes(memory.opencl_bytes),
                megabytes(memory.opengl_bytes)
            );
        }
        match &self.gather {
            Some(gather) => gather.print(),
            None => say!("gather: skipped, no photons"),
        }
    }
}

impl Gathering {
    fn print(&self) {
        say!("gather {} photons with R = {:.4} m", self.stored, self.radius);
        let here: Vec<_> = self.here.iter().map(|(backend, class)| format!("{backend} is {class}")).collect();
        say!("  here {}", here.join(", "));
        for (class, estimates) in [
            (Class::OpenGlGpu, &self.opengl),
            (Class::OpenGlSoftware, &self.opengl_software),
            (Class::OpenClGpu, &self.opencl),
            (Class::OpenClLanes, &self.opencl_cpu),
            (Class::Cpu, &self.cpu),
        ] {
            print_estimates(class, estimates);
        }
    }
}

/// A line for each method, the cheapest first.
fn print_estimates(class: Class, estimates: &[Estimate]) {
    let least = estimates.first().map_or(1.0, |best| best.cost);
    for (rank, estimate) in estimates.iter().enumerate() {
        let Estimate { method, tile, candidates, entries, cost, .. } = estimate;
        // Of each method the best tiles.
        if estimates[..rank].iter().any(|better| better.method == *method) {
            continue;
        }
        let size = tile.map(|[w, h]| format!(" {w}x{h}")).unwrap_or_default();
        let (dearest, share) = estimate.dearest(class);
        say!(
            "  {} {:<15} {:<17} {candidates:>9.1} candidates a pixel, {entries:>10.0} entries, {:>6.2} x the cost, \
             {:.0}% {dearest}",
            if rank == 0 { "used   " } else { "skipped" },
            class.name(),
            format!("{}{size}", method.name()),
            cost / least,
            100.0 * share
        );
    }
}

fn table<R: Record>(records: usize) -> Table {
    let texels = records * R::TEXELS;
    let shape = TextureShape::of(texels, TEXTURE_WIDTH_LOG2);
    Table { table: R::TABLE, records, texels, texture: [shape.width, shape.height], bytes: texels * TEXEL * 4 }
}
