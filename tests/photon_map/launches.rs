//! Kernels get what their texts ask for, by name: every kernel is launched at least once, as on a CPU and as on a GPU, and a
//! launch that forgets an argument, or a draw that forgets a table, is refused with its name.

use std::collections::BTreeSet;

use photile::device::cl::{Arguments, Buffer};
use photile::device::gl::{Headless, Program, Target};
use photile::device::submissions;
use photile::pipeline::{Machine, Pipeline};
use photile::program::features::{Features, Lights};
use photile::program::parameters::kernels;
use photile::program::source::{Options, assemble, units};
use photile::records::PhotonPosition;
use photile::settings::{Amount, Backend, FinalGather, Gather, LightMode, Method, Photons, Settings, Technique};
use photile::stage::map::MapView;

use super::device;
use super::gathered::features;
use super::tiles::{scene, settings};
use crate::common::one_at_a_time;

/// What only commands of their own launch, whose tests run them.
const OTHERS: [&str; 4] = ["probe", "stress_items", "validate_each", "validate_same"];

/// Every kernel of every unit, for CPUs and for GPUs.
fn all_kernels() -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for unit in units().into_iter().filter(|unit| unit.ends_with(".cl")) {
        for lanes in [1, 16] {
            let options = Options { lanes, defines: vec!["PARTS".into()], ..Options::default() };
            let source = assemble(unit, Some(&features()), &options);
            found.extend(kernels(&source.text).unwrap_or_else(|what| panic!("{unit}: {what}")).into_keys());
        }
    }
    found.retain(|kernel| !OTHERS.contains(&&**kernel));
    found
}

/// The kernels that pictures of all kinds launch.
fn launched(lanes: Option<u32>) -> BTreeSet<String> {
    let machine = Machine { backend: Some(Backend::OpenCl), lanes, ..Machine::default() };
    let mut pipeline = Pipeline::open(&machine, |_| {}).expect("an OpenCL device");
    let scene = scene("gi_ref");
    let small = |method, amount| {
        let usual = settings(method, [16, 16], 1);
        let gather = Gather { radius: Some(0.5), ..usual.gather };
        Settings { width: 24, height: 16, photons: Photons { amount, ..usual.photons }, gather, ..usual }
    };
    let direct = small(Method::Grid, Amount::Paths(4000));
    let gather = Technique::FinalGather(FinalGather { rays: 4, ..FinalGather::default() });
    pipeline.render(&scene, &Settings { technique: gather, ..direct }).unwrap();
    // So many samples that a GPU takes them in parts.
    let parts = Settings { width: 4, height: 4, samples: 4096, light: LightMode::Direct, ..direct };
    pipeline.render(&scene, &parts).unwrap();
    // Brute force behind a grid takes the map as it was stored.
    for (method, amount) in [
        (Method::Grid, Amount::Stored(6000)),
        (Method::Brute, Amount::Stored(6000)),
        (Method::Tiles, Amount::Paths(4000)),
    ] {
        pipeline.render(&scene, &small(method, amount)).unwrap();
    }
    match pipeline.map().expect("there are photons") {
        (MapView::Device { context, .. }, ..) => context.launched(),
        _ => panic!("OpenCL's maps are on the device"),
    }
}

#[test]
fn every_kernel_is_given_what_its_text_asks_for() {
    one_at_a_time();
    // Kernels that only GPUs need are launched here, too.
    submissions::set_everywhere(true);
    let found: BTreeSet<String> = [None, Some(1)].into_iter().flat_map(launched).collect();
    submissions::set_everywhere(false);
    let all = all_kernels();
    assert!(all.len() >= 20, "{all:?}");
    assert_eq!(all.difference(&found).collect::<Vec<_>>(), Vec::<&String>::new(), "never launched");
}

#[test]
fn a_launch_without_an_argument_is_refused_by_its_name() {
    let context = device();
    let kernel = context.kernel(&assemble("grid.cl", None, &Options::default()), "grid_bounds").unwrap();
    let positions = Buffer::<PhotonPosition>::new(&context, 4).unwrap();
    let (faces, bounds) = (Buffer::<f32>::new(&context, 4).unwrap(), Buffer::<i32>::new(&context, 12).unwrap());
    let most = Arguments::new().table(&positions).with("photon_faces", &faces).with("bounds", &bounds);
    let most = most.with("faces", 2).with("per_item", 1);
    let launch = |args: &Arguments| context.launch(&kernel, args, &[1], None);
    let error = launch(&most).unwrap_err().to_string();
    assert!(error.contains("grid_bounds: 'count' is not given"), "{error}");
    let error = launch(&most.clone().with("count", 0u32)).unwrap_err().to_string();
    assert!(error.contains("'count' is Int, given was Uint"), "{error}");
    launch(&most.with("count", 0)).unwrap();
}

#[test]
fn a_draw_without_a_table_is_refused_by_its_name() {
    one_at_a_time();
    let headless = Headless::new().expect("an OpenGL driver");
    let lit = Features { in_uniforms: false, lights: Lights::One, ..features() };
    let source = assemble("trace.frag", Some(&lit), &Options::default());
    let program = Program::new(&headless.gl, &source).unwrap();
    let target = Target::new(&headless.gl, 8, 8, false).unwrap();
    program.activate();
    let error = target.draw(&program).unwrap_err().to_string();
    assert!(error.contains("trace.frag: ") && error.contains("is not given"), "{error}");
    let names: Vec<&str> = program.samplers().collect();
    assert!(names.contains(&"shapes"), "{names:?}");
}
