//! The same seed gives the same bytes: run after run, with any number of threads, however submissions are cut.

use photile::device::submissions;
use photile::film::Image;
use photile::film::metrics::{self, measure};
use photile::pipeline::{Machine, Pipeline};
use photile::settings::{Amount, Backend, FinalGather, Method, Settings, Technique};

use super::one_at_a_time;
use crate::common::{backends, render, shipped};

fn settings(method: Method) -> Settings {
    let mut settings = Settings { width: 48, height: 36, seed: 5, ..Settings::default() };
    settings.photons.amount = Amount::Paths(3000);
    settings.gather.method = method;
    settings.gather.radius = Some(0.5);
    settings
}

fn bits(image: &Image) -> Vec<[u32; 3]> {
    image.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

/// What the bytes must not depend on runs for each of these.
fn ways() -> [Settings; 3] {
    let gather = Technique::FinalGather(FinalGather { rays: 8, ..FinalGather::default() });
    [settings(Method::Grid), settings(Method::TiledGrid), Settings { technique: gather, ..settings(Method::Grid) }]
}

#[test]
fn twenty_runs_give_the_same_bytes() {
    one_at_a_time();
    let scene = shipped("gi_ref");
    for mut pipeline in backends() {
        for wanted in ways() {
            let what = format!("{}, {:?}, {:?}", pipeline.backend.name(), wanted.gather.method, wanted.technique);
            let first = render(&mut pipeline, &scene, &wanted);
            for run in 1..20 {
                // Another seed in between, so that everything is made anew.
                pipeline.render(&scene, &Settings { seed: 6, width: 8, height: 6, ..wanted.clone() }).unwrap();
                let again = render(&mut pipeline, &scene, &wanted);
                assert!(bits(&again) == bits(&first), "{what}: run {run}");
            }
            let other = render(&mut pipeline, &scene, &Settings { seed: 6, ..wanted });
            assert!(bits(&other) != bits(&first), "{what}: another seed must show");
        }
    }
}

#[test]
fn threads_do_not_show() {
    // One of them glossy, which rules final gathering out.
    for (scene, ways) in [(shipped("glossy"), &ways()[..2]), (shipped("gi_ref"), &ways()[..])] {
        for wanted in ways {
            let image = |threads| {
                let machine = Machine { backend: Some(Backend::Cpu), threads, ..Machine::default() };
                let mut pipeline = Pipeline::open(&machine, |_| ()).unwrap();
                bits(&render(&mut pipeline, &scene, wanted))
            };
            let alone = image(1);
            for threads in [2, 3, 4, 5, 7, 8, 16, 33] {
                assert!(image(threads) == alone, "{threads} threads, {wanted:?}");
            }
        }
    }
}

#[test]
fn cutting_does_not_show_and_bounds_what_a_submission_takes() {
    one_at_a_time();
    let scene = shipped("gi_ref");
    for mut pipeline in backends() {
        let wanted = Settings { width: 96, height: 72, ..settings(Method::Grid) };
        let whole = render(&mut pipeline, &scene, &wanted);
        // So short that every piece is as small as pieces get.
        submissions::set_aim(0.001);
        submissions::reset_longest();
        let mut fresh = crate::common::open(pipeline.backend).unwrap();
        let cut = render(&mut fresh, &scene, &wanted);
        submissions::set_aim(0.0);
        assert!(bits(&cut) == bits(&whole), "{}", pipeline.backend.name());
        assert!(submissions::longest().0 > 0.0 || pipeline.backend == Backend::Cpu, "nothing was paced");
    }
}

/// Lets every kernel be cut, as on a GPU, until it is dropped.
struct Everywhere;

impl Everywhere {
    fn new() -> Everywhere {
        submissions::set_everywhere(true);
        Everywhere
    }
}

impl Drop for Everywhere {
    fn drop(&mut self) {
        submissions::set_everywhere(false);
        submissions::set_aim(0.0);
    }
}

#[test]
fn every_kernel_may_be_cut() {
    one_at_a_time();
    let scene = shipped("gi_ref");
    let gather = Technique::FinalGather(FinalGather { rays: 8, ..FinalGather::default() });
    for backend in [Backend::OpenCl, Backend::OpenGl] {
        for (method, technique) in [
            (Method::Grid, Technique::Map),
            (Method::Tiles, Technique::Map),
            (Method::TiledGrid, Technique::Map),
            (Method::Grid, gather),
        ] {
            // Enough photons for the scan to have two levels, and for the sort to have more than one work-item.
            let mut wanted = Settings { technique, ..settings(method) };
            wanted.photons.amount = Amount::Paths(20_000);
            let Some(mut pipeline) = crate::common::open(backend) else { continue };
            let whole = render(&mut pipeline, &scene, &wanted);
            let _everywhere = Everywhere::new();
            submissions::set_aim(0.001);
            let mut fresh = crate::common::open(backend).unwrap();
            let cut = render(&mut fresh, &scene, &wanted);
            // Once more: now it is known how long everything takes.
            let again = render(&mut fresh, &scene, &Settings { seed: 6, ..wanted.clone() });
            let once_more = render(&mut fresh, &scene, &wanted);
            assert!(bits(&cut) == bits(&whole), "{backend:?} {method:?} {technique:?}");
            assert!(bits(&once_more) == bits(&whole) && bits(&again) != bits(&whole), "{backend:?} {method:?}");
        }
    }
}

#[test]
fn a_picture_cut_within_its_pixels_is_the_same_but_for_the_order_of_sums() {
    one_at_a_time();
    let scene = shipped("gi_ref");
    let Some(mut pipeline) = crate::common::open(Backend::OpenCl) else { return };
    for (method, radius) in [(Method::Grid, 8.0), (Method::Brute, 1.0), (Method::Tiles, 8.0)] {
        // More photons in a disc than a GPU's work-item may look at.
        let mut wanted = Settings { width: 16, height: 12, samples: 3, ..settings(method) };
        wanted.photons.amount = Amount::Paths(400_000);
        wanted.gather.radius = Some(radius);
        let whole = render(&mut pipeline, &scene, &wanted);
        let _everywhere = Everywhere::new();
        let mut fresh = crate::common::open(Backend::OpenCl).unwrap();
        let cut = render(&mut fresh, &scene, &wanted);
        assert!(bits(&cut) != bits(&whole), "{method:?}: nothing was cut");
        let bound = metrics::Within { abs: 1e-6, rel: 1e-5 }; // sums of 10⁵ terms in another order
        let over = cut.pixels.iter().zip(&whole.pixels).filter(|(a, b)| bound.apart(**a, **b)).count();
        assert_eq!(over, 0, "{method:?}");
    }
}

#[test]
fn machines_agree_within_the_stated_bound() {
    one_at_a_time();
    let scene = shipped("gi_ref");
    let wanted = settings(Method::Grid);
    let mut images = Vec::new();
    for mut pipeline in backends() {
        let photons = pipeline.render(&scene, &wanted).unwrap().photons;
        images.push((pipeline.backend, photons, render(&mut pipeline, &scene, &wanted)));
    }
    for pair in images.windows(2) {
        // Counts are integers: what was stored must be the very same number.
        assert_eq!(pair[0].1, pair[1].1);
        let metrics = measure(&pair[0].2, &pair[1].2, &metrics::Settings::default()).unwrap();
        // 1e-3 of a radiance around 0.3: an edge pixel of 1728 that falls on the other side, and ulps elsewhere.
        assert!(metrics.rmse < 1e-2 && metrics.pixels_over < 40, "{:?} {:?}: {metrics:?}", pair[0].0, pair[1].0);
    }
}
