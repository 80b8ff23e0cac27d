//! Report: the experiments of the 2016 report, on every backend, beside its own figures.
//!
//! A row is a frame of a moving camera: tracing and gathering, and for tiles their lists and what of them is uploaded.
//! The photon map and its grid stay as they are. What is measured is saved row by row and not measured again.

use serde::{Deserialize, Serialize};

use super::saved;
use super::table::{Table, Value};
use super::timing::Samples;
use super::{MachineInfo, Measured, Options, Progress, Report, Steps, Suite, or_end};
use crate::error::{Error, Result};
use crate::pipeline::Pipeline;
use crate::settings::{Amount, Backend};
use cases::{Case, RADIUS, Way, cases};
use errors::Errors;

mod cases;
mod charts;
mod errors;
mod published;

/// How far the camera moves between frames, metres: another view, for which tiles are made anew and nothing else.
const STEP: f64 = 1e-6;

/// The numbers of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Plan {
    radius: f32,
    photons: Vec<u32>,
    rounds: u32,
    threads: usize,
    /// Samples a pixel of the pictures whose errors are measured.
    samples: u32,
}

/// A row as files have it; its fields are the columns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Row {
    scene: String,
    width: u32,
    height: u32,
    photons: Option<u32>,
    way: String,
    /// The report's names: cells along z, x, y of its box; pixels.
    grid: Option<String>,
    tile: Option<String>,
    backend: String,
    /// What gathered, and in which tiles, where that was chosen.
    gather: Option<String>,
    chosen_tile: Option<String>,
    radius_m: Option<f64>,
    paths: Option<u64>,
    /// Tiles and upload, trace and gather; and the sum: medians.
    frame_ms: f64,
    trace_ms: f64,
    build_ms: f64,
    rounds: u32,
    /// At the reference's size, of these photons and this radius.
    rel_mse: Option<f64>,
    report_ms: Option<f64>,
}

impl Row {
    /// Whether it is this case's.
    fn is_of(&self, case: &Case) -> bool {
        let [width, height] = case.size;
        (self.scene.as_str(), self.width, self.height, self.photons) == (&case.scene, width, height, case.photons)
            && (self.way.as_str(), self.backend.as_str()) == (case.way.name(), case.backend.name())
            && self.grid == case.grid.map(|cells| cells.name())
            && self.tile == case.tile.map(tile_name)
    }
}

fn tile_name([width, height]: [u32; 2]) -> String {
    format!("{width}x{height}")
}

/// See [`super::Suite::Report`].
pub fn run(options: &Options, machine: &MachineInfo, progress: &mut dyn FnMut(Progress)) -> Result<Measured> {
    let plan = Plan {
        radius: RADIUS,
        photons: options.list(&options.photons, &[12_000, 200_000], &[2000]),
        rounds: options.or(options.repeat, 5, 1),
        threads: options.threads,
        samples: if options.quick { 4 } else { 16 },
    };
    if let Some(radius) = options.radii.first() {
        return Err(Error::Usage(format!(
            "found a radius of {radius}: the report's suite has the report's, {RADIUS} m"
        )));
    }
    let names: Vec<&str> = options.scenes.iter().map(|scene| scene.name.as_str()).collect();
    let mut cases = cases(&names, &options.backends, &plan.photons);
    if let Some((width, height)) = options.size {
        cases.retain(|case| case.size == [width, height]);
        if cases.is_empty() {
            return Err(Error::Usage(format!(
                "found --size {width}x{height}, expected one of the report's 160x160, 320x240, 640x480"
            )));
        }
    } else if options.quick {
        cases.retain(|case| case.size == cases::SIZES[0]);
    }

    let mut rows: Vec<Row> = match options.directory.as_deref().map(|directory| directory.join("report.json")) {
        Some(path) if path.exists() => saved::rows(&path, &plan, machine)?,
        _ => Vec::new(),
    };
    let mut steps = Steps::new(progress, cases.len());
    let kept = cases.iter().filter(|case| rows.iter().any(|row| row.is_of(case))).count();
    if kept > 0 {
        steps.notice(&format!("{kept} of {} rows are measured already and kept", cases.len()));
    }
    let mut bench = Bench { options, plan: &plan, open: Vec::new(), errors: Vec::new() };
    let mut ended = None;
    for case in &cases {
        if options.stop.load(std::sync::atomic::Ordering::Relaxed) {
            break;
        }
        steps.begin(&case.label());
        if rows.iter().any(|row| row.is_of(case)) {
            continue;
        }
        let Some(row) = or_end(bench.measure(case, &mut steps), !rows.is_empty(), &mut ended)? else { break };
        let Some(row) = row else { continue };
        rows.push(row);
        if let Some(directory) = &options.directory {
            let measured = measured(&plan, &cases, &rows)?;
            let Measured { settings, rows, .. } = measured;
            let nothing = (Vec::new(), Vec::new());
            let machine = machine.clone();
            Report {
                suite: Suite::Report,
                machine,
                settings,
                rows,
                summaries: nothing.0,
                charts: nothing.1,
                ended: None,
            }
            .write_to(directory)?;
        }
    }
    if rows.is_empty() {
        return Err(Error::Driver("none of the backends is there: nothing was measured".into()));
    }
    Ok(Measured { ended, ..measured(&plan, &cases, &rows)? })
}

/// Tables and charts of what there is, in the cases' order.
fn measured(plan: &Plan, cases: &[Case], rows: &[Row]) -> Result<Measured> {
    let in_order: Vec<(&Case, &Row)> =
        cases.iter().filter_map(|case| Some((case, rows.iter().find(|row| row.is_of(case))?))).collect();
    Ok(Measured {
        settings: saved::settings(plan)?,
        rows: saved::table(rows, &COLUMNS)?,
        summaries: summaries(&in_order),
        charts: charts::charts(&in_order),
        ended: None,
    })
}

/// The fields of [`Row`].
const COLUMNS: [&str; 18] = [
    "scene",
    "width",
    "height",
    "photons",
    "way",
    "grid",
    "tile",
    "backend",
    "gather",
    "chosen_tile",
    "radius_m",
    "paths",
    "frame_ms",
    "trace_ms",
    "build_ms",
    "rounds",
    "rel_mse",
    "report_ms",
];

/// Backends side by side with the report's figures; errors and radii.
fn summaries(rows: &[(&Case, &Row)]) -> Vec<Table> {
    let backends: Vec<Backend> =
        Backend::ALL.into_iter().filter(|b| rows.iter().any(|(c, _)| c.backend == *b)).collect();
    let mut columns: Vec<String> = ["scene", "size", "photons", "way"].map(String::from).to_vec();
    columns.extend(backends.iter().map(|backend| format!("{} ms", backend.name())));
    columns.extend(["report's CL", "report's CPU", "chosen", "relMSE"].map(String::from));
    let mut table = Table::new(columns);
    let mut done: Vec<Case> = Vec::new();
    for (case, row) in rows {
        let on = |backend| Case { backend, ..(*case).clone() };
        if done.contains(&on(Backend::Cpu)) {
            continue;
        }
        done.push(on(Backend::Cpu));
        let place = case.grid.map(|cells| cells.name()).or(case.tile.map(tile_name)).unwrap_or_default();
        let mut cells: Vec<Value> = vec![
            case.scene.as_str().into(),
            tile_name(case.size).as_str().into(),
            case.photons.into(),
            format!("{} {place}", case.way.name()).trim_end().into(),
        ];
        let of = |backend| rows.iter().find(|(own, _)| **own == on(backend)).map(|(_, row)| *row);
        cells.extend(backends.iter().map(|backend| Value::from(of(*backend).map(|row| row.frame_ms))));
        cells.extend([Backend::OpenCl, Backend::Cpu].map(|backend| Value::from(published::published(&on(backend)))));
        // The choice differs by backend: of each that was measured.
        let chosen = backends.iter().filter_map(|backend| {
            let row = of(*backend).filter(|_| case.way == Way::Auto)?;
            let tile = row.chosen_tile.as_ref().map(|tile| format!(" {tile}")).unwrap_or_default();
            Some(format!("{}: {}{tile}", backend.name(), row.gather.as_deref().unwrap_or("-")))
        });
        let mut chosen = chosen.collect::<Vec<_>>().join(", ");
        if let (Way::Auto, Some(radius)) = (case.way, row.radius_m) {
            chosen = format!("R = {radius:.2}; {chosen}");
        }
        cells.extend([chosen.as_str().into(), row.rel_mse.into()]);
        table.push(cells);
    }
    vec![table]
}

/// The pipelines that are open, and what was found with them.
struct Bench<'a> {
    options: &'a Options,
    plan: &'a Plan,
    /// `None` of those that are not there.
    open: Vec<(Backend, Option<Pipeline>)>,
    errors: Vec<Option<Errors>>,
}

impl Bench<'_> {
    /// The pipeline of a backend, opened when first asked for.
    fn pipeline(&mut self, backend: Backend, steps: &mut Steps) -> Option<&mut Pipeline> {
        if !self.open.iter().any(|(own, _)| *own == backend) {
            let opened = Pipeline::open(&self.options.machine(Some(backend)), |line| steps.notice(line));
            let opened = opened.inspect_err(|error| steps.notice(&format!("{} not measured: {error}", backend.name())));
            self.open.push((backend, opened.ok()));
        }
        self.open.iter_mut().find(|(own, _)| *own == backend)?.1.as_mut()
    }

    /// Measures a case; `None` where its backend or its reference is not there.
    fn measure(&mut self, case: &Case, steps: &mut Steps) -> Result<Option<Row>> {
        let scene = self.options.scenes.iter().find(|scene| scene.name == case.scene).expect("made from these").clone();
        let mut settings = case.settings();
        let mut errors = None;
        if let Some(photons) = case.photons {
            settings.photons.amount = Amount::Stored(photons);
            errors = self.errors(&scene, photons, steps)?.map(|found| (found.paths, found.report, found.auto));
        }
        if case.way == Way::Auto {
            let Some((paths, _, (radius, _))) = errors else { return Ok(None) };
            settings.photons.amount = Amount::Paths(paths);
            settings.gather.radius = Some(radius);
        }
        let rounds = self.plan.rounds;
        let Some(pipeline) = self.pipeline(case.backend, steps) else { return Ok(None) };
        let mut moved = scene.clone();
        let first = pipeline.render(&scene, &settings)?;
        let [mut build, mut trace] = [Samples::default(), Samples::default()];
        let mut take = |times: &crate::pipeline::Times| {
            build.ms.push(times.tiles + if times.tiles > 0.0 { times.upload } else { 0.0 });
            trace.ms.push(times.trace);
        };
        // The first frame builds programs and tables; where that is little, on the CPU or in a long one, it may count.
        let rounds = match first.times.trace {
            long if long > 20_000.0 || long > 3000.0 && case.backend == Backend::Cpu => {
                take(&first.times);
                0
            }
            long if long > 3000.0 => 1,
            long if long > 300.0 => rounds.min(3),
            _ => rounds,
        };
        let mut last = first;
        for round in 0..rounds {
            moved.camera.position.x = scene.camera.position.x + STEP * f64::from(round + 1);
            last = pipeline.render(&moved, &settings)?;
            take(&last.times);
        }
        let frames = Samples { ms: build.ms.iter().zip(&trace.ms).map(|(build, trace)| build + trace).collect() };
        let [width, height] = case.size;
        Ok(Some(Row {
            scene: case.scene.clone(),
            width,
            height,
            photons: case.photons,
            way: case.way.name().into(),
            grid: case.grid.map(|cells| cells.name()),
            tile: case.tile.map(tile_name),
            backend: case.backend.name().into(),
            gather: last.method.map(|method| method.name().into()),
            chosen_tile: last.tile.map(tile_name),
            radius_m: last.radius.map(|radius| Value::from(radius).number().unwrap_or(f64::NAN)),
            paths: last.photons.map(|counts| counts.emitted),
            frame_ms: frames.median(),
            trace_ms: trace.median(),
            build_ms: build.median(),
            rounds: frames.ms.len() as u32,
            rel_mse: errors.map(|(_, report, (_, auto))| if case.way == Way::Auto { auto } else { report }),
            report_ms: published::published(case),
        }))
    }
}
