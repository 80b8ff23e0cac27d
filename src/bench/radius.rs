//! Radius: error against a reference by gather radius, around the radius that is chosen when the user names none.

use super::plot::{Chart, Curve, Look};
use super::reference::reference;
use super::table::{Table, Value};
use super::{Measured, Options, Progress, Steps, or_end};
use crate::error::{Error, Result};
use crate::film::Image;
use crate::film::metrics::{self, measure};
use crate::pipeline::Pipeline;
use crate::scene::Scene;
use crate::settings::{Amount, Settings};

/// Multiples of the chosen radius; 1 is the chosen one itself.
const FACTORS: [f32; 11] = [0.25, 0.35, 0.5, 0.6, 0.7, 0.85, 1.0, 1.2, 1.4, 2.0, 2.8];
const QUICK_FACTORS: [f32; 3] = [0.5, 1.0, 2.0];

/// The numbers of a run.
#[derive(serde::Serialize)]
struct Plan {
    paths: Vec<u32>,
    factors: Vec<f32>,
    seeds: u32,
    samples: u32,
    backend: &'static str,
}

/// Error at one radius.
struct Point {
    factor: f32,
    radius: f32,
    rmse: f64,
    rel_mse: f64,
}

/// See [`super::Suite::Radius`].
pub fn run(options: &Options, progress: &mut dyn FnMut(Progress)) -> Result<Measured> {
    let references = options.scenes.iter().map(|scene| reference(options, scene)).collect::<Result<Vec<Image>>>()?;
    let mut plan = Plan {
        paths: options.list(&options.photons, &[200_000, 20_000], &[5_000]),
        factors: if options.quick { QUICK_FACTORS.to_vec() } else { FACTORS.to_vec() },
        seeds: options.or(options.seeds, 2, 1),
        // Edges of shapes differ from the reference by their sampling alone: at one sample that would hide all else.
        samples: if options.quick { 4 } else { 16 },
        backend: "",
    };
    let curves = options.scenes.len() * plan.paths.len();
    let mut steps = Steps::new(progress, curves * plan.factors.len() * plan.seeds as usize);
    let mut pipeline = open(options, &mut steps)?;
    plan.backend = pipeline.backend.name();

    let mut rows = Table::new(["scene", "paths", "factor", "radius_m", "rmse", "rel_mse", "is_auto", "is_best"]);
    let mut columns = vec!["scene".to_string(), "paths".into(), "auto R".into(), "best R".into(), "auto/best".into()];
    columns.extend(plan.factors.iter().map(|factor| format!("x{factor}")));
    let mut summary = Table::new(columns);
    let mut chart = Chart {
        title: format!(
            "Error by gather radius, {} samples a pixel; rings: the radius chosen without --radius",
            plan.samples
        ),
        x: "radius / chosen radius".into(),
        y: "RMSE, radiance".into(),
        curves: Vec::new(),
    };
    let mut ended = None;
    'all: for (scene, reference) in options.scenes.iter().zip(&references) {
        for paths in &plan.paths {
            if options.is_stopped() {
                break 'all;
            }
            let points = curve(&mut pipeline, scene, reference, *paths, &plan, &mut steps);
            let Some(points) = or_end(points, !rows.is_empty(), &mut ended)? else { break 'all };
            let best = points.iter().min_by(|a, b| a.rmse.total_cmp(&b.rmse)).expect("there are factors");
            let auto = points.iter().find(|p| p.factor == 1.0).expect("1 is among the factors");
            chart.curves.push(Curve {
                name: format!("{}, {paths} paths", scene.name),
                points: points.iter().map(|p| (p.factor.into(), p.rmse)).collect(),
                marked: points.iter().position(|p| p.factor == 1.0),
                look: Look::default(),
            });
            let mut row: Vec<Value> = vec![scene.name.as_str().into(), (*paths).into()];
            row.extend([auto.radius.into(), best.radius.into(), (auto.rmse / best.rmse).into()]);
            row.extend(points.iter().map(|p| Value::from(p.rmse)));
            summary.push(row);
            for p in &points {
                rows.push([
                    scene.name.as_str().into(),
                    (*paths).into(),
                    p.factor.into(),
                    p.radius.into(),
                    p.rmse.into(),
                    p.rel_mse.into(),
                    (p.factor == 1.0).into(),
                    (p.factor == best.factor).into(),
                ]);
            }
        }
    }
    let settings = serde_json::to_value(&plan).map_err(|e| Error::Failed(format!("JSON: {e}")))?;
    Ok(Measured { settings, rows, summaries: vec![summary], charts: vec![("radius".into(), chart)], ended })
}

/// The first backend that is there, of those wanted.
fn open(options: &Options, steps: &mut Steps) -> Result<Pipeline> {
    let mut why = Error::Usage("no backend is asked for".into());
    for backend in &options.backends {
        match Pipeline::open(&options.machine(Some(*backend)), |line| steps.notice(line)) {
            Ok(pipeline) => return Ok(pipeline),
            Err(error) => {
                steps.notice(&format!("{} passed over: {error}", backend.name()));
                why = error;
            }
        }
    }
    Err(why)
}

/// Errors over the factors, averaged over the seeds.
fn curve(
    pipeline: &mut Pipeline,
    scene: &Scene,
    reference: &Image,
    paths: u32,
    plan: &Plan,
    steps: &mut Steps,
) -> Result<Vec<Point>> {
    let mut settings =
        Settings { width: reference.width, height: reference.height, samples: plan.samples, ..Settings::default() };
    settings.photons.amount = Amount::Paths(paths);
    let chosen = pipeline.render(scene, &settings)?.radius;
    let chosen = chosen.ok_or_else(|| Error::Usage(format!("{}: nothing that photons could light", scene.name)))?;

    let point = |factor: &f32| Point { factor: *factor, radius: chosen * factor, rmse: 0.0, rel_mse: 0.0 };
    let mut points: Vec<Point> = plan.factors.iter().map(point).collect();
    // A seed's photons serve all radii.
    for seed in 0..plan.seeds {
        for point in &mut points {
            steps.begin(&format!("{}: {paths} paths, seed {seed}, R={:.3}", scene.name, point.radius));
            settings.seed = seed;
            settings.gather.radius = Some(point.radius);
            let found = measure(&pipeline.render(scene, &settings)?.image, reference, &metrics::Settings::default())?;
            point.rmse += found.rmse * found.rmse / f64::from(plan.seeds);
            point.rel_mse += found.rel_mse / f64::from(plan.seeds);
        }
    }
    points.iter_mut().for_each(|point| point.rmse = point.rmse.sqrt());
    Ok(points)
}
