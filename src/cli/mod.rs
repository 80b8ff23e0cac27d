//! The command line: a file a command. Argument types hold syntax only; policy lives below.

#[macro_use]
mod output;

mod batches;
mod bench;
mod compare;
mod doctor;
mod options;
mod passes;
mod plan;
mod reference;
mod render;
mod rescue;
mod signals;
mod stress;
mod validate;
mod view;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use output::{notice, print_json, say_written};
use signals::stop_on_signal;

use crate::device::cl::{self, caches};
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
    /// What a child does for [`cl::probing`].
    #[command(name = cl::probing::COMMAND, hide = true)]
    ProbeOpencl(cl::probing::Args),
}

/// Reads the command line and does what it says. The exit code: 0 done, 1 failed, 2 wrong usage or bad input.
pub fn run() -> ExitCode {
    let started = std::time::Instant::now();
    output::begin();
    let command = match Cli::try_parse() {
        Ok(cli) => cli.command,
        Err(usage) => return ExitCode::from(output::end_with(output::print_usage(&usage))),
    };
    if let Command::ProbeOpencl(args) = &command {
        cl::probing::answer(args);
        return ExitCode::SUCCESS;
    }
    // Before there is any other thread, and any driver that reads it.
    if let Some(line) = caches::prepare() {
        notice(&line);
    }
    cl::aborts::outlive();
    cl::probing::enable();
    signals::listen();
    output::end(execute(command, started))
}

fn execute(command: Command, started: std::time::Instant) -> Result<()> {
    match command {
        Command::Render(args) => render::run(&args),
        Command::View(args) => view::run(&args, started),
        Command::Compare(args) => compare::run(&args),
        Command::Bench(args) => bench::run(&args),
        Command::Stress(args) => stress::run(&args),
        Command::Validate(args) => validate::run(&args),
        Command::Reference(args) => reference::run(&args),
        Command::Plan(args) => plan::run(&args),
        Command::Doctor(args) => doctor::run(&args),
        Command::ProbeOpencl(_) => Ok(()), // answered above
    }
}
