//! `photile bench`: suites of measurements; tables on stdout, JSON, CSV.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use clap::ValueEnum;

use super::options::{Size, choice, parse_count, parse_device, parse_radius};
use super::{output, print_json, rescue, say_written, stop_on_signal};
use crate::bench::{Options, Progress, Suite, make_directory, scenes};
use crate::error::{Error, Result};
use crate::film::check_directory;
use crate::scene::{self, Scene};
use crate::settings::Backend;

/// Measure: speed by backend, error by gather radius, candidates by cell size
#[derive(clap::Args)]
pub struct Args {
    /// Scene files, or names of built-in scenes [default: the suite's own]
    scenes: Vec<String>,
    /// What to measure
    #[arg(long, value_enum, default_value = "speed")]
    suite: SuiteArg,
    /// Which backends to measure, such as opengl,opencl; where one is enough, the first that works
    #[arg(long, value_parser = choice::<Backend>(), value_delimiter = ',', default_values = Backend::ALL.map(Backend::name))]
    backends: Vec<Backend>,
    /// OpenCL device to use: its number as doctor counts them, such as #2 or 2, or part of its name
    #[arg(long, value_name = "DEVICE", value_parser = parse_device)]
    device: Option<String>,
    /// Threads of the CPU backend
    #[arg(long, value_name = "T", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: u16,
    /// Image size in pixels [default: 640x480, or the reference's]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Photons of a map, such as 20k,200k: stored ones, or paths for the radius suite [default: the suite's own]
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = parse_count)]
    photons: Vec<u32>,
    /// Gather radii in metres [default: the suite's own]
    #[arg(long, value_name = "R,...", value_delimiter = ',', value_parser = parse_radius)]
    radii: Vec<f32>,
    /// Rounds of each timing, after one to warm up; the median counts
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeat: Option<u32>,
    /// Seeds over which errors are averaged
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    seeds: Option<u32>,
    /// Image to measure errors against [default: tests/golden/SCENE.exr]
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// Curves of other renderers for the error suite's plots: a CSV of scene,name,seconds,rel_mse
    #[arg(long, value_name = "FILE")]
    peers: Option<PathBuf>,
    /// Small numbers, done in seconds
    #[arg(long)]
    quick: bool,
    /// Write the measured rows as CSV
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write CSV, JSON and, where there are curves, plots into this directory
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Print one JSON object on stdout
    #[arg(long)]
    json: bool,
}

/// A suite, as on the command line.
#[derive(ValueEnum, Clone, Copy, Debug)]
enum SuiteArg {
    /// Milliseconds of trace, gather, emission, grid and upload, by backend
    Speed,
    /// Error against a reference by gather radius
    Radius,
    /// Candidates tested for each photon accepted
    Gather,
    /// The experiments of the 2016 report beside its own figures; with -o, rows measured before are kept
    Report,
    /// Error against a reference by run time, by technique and setting; with -o, rows measured before are kept
    Error,
    /// The automatic choice between grid, tiles and tiled grid against what each takes; with -o, rows are kept
    Choice,
}

impl From<SuiteArg> for Suite {
    fn from(arg: SuiteArg) -> Self {
        match arg {
            SuiteArg::Speed => Suite::Speed,
            SuiteArg::Radius => Suite::Radius,
            SuiteArg::Gather => Suite::Gather,
            SuiteArg::Report => Suite::Report,
            SuiteArg::Error => Suite::Error,
            SuiteArg::Choice => Suite::Choice,
        }
    }
}

pub fn run(args: &Args) -> Result<()> {
    let suite = Suite::from(args.suite);
    let named: Vec<&str> = match args.scenes.is_empty() {
        true => suite.scenes().to_vec(),
        false => args.scenes.iter().map(String::as_str).collect(),
    };
    let options = Options {
        scenes: named.into_iter().map(load).collect::<Result<_>>()?,
        backends: args.backends.clone(),
        device: args.device.clone(),
        threads: args.threads.into(),
        size: args.size.map(|size| (size.width, size.height)),
        photons: args.photons.clone(),
        radii: args.radii.clone(),
        repeat: args.repeat,
        seeds: args.seeds,
        reference: args.reference.clone(),
        peers: args.peers.clone(),
        quick: args.quick,
        directory: args.output.clone(),
        stop: stop_on_signal("row"),
    };
    // What cannot be written should be known before minutes are spent.
    if let Some(csv) = &args.csv {
        check_directory(csv)?;
    }
    if let Some(directory) = &args.output {
        make_directory(directory)?;
        check_directory(&directory.join(format!("{}.csv", suite.name())))?;
    }

    let bar = output::bar(Some(1), "{bar:40} {pos}/{len} {msg}, {elapsed} (left {left})");
    let report = suite.run(&options, &mut |progress: Progress| {
        if progress.is_notice {
            bar.suspend(|| super::notice(progress.what));
            return;
        }
        bar.set_length(progress.total);
        bar.set_position(progress.done);
        bar.set_message(progress.what.to_string());
    })?;
    bar.finish_and_clear();

    if args.json {
        print_json(&report);
    } else {
        output::print(report.text(output::columns()));
    }
    let csv = args.csv.as_ref().map_or(Ok(()), |csv| rescue::written_somewhere(csv, |path| report.write_csv(path)));
    let files = args.output.as_ref().map_or(Ok(()), |directory| report.write_to(directory).map(say_written));
    // Not what was asked for: a script must not take it for that.
    let ended = report.ended.as_ref().map_or(Ok(()), |why| Err(Error::Failed(why.clone())));
    let stopped = match options.stop.load(Ordering::Relaxed) {
        true => Err(Error::Failed("interrupted; the same command goes on where -o has saved its rows".into())),
        false => Ok(()),
    };
    output::all([csv, files, ended.and(stopped)])
}

/// A scene file, or the built-in scene of that name where there is no such file.
fn load(name: &str) -> Result<Scene> {
    match scenes::built_in(name) {
        _ if Path::new(name).is_file() => Ok(scene::load(Path::new(name))?),
        Some(scene) => scene,
        None if name.contains(['.', '/', '\\']) => Ok(scene::load(Path::new(name))?),
        None => Err(Error::Usage(format!(
            "scene '{name}': neither a file nor one of {}",
            scenes::names().collect::<Vec<_>>().join(", ")
        ))),
    }
}
