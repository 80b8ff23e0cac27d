//! Error: what a second buys. Error against a reference by run time, for each technique and setting, in passes.
//!
//! A curve is one progressive render, looked at after 1, 2, 4 … passes; its time is that of the passes alone, without
//! compilation and without what looking costs. Medians of times and means of errors over several seeds.

use std::sync::atomic::Ordering;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::plot::{Chart, Curve, Look};
use super::reference::reference;
use super::table::{Table, Value};
use super::timing::median;
use super::{MachineInfo, Measured, Options, Progress, Report, Steps, Suite, or_end, saved};
use crate::error::{Error, Result};
use crate::film::Image;
use crate::film::metrics::{self, measure};
use crate::pipeline::Pipeline;
use crate::pipeline::progressive::{Progressive, bound_90};
use crate::scene::Scene;
use crate::settings::{Amount, Backend, FinalGather, Settings, Technique};
use crate::techniques::{Usual, default_technique};

/// The numbers of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Plan {
    /// A curve ends after the look at which it has taken so long.
    seconds: f64,
    seeds: u32,
    threads: usize,
    photons: Vec<u32>,
}

/// A technique with its settings.
struct Setting {
    name: String,
    technique: Technique,
    paths: u32,
    samples: u32,
}

/// A look at a curve; its fields are the columns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Row {
    scene: String,
    backend: String,
    setting: String,
    passes: u64,
    /// Median over the seeds.
    seconds: f64,
    /// Means over the seeds.
    rel_mse: f64,
    rmse: f64,
    /// The error that the render itself tells: mean relative standard error and bias.
    estimate: Option<f64>,
    /// Share of the values within the 90% bound around the mean.
    coverage: Option<f64>,
    seeds: u32,
    /// No other row of this scene and backend is both faster and better.
    front: bool,
}

const COLUMNS: [&str; 11] =
    ["scene", "backend", "setting", "passes", "seconds", "rel_mse", "rmse", "estimate", "coverage", "seeds", "front"];

/// See [`super::Suite::Error`].
pub fn run(options: &Options, machine: &MachineInfo, progress: &mut dyn FnMut(Progress)) -> Result<Measured> {
    let plan = Plan {
        seconds: if options.quick { 0.4 } else { 8.0 },
        seeds: options.or(options.seeds, 3, 1),
        threads: options.threads,
        photons: options.list(&options.photons, &[200_000, 20_000], &[50_000]),
    };
    let references = options.scenes.iter().map(|scene| reference(options, scene)).collect::<Result<Vec<Image>>>()?;
    let peers = peers(options)?;
    let mut rows: Vec<Row> = match options.directory.as_deref().map(|directory| directory.join("error.json")) {
        Some(path) if path.exists() => saved::rows(&path, &plan, machine)?,
        _ => Vec::new(),
    };
    let pairs = || options.scenes.iter().zip(&references);
    let curves: usize = pairs().map(|(scene, reference)| settings(scene, reference, &plan, false).len()).sum();
    let mut steps = Steps::new(progress, curves * options.backends.len());
    if !rows.is_empty() {
        steps.notice(&format!("{} rows are measured already and kept", rows.len()));
    }
    let mut ended = None;
    'all: for backend in &options.backends {
        let opened = Pipeline::open(&options.machine(Some(*backend)), |line| steps.notice(line));
        let mut pipeline = match opened {
            Ok(pipeline) => pipeline,
            Err(error) => {
                steps.notice(&format!("{} not measured: {error}", backend.name()));
                continue;
            }
        };
        for (scene, reference) in pairs() {
            for setting in settings(scene, reference, &plan, pipeline.is_on_gpu()) {
                if options.stop.load(Ordering::Relaxed) {
                    break 'all;
                }
                steps.begin(&format!("{}, {}, {}", scene.name, backend.name(), setting.name));
                let known = |row: &Row| {
                    (&row.scene, row.backend.as_str(), &row.setting) == (&scene.name, backend.name(), &setting.name)
                };
                if rows.iter().any(known) {
                    continue;
                }
                let curve = curve(&mut pipeline, *backend, scene, reference, &setting, &plan);
                match or_end(curve, !rows.is_empty(), &mut ended)? {
                    Some(curve) => rows.extend(curve),
                    None => break 'all,
                }
                mark_fronts(&mut rows);
                if let Some(directory) = &options.directory {
                    let measured = measured(&plan, &rows, &peers)?;
                    let Measured { settings, rows, .. } = measured;
                    let (summaries, charts, machine) = (Vec::new(), Vec::new(), machine.clone());
                    Report { suite: Suite::Error, machine, settings, rows, summaries, charts, ended: None }
                        .write_to(directory)?;
                }
            }
        }
    }
    if rows.is_empty() {
        return Err(Error::Driver("none of the backends is there: nothing was measured".into()));
    }
    Ok(Measured { ended, ..measured(&plan, &rows, &peers)? })
}

/// What is compared in a scene.
fn settings(scene: &Scene, reference: &Image, plan: &Plan, on_gpu: bool) -> Vec<Setting> {
    let mut list = Vec::new();
    let size = Settings { width: reference.width, height: reference.height, ..Settings::default() };
    if let Technique::FinalGather(_) = default_technique(scene, &size) {
        let Usual { gather: usual, paths, samples } = Usual::of(scene, &size, on_gpu);
        let gather = |name: &str, gather: FinalGather, paths: u32, samples: u32| Setting {
            name: name.into(),
            technique: Technique::FinalGather(gather),
            paths,
            samples,
        };
        list.push(gather("final-gather", usual, paths, samples));
        list.push(gather("final-gather, 1/4 photons", usual, paths / 4, samples));
        list.push(gather("final-gather, 1/4 rays", FinalGather { rays: usual.rays / 4, ..usual }, paths, samples));
        list.push(gather("final-gather, 1 sample", usual, paths, 1));
        list.push(gather("final-gather, no lit points", FinalGather { points: 0, ..usual }, paths, samples));
        list.push(gather("final-gather, each sample", FinalGather { spacing: 1, rays: 16, ..usual }, paths, 1));
    }
    for paths in &plan.photons {
        let name = format!("map, {paths} paths");
        list.push(Setting { name, technique: Technique::Map, paths: *paths, samples: 1 });
    }
    list
}

/// A look at one seed's render.
struct Judged {
    seconds: f64,
    rel_mse: f64,
    rmse: f64,
    estimate: Option<f64>,
    coverage: Option<f64>,
}

/// Times and errors of one setting, pass by pass: a curve of the chart.
fn curve(
    pipeline: &mut Pipeline,
    backend: Backend,
    scene: &Scene,
    reference: &Image,
    setting: &Setting,
    plan: &Plan,
) -> Result<Vec<Row>> {
    let mut looks: Vec<Vec<Judged>> = Vec::new();
    for seed in 0..plan.seeds {
        let mut settings = Settings {
            width: reference.width,
            height: reference.height,
            samples: setting.samples,
            seed,
            technique: setting.technique,
            ..Settings::default()
        };
        settings.photons.amount = Amount::Paths(setting.paths);
        let mut progressive = Progressive::new(scene, &settings)?;
        progressive.warm_up(pipeline, scene)?;
        let mut seconds = 0.0;
        for look in 0.. {
            // Seeds after the first take as many passes as it did.
            if (seed == 0 && seconds >= plan.seconds) || (seed > 0 && look >= looks.len()) {
                break;
            }
            let started = Instant::now();
            let mut compile = 0.0;
            while progressive.passes() < 1 << look {
                compile += progressive.step(pipeline, scene)?.times.compile;
            }
            seconds += started.elapsed().as_secs_f64() - compile / 1e3;
            if seed == 0 {
                looks.push(Vec::new());
            }
            looks[look].push(judge(&mut progressive, reference, seconds)?);
        }
    }
    let rows = looks.iter().enumerate().map(|(look, seeds)| {
        let mean = |of: &dyn Fn(&Judged) -> Option<f64>| {
            let values: Vec<f64> = seeds.iter().filter_map(of).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        Row {
            scene: scene.name.clone(),
            backend: backend.name().into(),
            setting: setting.name.clone(),
            passes: 1 << look,
            seconds: median(&seeds.iter().map(|look| look.seconds).collect::<Vec<_>>()),
            rel_mse: mean(&|look| Some(look.rel_mse)).unwrap_or(f64::NAN),
            rmse: mean(&|look| Some(look.rmse)).unwrap_or(f64::NAN),
            estimate: mean(&|look| look.estimate),
            coverage: mean(&|look| look.coverage),
            seeds: seeds.len() as u32,
            front: false,
        }
    });
    Ok(rows.collect())
}

/// How wrong a render is, and what it says of that itself.
fn judge(progressive: &mut Progressive, reference: &Image, seconds: f64) -> Result<Judged> {
    let image = progressive.image()?;
    let found = measure(&image, reference, &metrics::Settings::default())?;
    let estimate = progressive.estimate();
    let coverage = estimate.as_ref().map(|estimate| {
        let values = image.pixels.len() * 3;
        let within = (0..values).filter(|i| {
            let (pixel, channel) = (i / 3, i % 3);
            let wrong = (image.pixels[pixel][channel] - reference.pixels[pixel][channel]).abs();
            wrong <= bound_90(estimate, pixel, channel)
        });
        within.count() as f64 / values as f64
    });
    let estimate = estimate.map(|estimate| estimate.relative);
    Ok(Judged { seconds, rel_mse: found.rel_mse, rmse: found.rmse, estimate, coverage })
}

/// Marks the rows that no other row of their scene and backend beats in both time and error.
fn mark_fronts(rows: &mut [Row]) {
    for i in 0..rows.len() {
        let beaten = rows.iter().any(|other| {
            (&other.scene, &other.backend) == (&rows[i].scene, &rows[i].backend)
                && other.seconds <= rows[i].seconds
                && other.rel_mse <= rows[i].rel_mse
                && (other.seconds, other.rel_mse) != (rows[i].seconds, rows[i].rel_mse)
        });
        rows[i].front = !beaten;
    }
}

/// Scene, name, points of others' curves.
type Peers = Vec<(String, String, Vec<(f64, f64)>)>;

/// Curves of other renderers, from a CSV of `scene,name,seconds,rel_mse`.
fn peers(options: &Options) -> Result<Peers> {
    let mut peers: Peers = Vec::new();
    let Some(path) = &options.peers else { return Ok(peers) };
    let text = std::fs::read_to_string(path)
        .map_err(|error| Error::File { path: path.clone(), what: format!("cannot read it: {error}") })?;
    for (number, line) in text.lines().enumerate().skip(1).filter(|(_, line)| !line.trim().is_empty()) {
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        let refuse = || {
            Error::Usage(format!(
                "{}:{}: found '{line}', expected scene,name,seconds,rel_mse with numbers > 0",
                path.display(),
                number + 1
            ))
        };
        let [scene, name, seconds, error] = fields[..] else { return Err(refuse()) };
        let positive = |text: &str| text.parse::<f64>().ok().filter(|x| *x > 0.0 && x.is_finite());
        let (Some(seconds), Some(error)) = (positive(seconds), positive(error)) else { return Err(refuse()) };
        match peers.iter_mut().find(|(s, n, _)| (s.as_str(), n.as_str()) == (scene, name)) {
            Some((.., points)) => points.push((seconds, error)),
            None => peers.push((scene.into(), name.into(), vec![(seconds, error)])),
        }
    }
    Ok(peers)
}

/// The table, for people the error after set times, and a plot a scene and backend.
fn measured(plan: &Plan, rows: &[Row], peers: &Peers) -> Result<Measured> {
    let mut pairs: Vec<(&str, &str)> = Vec::new();
    for row in rows {
        if !pairs.contains(&(&row.scene, &row.backend)) {
            pairs.push((&row.scene, &row.backend));
        }
    }
    const TIMES: [f64; 6] = [0.05, 0.3, 1.0, 5.0, 10.0, 30.0];
    let mut columns: Vec<String> = ["scene", "backend", "setting"].map(String::from).to_vec();
    columns.extend(TIMES.iter().map(|time| format!("at {time} s")));
    columns.extend(["last s", "relMSE", "slope", "coverage"].map(String::from));
    let mut summary = Table::new(columns);
    let mut charts = Vec::new();
    for (scene, backend) in pairs {
        let own: Vec<&Row> =
            rows.iter().filter(|row| (row.scene.as_str(), row.backend.as_str()) == (scene, backend)).collect();
        let mut names: Vec<&str> = Vec::new();
        for row in &own {
            if !names.contains(&row.setting.as_str()) {
                names.push(&row.setting);
            }
        }
        let mut chart = Chart {
            title: format!("{scene} on {backend}: what a second buys"),
            x: "seconds".into(),
            y: "relMSE".into(),
            curves: Vec::new(),
        };
        for name in names {
            let points: Vec<&&Row> = own.iter().filter(|row| row.setting == name).collect();
            let mut cells: Vec<Value> = vec![scene.into(), backend.into(), name.into()];
            // The best that was there by then.
            cells.extend(TIMES.iter().map(|time| {
                let by_then = points.iter().filter(|row| row.seconds <= *time).map(|row| row.rel_mse);
                Value::from(by_then.reduce(f64::min))
            }));
            let last = points.last().expect("a setting has rows");
            let coverage = last.coverage;
            cells.extend([last.seconds.into(), last.rel_mse.into(), slope(&points).into(), coverage.into()]);
            summary.push(cells);
            chart.curves.push(Curve {
                name: name.into(),
                points: points.iter().map(|row| (row.seconds, row.rel_mse)).collect(),
                marked: None,
                look: Look::default(),
            });
        }
        let mut front: Vec<(f64, f64)> =
            own.iter().filter(|row| row.front).map(|row| (row.seconds, row.rel_mse)).collect();
        front.sort_by(|a, b| a.0.total_cmp(&b.0));
        let look = Look { color: Some(Look::DARK_GREY), dash: 6 };
        chart.curves.push(Curve { name: "front".into(), points: front, marked: None, look });
        for (_, name, points) in peers.iter().filter(|(of, ..)| of == scene) {
            let look = Look { color: Some(Look::GREY), dash: 3 };
            chart.curves.push(Curve { name: name.clone(), points: points.clone(), marked: None, look });
        }
        charts.push((format!("error-{scene}-{backend}"), chart));
    }
    Ok(Measured {
        settings: saved::settings(plan)?,
        rows: saved::table(rows, &COLUMNS)?,
        summaries: vec![summary],
        charts,
        ended: None,
    })
}

/// Of log relMSE over log passes, by least squares.
fn slope(points: &[&&Row]) -> Option<f64> {
    let logs: Vec<(f64, f64)> = points.iter().map(|row| ((row.passes as f64).ln(), row.rel_mse.ln())).collect();
    let count = logs.len() as f64;
    let (x, y) = logs.iter().fold((0.0, 0.0), |sum, (x, y)| (sum.0 + x / count, sum.1 + y / count));
    let (xx, xy) = logs.iter().fold((0.0, 0.0), |sum, (a, b)| (sum.0 + (a - x).powi(2), sum.1 + (a - x) * (b - y)));
    (logs.len() > 2).then(|| xy / xx)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(seconds: f64, rel_mse: f64) -> Row {
        let text = String::new;
        let (passes, rmse, estimate, coverage, seeds, front) = (seconds as u64, 0.0, None, None, 1, false);
        Row {
            scene: text(),
            backend: text(),
            setting: text(),
            passes,
            seconds,
            rel_mse,
            rmse,
            estimate,
            coverage,
            seeds,
            front,
        }
    }

    #[test]
    fn the_front_is_what_nothing_beats() {
        let mut rows = vec![row(1.0, 0.1), row(2.0, 0.2), row(2.0, 0.05), row(4.0, 0.05), row(8.0, 0.01)];
        mark_fronts(&mut rows);
        assert_eq!(rows.iter().map(|row| row.front).collect::<Vec<_>>(), [true, false, true, false, true]);
    }

    #[test]
    fn the_slope_of_a_power_law_is_its_power() {
        let rows: Vec<Row> = (0..6).map(|i| row(f64::from(1 << i), 0.3 * f64::from(1 << i).powf(-2.0 / 3.0))).collect();
        let points: Vec<&Row> = rows.iter().collect();
        let points: Vec<&&Row> = points.iter().collect();
        assert!((slope(&points).unwrap() + 2.0 / 3.0).abs() < 1e-9);
        assert!(slope(&points[..2]).is_none());
    }
}
