//! A picture whose photons do not fit into a device's memory: the same number of paths in batches, one map after the
//! other, and the mean of their pictures. The radius stays the one of all paths together.

use super::notice;
use crate::error::{Error, Result};
use crate::film::Image;
use crate::pipeline::{Pipeline, Rendering, Times};
use crate::scene::Scene;
use crate::settings::{Amount, Method, Pass, Settings, Technique};
use crate::stage::map::MapCounts;

/// Most batches that are tried: a device that has no room for a 64th of the photons has none for the picture.
const MOST: u32 = 64;

/// Renders a picture in as few batches as the device's memory asks for, mostly one.
///
/// # Errors
/// As [`Pipeline::render`]; [`Error::Memory`] where smaller batches do not help.
pub fn render(pipeline: &mut Pipeline, scene: &Scene, settings: &Settings) -> Result<Rendering> {
    let mut batches = 1;
    loop {
        let result = match batches {
            1 => pipeline.render(scene, settings),
            _ => in_batches(pipeline, scene, settings, batches),
        };
        match result {
            Err(Error::Memory(what)) if batches < MOST && may_be_cut(settings, 2 * batches) => {
                batches *= 2;
                notice(&format!("{what}; trying {batches} batches of photons, one after the other"));
            }
            result => return result,
        }
    }
}

/// Whether the mean of several maps' pictures is a picture of them all: not where the k nearest are sought.
fn may_be_cut(settings: &Settings, batches: u32) -> bool {
    let many = matches!(settings.photons.amount, Amount::Paths(paths) if paths / batches >= 1);
    many && settings.gather.method != Method::Knn && settings.technique == Technique::Map
}

fn in_batches(pipeline: &mut Pipeline, scene: &Scene, settings: &Settings, batches: u32) -> Result<Rendering> {
    let Amount::Paths(paths) = settings.photons.amount else { return pipeline.render(scene, settings) };
    let mut settings = settings.clone();
    let wanted = settings.gather.radius;
    let mut sums: Vec<[f64; 3]> = Vec::new();
    let (mut times, mut counts) = (Times::default(), MapCounts::default());
    let mut last = None;
    for batch in 0..batches {
        // Sizes that differ by one path at most.
        let share = |batch: u32| (u64::from(paths) * u64::from(batch) / u64::from(batches)) as u32;
        let own = share(batch + 1) - share(batch);
        settings.photons.amount = Amount::Paths(own);
        let pass = Pass { index: batch, ..Pass::single(&settings) };
        let mut rendering = pipeline.render_pass(scene, &settings, &pass)?;
        if let (0, None, Some(radius)) = (batch, wanted, rendering.radius) {
            // A chosen radius falls as n^(−1/6) (`radius.rs`), and n is that of all batches.
            settings.gather.radius = Some(radius * (batches as f32).powf(-1.0 / 6.0));
            times.add(&rendering.times);
            rendering = pipeline.render_pass(scene, &settings, &pass)?;
        }
        times.add(&rendering.times);
        let photons = rendering.photons.unwrap_or_default();
        (counts.emitted, counts.stored) = (counts.emitted + photons.emitted, counts.stored + photons.stored);
        sums.resize(rendering.image.pixels.len(), [0.0; 3]);
        let weight = f64::from(own) / f64::from(paths);
        for (sum, pixel) in sums.iter_mut().zip(&rendering.image.pixels) {
            *sum = [0, 1, 2].map(|channel| sum[channel] + weight * f64::from(pixel[channel]));
        }
        last = Some(rendering);
    }
    let Some(last) = last else { return pipeline.render(scene, &settings) };
    let pixels = sums.into_iter().map(|sum| sum.map(|value| value as f32)).collect();
    let image = Image::from_pixels(last.image.width, last.image.height, pixels)?;
    Ok(Rendering { image, times, photons: last.photons.map(|_| counts), ..last })
}
