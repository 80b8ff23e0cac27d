//! `photile compare`: backends against each other on a scene, or one image file against another.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::options::{RenderOptions, choice};
use super::{notice, print_json};
use crate::cpu::edges::is_on_edge;
use crate::error::{Error, Result};
use crate::film::metrics::{self, Mask, Within, measure, measure_except};
use crate::film::{Image, SaveOptions, check_output, heat_map};
use crate::packing::Packed;
use crate::pipeline::{Devices, Pipeline};
use crate::program::features::Features;
use crate::rays::scene::SceneTables;
use crate::settings::{Backend, Method, Pass, Settings};

/// Render a scene on every backend and compare the pictures, or compare two image files
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    options: RenderOptions,
    /// A second image: then the first argument is an image too (PNG or EXR), and these two are compared
    reference: Option<PathBuf>,
    /// Where to write the difference as a heat map (PNG)
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Which backends to compare, such as opengl,opencl
    #[arg(long, value_parser = choice::<Backend>(), value_delimiter = ',', default_values = Backend::ALL.map(Backend::name))]
    backends: Vec<Backend>,
    /// Which gathers to compare, such as grid,brute [default: the scene's]
    #[arg(long, value_parser = choice::<Method>(), value_delimiter = ',', conflicts_with = "gather")]
    gathers: Vec<Method>,
    /// Pictures made for each timing, after one to warm up; the median counts
    #[arg(long, value_name = "N", default_value_t = 5)]
    repeat: u32,
    /// Fail (exit 1) when a pair's RMSE outside flipped pixels is larger
    #[arg(long, value_name = "RMSE")]
    max_rmse: Option<f64>,
    /// Fail (exit 1) when a pair has more flipped pixels
    #[arg(long, value_name = "PIXELS")]
    max_flips: Option<usize>,
    /// Print one JSON object on stdout
    #[arg(long)]
    json: bool,
}

/// Two pictures. `rmse`, `rel_mse` and `max_abs` leave flipped pixels out, those that differ and sit on an edge;
/// `*_all` have them.
#[derive(Serialize)]
struct Pair {
    a: String,
    b: String,
    max_abs: f64,
    rmse: f64,
    rel_mse: f64,
    /// RMSE as a share of the picture's mean.
    rmse_over_mean: f64,
    pixels_over: usize,
    flipped_pixels: usize,
    max_abs_all: f64,
    rmse_all: f64,
    time_ratio: f64,
}

#[derive(Serialize)]
struct Side {
    name: String,
    trace_ms: f64,
    devices: Devices,
}

#[derive(Serialize)]
struct Report {
    scene: String,
    size: [u32; 2],
    sides: Vec<Side>,
    pairs: Vec<Pair>,
    heat_map: Option<String>,
}

pub fn run(args: &Args) -> Result<()> {
    match &args.reference {
        Some(reference) => compare_files(args, reference),
        None => compare_backends(args),
    }
}

/// Two image files, all pixels.
fn compare_files(args: &Args, reference: &Path) -> Result<()> {
    let output = args.output.as_deref().map(|path| check_output(path).map(|_| path)).transpose()?;
    let (image, reference) = (Image::load(&args.options.scene)?, Image::load(reference)?);
    let found = measure(&image, &reference, &metrics::Settings::default())?;
    if let Some(path) = output {
        heat_map(&image, &reference)?.save(path, &SaveOptions::default())?;
    }
    if args.json {
        print_json(&found);
    } else {
        say!(
            "RMSE {:.3e}  relMSE {:.3e}  MAE {:.3e}  max {:.3e}  SMAPE {:.3e}  PSNR {:.1} dB  {} of {} pixels over",
            found.rmse,
            found.rel_mse,
            found.mae,
            found.max_abs,
            found.smape,
            found.psnr,
            found.pixels_over,
            found.pixels
        );
    }
    bound(args, "the images", found.rmse, 0)
}

/// A scene on every backend that is there.
fn compare_backends(args: &Args) -> Result<()> {
    let scene = args.options.load()?;
    let mut settings = args.options.settings(&scene);
    if let Some(chosen) = args.options.choose_paths(&scene, &mut settings)? {
        notice(&chosen);
    }
    if let Some(output) = &args.output {
        check_output(output)?;
    }
    let mut sides = Vec::new();
    let mut images = Vec::new();
    // What each side gathers with, and how that is said.
    let mut gathers: Vec<(Settings, String)> = Vec::new();
    for gather in &args.gathers {
        let mut with = settings.clone();
        with.gather.method = *gather;
        gathers.push((with, format!("/{}", gather.name())));
    }
    if gathers.is_empty() {
        gathers.push((settings.clone(), String::new()));
    }
    for backend in args.backends.iter().copied() {
        let size = [settings.width, settings.height];
        match Pipeline::open_for(&args.options.machine(Some(backend)), size, notice) {
            Ok(mut pipeline) => {
                for (settings, gather) in &gathers {
                    let (image, trace_ms) = timed(&mut pipeline, &scene, settings, args.repeat)?;
                    images.push(image);
                    let name = format!("{}{gather}", backend.name());
                    sides.push(Side { name, trace_ms, devices: pipeline.devices.clone() });
                }
            }
            Err(error) => notice(&format!("{} not compared: {error}", backend.name())),
        }
    }
    // The twin tells which pixels two right renderers may see differently.
    let (features, packed) = (Features::of(&scene, &settings), Packed::new(&scene, scene.camera.position));
    let frame = packed.frame(&scene.camera, &settings, &Pass::single(&settings));
    let tables = SceneTables::new(&packed, &features);
    let on_edge =
        |pixel: usize| is_on_edge(&tables, &frame, pixel as u32 % settings.width, pixel as u32 / settings.width);
    let mut pairs = Vec::new();
    let mut worst: Option<(f64, Image)> = None;
    for (i, j) in (0..images.len()).flat_map(|i| (i + 1..images.len()).map(move |j| (i, j))) {
        let pair = pair(&sides[i], &sides[j], &images[i], &images[j], &on_edge)?;
        if worst.as_ref().is_none_or(|(rmse, _)| pair.rmse_all > *rmse) {
            worst = Some((pair.rmse_all, heat_map(&images[i], &images[j])?));
        }
        pairs.push(pair);
    }
    let heat_map = match (&args.output, worst) {
        (Some(path), Some((_, map))) => {
            map.save(path, &SaveOptions::default())?;
            Some(path.display().to_string())
        }
        _ => None,
    };
    let report = Report { scene: scene.name, size: [settings.width, settings.height], sides, pairs, heat_map };
    if args.json {
        print_json(&report);
    } else {
        print(&report);
    }
    if report.pairs.is_empty() {
        return Err(Error::Failed("only one backend is there: nothing was compared".into()));
    }
    for pair in &report.pairs {
        bound(args, &format!("{} and {}", pair.a, pair.b), pair.rmse, pair.flipped_pixels)?;
    }
    Ok(())
}

/// The picture, and the median milliseconds of its trace.
fn timed(
    pipeline: &mut Pipeline,
    scene: &crate::scene::Scene,
    settings: &Settings,
    repeat: u32,
) -> Result<(Image, f64)> {
    let image = pipeline.render(scene, settings)?.image;
    let mut times = Vec::new();
    for _ in 0..repeat {
        times.push(pipeline.retrace(scene, settings, &Pass::single(settings))?);
    }
    times.sort_by(f64::total_cmp);
    Ok((image, times.get(times.len() / 2).copied().unwrap_or(f64::NAN)))
}

fn pair(a: &Side, b: &Side, image_a: &Image, image_b: &Image, on_edge: &dyn Fn(usize) -> bool) -> Result<Pair> {
    // 1e-4: an order above what float32 leaves between compilers, an order below what an eye or a reference sees.
    let tolerance = Within { abs: 1e-4, rel: 1e-4 };
    let settings = metrics::Settings { tolerance, ..Default::default() };
    let apart = |i: usize| tolerance.apart(image_a.pixels[i], image_b.pixels[i]);
    let flipped: Mask = (0..image_a.pixels.len()).map(|i| apart(i) && on_edge(i)).collect();
    let all = measure(image_a, image_b, &settings)?;
    let smooth = measure_except(image_a, image_b, &flipped, &settings)?;
    Ok(Pair {
        a: a.name.clone(),
        b: b.name.clone(),
        max_abs: smooth.max_abs,
        rmse: smooth.rmse,
        rel_mse: smooth.rel_mse,
        rmse_over_mean: smooth.rmse / mean(image_b),
        pixels_over: smooth.pixels_over,
        flipped_pixels: flipped.iter().filter(|flip| **flip).count(),
        max_abs_all: all.max_abs,
        rmse_all: all.rmse,
        time_ratio: a.trace_ms / b.trace_ms,
    })
}

/// Mean over pixels and channels.
fn mean(image: &Image) -> f64 {
    let sum: f64 = image.pixels.iter().flatten().map(|v| f64::from(*v)).sum();
    sum / (3 * image.pixels.len().max(1)) as f64
}

fn print(report: &Report) {
    for side in &report.sides {
        let device = side.devices.opengl.as_ref().or(side.devices.opencl.as_ref());
        say!("{:<13} {:>9.2} ms  {}", side.name, side.trace_ms, device.map_or("", String::as_str));
    }
    say!(
        "{:<26} {:>10} {:>10} {:>10} {:>10} {:>6} {:>6} {:>10} {:>8}",
        "pair",
        "max",
        "RMSE",
        "RMSE/mean",
        "relMSE",
        "over",
        "flips",
        "max, all",
        "time"
    );
    for p in &report.pairs {
        say!(
            "{:<26} {:>10.2e} {:>10.2e} {:>10.2e} {:>10.2e} {:>6} {:>6} {:>10.2e} {:>7.2}x",
            format!("{} : {}", p.a, p.b),
            p.max_abs,
            p.rmse,
            p.rmse_over_mean,
            p.rel_mse,
            p.pixels_over,
            p.flipped_pixels,
            p.max_abs_all,
            p.time_ratio
        );
    }
}

/// Holds a pair to the bounds that were asked for.
fn bound(args: &Args, pair: &str, rmse: f64, flips: usize) -> Result<()> {
    if let Some(limit) = args.max_rmse.filter(|limit| rmse.is_nan() || limit.is_nan() || rmse > *limit) {
        return Err(Error::Failed(format!("{pair}: found RMSE {rmse:.3e}, expected at most {limit:.3e}")));
    }
    if let Some(limit) = args.max_flips.filter(|limit| flips > *limit) {
        return Err(Error::Failed(format!("{pair}: found {flips} flipped pixels, expected at most {limit}")));
    }
    Ok(())
}
