//! Every way of gathering compiles, in both languages.

use std::collections::BTreeSet;

use photile::device::gl::{Headless, Program};
use photile::program::gathering::Gathering;
use photile::program::source::{Options, assemble};
use photile::records::table_sets::SCENE;
use photile::settings::{DensityKernel, Method};

use super::device;
use super::gathered::features;
use crate::common::one_at_a_time;

/// A permutation's choices as small numbers.
fn choices(gathering: &Gathering) -> [usize; 6] {
    let methods = [Method::Grid, Method::Tiles, Method::TiledGrid, Method::Knn, Method::Brute];
    let place = |method| methods.iter().position(|m| *m == method).expect("a method that gathers");
    let kernel = DensityKernel::ALL.iter().position(|k| *k == gathering.density_kernel).expect("a kernel");
    let flags = [gathering.hashed, gathering.clip, gathering.both_sides, gathering.footprints].map(usize::from);
    [place(gathering.method), kernel, flags[0], flags[1], flags[2], flags[3]]
}

/// Pairs of choices that meet in a permutation.
fn pairs(gathering: &Gathering) -> BTreeSet<[(usize, usize); 2]> {
    let own: Vec<_> = choices(gathering).into_iter().enumerate().collect();
    own.iter().flat_map(|a| own.iter().filter(move |b| a.0 < b.0).map(|b| [*a, *b])).collect()
}

/// A few permutations in which every two choices meet that can.
fn covering(all: &[Gathering]) -> Vec<Gathering> {
    let mut open: BTreeSet<_> = all.iter().flat_map(pairs).collect();
    let mut chosen = Vec::new();
    while !open.is_empty() {
        let best = *all.iter().max_by_key(|g| pairs(g).intersection(&open).count()).expect("a pair is someone's");
        open.retain(|pair| !pairs(&best).contains(pair));
        chosen.push(best);
    }
    chosen
}

#[test]
fn every_gathering_compiles_in_opengl() {
    one_at_a_time();
    let Ok(headless) = Headless::new() else {
        eprintln!("SKIPPED: OpenGL is missing");
        return;
    };
    let all = Gathering::reachable();
    assert!(all.len() >= 100, "{}", all.len());
    for (number, gathering) in all.iter().enumerate() {
        let mut defines = gathering.defines();
        if number % 2 == 1 {
            defines.push("SLICED".into());
        }
        let counts = (number % 4 < 2).then_some([2, 3, 0]);
        let features = photile::program::features::Features { glossy: number % 3 > 0, counts, ..features() };
        let all_defines = [features.defines(), defines.clone()].concat();
        let source = assemble("trace.frag", Some(&features), &Options { defines, ..Options::default() });
        let program = Program::new(&headless.gl, &source).unwrap_or_else(|error| panic!("{gathering:?}: {error}"));
        // What it reads is what OpenCL's functions would be given.
        let known = SCENE.textures(Some(&all_defines));
        let strange: Vec<&str> = program.samplers().filter(|name| !known.contains(name)).collect();
        assert!(strange.is_empty(), "{gathering:?}: {strange:?} are in no table set of this program, {known:?}");
    }
}

#[test]
fn every_two_choices_of_gathering_compile_in_opencl() {
    let context = device();
    let chosen = covering(&Gathering::reachable());
    assert!((12..60).contains(&chosen.len()), "{}", chosen.len());
    for (number, gathering) in chosen.iter().enumerate() {
        // One lane's vocabulary differs in the shim alone, which the kernels of other tests compile as well.
        let lanes = gathering.lanes(if number % 4 == 0 { 1 } else { context.device.lanes });
        let counts = (number % 8 < 4).then_some([2, 3, 0]);
        let features = photile::program::features::Features { glossy: number % 3 == 0, counts, ..features() };
        let mut defines = gathering.defines();
        // As on a GPU, wherever that compiles.
        defines.extend(gathering.is_grouped(lanes, true).then(Gathering::group_defines).into_iter().flatten());
        let options = Options { lanes, defines, ..Options::default() };
        let kernel = context.kernel(&assemble("trace.cl", Some(&features), &options), "trace");
        kernel.unwrap_or_else(|error| panic!("{gathering:?}: {error}"));
    }
}

#[test]
fn a_choice_that_nobody_makes_would_be_noticed() {
    let all = Gathering::reachable();
    let chosen = covering(&all);
    let covered: BTreeSet<_> = chosen.iter().flat_map(pairs).collect();
    assert!(all.iter().flat_map(pairs).all(|pair| covered.contains(&pair)));
    let fewer: BTreeSet<_> = chosen.iter().filter(|g| g.method != Method::Brute).flat_map(pairs).collect();
    assert!(all.iter().flat_map(pairs).any(|pair| !fewer.contains(&pair)));
}
