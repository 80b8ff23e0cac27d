//! Fuzzing of the scene parser with stable Rust: the body that `tests/fuzz` gives to cargo-fuzz, here with mutations of
//! the shipped scenes. Seconds by default; `PHOTILE_FUZZ_SECONDS=600 cargo test --release --test all stress::fuzz` goes
//! on.

use std::time::{Duration, Instant};

use photile::rays::random::hash_u;

#[path = "../fuzz/body.rs"]
mod body;

/// What means something to TOML or to scenes.
const TOKENS: [&str; 40] = [
    "[",
    "]",
    "[[",
    "]]",
    "{",
    "}",
    "=",
    ",",
    ".",
    "\"",
    "'",
    "#",
    "\n",
    "\r\n",
    "\t",
    "\\u0000",
    "\"\"\"",
    "nan",
    "inf",
    "-inf",
    "1e999",
    "-0.0",
    "1e-320",
    "0x7fffffffffffffff",
    "-9223372036854775808",
    "1979-05-27",
    "true",
    "camera",
    "materials",
    "lights",
    "spheres",
    "planes",
    "render",
    "position",
    "look_at",
    "up",
    "fov_y",
    "intensity",
    "offset",
    "\u{feff}",
];

struct Random(u32);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9);
        hash_u(self.0) as usize % end.max(1)
    }
}

/// A few changes: bytes, pieces moved or doubled, tokens, lines of another scene.
fn mutated(random: &mut Random, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = seeds[random.below(seeds.len())].clone();
    for _ in 0..1 + random.below(6) {
        let at = random.below(bytes.len() + 1);
        let end = (at + random.below(40)).min(bytes.len());
        match random.below(6) {
            0 if at < bytes.len() => bytes[at] = random.below(256) as u8,
            1 => drop(bytes.drain(at..end)),
            2 => {
                let piece = bytes[at..end].to_vec();
                let to = random.below(bytes.len() + 1);
                bytes.splice(to..to, piece);
            }
            3 => drop(bytes.splice(at..at, TOKENS[random.below(TOKENS.len())].bytes())),
            4 => drop(bytes.splice(at..end, TOKENS[random.below(TOKENS.len())].bytes())),
            _ => {
                let other = &seeds[random.below(seeds.len())];
                let lines: Vec<&[u8]> = other.split(|byte| *byte == b'\n').collect();
                let line = lines[random.below(lines.len())].to_vec();
                bytes.splice(at..at, [b"\n", &line[..], b"\n"].concat());
            }
        }
    }
    bytes
}

#[test]
fn the_parser_survives_mutated_scenes() {
    let seconds = std::env::var("PHOTILE_FUZZ_SECONDS").ok().and_then(|text| text.parse().ok()).unwrap_or(1.0);
    let seeds: Vec<Vec<u8>> = crate::common::all_shipped()
        .iter()
        .map(|name| std::fs::read(crate::common::scene_path(name)).unwrap())
        .collect();
    let (begin, limit) = (Instant::now(), Duration::from_secs_f64(seconds));
    let mut runs = 0u64;
    while begin.elapsed() < limit || runs < 1000 {
        let bytes = mutated(&mut Random(runs as u32), &seeds);
        if let Err(panic) = std::panic::catch_unwind(|| body::parse(&bytes)) {
            eprintln!("run {runs}:\n{}", String::from_utf8_lossy(&bytes));
            std::panic::resume_unwind(panic);
        }
        runs += 1;
    }
    eprintln!("{runs} mutated scenes in {:.0} s", begin.elapsed().as_secs_f64());
}

#[test]
fn most_kinds_of_input_are_reached() {
    let seeds = [std::fs::read(crate::common::scene_path("gi_ref")).unwrap()];
    let outcomes = (0..2000).map(|i| body::parse(&mutated(&mut Random(i), &seeds)));
    let accepted = outcomes.filter(|accepted| *accepted).count();
    assert!((50..1950).contains(&accepted), "{accepted} of 2000 mutated scenes are accepted");
}
