//! Benchmarks: suites that measure, and the report that all of them give.
//!
//! A suite is a file here with a function from [`Options`] to a [`Report`], and a line in [`Suite`].

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;

use crate::error::{Error, Result};
use crate::film::write_beside;
use crate::pipeline::Machine;
use crate::scene::Scene;
use crate::settings::Backend;

mod choice;
mod error;
mod gather;
mod machine;
pub mod plot;
mod radius;
mod reference;
mod report;
mod saved;
pub mod scenes;
mod speed;
pub mod table;
pub mod timing;

pub use machine::MachineInfo;
use plot::Chart;
use table::Table;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Suite {
    /// Milliseconds of the stages and of the picture, by backend.
    Speed,
    /// Error against a reference by gather radius, around the one that is chosen.
    Radius,
    /// Candidates tested for each photon accepted.
    Gather,
    /// The experiments of the 2016 report, beside its own figures.
    Report,
    /// Error against a reference by run time, for each technique and setting.
    Error,
    /// The automatic choice between grid, tiles and tiled grid against what each takes.
    Choice,
}

impl Suite {
    /// As users write it, and as files are named.
    pub fn name(self) -> &'static str {
        match self {
            Suite::Speed => "speed",
            Suite::Radius => "radius",
            Suite::Gather => "gather",
            Suite::Report => "report",
            Suite::Error => "error",
            Suite::Choice => "choice",
        }
    }

    /// The scenes that it takes when none are named: built-in ones.
    pub fn scenes(self) -> &'static [&'static str] {
        match self {
            Suite::Error => &["gi_ref", "gi_two_lights", "sphere_and_plane", "color_bleeding"],
            Suite::Speed | Suite::Choice => &["gi_ref", "sphere_and_plane", "box"],
            Suite::Radius | Suite::Gather | Suite::Report => &["gi_ref", "sphere_and_plane"],
        }
    }

    /// Runs it, telling how far it is.
    ///
    /// # Errors
    /// [`Error::Usage`] for options that it cannot honour, [`Error::Driver`] when no backend is there, and what the
    /// pipeline meets.
    pub fn run(self, options: &Options, progress: &mut dyn FnMut(Progress)) -> Result<Report> {
        let mut machine = MachineInfo::here(options.device.as_deref());
        let measured = match self {
            Suite::Speed => speed::run(options, progress)?,
            Suite::Radius => radius::run(options, progress)?,
            Suite::Gather => gather::run(options, progress)?,
            Suite::Report => report::run(options, &machine, progress)?,
            Suite::Error => error::run(options, &machine, progress)?,
            Suite::Choice => choice::run(options, &machine, progress)?,
        };
        machine.finish();
        let Measured { settings, rows, summaries, charts, ended } = measured;
        Ok(Report { suite: self, machine, settings, rows, summaries, charts, ended })
    }
}

/// What a suite may be asked; each takes what it has a use for.
#[derive(Clone, Debug)]
pub struct Options {
    /// The scenes to measure, in this order.
    pub scenes: Vec<Scene>,
    /// In this order; those that are not there are left out.
    pub backends: Vec<Backend>,
    /// Part of an OpenCL device's or platform's name.
    pub device: Option<String>,
    /// Threads of the CPU backend.
    pub threads: usize,
    /// Pixels; `None`: 640 × 480, or the reference's size.
    pub size: Option<(u32, u32)>,
    /// Photons of a map, one or several; empty: the suite's own.
    pub photons: Vec<u32>,
    /// Gather radii, metres; empty: the suite's own.
    pub radii: Vec<f32>,
    /// Rounds of each timing; `None`: the suite's own.
    pub repeat: Option<u32>,
    /// Seeds over which errors are averaged; `None`: the suite's own.
    pub seeds: Option<u32>,
    /// Image to measure errors against; `None`: `tests/golden/NAME.exr`.
    pub reference: Option<PathBuf>,
    /// A CSV of others' curves, `scene,name,seconds,rel_mse`, for the same plots.
    pub peers: Option<PathBuf>,
    /// Small numbers: seconds, to see that all works.
    pub quick: bool,
    /// Where a suite of many minutes saves each row, and finds those that an earlier run saved.
    pub directory: Option<PathBuf>,
    /// Set from outside: such a suite ends after the row at hand.
    pub stop: Arc<AtomicBool>,
}

impl Options {
    /// Whether a suite shall end after the row at hand.
    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// A suite's number: the user's, else one of two.
    fn or<T: Copy>(&self, wanted: Option<T>, usual: T, quick: T) -> T {
        wanted.unwrap_or(if self.quick { quick } else { usual })
    }

    /// A suite's list: the user's, else one of two.
    fn list<T: Copy>(&self, wanted: &[T], usual: &[T], quick: &[T]) -> Vec<T> {
        let own = if self.quick { quick } else { usual };
        if wanted.is_empty() { own } else { wanted }.to_vec()
    }

    fn machine(&self, backend: Option<Backend>) -> Machine {
        Machine { backend, device: self.device.clone(), threads: self.threads, lanes: None }
    }
}

/// How far a suite is.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress<'a> {
    /// How many steps are done.
    pub done: u64,
    /// How many steps there are in all.
    pub total: u64,
    /// What is going on, or what the user should know ([`Progress::is_notice`]).
    pub what: &'a str,
    /// A fact that stays true, such as a backend that is not there.
    pub is_notice: bool,
}

/// Counts a suite's steps.
struct Steps<'a> {
    progress: &'a mut dyn FnMut(Progress),
    done: u64,
    total: u64,
}

impl<'a> Steps<'a> {
    fn new(progress: &'a mut dyn FnMut(Progress), total: usize) -> Steps<'a> {
        Steps { progress, done: 0, total: total as u64 }
    }

    /// Begins a step; the one before is done.
    fn begin(&mut self, what: &str) {
        (self.progress)(Progress { done: self.done, total: self.total, what, is_notice: false });
        self.done += 1;
    }

    fn notice(&mut self, what: &str) {
        (self.progress)(Progress { done: self.done, total: self.total, what, is_notice: true });
    }
}

/// What a suite hands back.
struct Measured {
    /// The numbers it ran with.
    settings: serde_json::Value,
    rows: Table,
    summaries: Vec<Table>,
    charts: Vec<(String, Chart)>,
    /// Why rows are missing, where an error ended it.
    ended: Option<String>,
}

/// What a part of a suite gave. An error ends the suite with the rows that there are; it is the suite's own where there
/// are none.
fn or_end<T>(part: Result<T>, has_rows: bool, ended: &mut Option<String>) -> Result<Option<T>> {
    match part {
        Ok(part) => Ok(Some(part)),
        Err(error) if has_rows => {
            *ended = Some(error.to_string());
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

/// A finished suite.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The suite that ran.
    pub suite: Suite,
    /// The machine and its drivers.
    pub machine: MachineInfo,
    /// The numbers it ran with.
    pub settings: serde_json::Value,
    /// All that was measured, a row each.
    pub rows: Table,
    /// The same for people: what should be compared stands side by side.
    pub summaries: Vec<Table>,
    /// Curves, under their files' names.
    #[serde(skip)]
    pub charts: Vec<(String, Chart)>,
    /// Why rows are missing, where an error ended it.
    pub ended: Option<String>,
}

impl Report {
    /// The report as text, for a terminal of so many columns.
    pub fn text(&self, columns: usize) -> String {
        let tables: Vec<&Table> =
            if self.summaries.is_empty() { vec![&self.rows] } else { self.summaries.iter().collect() };
        let tables: String = tables.iter().map(|table| format!("\n{}", table.text_within(columns))).collect();
        self.machine.text_within(columns) + &tables
    }

    /// Writes the rows as CSV.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn write_csv(&self, path: &Path) -> Result<()> {
        use std::io::Write;
        write_beside(path, |file| file.write_all(self.rows.csv().as_bytes()))
    }

    /// Writes `SUITE.csv`, `SUITE.json` and each chart as SVG and PNG into a directory, which is made where it is not
    /// there. The files' paths.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn write_to(&self, directory: &Path) -> Result<Vec<PathBuf>> {
        use std::io::Write;
        make_directory(directory)?;
        let path = |extension: &str| directory.join(format!("{}.{extension}", self.suite.name()));
        let (csv, json) = (path("csv"), path("json"));
        self.write_csv(&csv)?;
        let text = serde_json::to_string_pretty(self).map_err(|e| Error::Failed(format!("JSON: {e}")))?;
        write_beside(&json, |file| writeln!(file, "{text}"))?;
        let mut written = vec![csv, json];
        for (name, chart) in &self.charts {
            let [svg, png] = ["svg", "png"].map(|extension| directory.join(format!("{name}.{extension}")));
            chart.write_svg(&svg)?;
            chart.write_png(&png)?;
            written.extend([svg, png]);
        }
        Ok(written)
    }
}

/// A directory that files can go to.
///
/// # Errors
/// [`Error::File`] with what the system answered.
pub fn make_directory(directory: &Path) -> Result<()> {
    std::fs::create_dir_all(directory)
        .map_err(|error| Error::File { path: directory.into(), what: format!("cannot make the directory: {error}") })
}
