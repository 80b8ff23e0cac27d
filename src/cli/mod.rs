//! The command line: a file a command. Argument types hold syntax only; policy lives below.

mod bench;
mod compare;
mod doctor;
mod options;
mod plan;
mod reference;
mod render;
mod stress;
mod validate;

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
    match Cli::parse().command {
        Command::Render(args) => render::run(&args),
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
