//! `photile view`: the window.

use std::path::PathBuf;
use std::time::Instant;

use super::options::{BackendArg, RenderOptions};
use super::print_json;
use crate::error::{Error, Result};
use crate::settings::Backend;
use crate::window;

/// Fly through a scene in a window; F1 there lists the keys
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    options: RenderOptions,
    /// Which machine renders [default: opengl; B changes it]
    #[arg(long, value_enum)]
    backend: Option<BackendArg>,
    /// Milliseconds that a frame may take while things move [default: 33 on a GPU, 100 on software OpenGL]
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u32).range(1..=60_000))]
    budget: Option<u32>,
    /// Passes until the picture counts as converged
    #[arg(long, value_name = "P", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    passes: u32,
    /// Begin without the panel (Tab brings it)
    #[arg(long)]
    no_panel: bool,
    /// Where P writes .png and .exr [default: the scene's name]
    #[arg(long, value_name = "PATH")]
    screenshot: Option<PathBuf>,
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
    let summary = window::run(
        window::Options {
            path: args.options.scene.clone(),
            scene,
            settings,
            machine: args.options.machine(args.backend.map(Backend::from)),
            budget: args.budget.map(f64::from),
            passes: args.passes,
            panel: !args.no_panel,
            screenshot,
        },
        started,
    )?;
    if args.json {
        print_json(&summary);
    }
    Ok(())
}
