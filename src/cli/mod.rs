//! The command line: a file a command. Argument types hold syntax only; policy lives below.

mod batches;
mod bench;
mod compare;
mod doctor;
mod options;
mod passes;
mod plan;
mod reference;
mod render;
mod stress;
mod validate;
mod view;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::{Parser, Subcommand};

use crate::error::Result;

/// Photon mapping with OpenCL photons and OpenGL gathering; the same in OpenCL alone and on the CPU.
#[derive(Parser)]
#[command(name = "photile", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Render(render::Args),
    View(view::Args),
    Compare(compare::Args),
    Bench(bench::Args),
    Stress(stress::Args),
    Validate(validate::Args),
    Reference(reference::Args),
    Plan(plan::Args),
    Doctor(doctor::Args),
}

/// Reads the command line and does what it says. Wrong usage ends the process with exit code 2, as clap does.
///
/// # Errors
/// Whatever the command meets; [`crate::error::Error::exit_code`] says how the process should end.
pub fn run() -> Result<()> {
    let started = std::time::Instant::now();
    match Cli::parse().command {
        Command::Render(args) => render::run(&args),
        Command::View(args) => view::run(&args, started),
        Command::Compare(args) => compare::run(&args),
        Command::Bench(args) => bench::run(&args),
        Command::Stress(args) => stress::run(&args),
        Command::Validate(args) => validate::run(&args),
        Command::Reference(args) => reference::run(&args),
        Command::Plan(args) => plan::run(&args),
        Command::Doctor(args) => doctor::run(&args),
    }
}

/// Prints one JSON object on stdout.
fn print_json(value: &impl serde::Serialize) {
    println!("{}", serde_json::to_string_pretty(value).expect("records of numbers and strings always serialise"));
}

/// A line for the user on stderr.
fn notice(line: &str) {
    eprintln!("photile: {line}");
}

/// A flag that the first Ctrl-C sets, for work that stops after the `part` at hand; the second one ends the program.
fn stop_on_interrupt(part: &'static str) -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    let seen = flag.clone();
    let installed = ctrlc::set_handler(move || {
        if seen.swap(true, Ordering::Relaxed) {
            std::process::exit(130); // 128 + SIGINT, as a shell reports it
        }
        notice(&format!("stopping after this {part}; Ctrl-C again ends at once"));
    });
    if let Err(e) = installed {
        notice(&format!("Ctrl-C will not save what is done: {e}"));
    }
    flag
}
