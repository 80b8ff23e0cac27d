//! Choice: the automatic choice between grid, tiles and tiled grid against what each of them really takes.

use std::time::Instant;

use super::table::{Table, Value};
use super::timing::{Samples, median};
use super::{Measured, Options, Progress, Steps};
use crate::choice::{self, Estimate, TERMS};
use crate::error::{Error, Result};
use crate::pipeline::Pipeline;
use crate::scene::Scene;
use crate::settings::{Amount, Gather, LightMode, Method, Settings};

/// What a choice may cost beyond the best one to be a good one.
const GOOD: f64 = 1.15;

/// The numbers of a run.
#[derive(serde::Serialize)]
struct Plan {
    sizes: Vec<[u32; 2]>,
    stored: Vec<u32>,
    /// Gather radii in metres; 0 is the automatic one.
    radii: Vec<f32>,
    rounds: u32,
    threads: usize,
}

/// Something that could be chosen, and what it takes.
struct Rival {
    estimate: Estimate,
    ms: f64,
}

impl Rival {
    fn name(&self) -> String {
        let size = self.estimate.tile.map(|[w, h]| format!(" {w}x{h}")).unwrap_or_default();
        self.estimate.method.name().to_string() + &size
    }
}

/// See [`super::Suite::Choice`].
pub fn run(options: &Options, progress: &mut dyn FnMut(Progress)) -> Result<Measured> {
    let sizes = match options.size {
        Some((width, height)) => vec![[width, height]],
        None if options.quick => vec![[64, 48]],
        None => vec![[160, 160], [640, 480]],
    };
    let plan = Plan {
        sizes,
        stored: options.list(&options.photons, &[12_000, 200_000], &[3000]),
        radii: options.list(&options.radii, &[0.0, 1.0, 0.2], &[0.0]),
        rounds: options.or(options.repeat, 2, 1),
        threads: options.threads,
    };
    let settings = plan.sizes.len() * plan.stored.len() * plan.radii.len();
    let mut steps = Steps::new(progress, options.backends.len() * options.scenes.len() * settings);
    let mut columns =
        ["class", "scene", "size", "photons", "radius_m", "gather", "ms", "predicted_ms"].map(String::from).to_vec();
    columns.extend(TERMS.map(String::from));
    let mut rows = Table::new(columns);
    let mut verdicts =
        Table::new(["class", "scene", "size", "photons", "R", "chosen", "ms", "best", "best ms", "chosen/best"]);
    let mut shares = Table::new(["class", "settings", "within 15%", "worst", "mean", "choosing, ms"]);
    let mut costs = Table::new(["class", "term", "ns"]);
    for backend in &options.backends {
        let mut pipeline = match Pipeline::open(&options.machine(Some(*backend)), |line| steps.notice(line)) {
            Ok(pipeline) => pipeline,
            Err(error) => {
                steps.notice(&format!("{} not measured: {error}", backend.name()));
                continue;
            }
        };
        let class = pipeline.class();
        let [mut ratios, mut choosing] = [Vec::new(), Vec::new()];
        let mut measured = Vec::new();
        for (scene, size, stored, radius) in settings_of(options, &plan) {
            steps.begin(&format!(
                "{}: {}x{}, {stored} photons, R={radius}, {}",
                scene.name,
                size[0],
                size[1],
                class.name()
            ));
            let (radius, rivals, ms) = compare(&mut pipeline, scene, size, stored, radius, plan.rounds)?;
            choosing.push(ms);
            let setting: [Value; 5] = [
                class.name().into(),
                scene.name.as_str().into(),
                format!("{}x{}", size[0], size[1]).as_str().into(),
                stored.into(),
                radius.into(),
            ];
            for rival in &rivals {
                let mut row = setting.to_vec();
                row.extend([rival.name().as_str().into(), rival.ms.into(), rival.estimate.cost.into()]);
                row.extend(rival.estimate.counts.map(Value::from));
                rows.push(row);
                measured.push((rival.estimate.counts, rival.ms));
            }
            // The first is the one that would be chosen.
            let Some((chosen, best)) = rivals.first().zip(rivals.iter().min_by(|a, b| a.ms.total_cmp(&b.ms))) else {
                continue;
            };
            ratios.push(chosen.ms / best.ms);
            let mut row = setting.to_vec();
            row.extend([chosen.name().as_str().into(), chosen.ms.into()]);
            row.extend([best.name().as_str().into(), best.ms.into(), (chosen.ms / best.ms).into()]);
            verdicts.push(row);
        }
        let good = ratios.iter().filter(|ratio| **ratio <= GOOD).count() as u64;
        let worst = ratios.iter().copied().fold(0.0, f64::max);
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        let ms = median(&choosing);
        shares.push([
            class.name().into(),
            (ratios.len() as u64).into(),
            good.into(),
            worst.into(),
            mean.into(),
            ms.into(),
        ]);
        for (term, ns) in TERMS.iter().zip(choice::fit(&measured)) {
            costs.push([class.name().into(), (*term).into(), ns.into()]);
        }
    }
    if rows.is_empty() {
        return Err(Error::Driver("none of the backends is there: nothing was measured".into()));
    }
    let settings = serde_json::to_value(&plan).map_err(|e| Error::Failed(format!("JSON: {e}")))?;
    Ok(Measured { settings, rows, summaries: vec![verdicts, costs, shares], charts: Vec::new() })
}

fn settings_of<'a>(options: &'a Options, plan: &'a Plan) -> impl Iterator<Item = (&'a Scene, [u32; 2], u32, f32)> {
    options.scenes.iter().flat_map(move |scene| {
        plan.stored.iter().flat_map(move |stored| {
            let sizes = move |radius: &f32| {
                plan.sizes.iter().map(move |size| (scene, *size, *stored, *radius)).collect::<Vec<_>>()
            };
            plan.radii.iter().flat_map(sizes)
        })
    })
}

/// The radius; all that could be chosen, what would be chosen first; the milliseconds that choosing took. All light by photons: as many as are asked for
/// in open scenes too.
fn compare(
    pipeline: &mut Pipeline,
    scene: &Scene,
    [width, height]: [u32; 2],
    stored: u32,
    radius: f32,
    rounds: u32,
) -> Result<(f32, Vec<Rival>, f64)> {
    let default = Settings { width, height, light: LightMode::Photons, ..Settings::default() };
    let mut settings =
        Settings { gather: Gather { radius: (radius > 0.0).then_some(radius), ..default.gather }, ..default };
    settings.photons.amount = Amount::Stored(stored);
    // Tiles leave photons as they were stored: from these the choice is made.
    settings.gather.method = Method::Tiles;
    let radius = pipeline.render(scene, &settings)?.radius.unwrap_or(radius);
    let start = Instant::now();
    let estimates = pipeline.estimates()?;
    let choosing = start.elapsed().as_secs_f64() * 1e3;
    let mut rivals = Vec::new();
    for estimate in estimates {
        settings.gather.method = estimate.method;
        settings.gather.tile = estimate.tile;
        let mut samples = Samples::default();
        for round in 0..=rounds {
            // Another radius makes another grid and other tiles of the same photons; a thousandth changes nothing else.
            settings.gather.radius = Some(radius * (1.0 + 1e-3 * round as f32));
            let times = match pipeline.render(scene, &settings) {
                Ok(rendering) => rendering.times,
                // Lists that are too long for floats cannot be chosen, and are not.
                Err(Error::Usage(_)) => break,
                Err(error) => return Err(error),
            };
            let ms = times.grid + times.tiles + times.upload + times.trace;
            samples.ms.push(ms);
            if ms > 2000.0 && round > 0 {
                break;
            }
        }
        // What a quiet machine would show: others' work must not decide what is best.
        if !samples.ms.is_empty() {
            rivals.push(Rival { estimate, ms: samples.least() });
        }
    }
    Ok((radius, rivals, choosing))
}
