//! Every suite holds, and every suite can fail.

use photile::kinds::{ShapeKind, ShapeSet};
use photile::program::features::{Features, Lights};
use photile::program::source as assembly;
use photile::settings::Backend;
use photile::stress::{Fault, Options, Report, Size, Suite, run};

use super::one_at_a_time;

fn stress(suites: &[Suite], backends: &[Backend], fault: Option<Fault>) -> Report {
    let (backends, stop) = (backends.to_vec(), Default::default());
    let options = Options { backends, device: None, threads: 2, size: Size::Tiny, fault, stop };
    run(suites, &options, &mut |_| ()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_twins_hold_every_bound() {
    let report = stress(&Suite::ALL, &[Backend::Cpu], None);
    let failed: Vec<_> = report.rows.iter().filter(|row| !row.holds).collect();
    assert!(failed.is_empty(), "{failed:#?}");
    for suite in Suite::ALL {
        assert!(report.rows.iter().any(|row| row.suite == suite), "{suite:?} tests nothing");
    }
}

#[test]
fn devices_hold_the_bounds_of_single_functions() {
    one_at_a_time();
    let suites = [Suite::Intersection, Suite::Leaks, Suite::Estimator, Suite::Random];
    let report = stress(&suites, &Backend::ALL, None);
    let failed: Vec<_> = report.rows.iter().filter(|row| !row.holds).collect();
    assert!(failed.is_empty(), "{failed:#?}");
    for backend in [Backend::OpenCl, Backend::OpenGl] {
        if !report.rows.iter().any(|row| row.backend == backend) {
            crate::common::missing(backend.name(), &"left out of the suites");
        }
    }
}

#[test]
fn every_fault_is_found_by_its_suite() {
    for fault in Fault::ALL {
        let report = stress(&[fault.found_by()], &[Backend::Cpu], Some(fault));
        assert!(report.failed > 0, "{} passes", fault.name());
    }
}

#[test]
fn devices_find_faults_of_their_own_code() {
    one_at_a_time();
    for fault in [Fault::NaiveSphere, Fault::FixedEpsilon] {
        let report = stress(&[fault.found_by()], &[Backend::OpenGl, Backend::OpenCl, Backend::Cpu], Some(fault));
        for backend in Backend::ALL {
            let of_backend = || report.rows.iter().filter(|row| row.backend == backend);
            assert!(of_backend().count() == 0 || of_backend().any(|row| !row.holds), "{backend:?} {}", fault.name());
        }
    }
}

/// GPUs have one lane, and that code is seldom built here.
#[test]
fn one_lane_compiles_too() {
    one_at_a_time();
    let features = Features {
        shapes: ShapeSet::of(ShapeKind::Sphere).and(ShapeSet::of(ShapeKind::Plane)),
        lights: Lights::None,
        shadows: ShapeSet::NONE,
        two_sided: true,
        glossy: false,
        ambient: false,
        one_sample: true,
        in_uniforms: false,
        counts: None,
    };
    one_at_a_time();
    let Ok(device) = photile::device::cl::devices(None).map(|mut devices| devices.remove(0)) else {
        return crate::common::missing("OpenCL", &"no device");
    };
    let context = photile::device::cl::Context::new(device).unwrap();
    for body in ["STRESS_INTERSECTION", "STRESS_LEAKS", "STRESS_RANDOM"] {
        for (two_sided, contracted) in [(false, false), (true, true)] {
            let options = assembly::Options { contracted, defines: vec![body.into()], ..assembly::Options::default() };
            let source = assembly::assemble("stress.cl", Some(&Features { two_sided, ..features }), &options);
            context.kernel(&source, "stress_items").unwrap_or_else(|error| panic!("{error}"));
        }
    }
}
