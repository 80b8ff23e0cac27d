//! Suite: random numbers. The same integers on every machine, at the counters' limits too; never 1; spread evenly;
//! without correlation between neighbouring paths, bounces, passes and dimensions.

use glam::Vec3;
use rayon::prelude::*;

use super::lab::{Answer, Task};
use super::{Bench, Fault, Found, Row, Spread, Suite};
use crate::cpu::photons::stream_of;
use crate::error::Result;
use crate::packing::Packed;
use crate::rays::random::{R4_STEPS, hash_u, hash2_u, owen_scramble, sequence_u, sobol_second, unit_real};
use crate::rays::walk::{number_u, sample_sphere};
use crate::settings::Backend;

/// What the twins make of two counters.
fn twin((first, second): (u32, u32), fault: Option<Fault>) -> Answer {
    let turned = sample_sphere(first, second).to_array().map(f32::to_bits);
    let real = match fault {
        // All 32 bits: the last 128 integers round to 1.
        Some(Fault::RoundedUp) => first as f32 * (1.0 / 4_294_967_296.0),
        _ => unit_real(first),
    };
    [
        hash2_u(first, second),
        real.to_bits(),
        owen_scramble(sobol_second(first), second),
        sequence_u(first, R4_STEPS[0], second),
        turned[0],
        turned[1],
        turned[2],
        first.reverse_bits(),
    ]
}

/// Counters at their limits with each other, then some that a hash scatters.
fn counters(count: u32) -> Vec<(u32, u32)> {
    let limits: Vec<u32> = (0..32)
        .flat_map(|bit| [1u32 << bit, (1u32 << bit).wrapping_sub(1), !(1u32 << bit)])
        .chain([0, 1, u32::MAX, u32::MAX - 1, 0xffff_ff00, 0xffff_ff7f, 0xffff_ff80])
        .collect();
    let pairs = limits.iter().flat_map(|a| limits.iter().map(|b| (*a, *b)));
    pairs.chain((0..count).map(|i| (hash_u(i), hash2_u(i, 17)))).collect()
}

pub(super) fn run(bench: &mut Bench) -> Result<Found> {
    let fault = bench.options.fault;
    let mut found = Found::default();
    let counters = counters(bench.options.by_size(20_000, 200_000, 2_000_000));
    let split = |u: u32| [(u & 0xffff) as f32, (u >> 16) as f32, 0.0];
    let cases: Vec<[f32; 3]> = counters.iter().flat_map(|(a, b)| [split(*a), split(*b)]).collect();
    let expected: Vec<Answer> = counters.par_iter().map(|pair| twin(*pair, None)).collect();
    let packed = Packed::default();
    for backend in bench.backends() {
        bench.step(&format!("random: counters, {}", backend.name()))?;
        let answers = match backend {
            Backend::Cpu => bench.pool.install(|| counters.par_iter().map(|pair| twin(*pair, fault)).collect()),
            _ => {
                let body = "STRESS_RANDOM";
                let task = Task {
                    body,
                    packed: &packed,
                    alone: true,
                    in_uniforms: false,
                    two_sided: false,
                    defines: &[],
                    contracted: false,
                    cases: &cases,
                    batch: 1 << 20,
                    fault,
                };
                bench.lab.ask(backend, &task, 0..counters.len())?
            }
        };
        let integers = |a: &Answer| [a[0], a[1], a[2], a[3], a[7]];
        let differ = answers.iter().zip(&expected).filter(|(a, b)| integers(a) != integers(b)).count();
        let ones = answers.iter().filter(|a| !(0.0..1.0).contains(&f32::from_bits(a[1]))).count();
        let lengths: Vec<f64> = answers.iter().map(off_unit).collect();
        let cases = answers.len() as u64;
        for (measure, spread, bound) in [
            ("counters whose integers differ from the CPU's", Spread::events(differ as u64, cases), 0.0),
            ("numbers outside [0, 1)", Spread::events(ones as u64, cases), 0.0),
            // Polynomials to 1e-8, two products, a root: the length is off by three ulps at most.
            ("length of directions − 1, ulp", Spread::of(&lengths), 4.0),
        ] {
            found.rows.push(Row::new(Suite::Random, "counters at limits", backend, measure, spread, bound));
        }
    }
    bench.step("random: statistics")?;
    found.rows.extend(statistics(bench));
    Ok(found)
}

/// By how many ulps a direction's length is not 1.
fn off_unit(answer: &Answer) -> f64 {
    let [x, y, z] = [answer[4], answer[5], answer[6]].map(f32::from_bits);
    (Vec3::new(x, y, z).as_dvec3().length() - 1.0).abs() / f64::from(f32::EPSILON)
}

/// The very numbers that walks draw, by path, bounce, dimension and pass; the machines' integers are these.
fn number(pass: u32, path: u32, bounce: u32, dimension: u32) -> f64 {
    let mut key = hash_u(path ^ stream_of(3, pass));
    for _ in 0..bounce {
        key = hash_u(key);
    }
    f64::from(unit_real(number_u(key, dimension)))
}

fn statistics(bench: &Bench) -> Vec<Row> {
    let paths = bench.options.by_size(1 << 14, 1 << 18, 1 << 21u32);
    let correlated = bench.options.fault == Some(Fault::SharedNumbers);
    let draws = |pass: u32, bounce: u32, dimension: u32, step: u32| {
        move |path: u32| number(pass, path.wrapping_add(step), bounce, dimension)
    };
    let mut evenness = Vec::new();
    let mut correlation = Vec::new();
    // Passes and bounces far on, and the last paths that there are, are as good as the first.
    for (pass, bounce, step) in [(0, 0, 0), (0, 1, 0), (0, 7, 0), (u32::MAX, 0, 0), (1, 31, 0u32.wrapping_sub(paths))] {
        for dimension in 0..8 {
            let base = draws(pass, bounce, dimension, step);
            evenness.push(chi_square(bench, paths, base));
            // Paths 1, 2, 2⁸ and 2¹⁶ apart; passes and bounces 1 and some apart; every other dimension.
            let paths_apart = [0, 1, 8, 16].map(|log2| draws(pass, bounce, dimension, step.wrapping_add(1 << log2)));
            let passes_apart = [1, 1000].map(|apart| draws(pass.wrapping_add(apart), bounce, dimension, step));
            let bounces_apart = [1, 5].map(|apart| draws(pass, bounce + apart, dimension, step));
            let others =
                (dimension + 1..8).map(|other| draws(pass, bounce, if correlated { dimension } else { other }, step));
            for other in paths_apart.into_iter().chain(passes_apart).chain(bounces_apart).chain(others) {
                correlation.push(correlate(bench, paths, base, other));
            }
        }
    }
    let row = |measure, values: &[f64], bound| {
        let case = format!("{paths} paths, 8 dimensions, 5 passes and bounces");
        Row::new(Suite::Random, case, Backend::Cpu, measure, Spread::of(values), bound)
    };
    vec![
        // Normal deviates: of 40 and 460 of them one beyond 5 comes once in 3,500 sets.
        row("evenness over 256 bins, standard deviations", &evenness, 5.0),
        // Of random numbers one of 9,000 boxes lies beyond 3.7; a sequence must stay well below.
        row("evenness of the sequence over 16 × 16, standard deviations", &sequence(bench, paths), 2.0),
        row("correlation of paths, passes, bounces, dimensions, standard deviations", &correlation, 5.0),
    ]
}

/// χ² of a histogram, as a normal deviate (Wilson & Hilferty 1931); both too even and too uneven count.
fn chi_square(bench: &Bench, paths: u32, draw: impl Fn(u32) -> f64 + Sync) -> f64 {
    const BINS: usize = 256;
    let fold = |mut bins: [u64; BINS], path: u32| {
        bins[(draw(path) * BINS as f64) as usize] += 1;
        bins
    };
    let sum = |a: [u64; BINS], b: [u64; BINS]| std::array::from_fn(|i| a[i] + b[i]);
    let bins = bench.pool.install(|| (0..paths).into_par_iter().fold(|| [0; BINS], fold).reduce(|| [0; BINS], sum));
    let expected = f64::from(paths) / BINS as f64;
    let chi2: f64 = bins.iter().map(|n| (*n as f64 - expected).powi(2) / expected).sum();
    let degrees = (BINS - 1) as f64;
    let spread = 2.0 / (9.0 * degrees);
    (((chi2 / degrees).cbrt() - (1.0 - spread)) / spread.sqrt()).abs()
}

/// The largest miscounts of emission's sequence over a square of boxes, for each two of its dimensions.
fn sequence(bench: &Bench, paths: u32) -> Vec<f64> {
    let pairs = (0..4).flat_map(|a| (a + 1..4).map(move |b| (a, b)));
    // From the first path on, with another shift, and across the counter's end.
    let starts = [(0, 0), (0, hash_u(17)), (0u32.wrapping_sub(paths / 2), 0)];
    let miscount = |((a, b), (start, shift)): ((usize, usize), (u32, u32))| {
        let mut boxes = [0u32; 256];
        for path in 0..paths {
            let high = |d: usize| sequence_u(start.wrapping_add(path), R4_STEPS[d], shift) >> 28;
            boxes[(high(a) << 4 | high(b)) as usize] += 1;
        }
        let expected = f64::from(paths) / 256.0;
        boxes.iter().map(|count| (f64::from(*count) - expected).abs()).fold(0.0, f64::max) / expected.sqrt()
    };
    let cases: Vec<_> = pairs.flat_map(|pair| starts.map(|start| (pair, start))).collect();
    bench.pool.install(|| cases.into_par_iter().map(miscount).collect())
}

/// The correlation of two sequences of uniform numbers, in standard deviations of that of independent ones.
fn correlate(bench: &Bench, paths: u32, a: impl Fn(u32) -> f64 + Sync, b: impl Fn(u32) -> f64 + Sync) -> f64 {
    let product = |path: u32| (a(path) - 0.5) * (b(path) - 0.5);
    let sum: f64 = bench.pool.install(|| (0..paths).into_par_iter().map(product).sum());
    // Var((u − ½)(v − ½)) = (1/12)².
    (sum * 12.0 / f64::from(paths).sqrt()).abs()
}
