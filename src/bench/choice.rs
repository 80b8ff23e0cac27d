//! Choice: the automatic choice between grid, tiles and tiled grid against what each of them really takes.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::gather::emit;
use super::saved;
use super::table::{Table, Value};
use super::timing::{Samples, median};
use super::{MachineInfo, Measured, Options, Progress, Report, Steps, Suite, or_end};
use crate::cpu::grid::face_of;
use crate::error::{Error, Result};
use crate::packing::Packed;
use crate::pipeline::{Pipeline, Rendering};
use crate::plan::choice::{self, Class, Estimate, Question, TERMS, Taken};
use crate::plan::photon_sample::Sample;
use crate::plan::radius;
use crate::program::features::Features;
use crate::rays::scene::SceneTables;
use crate::scene::Scene;
use crate::settings::{Amount, Gather, LightMode, Pass, Settings};

/// What a choice may cost beyond the best one to be a good one.
const GOOD: f64 = 1.15;

/// Milliseconds beyond which a method is timed once only, and below which twice as often: medians of little need more.
const LONG: f64 = 1000.0;
const SHORT: f64 = 30.0;

/// How many times as long as the best one's a first picture takes where no more of its kind are needed: it is not the best.
const HOPELESS: f64 = 3.0;

/// The numbers of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Plan {
    sizes: Vec<[u32; 2]>,
    stored: Vec<u32>,
    /// Gather radii in metres; 0 is the automatic one.
    radii: Vec<f32>,
    rounds: u32,
    threads: usize,
}

/// A measured way of gathering; its fields are columns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Row {
    class: String,
    scene: String,
    size: String,
    photons: u32,
    /// As asked for: 0 is the automatic one.
    radius_m: f64,
    gather: String,
    /// Building and gathering, the median of the rounds.
    ms: f64,
    /// How many times longer than the best of the setting.
    over_best: f64,
    rounds: u32,
}

/// The fields of [`Row`].
const COLUMNS: [&str; 9] = ["class", "scene", "size", "photons", "radius_m", "gather", "ms", "over_best", "rounds"];

/// What is asked: a map, a radius, a size.
#[derive(Clone, Copy)]
struct Setting<'a> {
    class: Class,
    scene: &'a Scene,
    size: [u32; 2],
    stored: u32,
    radius: f32,
}

impl Setting<'_> {
    fn size_name(&self) -> String {
        format!("{}x{}", self.size[0], self.size[1])
    }

    fn is_of(&self, row: &Row) -> bool {
        let own = (self.class.name(), self.scene.name.as_str(), self.size_name(), self.stored);
        own == (row.class.as_str(), row.scene.as_str(), row.size.clone(), row.photons)
            && Value::from(self.radius).number() == Some(row.radius_m)
    }

    /// All light by photons: as many as are asked for in open scenes too.
    fn settings(&self) -> Settings {
        let [width, height] = self.size;
        let default = Settings { width, height, light: LightMode::Photons, ..Settings::default() };
        let mut settings = Settings {
            gather: Gather { radius: (self.radius > 0.0).then_some(self.radius), ..default.gather },
            ..default
        };
        settings.photons.amount = Amount::Stored(self.stored);
        settings
    }
}

fn name(estimate: &Estimate) -> String {
    let size = estimate.tile.map(|[w, h]| format!(" {w}x{h}")).unwrap_or_default();
    estimate.method.name().to_string() + &size
}

/// See [`super::Suite::Choice`].
pub fn run(options: &Options, machine: &MachineInfo, progress: &mut dyn FnMut(Progress)) -> Result<Measured> {
    let sizes = match options.size {
        Some((width, height)) => vec![[width, height]],
        None if options.quick => vec![[64, 48]],
        None => vec![[160, 160], [640, 480]],
    };
    let plan = Plan {
        sizes,
        stored: options.list(&options.photons, &[12_000, 200_000], &[3000]),
        radii: options.list(&options.radii, &[0.0, 1.0, 0.2], &[0.0]),
        rounds: options.or(options.repeat, 5, 1),
        threads: options.threads,
    };
    let mut rows: Vec<Row> = match options.directory.as_deref().map(|directory| directory.join("choice.json")) {
        Some(path) if path.exists() => saved::rows(&path, &plan, machine)?,
        _ => Vec::new(),
    };
    let count = plan.sizes.len() * plan.stored.len() * plan.radii.len();
    let mut steps = Steps::new(progress, options.backends.len() * options.scenes.len() * count);
    let (mut judged, mut ended) = (Judged::new(), None);
    for backend in &options.backends {
        let mut pipeline = match Pipeline::open(&options.machine(Some(*backend)), |line| steps.notice(line)) {
            Ok(pipeline) => pipeline,
            Err(error) => {
                steps.notice(&format!("{} not measured: {error}", backend.name()));
                continue;
            }
        };
        let class = pipeline.class();
        let mut answers = Vec::new();
        for setting in settings_of(options, &plan, class) {
            let (scene, size) = (&setting.scene.name, setting.size_name());
            steps.begin(&format!(
                "{scene}: {size}, {} photons, R={}, {}",
                setting.stored,
                setting.radius,
                class.name()
            ));
            if options.stop.load(std::sync::atomic::Ordering::Relaxed) {
                break;
            }
            let (radius, estimates, choosing) = ask(&setting)?;
            if !rows.iter().any(|row| setting.is_of(row)) {
                let measured = measure(&mut pipeline, &setting, radius, &estimates, plan.rounds);
                match or_end(measured, !rows.is_empty(), &mut ended)? {
                    Some(measured) => rows.extend(measured),
                    None => break,
                }
                if let Some(directory) = &options.directory {
                    let (settings, machine) = (saved::settings(&plan)?, machine.clone());
                    let rows = saved::table(&rows, &COLUMNS)?;
                    let (summaries, charts) = Default::default();
                    Report { suite: Suite::Choice, machine, settings, rows, summaries, charts, ended: None }
                        .write_to(directory)?;
                }
            }
            answers.push((setting, estimates, choosing));
        }
        judged.add(class, &answers, &rows);
    }
    if rows.is_empty() {
        return Err(Error::Driver("none of the backends is there: nothing was measured".into()));
    }
    let Judged { verdicts, costs, shares } = judged;
    let rows = saved::table(&rows, &COLUMNS)?;
    let summaries = vec![verdicts, costs, shares];
    Ok(Measured { settings: saved::settings(&plan)?, rows, summaries, charts: Vec::new(), ended })
}

fn settings_of<'a>(options: &'a Options, plan: &'a Plan, class: Class) -> impl Iterator<Item = Setting<'a>> {
    options.scenes.iter().flat_map(move |scene| {
        plan.stored.iter().flat_map(move |stored| {
            let of = move |(radius, size): (f32, [u32; 2])| Setting { class, scene, size, stored: *stored, radius };
            plan.radii.iter().flat_map(|radius| plan.sizes.iter().map(|size| (*radius, *size))).map(of)
        })
    })
}

/// What each setting's model says, and the milliseconds that it took: the radius, and the estimates, the cheapest first.
fn ask(setting: &Setting) -> Result<(f32, Vec<Estimate>, f64)> {
    let settings = setting.settings();
    let features = Features::of(setting.scene, &settings);
    let packed = Packed::new(setting.scene, setting.scene.camera.position);
    let tables = SceneTables::new(&packed, &features);
    let frame = packed.frame(&setting.scene.camera, &settings, &Pass::single(&settings));
    // A map's beginning is the same whatever its length.
    let map = emit(&tables, &packed, setting.stored.min(radius::SAMPLE as u32), true)?;
    let faces = map.surfaces.iter().map(|surface| face_of(surface) as u32).collect();
    let sample = Sample { positions: map.positions.clone(), faces };
    let stored = setting.stored.into();
    let radius = settings.gather.radius.unwrap_or_else(|| radius::choose(&tables, &frame, &sample, stored));
    let start = Instant::now();
    let question = Question { stored, radius, tile: None, class: setting.class };
    let estimates = choice::estimates(&tables, &frame, &sample, &question);
    Ok((radius, estimates, start.elapsed().as_secs_f64() * 1e3))
}

/// Times everything that could be chosen, one after the other, round by round: of each the second of two pictures.
fn measure(
    pipeline: &mut Pipeline,
    setting: &Setting,
    radius: f32,
    estimates: &[Estimate],
    rounds: u32,
) -> Result<Vec<Row>> {
    let mut settings = setting.settings();
    settings.gather.radius = Some(radius);
    let mut samples = vec![Samples::default(); estimates.len()];
    let mut warm_up = vec![0.0f64; estimates.len()];
    let mut best_first = f64::INFINITY;
    for round in 0..=2 * rounds {
        for (number, ((estimate, samples), first)) in estimates.iter().zip(&mut samples).zip(&mut warm_up).enumerate() {
            let wanted = match *first {
                _ if round == 0 => rounds,
                first if first.is_nan() => 0,
                first if first > SHORT && first > HOPELESS * best_first => 0,
                first if first > LONG => 1,
                first if first < SHORT => 2 * rounds,
                _ => rounds,
            };
            if round > wanted {
                continue;
            }
            settings.gather.method = estimate.method;
            settings.gather.tile = estimate.tile;
            // Photons of its own, as where a light moves: everything is sorted and moved anew, and nobody finds what
            // another left. What is short is rendered twice, since drivers and paces have to settle on it again, and the
            // very first time some compile.
            let mut ms = 0.0;
            for again in 0..2 {
                if again > 0 && (ms > LONG || ms.is_nan()) {
                    break;
                }
                let index = 2 * (round * estimates.len() as u32 + number as u32) + again;
                let pass = Pass { index, ..Pass::single(&settings) };
                ms = match pipeline.render_pass(setting.scene, &settings, &pass) {
                    Ok(Rendering { times, .. }) => times.grid + times.tiles + times.upload + times.trace,
                    // Lists that are too long for floats cannot be chosen, and are not.
                    Err(Error::Usage(_)) => f64::NAN,
                    Err(error) => return Err(error),
                };
            }
            if ms.is_nan() {
                *first = ms;
                continue;
            }
            match round {
                0 => (*first, best_first) = (ms, best_first.min(ms)),
                _ => samples.ms.push(ms),
            }
        }
    }
    for (samples, first) in samples.iter_mut().zip(warm_up) {
        if samples.ms.is_empty() && !first.is_nan() {
            samples.ms.push(first);
        }
    }
    let done = || estimates.iter().zip(&samples).filter(|(_, samples)| !samples.ms.is_empty());
    let best = done().map(|(_, samples)| samples.median()).fold(f64::INFINITY, f64::min);
    let row = |(estimate, samples): (&Estimate, &Samples)| Row {
        class: setting.class.name().into(),
        scene: setting.scene.name.clone(),
        size: setting.size_name(),
        photons: setting.stored,
        radius_m: Value::from(setting.radius).number().unwrap_or_default(),
        gather: name(estimate),
        ms: samples.median(),
        over_best: samples.median() / best,
        rounds: samples.ms.len() as u32,
    };
    Ok(done().map(row).collect())
}

/// The model held against what was measured.
struct Judged {
    verdicts: Table,
    costs: Table,
    shares: Table,
}

impl Judged {
    fn new() -> Judged {
        Judged {
            verdicts: Table::new([
                "class",
                "scene",
                "size",
                "photons",
                "R",
                "chosen",
                "ms",
                "best",
                "best ms",
                "chosen/best",
                "fitted",
            ]),
            costs: Table::new(["class", "term", "ns", "fitted ns"]),
            shares: Table::new([
                "class",
                "settings",
                "within 15%",
                "worst",
                "mean",
                "fitted within 15%",
                "fitted worst",
                "choosing, ms",
            ]),
        }
    }

    /// Adds a class: what was asked and answered, and its rows among others'.
    fn add(&mut self, class: Class, answers: &[(Setting, Vec<Estimate>, f64)], rows: &[Row]) {
        let of = |setting: &Setting, estimate: &Estimate| {
            rows.iter().find(|row| setting.is_of(row) && row.gather == name(estimate))
        };
        let taken = |(setting, estimates, _): &(Setting, Vec<Estimate>, f64)| {
            let rows = estimates.iter().filter_map(|estimate| Some((estimate, of(setting, estimate)?)));
            let taken = |(estimate, row): (&Estimate, &Row)| Taken {
                counts: estimate.counts,
                ms: row.ms,
                over_best: row.over_best,
            };
            rows.map(taken).collect::<Vec<_>>()
        };
        let fitted = choice::fit_choice(&answers.iter().map(taken).collect::<Vec<_>>());
        let [mut ratios, mut fitted_ratios] = [Vec::new(), Vec::new()];
        for (setting, estimates, _) in answers {
            let done: Vec<(&Estimate, &Row)> =
                estimates.iter().filter_map(|estimate| Some((estimate, of(setting, estimate)?))).collect();
            let cost = |(estimate, _): &(&Estimate, &Row)| estimate.cost_at(&fitted);
            // The first is the one that would be chosen.
            let Some(((_, chosen), (_, best), (_, other))) = done.first().and_then(|chosen| {
                let best = done.iter().min_by(|a, b| a.1.ms.total_cmp(&b.1.ms))?;
                Some((chosen, best, done.iter().min_by(|a, b| cost(a).total_cmp(&cost(b)))?))
            }) else {
                continue;
            };
            ratios.push(chosen.over_best);
            fitted_ratios.push(other.over_best);
            let fitted = format!("{} {}", other.gather, super::table::shown(other.over_best));
            self.verdicts.push([
                class.name().into(),
                setting.scene.name.as_str().into(),
                setting.size_name().as_str().into(),
                setting.stored.into(),
                setting.radius.into(),
                chosen.gather.as_str().into(),
                chosen.ms.into(),
                best.gather.as_str().into(),
                best.ms.into(),
                chosen.over_best.into(),
                Value::from(fitted.as_str()),
            ]);
        }
        let good = |ratios: &[f64]| Value::from(ratios.iter().filter(|ratio| **ratio <= GOOD).count() as u64);
        let worst = |ratios: &[f64]| Value::from(ratios.iter().copied().fold(0.0, f64::max));
        self.shares.push([
            class.name().into(),
            (ratios.len() as u64).into(),
            good(&ratios),
            worst(&ratios),
            (ratios.iter().sum::<f64>() / ratios.len() as f64).into(),
            good(&fitted_ratios),
            worst(&fitted_ratios),
            median(&answers.iter().map(|(_, _, ms)| *ms).collect::<Vec<_>>()).into(),
        ]);
        for ((term, ns), fitted) in TERMS.iter().zip(class.costs()).zip(fitted) {
            self.costs.push([class.name().into(), (*term).into(), (*ns).into(), fitted.into()]);
        }
    }
}
