//! Suite: random numbers. The same integers on every machine, at the counters' limits too; never 1; spread evenly;
//! without correlation between neighbouring paths, bounces, passes and dimensions.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::lab::{Answer, Task};
use super::{Bench, Fault, Found, Row, Spread, Suite};
use crate::cpu::photons::stream_of;
use crate::cpu::random::{R4_STEPS, hash_u, hash2_u, owen_scramble, sequence_u, sobol_second, unit_real};
use crate::cpu::walk::{number_u, sample_sphere};
use crate::error::Result;
use crate::pack::Packed;
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
    let packed =
        Packed { origin: DVec3::ZERO, objects: Vec::new(), sphere_count: 0, lights: Vec::new(), glasses: Vec::new() };
    for backend in bench.backends() {
        bench.step(&format!("random: counters, {}", backend.name()));
        let answers = match backend {
            Backend::Cpu => bench.pool.install(|| counters.par_iter().map(|pair| twin(*pair, fault)).collect()),
            _ => {
                let body = "STRESS_RANDOM";
                let task = Task {
                    body,
                    packed: &packed,
                    alone: true,
                    in_uniforms: false,
                    cases: &cases,
                    batch: 1 << 20,
                    fault,
                };
                bench.lab.ask(backend, &task, counters.len())?
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
    bench.step("random: statistics");
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
    for dimension in 0..8 {
        for bounce in [0, 1, 7] {
            let base = draws(0, bounce, dimension, 0);
            evenness.push(chi_square(bench, paths, base));
            for other in [
                draws(0, bounce, dimension, 1),
                draws(1, bounce, dimension, 0),
                draws(0, bounce + 1, dimension, 0),
                if correlated { base } else { draws(0, bounce, (dimension + 1) % 8, 0) },
            ] {
                correlation.push(correlate(bench, paths, base, other));
            }
        }
    }
    let row = |measure, values: &[f64], bound| {
        let case = format!("{paths} paths, 8 dimensions, 3 bounces");
        Row::new(Suite::Random, case, Backend::Cpu, measure, Spread::of(values), bound)
    };
    vec![
        // Normal deviates: of 24 and 96 of them one beyond 5 comes once in 20,000 sets.
        row("evenness over 256 bins, standard deviations", &evenness, 5.0),
        row("correlation of neighbours, standard deviations", &correlation, 5.0),
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

/// The correlation of two sequences of uniform numbers, in standard deviations of that of independent ones.
fn correlate(bench: &Bench, paths: u32, a: impl Fn(u32) -> f64 + Sync, b: impl Fn(u32) -> f64 + Sync) -> f64 {
    let product = |path: u32| (a(path) - 0.5) * (b(path) - 0.5);
    let sum: f64 = bench.pool.install(|| (0..paths).into_par_iter().map(product).sum());
    // Var((u − ½)(v − ½)) = (1/12)².
    (sum * 12.0 / f64::from(paths).sqrt()).abs()
}
