//! `photile stress`: does float32 show anywhere?

use std::path::PathBuf;

use clap::ValueEnum;

use super::options::{choice, parse_device};
use super::{output, print_json, say_written, stop_on_signal};
use crate::error::{Error, Result};
use crate::film::check_directory;
use crate::settings::Backend;
use crate::stress::{Fault, Options, Progress, Size, Suite, run as stress};

/// Stress numerical stability: every backend against double precision, with a bound on every figure
#[derive(clap::Args)]
pub struct Args {
    /// What to test, such as intersection,leaks [default: all]
    #[arg(long, value_name = "SUITE,...", value_delimiter = ',', value_parser = parse_suite)]
    suite: Vec<Suite>,
    /// Which backends to test
    #[arg(long, value_parser = choice::<Backend>(), value_delimiter = ',', default_values = Backend::ALL.map(Backend::name))]
    backend: Vec<Backend>,
    /// OpenCL device to use: its number as doctor counts them, such as #2 or 2, or part of its name
    #[arg(long, value_name = "DEVICE", value_parser = parse_device)]
    device: Option<String>,
    /// Threads of the CPU's share [default: all]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Fewer cases: done within a minute
    #[arg(long)]
    quick: bool,
    /// How many cases, in place of --quick
    #[arg(long, value_enum, hide = true, conflicts_with = "quick")]
    size: Option<SizeArg>,
    /// Break something on purpose, such as naive-sphere: a bound must then fail
    #[arg(long, value_name = "FAULT", value_parser = parse_fault)]
    inject: Option<Fault>,
    /// Write CSV, JSON and plots into this directory
    #[arg(short, long, value_name = "DIR", alias = "output")]
    out: Option<PathBuf>,
    /// Print one JSON object on stdout
    #[arg(long)]
    json: bool,
}

/// A size, as on the command line.
#[derive(ValueEnum, Clone, Copy, Debug)]
enum SizeArg {
    Tiny,
    Quick,
    Full,
}

fn parse_suite(text: &str) -> std::result::Result<Suite, String> {
    let names = Suite::ALL.map(Suite::name).join(", ");
    let known = Suite::ALL.into_iter().find(|suite| suite.name() == text);
    known.ok_or_else(|| format!("found '{text}', expected one of {names}"))
}

fn parse_fault(text: &str) -> std::result::Result<Fault, String> {
    let names = Fault::ALL.map(Fault::name).join(", ");
    let known = Fault::ALL.into_iter().find(|fault| fault.name() == text);
    known.ok_or_else(|| format!("found '{text}', expected one of {names}"))
}

pub fn run(args: &Args) -> Result<()> {
    let suites = if args.suite.is_empty() { Suite::ALL.to_vec() } else { args.suite.clone() };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let options = Options {
        backends: args.backend.clone(),
        device: args.device.clone(),
        threads: args.threads.map_or(cores, usize::from),
        size: match args.size {
            Some(SizeArg::Tiny) => Size::Tiny,
            Some(SizeArg::Full) => Size::Full,
            Some(SizeArg::Quick) => Size::Quick,
            None if args.quick => Size::Quick,
            None => Size::Full,
        },
        fault: args.inject,
        stop: stop_on_signal("step"),
    };
    if let Some(directory) = &args.out {
        crate::bench::make_directory(directory)?;
        check_directory(&directory.join("stress.csv"))?;
    }
    let bar = output::bar(None, "{spinner} {msg} ({elapsed})");
    bar.enable_steady_tick(std::time::Duration::from_millis(200));
    let report = stress(&suites, &options, &mut |progress| match progress {
        Progress::Notice(line) => bar.suspend(|| super::notice(line)),
        Progress::Step(what) => bar.set_message(what.to_string()),
    })?;
    bar.finish_and_clear();
    if args.json {
        print_json(&report);
    } else {
        output::print(report.text(output::columns()));
    }
    let files = args.out.as_ref().map_or(Ok(()), |directory| report.write_to(directory).map(say_written));
    let ended = report.ended.as_ref().map_or(Ok(()), |why| Err(Error::Failed(why.clone())));
    let bounds = match report.rows.iter().find(|row| !row.holds) {
        None => Ok(()),
        Some(row) => Err(Error::Failed(format!(
            "{} of {} bounds fail; the first: {}, {}, {}, {}: found {:.3e} at worst, expected at most {:.3e}",
            report.failed,
            report.rows.len(),
            row.suite.name(),
            row.case,
            row.backend.name(),
            row.measure,
            row.spread.worst,
            row.bound
        ))),
    };
    output::all([files, ended, bounds])
}
