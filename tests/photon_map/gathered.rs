//! Radiance gathered by every method and form, on the device and by the twin, is the same but for the order of sums.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use photile::cpu::gather::{self, photon_radiance};
use photile::cpu::grid::{GridTables, face_of, grid};
use photile::device::cl::{Buffer, Context};
use photile::device::gl::{Headless, Program, Target};
use photile::kinds::{ShapeKind, ShapeSet};
use photile::packing::Packed;
use photile::plan::cells::{CellSize, Form, GridPlan};
use photile::program::features::{Features, Lights};
use photile::program::gathering::{DensityKernel, Gathering, Method};
use photile::program::source::{Options, Source, assemble};
use photile::rays::camera::camera_direction;
use photile::rays::scene::{SceneTables, Surface};
use photile::records::{Frame, Material, SPHERE, Shape};
use photile::stage::grid::{Grid, GridSettings, GridStage};
use photile::stage::photon_map::PhotonMap;
use photile::stage::photon_textures::PhotonTextures;
use photile::stage::scene_buffers::SceneBuffers;

use super::timings::closed_room;
use super::{Map, ROOM_SPHERES, Random, device, packed_of, room, room_material, room_photons, surface_point, upload};

const WIDTH: usize = 64;
const HEIGHT: usize = 48;

pub fn features() -> Features {
    Features {
        shapes: ShapeSet::of(ShapeKind::Sphere).and(ShapeSet::of(ShapeKind::Plane)),
        lights: Lights::None,
        shadows: ShapeSet::NONE,
        two_sided: true,
        glossy: true,
        ambient: false,
        one_sample: true,
        in_uniforms: true,
        counts: None,
    }
}

fn packed() -> Packed {
    packed_of(room(), ROOM_SPHERES, room_material())
}

/// A wide view into the room's corners.
fn frame() -> Frame {
    let forward = Vec3::new(-0.3, -0.35, -0.9).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    Frame {
        position: [-0.5, 1.2, 1.0],
        right: (right * 1.2).to_array(),
        up: (right.cross(forward) * 0.9).to_array(),
        forward: forward.to_array(),
        width: WIDTH as f32,
        height: HEIGHT as f32,
        samples: 1.0,
        sphere_count: ROOM_SPHERES as f32,
        plane_count: (room().len() - ROOM_SPHERES) as f32,
        ..Frame::default()
    }
}

/// The grid that a method reads: methods that read the map as it was stored have it laid out only.
fn built<'a>(
    context: &Context,
    stage: &'a mut GridStage,
    map: PhotonMap,
    wanted: &GridSettings,
    method: Method,
) -> (&'a Grid, Option<PhotonMap>) {
    let shapes = packed().shapes;
    if method.reads_stored() {
        return (stage.lay_out(context, &shapes, &map.view(), wanted).unwrap(), Some(map));
    }
    (stage.build(context, &shapes, map, wanted).unwrap(), None)
}

/// As `on_device` with a text that `change` has changed.
fn on_device_with(
    context: &Context,
    stage: &mut GridStage,
    map: &Map,
    wanted: &GridSettings,
    (gathering, lanes): (Gathering, u32),
    change: impl FnOnce(&mut Source),
) -> Vec<[f32; 3]> {
    let (grid, stored) = built(context, stage, upload(context, map), wanted, gathering.method);
    let stored = stored.as_ref().map(PhotonMap::view);
    let packed = packed();
    let gathering = Gathering { hashed: grid.plan.hashed, ..gathering };
    let lanes = gathering.lanes(lanes);
    let options = Options { lanes, defines: gathering.defines(), ..Options::default() };
    let mut source = assemble("trace.cl", Some(&features()), &options);
    change(&mut source);
    let kernel = context.kernel(&source, "trace").unwrap();
    let frame = Buffer::from_slice(context, &[frame()]).unwrap();
    let scene = SceneBuffers::new(context, &packed).unwrap();
    let film = Buffer::<[f32; 3]>::new(context, WIDTH * HEIGHT).unwrap();
    let args = scene.arguments().table(&frame).and(&grid.arguments(stored.as_ref(), gathering.method).unwrap());
    let args = args.with("film", &film).with("width", WIDTH as i32).with("height", HEIGHT as i32);
    // As many bands as rows, one after the other: uncut.
    let args = args.with("bands", HEIGHT as i32).with("stride", 1);
    // More work-items than any block size needs: the kernel drops the surplus.
    context.launch(&kernel, &args, &[WIDTH, HEIGHT], None).unwrap();
    film.to_vec(context).unwrap()
}

fn on_device(
    context: &Context,
    stage: &mut GridStage,
    map: &Map,
    wanted: &GridSettings,
    gathering: Gathering,
    lanes: u32,
) -> Vec<[f32; 3]> {
    on_device_with(context, stage, map, wanted, (gathering, lanes), |_| {})
}

fn on_gl(
    context: &Context,
    headless: &Headless,
    stage: &mut GridStage,
    map: &Map,
    wanted: &GridSettings,
    gathering: Gathering,
) -> Vec<[f32; 3]> {
    let (grid, stored) = built(context, stage, upload(context, map), wanted, gathering.method);
    let stored = stored.as_ref().map(PhotonMap::view);
    let packed = packed();
    let gathering = Gathering { hashed: grid.plan.hashed, ..gathering };
    let mut photons = PhotonTextures::new(&headless.gl, true).unwrap();
    photons.fill(context, grid, stored.as_ref(), &gathering).unwrap();
    let options = Options { defines: gathering.defines(), ..Options::default() };
    let program = Program::new(&headless.gl, &assemble("trace.frag", Some(&features()), &options)).unwrap();
    let target = Target::new(&headless.gl, WIDTH as u32, HEIGHT as u32, false).unwrap();
    program.activate();
    program.set_records(&[frame()]);
    packed.tables().into_iter().for_each(|(name, floats)| program.set_texels(name, floats));
    photons.bind(&program);
    target.draw(&program).unwrap();
    target.read().iter().map(|[r, g, b, _]| [*r, *g, *b].map(f32::from_bits)).collect()
}

/// A map as the twin gathers from it by a grid.
fn in_grid<'a>(
    map: &'a Map,
    gathering: &'a Gathering,
    plan: &'a GridPlan,
    grid: &'a GridTables,
) -> gather::PhotonMap<'a> {
    gather::PhotonMap { gathering, plan, stored: map.tables(), grid, tiles: None }
}

fn by_twin(map: &Map, wanted: &GridSettings, gathering: Gathering) -> Vec<[f32; 3]> {
    let (packed, features, frame) = (packed(), features(), frame());
    let scene = SceneTables::new(&packed, &features);
    let mut plan = map.plan(&packed.shapes, wanted.radius, wanted.size, wanted.form);
    plan.gather.nearest = wanted.nearest as f32;
    let tables = grid(&map.tables(), &plan);
    let gathering = Gathering { hashed: plan.hashed, ..gathering };
    let map = in_grid(map, &gathering, &plan, &tables);
    let pixel = |i: usize| {
        let direction = camera_direction(&frame, (i % WIDTH) as f32 + 0.5, (i / WIDTH) as f32 + 0.5);
        let origin = Vec3::from(frame.position);
        let hit = scene.closest_hit(origin, direction, None).expect("the room is closed");
        let surface = scene.surface_at(origin, direction, hit);
        photon_radiance(&scene, &map, &surface, -direction, 0).to_array()
    };
    (0..WIDTH * HEIGHT).map(pixel).collect()
}

/// Largest difference, in units of the mean.
fn difference(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
    let mean = a.iter().flatten().sum::<f32>() / (3 * a.len()) as f32;
    assert!(mean > 0.0 && a.len() == b.len());
    a.iter().flatten().zip(b.iter().flatten()).map(|(x, y)| (x - y).abs() / mean).fold(0.0, f32::max)
}

// Sums of the same floats in another order, some hundred terms: 1e-7 each. Hit points differ by an ulp or two between
// compilers, and glossy lobes (α = 0.3) amplify that a little.
const SAME_HITS: f32 = 1e-5;
const OTHER_COMPILER: f32 = 1e-4;

#[test]
fn grids_of_both_forms_equal_brute_force_on_every_lane_width() {
    let context = device();
    let mut stage = GridStage::new(&context).unwrap();
    let map = room_photons(3000, 11);
    for radius in [0.15, 1.0] {
        for kernel in DensityKernel::ALL {
            let gathering = Gathering {
                density_kernel: kernel,
                clip: true,
                both_sides: true,
                footprints: true,
                ..Gathering::default()
            };
            let truth = by_twin(&map, &GridSettings::radius(radius), Gathering { method: Method::Brute, ..gathering });
            for form in [Form::Dense, Form::Hashed(Some(32))] {
                let wanted = GridSettings { form, ..GridSettings::radius(radius) };
                let twin = by_twin(&map, &wanted, gathering);
                assert!(difference(&truth, &twin) < SAME_HITS, "{kernel:?}, {form:?}: {}", difference(&truth, &twin));
            }
        }
        let gathering = Gathering { clip: true, ..Gathering::default() };
        let brute = Gathering { method: Method::Brute, ..gathering };
        let truth = on_device(&context, &mut stage, &map, &GridSettings::radius(radius), brute, context.device.lanes);
        for lanes in [1, context.device.lanes] {
            for form in [Form::Dense, Form::Hashed(Some(32))] {
                let wanted = GridSettings { form, ..GridSettings::radius(radius) };
                let found = on_device(&context, &mut stage, &map, &wanted, gathering, lanes);
                let off = difference(&truth, &found);
                assert!(off < SAME_HITS, "{lanes} lanes, {form:?}, R = {radius}: {off}");
            }
        }
    }
}

#[test]
fn device_and_twin_gather_the_same() {
    let context = device();
    let mut stage = GridStage::new(&context).unwrap();
    let map = room_photons(3000, 12);
    // Every method, every kernel but the constant one, whose rim an ulp moves a photon across; few, since a driver
    // takes a second for each permutation.
    for (method, kernel, both_sides) in [
        (Method::Grid, DensityKernel::Epanechnikov, true),
        (Method::Grid, DensityKernel::Cone, false),
        (Method::Grid, DensityKernel::Biweight, false),
        (Method::Knn, DensityKernel::Epanechnikov, false),
        (Method::Knn, DensityKernel::Biweight, true),
        (Method::Brute, DensityKernel::Cone, true),
    ] {
        let gathering = Gathering {
            method,
            density_kernel: kernel,
            clip: true,
            both_sides,
            footprints: both_sides,
            hashed: false,
            edges: false,
        };
        let wanted = GridSettings { nearest: 12, ..GridSettings::radius(0.8) };
        let twin = by_twin(&map, &wanted, gathering);
        let found = on_device(&context, &mut stage, &map, &wanted, gathering, context.device.lanes);
        let off = difference(&twin, &found);
        assert!(off < OTHER_COMPILER, "{gathering:?}: {off}");
    }
}

/// Mean of the radiance at points of a uniformly lit closed room, as a share of the truth, where walls cut discs:
/// within a third of R of a corner on one wall, R = 0.5.
fn share_of_truth_in_corners(gathering: Gathering) -> f32 {
    let photons = 100_000;
    let (packed, mut map) = closed_room(photons);
    map.powers.iter_mut().for_each(|p| p.power = [1.0; 3]);
    let features = Features { shapes: ShapeSet::of(ShapeKind::Plane), glossy: false, ..features() };
    let scene = SceneTables::new(&packed, &features);
    let plan = map.plan(&packed.shapes, 0.5, CellSize::Auto, Form::Auto);
    let tables = grid(&map.tables(), &plan);
    let map = in_grid(&map, &gathering, &plan, &tables);
    let (mut random, queries, mut sum) = (Random::new(15), 400, 0.0);
    for _ in 0..queries {
        let corner = [0, 1, 2].map(|_| if random.uniform(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 });
        let inwards = [random.uniform(0.0, 0.17), 0.0, random.uniform(0.0, 0.17)];
        let position = Vec3::from([3.0, 2.0, 3.0]) * Vec3::from(corner) - Vec3::from(corner) * Vec3::from(inwards);
        let (shape, side) = if corner[1] < 0.0 { (2, 1.0) } else { (3, -1.0) };
        let surface = Surface { position, normal: Vec3::Y * side, shape, side };
        sum += photon_radiance(&scene, &map, &surface, surface.normal, 0).x;
    }
    // 168 m² of walls; albedo 0.7.
    let truth = 0.7 * std::f32::consts::FRAC_1_PI * photons as f32 / 168.0;
    sum / queries as f32 / truth
}

#[test]
fn corners_are_as_bright_as_walls() {
    for kernel in DensityKernel::ALL {
        let clipped =
            share_of_truth_in_corners(Gathering { density_kernel: kernel, clip: true, ..Gathering::default() });
        // Eight corners with some 120 photons within R of each, all queries of a corner sharing them: 3 %.
        assert!((clipped - 1.0).abs() < 0.1, "{kernel:?}: {clipped}");
        let open = share_of_truth_in_corners(Gathering { density_kernel: kernel, ..Gathering::default() });
        assert!(open < 0.6, "without clipping corners must be dark, {kernel:?}: {open}");
    }
}

#[test]
fn the_fragment_shader_gathers_the_same() {
    let context = device();
    let headless = Headless::new().expect("an OpenGL driver");
    let mut stage = GridStage::new(&context).unwrap();
    let map = room_photons(3000, 14);
    for (method, form) in [
        (Method::Grid, Form::Dense),
        (Method::Grid, Form::Hashed(Some(32))),
        (Method::Knn, Form::Dense),
        (Method::Brute, Form::Dense),
    ] {
        let both_sides = form != Form::Dense;
        let gathering = Gathering { method, clip: true, both_sides, footprints: both_sides, ..Gathering::default() };
        let wanted = GridSettings { nearest: 12, form, ..GridSettings::radius(0.8) };
        let twin = by_twin(&map, &wanted, gathering);
        let found = on_gl(&context, &headless, &mut stage, &map, &wanted, gathering);
        let off = difference(&twin, &found);
        assert!(off < OTHER_COMPILER, "{gathering:?}, {form:?}: {off}");
    }
}

/// Share of the pixels that differ by more than a tolerance, in units of the mean.
fn pixels_apart(a: &[[f32; 3]], b: &[[f32; 3]], tolerance: f32) -> f32 {
    let mean = a.iter().flatten().sum::<f32>() / (3 * a.len()) as f32;
    let apart = |(a, b): &(&[f32; 3], &[f32; 3])| a.iter().zip(*b).any(|(a, b)| (a - b).abs() > tolerance * mean);
    assert!(mean > 0.0 && a.len() == b.len());
    a.iter().zip(b).filter(apart).count() as f32 / a.len() as f32
}

#[test]
fn every_kernel_is_the_twins_in_both_languages() {
    let context = device();
    let headless = Headless::new().expect("an OpenGL driver");
    let mut stage = GridStage::new(&context).unwrap();
    let (map, wanted) = (room_photons(3000, 16), GridSettings::radius(0.8));
    let gathering = |kernel| Gathering { density_kernel: kernel, clip: true, ..Gathering::default() };
    let twins = DensityKernel::ALL.map(|kernel| by_twin(&map, &wanted, gathering(kernel)));
    for (number, kernel) in DensityKernel::ALL.into_iter().enumerate() {
        let cl = on_device(&context, &mut stage, &map, &wanted, gathering(kernel), context.device.lanes);
        let gl = on_gl(&context, &headless, &mut stage, &map, &wanted, gathering(kernel));
        for (language, found) in [("OpenCL", cl), ("OpenGL", gl)] {
            let apart = |twin: &[[f32; 3]]| pixels_apart(twin, &found, OTHER_COMPILER);
            // The constant kernel has a step at its rim, which an ulp moves a photon across: of 3072 discs with a hundred
            // photons and more, about one. The others fade, and no pixel may differ.
            let few = if kernel == DensityKernel::Constant { 1e-3 } else { 0.0 };
            assert!(apart(&twins[number]) <= few, "{language}, {kernel:?}: {} of the pixels", apart(&twins[number]));
            for (other, twin) in DensityKernel::ALL.iter().zip(&twins).filter(|(other, _)| **other != kernel) {
                assert!(apart(twin) > 0.9, "{language}: {kernel:?} is taken for {other:?}");
            }
        }
    }
}

/// Radiance of the k nearest photons around a point of the closed room by the definition, from all photons of its face.
fn by_sorting(map: &Map, surface: &Surface, k: usize, radius: f64) -> f64 {
    let face = 2 * surface.shape + usize::from(surface.side < 0.0);
    let mut near: Vec<(f64, f64)> = (0..map.positions.len())
        .filter(|i| face_of(&map.surfaces[*i]) == face)
        .map(|i| {
            let position = Vec3::from(map.positions[i].position).as_dvec3();
            (position.distance(surface.position.as_dvec3()), f64::from(map.powers[i].power[1]))
        })
        .filter(|(distance, _)| *distance < radius)
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    // The next one's distance is the radius; without a next one it is the largest there may be.
    let rim = near.get(k).map_or(radius, |next| next.0);
    let epanechnikov = |t: f64| 2.0 / PI * (1.0 - t * t);
    let sum: f64 = near.iter().take(k).map(|(distance, power)| power * epanechnikov(distance / rim)).sum();
    0.7 / PI * sum / (rim * rim)
}

#[test]
fn the_k_nearest_are_those_of_a_sorted_list() {
    let (packed, map) = closed_room(20_000);
    let features = Features { shapes: ShapeSet::of(ShapeKind::Plane), glossy: false, ..features() };
    let scene = SceneTables::new(&packed, &features);
    // Some 120 photons a square metre: within this radius 90 in the middle of a wall, 23 in a corner.
    let radius = 0.5;
    let mut random = Random::new(18);
    let points: Vec<Surface> = (0..200)
        .map(|_| {
            let shape = random.below(6);
            let position = Vec3::from(surface_point(&packed.shapes[shape], &mut random));
            let side = if shape % 2 == 0 { 1.0 } else { -1.0 };
            Surface { position, normal: side * Vec3::from(packed.shapes[shape].anchor), shape, side }
        })
        .collect();
    for form in [Form::Dense, Form::Hashed(Some(2))] {
        let mut plan = map.plan(&packed.shapes, radius, CellSize::Auto, form);
        let tables = grid(&map.tables(), &plan);
        for k in [1usize, 2, 10, 50, 256] {
            plan.gather.nearest = k as f32;
            let gathering = Gathering { method: Method::Knn, hashed: plan.hashed, ..Gathering::default() };
            let seen = in_grid(&map, &gathering, &plan, &tables);
            let mut others = 0;
            for surface in &points {
                let found = f64::from(photon_radiance(&scene, &seen, surface, surface.normal, 0).y);
                // Weights near the rim cancel: 1 − t² of float32 distances.
                let is = |k| (found - by_sorting(&map, surface, k, radius.into())).abs() < 2e-5 * found.max(1.0);
                assert!(is(k), "k = {k}, {form:?}: {found} for {}", by_sorting(&map, surface, k, radius.into()));
                others += usize::from(!is(k + 1));
            }
            // One more must show where there is one: everywhere, but in corners, nowhere.
            let expected = match k {
                1..=10 => points.len()..=points.len(),
                50 => points.len() / 2..=points.len() - 1,
                _ => 0..=0,
            };
            assert!(expected.contains(&others), "{k} for {}, {form:?}: {others} of the points tell", k + 1);
        }
    }
}

#[test]
fn the_device_takes_the_k_nearest_of_either_form() {
    let context = device();
    let mut stage = GridStage::new(&context).unwrap();
    let map = room_photons(3000, 17);
    let gathering = Gathering { method: Method::Knn, clip: true, ..Gathering::default() };
    for form in [Form::Dense, Form::Hashed(Some(32))] {
        for k in [1, 2, 30, 256] {
            let wanted = GridSettings { nearest: k, form, ..GridSettings::radius(0.8) };
            let found = on_device(&context, &mut stage, &map, &wanted, gathering, context.device.lanes);
            let off = difference(&by_twin(&map, &wanted, gathering), &found);
            assert!(off < OTHER_COMPILER, "k = {k}, {form:?}: {off}");
            let more = by_twin(&map, &GridSettings { nearest: k + 1, ..wanted }, gathering);
            // No disc holds so many.
            assert!(k == 256 || difference(&more, &found) > OTHER_COMPILER, "{k} for {}, {form:?}", k + 1);
        }
    }
}

/// Photons of equal power spread evenly over a sphere, inside and out: on a spiral (Vogel 1979).
fn even_sphere(sphere: &Shape, photons: usize) -> Map {
    let mut map = Map::default();
    let mut random = Random::new(19);
    for i in 0..photons {
        let height = 1.0 - (2.0 * i as f64 + 1.0) / photons as f64;
        let (sine, cosine) = (i as f64 * PI * (3.0 - 5f64.sqrt())).sin_cos();
        let across = (1.0 - height * height).sqrt();
        let direction = DVec3::new(across * cosine, height, across * sine);
        let position = DVec3::from(sphere.anchor.map(f64::from)) + direction * f64::from(sphere.extent);
        for side in [1.0, -1.0] {
            map.push(position.as_vec3().to_array(), 0, side, &mut random);
        }
    }
    map.powers.iter_mut().for_each(|p| p.power = [1.0; 3]);
    map
}

#[test]
fn an_even_sphere_is_as_bright_in_discs_of_every_size() {
    let photons = 200_000;
    let extent = 1.5;
    let sphere = Shape { anchor: [0.3, -0.2, 0.1], extent, kind: SPHERE, ..Shape::default() };
    let map = even_sphere(&sphere, photons);
    let packed = packed_of(vec![sphere], 1, Material { color: [1.0; 3], diffuse: 1.0, ..Material::default() });
    let features = Features { shapes: ShapeSet::of(ShapeKind::Sphere), glossy: false, ..features() };
    let scene = SceneTables::new(&packed, &features);
    let truth = photons as f64 / (4.0 * PI * f64::from(extent).powi(2));
    for share in [0.05, 0.2, 0.7, 1.3, 1.9] {
        let radius = share as f32 * extent;
        let plan = map.plan(&packed.shapes, radius, CellSize::Auto, Form::Auto);
        let tables = grid(&map.tables(), &plan);
        // A ball cuts a cap of π·r² out of the sphere, so every kernel's integral over it is that over a flat disc.
        let within = photons as f64 * share * share / 4.0;
        for kernel in DensityKernel::ALL {
            // What a spiral leaves: where kernels have a step, some of the √n photons on the rim, by chance; where they
            // fade, fewer by the root of n. And rounded sums.
            let exponent = if kernel == DensityKernel::Constant { -0.75 } else { -1.25 };
            let tolerance = 2.5 * within.powf(exponent) + 5e-6;
            let gathering = Gathering { density_kernel: kernel, hashed: plan.hashed, ..Gathering::default() };
            let seen = in_grid(&map, &gathering, &plan, &tables);
            let mut random = Random::new(20);
            for number in 0..20 {
                let normal = Vec3::from(random.direction());
                let side = if number % 2 == 0 { 1.0 } else { -1.0 };
                let position = Vec3::from(sphere.anchor) + normal * extent;
                let surface = Surface { position, normal: normal * side, shape: 0, side };
                let flux_density = PI * f64::from(photon_radiance(&scene, &seen, &surface, surface.normal, 0).x);
                let off = |flux_density: f64| (flux_density / truth - 1.0).abs();
                assert!(off(flux_density) < tolerance, "{kernel:?}, {share} radii: {flux_density} for {truth}");
                // Were the cap a flat disc as wide as the way along the sphere.
                let wrong = flux_density * (share / (2.0 * (0.5 * share).asin())).powi(2);
                let shows = share > 0.5 || share > 0.1 && kernel != DensityKernel::Constant;
                assert!(!shows || off(wrong) > tolerance, "{kernel:?}, {share} radii: the wrong area must show");
            }
        }
    }
}

/// Turns the order of a set's members round, where it is declared; whether there is such a set of more than one.
fn turn_round(source: &mut Source, set: &str) -> bool {
    let turned = |line: &str| {
        let (head, members) = [format!("#define {set}_PARAMS "), format!("#define {set} ")]
            .iter()
            .find_map(|head| Some((head.clone(), line.strip_prefix(head.as_str())?)))?;
        let members: Vec<&str> = members.split_inclusive(',').collect();
        Some(head + &members.into_iter().rev().collect::<Vec<_>>().join(" "))
    };
    let lines: Vec<String> = source.text.lines().map(|line| turned(line).unwrap_or_else(|| line.into())).collect();
    let text = lines.join("\n") + "\n";
    let is_other = text != source.text;
    source.text = text;
    is_other
}

#[test]
fn a_set_in_another_order_renders_the_same() {
    let context = device();
    let mut stage = GridStage::new(&context).unwrap();
    let map = room_photons(500, 11);
    let wanted = GridSettings::radius(0.5);
    let mut by = |change: &dyn Fn(&mut Source)| {
        on_device_with(&context, &mut stage, &map, &wanted, (Gathering::default(), context.device.lanes), change)
    };
    let usual = by(&|_| {});
    let turned = by(&|source| {
        for set in ["PACKED", "PHOTONS"] {
            assert!(turn_round(source, set), "{set}");
        }
    });
    assert!(usual == turned);
}

#[test]
fn pixel_buffers_fill_textures_as_host_memory_does() {
    let mut context = device();
    let headless = Headless::new().expect("an OpenGL driver");
    let mut stage = GridStage::new(&context).unwrap();
    // More than a row of a texture, and no whole number of them; then fewer again.
    for count in [5000, 777] {
        let map = room_photons(count, 15);
        for method in [Method::Grid, Method::Brute] {
            let gathering = Gathering { method, clip: true, ..Gathering::default() };
            let [host, pixels] = [false, true].map(|is_gpu| {
                // Devices that are not the CPU take the other way.
                context.device.is_gpu = is_gpu;
                on_gl(&context, &headless, &mut stage, &map, &GridSettings::radius(0.8), gathering)
            });
            assert!(host == pixels, "{count} photons, {method:?}");
            assert!(host.iter().flatten().any(|channel| *channel > 0.0));
        }
    }
}

#[test]
fn one_photon_more_or_less_would_be_noticed() {
    let map = room_photons(3000, 13);
    let mut fewer = map.clone();
    fewer.powers.iter_mut().for_each(|p| p.power = [0.0; 3]);
    let one = Gathering::default();
    let all = by_twin(&map, &GridSettings::radius(0.8), one);
    let dark = by_twin(&fewer, &GridSettings::radius(0.8), one);
    assert!(difference(&all, &dark) > OTHER_COMPILER);
    let seen = (0..map.len()).find(|i| {
        let mut without = map.clone();
        without.powers[*i].power = [0.0; 3];
        difference(&all, &by_twin(&without, &GridSettings::radius(0.8), one)) > OTHER_COMPILER
    });
    assert!(seen.is_some(), "a lost photon changes no pixel by more than the tolerance");
}
