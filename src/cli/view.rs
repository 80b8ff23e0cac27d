//! `photile view`: the window.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::options::{RenderOptions, choice};
use super::passes::TechniqueOptions;
use super::{notice, print_json, stop_on_signal};
use crate::error::{Error, Result};
use crate::film::{check_directory, check_distinct, write_beside};
use crate::settings::Backend;
use crate::window;
use crate::window::ladder::Budget;
use crate::window::percentiles::Percentiles;
use crate::window::replay::{self, Replayed};
use crate::window::script::Script;

/// Fly through a scene in a window; F1 there lists the keys
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    options: RenderOptions,
    /// Which machine renders [default: opengl; B changes it]
    #[arg(long, value_parser = choice::<Backend>())]
    backend: Option<Backend>,
    /// Milliseconds that a frame may take while things move [default: 33 on a GPU, 100 on software OpenGL]
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u32).range(1..=60_000))]
    budget: Option<u32>,
    /// Passes until the picture counts as converged
    #[arg(long, value_name = "P", default_value_t = 256, value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    passes: u32,
    #[command(flatten)]
    technique: TechniqueOptions,
    /// Begin without the panel (Tab brings it)
    #[arg(long)]
    no_panel: bool,
    /// Where P writes .png and .exr [default: the scene's name]
    #[arg(long, value_name = "PATH")]
    screenshot: Option<PathBuf>,
    /// Replay a recorded path (TOML), print frame-time percentiles, close
    #[arg(long, value_name = "FILE")]
    script: Option<PathBuf>,
    /// Write what each of the script's pictures took, by stage, as CSV
    #[arg(long, value_name = "FILE", requires = "script")]
    frames: Option<PathBuf>,
    /// Replay the script without a window
    #[arg(long, requires = "script")]
    headless: bool,
    /// Record the camera's path into a file [K does it too; default: the scene's name, .path.toml]
    #[arg(long, value_name = "FILE", conflicts_with = "headless")]
    record: Option<PathBuf>,
    /// Full quality, however long a frame takes
    #[arg(long, conflicts_with = "budget")]
    full_quality: bool,
    /// Print one JSON object on stdout when the window closes
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args, started: Instant) -> Result<()> {
    let scene = args.options.load()?;
    let settings = args.options.settings(&scene);
    let screenshot = args.screenshot.clone().unwrap_or_else(|| PathBuf::from(&scene.name));
    if screenshot.file_name().is_none() {
        return Err(Error::Usage(format!("found --screenshot {}, expected a file's name", screenshot.display())));
    }
    let [png, exr] = ["png", "exr"].map(|extension| screenshot.with_extension(extension));
    check_distinct(&[
        ("the scene", Some(&args.options.scene)),
        ("--script", args.script.as_deref()),
        ("--frames", args.frames.as_deref()),
        ("--record", args.record.as_deref()),
        ("--screenshot", Some(&png)),
        ("--screenshot", Some(&exr)),
    ])?;
    for path in [&args.frames, &args.record].into_iter().flatten() {
        check_directory(path)?;
    }
    let wish = args.technique.wish(&args.options, &scene);
    wish.settle(&scene, &mut settings.clone())?; // what contradicts itself is refused here as by render
    let script = args.script.as_deref().map(Script::load).transpose()?;
    let machine = args.options.machine(args.backend);
    let budget = match args.budget {
        _ if args.full_quality => Budget::None,
        None => Budget::Usual,
        Some(ms) => Budget::Ms(ms.into()),
    };
    if let (true, Some(script)) = (args.headless, &script) {
        let replayed = replay::replay(&scene, &settings, &machine, budget, script, args.frames.is_some(), notice)?;
        tell(&replayed, args.frames.as_deref())?;
        if args.json {
            print_json(&replayed);
        }
        return Ok(());
    }
    let options = window::Options {
        path: args.options.scene.clone(),
        scene,
        settings,
        machine,
        budget,
        passes: args.passes,
        wish,
        panel: !args.no_panel,
        screenshot,
        script,
        record: args.record.clone(),
        table: args.frames.is_some(),
        stop: stop_on_signal("frame"),
    };
    if let Some(path) = window::left_over(&args.options.scene) {
        notice(&format!("{} has the edits of a window that ended early", path.display()));
    }
    let summary = window::run(options, started)?;
    if let Some(replayed) = &summary.replayed {
        tell(replayed, args.frames.as_deref())?;
    }
    if args.json {
        print_json(&summary);
    }
    match (&summary.unsaved, summary.interrupted) {
        (Some(path), _) => Err(Error::Failed(format!("interrupted; {} has the edits", path.display()))),
        (None, true) => Err(Error::Failed("interrupted; there was nothing to save".into())),
        (None, false) => Ok(()),
    }
}

/// A replay's figures in words, and all of its pictures as a table where one is wanted.
fn tell(replayed: &Replayed, table: Option<&Path>) -> Result<()> {
    if let (Some(path), Some(table)) = (table, &replayed.table) {
        write_beside(path, |file| file.write_all(table.as_bytes()))?;
    }
    let Percentiles { frames, p50, p90, p99, max } = replayed.frame_ms;
    notice(&format!("{frames} frames: median {p50:.1} ms, p90 {p90:.1}, p99 {p99:.1}, longest {max:.1}"));
    for (level, count) in &replayed.levels {
        notice(&format!("{count} of them: {level}"));
    }
    let [before, after] = replayed.memory_bytes.map(|bytes| bytes as f64 / 1e6);
    notice(&format!("memory {before:.1} MB after a quarter, {after:.1} MB at the end"));
    Ok(())
}
