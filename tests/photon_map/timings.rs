//! Timings, on request: `cargo test --release --test all photon_map::timings -- --ignored --nocapture`.

use std::time::Instant;

use glam::Vec3;
use photile::device::cl::Buffer;
use photile::device::gl::{Headless, Program, Target};
use photile::kinds::{ShapeKind, ShapeSet};
use photile::packing::Packed;
use photile::plan::cells::CellSize;
use photile::program::features::{Features, Lights};
use photile::program::gathering::Gathering;
use photile::program::source::{Options, assemble};
use photile::records::{Frame, Material, PLANE, Shape};
use photile::stage::grid::{GridSettings, GridStage};
use photile::stage::photon_map::PhotonMap;
use photile::stage::photon_textures::PhotonTextures;
use photile::stage::scene_buffers::SceneBuffers;

use super::{Map, Random, device, packed_of, surface_point, upload};

const WIDTH: usize = 640;
const HEIGHT: usize = 480;

/// A closed room of 6 × 4 × 6 m with uniform photons on its walls.
pub fn closed_room(photons: usize) -> (Packed, Map) {
    let half = [3.0f32, 2.0, 3.0];
    let shapes: Vec<Shape> = (0..6)
        .map(|i| {
            let (axis, sign) = (i / 2, if i % 2 == 0 { -1.0 } else { 1.0 });
            let anchor = [0, 1, 2].map(|a| f32::from(u8::from(a == axis)));
            Shape { anchor, extent: sign * half[axis], kind: PLANE, ..Shape::default() }
        })
        .collect();
    let (mut random, mut map) = (Random::new(1), Map::default());
    // In proportion to the walls' areas: 24, 36 and 24 m² by axis.
    for _ in 0..photons {
        let axis = [0, 1, 1, 1, 2, 0, 2][random.below(7)];
        let wall = 2 * axis + random.below(2);
        let side = if wall % 2 == 0 { 1.0 } else { -1.0 };
        let position = surface_point(&shapes[wall], &mut random);
        map.push(position, wall, side, &mut random);
    }
    (packed_of(shapes, 0, Material { color: [0.7; 3], diffuse: 1.0, ..Material::default() }), map)
}

fn frame() -> Frame {
    let half_height = 26.565f32.to_radians().tan();
    Frame {
        position: [0.0, 0.0, 2.9],
        right: (Vec3::X * half_height * 4.0 / 3.0).to_array(),
        up: (Vec3::Y * half_height).to_array(),
        forward: [0.0, 0.0, -1.0],
        width: WIDTH as f32,
        height: HEIGHT as f32,
        samples: 1.0,
        plane_count: 6.0,
        ..Frame::default()
    }
}

/// Median and least milliseconds of some runs, after one that does not count.
fn time(runs: usize, mut run: impl FnMut()) -> (f64, f64) {
    run();
    let timed = |_| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64() * 1e3
    };
    median((0..runs).map(timed).collect())
}

/// Median and least.
fn median(mut times: Vec<f64>) -> (f64, f64) {
    times.sort_by(f64::total_cmp);
    (times[times.len() / 2], times[0])
}

#[test]
#[ignore = "measures, asserts nothing"]
fn timings() {
    let context = device();
    let mut stage = GridStage::new(&context).unwrap();
    println!("{}, {} lanes; milliseconds: median (least)", context.device.name, context.device.lanes);
    for count in [12_000, 200_000, 1_000_000] {
        let (packed, map) = closed_room(count);
        let uploaded = upload(&context, &map);
        let mut stored = Some(PhotonMap { directions: None, ..uploaded });
        let times = (0..10).map(|_| {
            context.finish().unwrap();
            let start = Instant::now();
            stage.build(&context, &packed.shapes, stored.take().unwrap(), &GridSettings::radius(0.1)).unwrap();
            context.finish().unwrap();
            let time = start.elapsed().as_secs_f64() * 1e3;
            stored = stage.restore(&context).unwrap();
            time
        });
        let (median, least) = median(times.skip(1).collect());
        let rate = count as f64 / median / 1e3;
        println!("grid of {count:>7} photons: {median:6.2} ({least:.2}), {rate:.0} M photons/s");
    }

    let (packed, map) = closed_room(200_000);
    let features = Features {
        shapes: ShapeSet::of(ShapeKind::Plane),
        lights: Lights::None,
        shadows: ShapeSet::NONE,
        two_sided: true,
        glossy: false,
        ambient: false,
        one_sample: true,
        in_uniforms: true,
        counts: None,
    };
    let uploaded = upload(&context, &map);
    let mut stored = Some(PhotonMap { directions: None, ..uploaded });
    let frame_buffer = Buffer::from_slice(&context, &[frame()]).unwrap();
    let scene = SceneBuffers::new(&context, &packed).unwrap();
    let film = Buffer::<[f32; 3]>::new(&context, WIDTH * HEIGHT).unwrap();
    let headless = Headless::new().ok();
    for radius in [0.1f32, 0.2] {
        for ratio in [0.25, 1.0 / 3.0, 0.5, 1.0] {
            let wanted = GridSettings { size: CellSize::Metres([radius * ratio; 3]), ..GridSettings::radius(radius) };
            let map = stored.take().or_else(|| stage.restore(&context).unwrap()).unwrap();
            let grid = stage.build(&context, &packed.shapes, map, &wanted).unwrap();
            let gathering = Gathering { clip: true, ..Gathering::default() };
            for lanes in [context.device.lanes, 1] {
                let options = Options { lanes, defines: gathering.defines(), ..Options::default() };
                let source = assemble("trace.cl", Some(&features), &options);
                let kernel = context.kernel(&source, "trace").unwrap();
                let map = grid.arguments(None, gathering.method).unwrap();
                let args = scene.arguments().table(&frame_buffer).and(&map).with("film", &film);
                let args = args.with("width", WIDTH as i32).with("height", HEIGHT as i32);
                let args = args.with("bands", HEIGHT as i32).with("stride", 1);
                let (columns, rows) = if lanes == 16 { (4, 4) } else { (1, 1) };
                let (median, least) = time(9, || {
                    context.launch(&kernel, &args, &[WIDTH / columns, HEIGHT / rows], Some(&[8, 8])).unwrap();
                    context.finish().unwrap();
                });
                println!("R = {radius}, cell {ratio:.2} R, OpenCL, {lanes:>2} lanes: {median:6.1} ({least:.1})");
            }
            let Some(headless) = &headless else { continue };
            let mut textures = PhotonTextures::new(&headless.gl, true).unwrap();
            textures.fill(&context, grid, None, &gathering).unwrap();
            let options = Options { defines: gathering.defines(), ..Options::default() };
            let program = Program::new(&headless.gl, &assemble("trace.frag", Some(&features), &options)).unwrap();
            let target = Target::new(&headless.gl, WIDTH as u32, HEIGHT as u32, false).unwrap();
            program.activate();
            program.set_records(&[frame()]);
            packed.tables().into_iter().for_each(|(name, floats)| program.set_texels(name, floats));
            textures.bind(&program);
            let (median, least) = time(3, || target.draw(&program).unwrap());
            println!("R = {radius}, cell {ratio:.2} R, OpenGL          : {median:6.1} ({least:.1})");
        }
    }
}
