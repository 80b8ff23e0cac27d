//! Stress: does float32 show? Every suite asks CPU, OpenCL and OpenGL the same and holds the answers against double
//! precision, a closed form, or the integers that must come out.
//!
//! A suite is a file here with a function from [`Options`] to rows, and a line in [`Suite`]. Each row has a bound; a
//! suite whose rows cannot fail proves nothing, so each can be given a [`Fault`] that it must find.

use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;

use crate::bench::plot::Chart;
use crate::bench::table::Table;
use crate::bench::{MachineInfo, make_directory};
use crate::error::{Error, Result};
use crate::film::write_beside;
use crate::pipeline::{Machine, Pipeline};
use crate::settings::Backend;

mod estimator;
mod exact;
mod intersection;
mod lab;
mod leaks;
mod long;
mod offset;
mod random;
mod special;
mod summary;
pub mod validate;

pub use lab::Lab;
pub use summary::{Row, Spread};

/// A family of tests that share a kind of question.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Suite {
    /// Roots, hit points and normals against double precision.
    Intersection,
    /// Rays in closed boxes: escapes and self-hits.
    Leaks,
    /// The same picture elsewhere and at another scale.
    Offset,
    /// Density estimates by radius and number of photons.
    Estimator,
    /// Random numbers: the same everywhere, evenly spread, independent.
    Random,
    /// Ten thousand passes, summed up where renders and windows do; passes at another time.
    Long,
    /// Special values through the whole pipeline.
    Special,
}

impl Suite {
    /// In the order in which they run.
    pub const ALL: [Suite; 7] = [
        Suite::Intersection,
        Suite::Leaks,
        Suite::Offset,
        Suite::Estimator,
        Suite::Random,
        Suite::Long,
        Suite::Special,
    ];

    /// As users write it.
    pub fn name(self) -> &'static str {
        match self {
            Suite::Intersection => "intersection",
            Suite::Leaks => "leaks",
            Suite::Offset => "offset",
            Suite::Estimator => "estimator",
            Suite::Random => "random",
            Suite::Long => "long",
            Suite::Special => "special",
        }
    }

    /// Runs it on what the bench holds.
    ///
    /// # Errors
    /// From the devices. A bound that fails is no error here: see [`Row::holds`].
    pub fn run(self, bench: &mut Bench) -> Result<Found> {
        match self {
            Suite::Intersection => intersection::run(bench),
            Suite::Leaks => leaks::run(bench),
            Suite::Offset => offset::run(bench),
            Suite::Estimator => estimator::run(bench),
            Suite::Random => random::run(bench),
            Suite::Long => long::run(bench),
            Suite::Special => special::run(bench),
        }
    }
}

/// A fault that is put in on purpose: the suite that is made for it must fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    /// The school's quadratic formula for spheres.
    NaiveSphere,
    /// Planes are hit from a millimetre on; no ray knows where it starts.
    FixedEpsilon,
    /// Scenes keep their world coordinates in float32.
    WorldCoordinates,
    /// A photon is missing from the map.
    LostPhoton,
    /// Uniform numbers from all 32 bits, some of which round to 1.
    RoundedUp,
    /// Two dimensions share their numbers.
    SharedNumbers,
    /// Sums are kept in float32.
    SingleSums,
    /// A pass has the numbers of the one before when it is rendered later.
    ShiftedPass,
    /// A pixel that is no number.
    NotANumber,
}

impl Fault {
    /// Every fault, in the order of the suites that find them.
    pub const ALL: [Fault; 9] = [
        Fault::NaiveSphere,
        Fault::FixedEpsilon,
        Fault::WorldCoordinates,
        Fault::LostPhoton,
        Fault::RoundedUp,
        Fault::SharedNumbers,
        Fault::SingleSums,
        Fault::ShiftedPass,
        Fault::NotANumber,
    ];

    /// The suite that is made for it.
    pub fn found_by(self) -> Suite {
        match self {
            Fault::NaiveSphere => Suite::Intersection,
            Fault::FixedEpsilon => Suite::Leaks,
            Fault::WorldCoordinates => Suite::Offset,
            Fault::LostPhoton => Suite::Estimator,
            Fault::RoundedUp | Fault::SharedNumbers => Suite::Random,
            Fault::SingleSums | Fault::ShiftedPass => Suite::Long,
            Fault::NotANumber => Suite::Special,
        }
    }

    /// As users write it.
    pub fn name(self) -> &'static str {
        match self {
            Fault::NaiveSphere => "naive-sphere",
            Fault::FixedEpsilon => "fixed-epsilon",
            Fault::WorldCoordinates => "world-coordinates",
            Fault::LostPhoton => "lost-photon",
            Fault::RoundedUp => "rounded-up",
            Fault::SharedNumbers => "shared-numbers",
            Fault::SingleSums => "single-sums",
            Fault::ShiftedPass => "shifted-pass",
            Fault::NotANumber => "not-a-number",
        }
    }

    /// As shaders know it, `FAULT_NAIVE_SPHERE`; suites without a shader of their own have no use for it.
    fn define(self) -> String {
        format!("FAULT_{}", self.name().to_uppercase().replace('-', "_"))
    }
}

/// How much is tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Size {
    /// Seconds a suite: for tests.
    Tiny,
    /// A minute for all.
    Quick,
    /// Some minutes for all: what bounds were measured with.
    Full,
}

/// What may be asked.
#[derive(Clone, Debug)]
pub struct Options {
    /// In this order; those that are not there are left out.
    pub backends: Vec<Backend>,
    /// Part of an OpenCL device's or platform's name.
    pub device: Option<String>,
    /// Threads of the CPU's share.
    pub threads: usize,
    /// How many cases.
    pub size: Size,
    /// What is broken on purpose.
    pub fault: Option<Fault>,
    /// Set from outside: it ends before the next step, and tells what was found until then.
    pub stop: Arc<AtomicBool>,
}

impl Options {
    /// A number by size.
    fn by_size<T>(&self, tiny: T, quick: T, full: T) -> T {
        match self.size {
            Size::Tiny => tiny,
            Size::Quick => quick,
            Size::Full => full,
        }
    }
}

/// What suites work with.
pub struct Bench<'a> {
    /// What the user asked for.
    pub options: &'a Options,
    /// The devices that the cases run on.
    pub lab: Lab,
    /// The CPU's threads.
    pub pool: Rc<rayon::ThreadPool>,
    progress: &'a mut dyn FnMut(Progress),
}

/// News of a run, for whoever watches it.
#[derive(Clone, Debug, PartialEq)]
pub enum Progress<'a> {
    /// A step of a suite.
    Step(&'a str),
    /// A fact that stays true, such as a backend that is not there.
    Notice(&'a str),
}

impl Bench<'_> {
    /// Says what goes on now.
    ///
    /// # Errors
    /// [`Error::Failed`] where it shall not.
    fn step(&mut self, what: &str) -> Result<()> {
        if self.options.stop.load(Ordering::Relaxed) {
            return Err(Error::Failed(format!("interrupted before {what}")));
        }
        (self.progress)(Progress::Step(what));
        Ok(())
    }

    fn backends(&self) -> Vec<Backend> {
        self.lab.backends.clone()
    }

    /// A renderer on a backend.
    fn pipeline(&mut self, backend: Backend) -> Result<Pipeline> {
        let options = self.options;
        let machine =
            Machine { backend: Some(backend), device: options.device.clone(), threads: options.threads, lanes: None };
        Pipeline::open(&machine, |line| (self.progress)(Progress::Notice(line)))
    }
}

/// What a suite found.
#[derive(Default)]
pub struct Found {
    /// A line each of the table.
    pub rows: Vec<Row>,
    /// Curves, under their files' names.
    pub charts: Vec<(String, Chart)>,
}

/// All that was tested.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The machine and its drivers.
    pub machine: MachineInfo,
    /// How many cases.
    pub size: Size,
    /// What was broken on purpose.
    pub fault: Option<Fault>,
    /// Seconds, all in all.
    pub seconds: f64,
    /// Rows whose bound fails.
    pub failed: usize,
    /// Quantities that were measured, with their bounds.
    pub rows: Vec<Row>,
    /// Why suites are missing: interrupted, or what a device answered.
    pub ended: Option<String>,
    /// Curves, under their files' names.
    #[serde(skip)]
    pub charts: Vec<(String, Chart)>,
}

/// Runs suites one after the other.
///
/// # Errors
/// [`Error::Driver`] when no backend is there; what suites meet.
pub fn run(suites: &[Suite], options: &Options, progress: &mut dyn FnMut(Progress)) -> Result<Report> {
    let begin = std::time::Instant::now();
    let mut machine = MachineInfo::here(options.device.as_deref());
    let lab = Lab::open(&options.backends, options.device.as_deref(), &mut |line| progress(Progress::Notice(line)));
    if lab.backends.is_empty() {
        return Err(Error::Driver("none of the backends that were asked for is there".into()));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(options.threads).build();
    let pool = pool.map(Rc::new).map_err(|error| Error::Device(format!("{} threads: {error}", options.threads)))?;
    let mut bench = Bench { options, lab, pool, progress };
    let (mut rows, mut charts, mut ended) = (Vec::new(), Vec::new(), None);
    for suite in suites {
        let found = match suite.run(&mut bench) {
            Ok(found) => found,
            // What was found before is not lost.
            Err(error) if !rows.is_empty() => {
                ended = Some(format!("{}: {error}", suite.name()));
                break;
            }
            Err(error) => return Err(error),
        };
        rows.extend(found.rows);
        charts.extend(found.charts);
    }
    machine.finish();
    let failed = rows.iter().filter(|row| !row.holds).count();
    let seconds = begin.elapsed().as_secs_f64();
    Ok(Report { machine, size: options.size, fault: options.fault, seconds, failed, rows, ended, charts })
}

impl Report {
    /// The report as text, for a terminal of so many columns.
    pub fn text(&self, columns: usize) -> String {
        format!(
            "{}\n{}\n{} rows, {} beyond their bounds, {:.0} s\n",
            self.machine.text_within(columns),
            summary::table(&self.rows).text_within(columns),
            self.rows.len(),
            self.failed,
            self.seconds
        )
    }

    /// All rows, a column each field.
    pub fn table(&self) -> Table {
        summary::table(&self.rows)
    }

    /// Writes `stress.csv`, `stress.json` and each chart as SVG and PNG into a directory, made where it is not there.
    /// The files' paths.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn write_to(&self, directory: &Path) -> Result<Vec<PathBuf>> {
        use std::io::Write;
        make_directory(directory)?;
        let (csv, json) = (directory.join("stress.csv"), directory.join("stress.json"));
        write_beside(&csv, |file| file.write_all(self.table().csv().as_bytes()))?;
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
