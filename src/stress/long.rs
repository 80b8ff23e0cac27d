//! Suite: long runs. Ten thousand passes and more are summed up where renders and windows sum them, and held against
//! compensated sums in double precision; and a pass is the same picture whenever it is rendered.

use super::{Bench, Fault, Found, Row, Spread, Suite};
use crate::bench::scenes::built_in;
use crate::device::gl::Mean;
use crate::error::{Error, Result};
use crate::film::{Accumulator, Image};
use crate::pipeline::progressive::Progressive;
use crate::rays::random::{hash2_u, unit_real};
use crate::scene::Scene;
use crate::settings::{Amount, Backend, FinalGather, Settings, Technique};

/// A sum that loses nothing worth mentioning (Neumaier 1974).
#[derive(Clone, Copy, Default)]
struct Exact {
    sum: f64,
    lost: f64,
}

impl Exact {
    fn add(&mut self, value: f64) {
        let sum = self.sum + value;
        self.lost += if self.sum.abs() >= value.abs() { (self.sum - sum) + value } else { (value - sum) + self.sum };
        self.sum = sum;
    }

    fn mean(&self, count: usize) -> f64 {
        (self.sum + self.lost) / count as f64
    }
}

/// Means of pictures, channel by channel.
fn exact_means(pictures: &[Image]) -> Vec<f64> {
    let channels = pictures.first().map_or(0, |picture| 3 * picture.pixels.len());
    let mut sums = vec![Exact::default(); channels];
    for picture in pictures {
        for (sum, value) in sums.iter_mut().zip(picture.pixels.iter().flatten()) {
            sum.add(f64::from(*value));
        }
    }
    sums.iter().map(|sum| sum.mean(pictures.len())).collect()
}

/// Relative errors; of what is black, anything but black is infinitely wrong.
fn errors(found: &Image, expected: &[f64]) -> Vec<f64> {
    let error = |(found, expected): (&f32, &f64)| {
        let error = (f64::from(*found) - expected).abs();
        if error == 0.0 { 0.0 } else { error / expected.abs() }
    };
    found.pixels.iter().flatten().zip(expected).map(error).collect()
}

/// Half an ulp of float32, in which pictures are handed out.
const ROUNDED: f64 = 6.1e-8;

/// Of double precision's own sums: 10⁷ roundings of 10⁻¹⁶, if all went one way.
const DOUBLE: f64 = 1.2e-9;

/// The window keeps its mean in float32: each pass rounds it by half an ulp, and what was rounded n passes ago weighs as
/// little as what was seen then. At random that is √(n/3)/2 ulps, 3.4e-6 after 10⁴ passes; three times as much is far
/// below a step of the screen, 4e-3.
const WINDOW: f64 = 1e-5;

pub(super) fn run(bench: &mut Bench) -> Result<Found> {
    let mut found = Found::default();
    found.rows.push(film(bench)?);
    found.rows.extend(window(bench)?);
    let scene = match built_in("gi_ref") {
        Some(scene) => scene?,
        None => return Err(Error::Failed("no scene named gi_ref".into())),
    };
    for backend in bench.backends() {
        let gather = FinalGather { rays: 4, spacing: 2, texels: 1 << 10, ..FinalGather::default() };
        for (name, technique, share) in
            [("map", Technique::Map, 1), ("final gathering", Technique::FinalGather(gather), 10)]
        {
            found.rows.extend(passes(bench, &scene, backend, name, technique, share)?);
        }
    }
    Ok(found)
}

/// The render's accumulator, fed with contributions between 10⁻³ and 10³.
fn film(bench: &mut Bench) -> Result<Row> {
    let count = bench.options.by_size(100_000, 1_000_000, 10_000_000u32);
    bench.step("long: sums of the film")?;
    let mut film = Accumulator::new((1, 1), 0);
    let (mut exact, mut single) = (Exact::default(), 0.0f32);
    for number in 0..count {
        let value = 10f64.powf(6.0 * f64::from(unit_real(hash2_u(number, 11))) - 3.0);
        film.add([value; 3]);
        exact.add(value);
        single += value as f32;
    }
    let mut mean = film.mean().map_or(f64::NAN, |mean| mean[0].x);
    if bench.options.fault == Some(Fault::SingleSums) {
        mean = f64::from(single) / f64::from(count);
    }
    let expected = exact.mean(count as usize);
    let case = format!("film: {count} contributions from 1e-3 to 1e3");
    Ok(Row::new(Suite::Long, case, Backend::Cpu, MEAN, Spread::one((mean - expected).abs() / expected), DOUBLE))
}

const MEAN: &str = "error of the mean, relative";

/// The window's running mean, which OpenGL keeps: constant and mixed contributions.
fn window(bench: &mut Bench) -> Result<Option<Row>> {
    let passes = bench.options.by_size(300, 3_000, 10_000usize);
    let Some(gl) = bench.lab.gl() else { return Ok(None) };
    gl.make_current()?;
    let mut mean = Mean::new(&gl.gl)?;
    let picture = |pass: usize| {
        Image::from_fn(16, 8, |x, y| {
            let pixel = y * 16 + x;
            let value = |channel: u32| match pixel {
                // What stays as it is must not drift.
                0..64 => 10f32.powf((pixel as f32 + 0.7) / 10.0 - 3.0),
                _ => 10f32.powf(3.0 * unit_real(hash2_u(pass as u32, 3 * pixel + channel)) - 1.5),
            };
            [0, 1, 2].map(value)
        })
    };
    let pictures: Vec<Image> = (0..passes).map(picture).collect();
    for picture in &pictures {
        mean.add_image(picture)?;
    }
    let errors = errors(&mean.read()?, &exact_means(&pictures));
    bench.step("long: the window's mean")?;
    let case = format!("window: {passes} passes, constant and from 0.03 to 30");
    Ok(Some(Row::new(Suite::Long, case, Backend::OpenGl, MEAN, Spread::of(&errors), WINDOW)))
}

/// Passes of a small picture: their mean, and some of them once more, later and alone.
fn passes(
    bench: &mut Bench,
    scene: &Scene,
    backend: Backend,
    name: &str,
    technique: Technique,
    share: usize,
) -> Result<Vec<Row>> {
    let count = bench.options.by_size(40, 400, 10_000usize) / share;
    bench.step(&format!("long: {count} passes of {name}, {}", backend.name()))?;
    let mut settings = Settings { width: 8, height: 6, technique, ..Settings::default() };
    settings.photons.amount = Amount::Paths(200);
    settings.gather.radius = Some(1.0);
    let mut pipeline = bench.pipeline(backend)?;
    let mut run = Progressive::new(scene, &settings)?;
    let kept = [0, 1, count / 2, count - 2];
    let mut states = Vec::new();
    let mut pictures = Vec::with_capacity(count);
    for pass in 0..count {
        if kept.contains(&pass) {
            states.push((pass, run.sums().clone()));
        }
        pictures.push(run.step(&mut pipeline, scene)?.image);
    }
    let errors = errors(&run.image()?, &exact_means(&pictures));

    // Later, on another pipeline, the last one first.
    let mut pipeline = bench.pipeline(backend)?;
    let (mut differ, mut pixels) = (0, 0);
    for (pass, sums) in states.into_iter().rev() {
        let again = Progressive::resume(scene, &settings, sums)?.step(&mut pipeline, scene)?.image;
        let shifted = usize::from(bench.options.fault == Some(Fault::ShiftedPass));
        let bits = |image: &Image| image.pixels.iter().map(|p| p.map(f32::to_bits)).collect::<Vec<_>>();
        let pairs = bits(&again).into_iter().zip(bits(&pictures[pass + shifted]));
        differ += pairs.filter(|(a, b)| a != b).count() as u64;
        pixels += again.pixels.len() as u64;
    }
    let row = |measure, spread, bound| {
        Row::new(Suite::Long, format!("{count} passes, {name}"), backend, measure, spread, bound)
    };
    Ok(vec![
        row(MEAN, Spread::of(&errors), ROUNDED),
        row("pixels that differ when rendered later", Spread::events(differ, pixels), 0.0),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compensated_sums_keep_what_plain_ones_lose() {
        let mut exact = Exact::default();
        for value in [1e16, 1.0, 1.0, -1e16] {
            exact.add(value);
        }
        assert_eq!(exact.mean(2), 1.0);
        assert_eq!(1e16 + 1.0 + 1.0 - 1e16, 0.0);
    }

    #[test]
    fn nothing_but_black_is_right_for_black() {
        let image = Image::from_fn(1, 1, |_, _| [0.0, 1e-30, 2.0]);
        assert_eq!(errors(&image, &[0.0, 0.0, 1.0]), [0.0, f64::INFINITY, 1.0]);
    }
}
