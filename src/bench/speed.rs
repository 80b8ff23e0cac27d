//! Speed: milliseconds of tracing, gathering, emission, grid and upload, on every backend, in turn.

use super::table::{Table, Value};
use super::timing::{Samples, in_turn};
use super::{Measured, Options, Progress, Steps, or_end};
use crate::error::{Error, Result};
use crate::pipeline::{Machine, Pipeline};
use crate::scene::Scene;
use crate::settings::{Amount, Backend, Gather, LightMode, Method, Pass, Settings};

/// Name of the backend whose kernels have one lane: what the others are measured by on a CPU.
const PLAIN: &str = "plain opencl";

/// A backend that takes part.
struct Subject {
    name: &'static str,
    pipeline: Pipeline,
}

/// One thing that was measured on some of the subjects.
struct Measure {
    stage: &'static str,
    /// Paths or photons.
    count: Option<u32>,
    radius: Option<f32>,
    /// Names and times.
    samples: Vec<(&'static str, Samples)>,
}

/// The numbers of a run.
#[derive(serde::Serialize)]
struct Plan {
    size: [u32; 2],
    stored: Vec<u32>,
    radii: Vec<f32>,
    paths: u32,
    large_map: u32,
    rounds: u32,
    threads: usize,
    backends: Vec<&'static str>,
    /// Lanes of an OpenCL work-item.
    lanes: Option<u32>,
}

/// See [`super::Suite::Speed`].
pub fn run(options: &Options, progress: &mut dyn FnMut(Progress)) -> Result<Measured> {
    let (width, height) = options.or(options.size, (640, 480), (64, 48));
    let mut plan = Plan {
        size: [width, height],
        stored: options.list(&options.photons, &[200_000], &[5_000]),
        radii: options.list(&options.radii, &[0.1, 0.2], &[0.1, 0.2]),
        paths: if options.quick { 20_000 } else { 1_000_000 },
        large_map: if options.quick { 20_000 } else { 1_000_000 },
        rounds: options.or(options.repeat, 7, 3),
        threads: options.threads,
        backends: Vec::new(),
        lanes: None,
    };
    // Direct light, each gather, emission, and the grid of each size.
    let steps_of_scene = 1 + plan.stored.len() * plan.radii.len() + 1 + plan.stored.len() + 1;
    let mut steps = Steps::new(progress, options.scenes.len() * steps_of_scene);
    let mut subjects = open(options, &mut steps)?;
    plan.backends = subjects.iter().map(|subject| subject.name).collect();
    plan.lanes = subjects.iter().filter_map(|subject| subject.pipeline.devices.lanes).max();

    let mut rows = Table::new([
        "scene",
        "stage",
        "count",
        "radius_m",
        "backend",
        "ms",
        "least_ms",
        "rounds",
        "per_second",
        "ratio_to_plain",
    ]);
    let mut pictures = pictures_table(&plan);
    let mut stages = Table::new(["scene", "stage", "backend", "ms", "M/s"]);
    let mut ended = None;
    for scene in options.scenes.iter().take_while(|_| !options.is_stopped()) {
        let pictures_of_scene = measure_pictures(scene, options, &plan, &mut subjects, &mut steps);
        let Some(measured) = or_end(pictures_of_scene, !rows.is_empty(), &mut ended)? else { break };
        for measure in measured {
            measure.add_to(&mut rows, scene);
            pictures.push(measure.side_by_side(scene, &plan));
        }
        let stages_of_scene = measure_stages(scene, options, &plan, &mut subjects, &mut steps);
        let Some(measured) = or_end(stages_of_scene, !rows.is_empty(), &mut ended)? else { break };
        for measure in measured {
            measure.add_to(&mut rows, scene);
            for (name, samples) in &measure.samples {
                let (ms, rate) = (samples.median(), measure.rate(samples).map(|rate| rate * 1e-6));
                let scene = scene.name.as_str();
                stages.push([scene.into(), measure.label().as_str().into(), (*name).into(), ms.into(), rate.into()]);
            }
        }
    }
    let settings = serde_json::to_value(&plan).map_err(|e| Error::Failed(format!("JSON: {e}")))?;
    Ok(Measured { settings, rows, summaries: vec![pictures, stages], charts: Vec::new(), ended })
}

/// The backends that are there, and plain kernels where OpenCL's have several lanes.
fn open(options: &Options, steps: &mut Steps) -> Result<Vec<Subject>> {
    let mut subjects = Vec::new();
    for backend in &options.backends {
        match Pipeline::open(&options.machine(Some(*backend)), |line| steps.notice(line)) {
            Ok(pipeline) => subjects.push(Subject { name: backend.name(), pipeline }),
            Err(error) => steps.notice(&format!("{} not measured: {error}", backend.name())),
        }
        let vectors = |s: &Subject| s.pipeline.backend == Backend::OpenCl && s.pipeline.devices.lanes > Some(1);
        if *backend == Backend::OpenCl && subjects.last().is_some_and(vectors) {
            let machine = Machine { lanes: Some(1), ..options.machine(Some(*backend)) };
            subjects.push(Subject { name: PLAIN, pipeline: Pipeline::open(&machine, |line| steps.notice(line))? });
        }
    }
    if subjects.is_empty() {
        return Err(Error::Driver("none of the backends is there: nothing was measured".into()));
    }
    Ok(subjects)
}

/// Trace alone, then trace and gather.
fn measure_pictures(
    scene: &Scene,
    options: &Options,
    plan: &Plan,
    subjects: &mut [Subject],
    steps: &mut Steps,
) -> Result<Vec<Measure>> {
    let direct = Settings { light: LightMode::Direct, ..settings(plan.size) };
    let mut measures = vec![(Measure::new("direct", None, None), direct)];
    for stored in &plan.stored {
        for radius in &plan.radii {
            let mut gathering = settings(plan.size);
            gathering.photons.amount = Amount::Stored(*stored);
            gathering.gather.radius = Some(*radius);
            measures.push((Measure::new("gather", Some(*stored), Some(*radius)), gathering));
        }
    }
    for (measure, settings) in measures.iter_mut().take_while(|_| !options.is_stopped()) {
        steps.begin(&format!("{}: {}", scene.name, measure.label()));
        let samples = in_turn(subjects, plan.rounds, |subject, _| {
            subject.pipeline.retrace(scene, settings, &Pass::single(settings))
        })?;
        measure.samples = subjects.iter().map(|s| s.name).zip(samples).collect();
    }
    // Those before it was stopped.
    Ok(measures.into_iter().map(|(measure, _)| measure).filter(|measure| !measure.samples.is_empty()).collect())
}

/// Emission, grid, upload; of a small picture, so that tracing takes no time.
fn measure_stages(
    scene: &Scene,
    options: &Options,
    plan: &Plan,
    subjects: &mut [Subject],
    steps: &mut Steps,
) -> Result<Vec<Measure>> {
    let (radius, mut base) = (plan.radii[0], settings([32, 24]));
    base.gather.radius = Some(radius);
    // OpenGL's photons come from the OpenCL device: once is enough.
    let opencl = subjects.iter().any(|s| s.pipeline.backend == Backend::OpenCl);
    let has_own_photons = |s: &Subject| !(opencl && s.pipeline.backend == Backend::OpenGl);
    let mut measures = Vec::new();
    if options.is_stopped() {
        return Ok(measures);
    }

    let mut emission = Measure::new("emission", Some(plan.paths), None);
    steps.begin(&format!("{}: {}", scene.name, emission.label()));
    let mut emitting: Vec<&mut Subject> = subjects.iter_mut().filter(|s| has_own_photons(s)).collect();
    let samples = in_turn(&mut emitting, plan.rounds, |subject, round| {
        let mut settings = base.clone();
        settings.photons.amount = Amount::Paths(plan.paths);
        let pass = Pass { index: round, ..Pass::single(&settings) }; // another pass is another map
        Ok(subject.pipeline.render_pass(scene, &settings, &pass)?.times.emit)
    })?;
    emission.samples = emitting.iter().map(|s| s.name).zip(samples).collect();
    measures.push(emission);

    for stored in plan.stored.iter().copied().chain([plan.large_map]).take_while(|_| !options.is_stopped()) {
        let (mut grid, mut upload) =
            (Measure::new("grid", Some(stored), Some(radius)), Measure::new("upload", Some(stored), None));
        steps.begin(&format!("{}: {}", scene.name, grid.label()));
        let mut uploads = vec![Samples::default(); subjects.len()];
        // The grid's kernels have no lanes: plain ones are the same.
        let mut numbered: Vec<(usize, &mut Subject)> =
            subjects.iter_mut().enumerate().filter(|(_, s)| s.name != PLAIN).collect();
        let grids = in_turn(&mut numbered, plan.rounds, |(i, subject), round| {
            let mut settings = base.clone();
            settings.photons.amount = Amount::Stored(stored);
            // A map that was never sorted: what a frame has.
            let pass = Pass { index: round, ..Pass::single(&settings) };
            let times = subject.pipeline.render_pass(scene, &settings, &pass)?.times;
            if round > 0 && subject.pipeline.backend == Backend::OpenGl {
                // What the driver put off shows in the trace that follows, and not in the next.
                let put_off = times.trace - subject.pipeline.retrace(scene, &settings, &pass)?;
                uploads[*i].ms.push(times.upload + put_off.max(0.0));
            }
            Ok(times.grid)
        })?;
        for ((i, subject), grids) in numbered.into_iter().zip(grids) {
            if has_own_photons(subject) {
                grid.samples.push((subject.name, grids));
            }
            if subject.pipeline.backend == Backend::OpenGl {
                upload.samples.push((subject.name, std::mem::take(&mut uploads[i])));
            }
        }
        measures.push(grid);
        measures.push(upload);
    }
    Ok(measures)
}

fn settings(size: [u32; 2]) -> Settings {
    // The grid by name: choosing a gather is no part of what is timed.
    let default = Settings::default();
    let gather = Gather { method: Method::Grid, ..default.gather };
    Settings { width: size[0], height: size[1], gather, ..default }
}

/// A table with a column a backend, and how many times the plain kernels' time each takes.
fn pictures_table(plan: &Plan) -> Table {
    let mut columns = vec!["scene".to_string(), "stage".into()];
    columns.extend(plan.backends.iter().map(|name| format!("{name} ms")));
    columns.extend(plan.ratios().map(|name| format!("{name}/plain")));
    Table::new(columns)
}

impl Plan {
    /// The backends that are measured by the plain kernels.
    fn ratios(&self) -> impl Iterator<Item = &'static str> {
        let base = base(self.backends.iter().copied());
        self.backends.iter().copied().filter(move |name| base.is_some_and(|base| base != *name))
    }
}

/// The plain kernels: OpenCL's own where they have one lane.
fn base(names: impl Iterator<Item = &'static str> + Clone) -> Option<&'static str> {
    let mut all = names.clone();
    all.find(|name| *name == PLAIN).or_else(|| names.clone().find(|name| *name == Backend::OpenCl.name()))
}

impl Measure {
    fn new(stage: &'static str, count: Option<u32>, radius: Option<f32>) -> Measure {
        Measure { stage, count, radius, samples: Vec::new() }
    }

    /// `gather 200k R=0.1`
    fn label(&self) -> String {
        let count = self.count.map(|count| format!(" {}", short(count))).unwrap_or_default();
        let radius = self.radius.map(|radius| format!(" R={radius}")).unwrap_or_default();
        format!("{}{count}{radius}", self.stage)
    }

    /// Paths or photons a second, where that is what counts.
    fn rate(&self, samples: &Samples) -> Option<f64> {
        let counted = matches!(self.stage, "emission" | "grid" | "upload");
        self.count.filter(|_| counted).map(|count| f64::from(count) / samples.median() * 1e3)
    }

    fn of(&self, name: &str) -> Option<&Samples> {
        self.samples.iter().find(|(own, _)| *own == name).map(|(_, samples)| samples)
    }

    fn base(&self) -> Option<&Samples> {
        self.of(base(self.samples.iter().map(|(name, _)| *name))?)
    }

    fn add_to(&self, rows: &mut Table, scene: &Scene) {
        for (name, samples) in &self.samples {
            rows.push([
                scene.name.as_str().into(),
                self.stage.into(),
                self.count.into(),
                self.radius.into(),
                (*name).into(),
                samples.median().into(),
                samples.least().into(),
                (samples.ms.len() as u64).into(),
                self.rate(samples).into(),
                self.base().map(|base| samples.ratio_to(base)).into(),
            ]);
        }
    }

    fn side_by_side(&self, scene: &Scene, plan: &Plan) -> Vec<Value> {
        let mut row: Vec<Value> = vec![scene.name.as_str().into(), self.label().as_str().into()];
        row.extend(plan.backends.iter().map(|name| Value::from(self.of(name).map(Samples::median))));
        row.extend(plan.ratios().map(|name| {
            let ratio = self.of(name).zip(self.base()).map(|(samples, base)| samples.ratio_to(base));
            Value::from(ratio)
        }));
        row
    }
}

/// A count as the command line takes it: `200k`, `1M`.
fn short(count: u32) -> String {
    match count {
        _ if count % 1_000_000 == 0 && count > 0 => format!("{}M", count / 1_000_000),
        _ if count % 1000 == 0 && count > 0 => format!("{}k", count / 1000),
        _ => count.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measure(times: &[(&'static str, &[f64])]) -> Measure {
        let samples = times.iter().map(|(name, ms)| (*name, Samples { ms: ms.to_vec() })).collect();
        Measure { samples, ..Measure::new("emission", Some(2_000_000), None) }
    }

    #[test]
    fn ratios_are_to_the_plain_kernels_or_to_opencl_where_it_has_one_lane() {
        let cpu = measure(&[("opengl", &[8.0]), ("opencl", &[1.0]), (PLAIN, &[4.0])]);
        assert_eq!(cpu.of("opengl").unwrap().ratio_to(cpu.base().unwrap()), 2.0);
        assert_eq!(cpu.of("opencl").unwrap().ratio_to(cpu.base().unwrap()), 0.25);
        let gpu = measure(&[("opengl", &[8.0]), ("opencl", &[2.0])]);
        assert_eq!(gpu.of("opengl").unwrap().ratio_to(gpu.base().unwrap()), 4.0);
        assert!(measure(&[("cpu", &[1.0])]).base().is_none());
    }

    #[test]
    fn rates_are_by_the_second() {
        let emission = measure(&[("opencl", &[100.0])]);
        assert_eq!(emission.rate(emission.of("opencl").unwrap()), Some(2e7));
        let gather = Measure { stage: "gather", ..emission };
        assert_eq!(gather.rate(gather.of("opencl").unwrap()), None);
        assert_eq!(gather.label(), "gather 2M");
        assert_eq!((short(200_000), short(1_500_000), short(12_345)), ("200k".into(), "1500k".into(), "12345".into()));
    }
}
