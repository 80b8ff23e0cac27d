//! Paths per second, on demand: `cargo test --release --test all photons::speed -- --ignored --nocapture`.

use std::rc::Rc;
use std::time::Instant;

use photile::device::cl::{Context, devices};
use photile::stage::photons::Photons;
use photile::stage::scan::Scan;

use super::{Case, paths};
use crate::common::one_at_a_time;

#[test]
#[ignore = "a measurement"]
fn paths_per_second() {
    one_at_a_time();
    let context = Rc::new(Context::new(devices(None).unwrap().remove(0)).unwrap());
    eprintln!("{} ({} lanes)", context.device.name, context.device.lanes);
    let mut stage = Photons::new(Rc::clone(&context), Rc::new(Scan::new(&context).unwrap()));
    for name in ["gi_ref", "gi_two_lights", "sphere_and_plane", "color_bleeding", "glossy"] {
        let case = Case::shipped(name);
        stage.upload(&case.packed, case.plan.clone()).unwrap();
        for (number, repeats) in [(10_000, 50), (200_000, 15), (1_000_000, 7), (4_000_000, 3)] {
            let emission = paths(number);
            stage.compile(&case.features, &emission).unwrap();
            let mut old = None;
            let mut times: Vec<f64> = (0..=repeats)
                .map(|_| {
                    let start = Instant::now();
                    let map = stage.emit(&emission, old.take()).unwrap();
                    context.finish().unwrap();
                    let time = start.elapsed().as_secs_f64();
                    assert_eq!(map.emitted, number);
                    old = Some(map);
                    time
                })
                .skip(1)
                .collect();
            times.sort_by(f64::total_cmp);
            let median = times[times.len() / 2];
            eprintln!(
                "{name:18} {number:8} paths {:9.3} ms {:8.1} M paths/s",
                median * 1e3,
                f64::from(number) / median * 1e-6
            );
        }
    }
}
