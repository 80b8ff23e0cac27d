//! Suite: the density estimate against the same sum in double precision, photon by photon.
//!
//! Photons lie on a floor seen from above. Errors are shares of what the accepted photons would give if all lay at the
//! query point: where kernels weigh almost nothing, that is what rounding refers to. A coordinate rounded by an ulp
//! moves a weight by 2·ulp/R, so bounds grow with 1/R.

use std::rc::Rc;

use glam::Vec3;
use rayon::prelude::*;

use super::exact::ulp;
use super::{Bench, Fault, Found, Row, Spread, Suite};
use crate::bench::plot::{Chart, Curve, Look};
use crate::cpu;
use crate::cpu::grid::PhotonSurface;
use crate::cpu::photons::PhotonTables;
use crate::device::cl::Buffer;
use crate::error::Result;
use crate::kinds::{ShapeKind, ShapeSet};
use crate::packing::Packed;
use crate::packing::packed_scene::PackedScene;
use crate::plan::cells::{CellSize, Form, plan};
use crate::program::features::{Features, Lights};
use crate::program::gathering::Gathering;
use crate::rays::camera::camera_direction;
use crate::rays::random::{hash2_u, unit_real};
use crate::rays::scene::SceneTables;
use crate::records::{Frame, Material, PLANE, PhotonPosition, PhotonPower, Shape};
use crate::settings::Backend;
use crate::stage::grid::{GridSettings, GridStage};
use crate::stage::map::MapView;
use crate::stage::photon_map::PhotonMap;
use crate::stage::trace::{ClTrace, CpuTrace, GlTrace, Permutation, Trace};

/// Half the floor's width, metres.
const HALF: f32 = 5.0;
/// Where the camera stands above it: away from 0, so that coordinates are negative and of different size.
const CENTER: [f32; 2] = [-3.7, -1.3];
/// Albedo of the floor.
const WHITE: f32 = 0.8;

/// One photon map and how it is seen.
struct Case {
    name: String,
    radius: f32,
    /// Pixels across and down.
    size: (u32, u32),
    /// Half the visible width, metres.
    half: f32,
    photons: PhotonTables,
    /// Share of the accepted photons' sum that may be lost besides coordinates' rounding.
    bound: f64,
}

/// A white floor at z = 0.
fn floor() -> Packed {
    let shape = Shape { anchor: [0.0, 0.0, 1.0], extent: 0.0, kind: PLANE, ..Shape::default() };
    let material = Material { color: [WHITE; 3], diffuse: 1.0, ..Material::default() };
    Packed { shapes: vec![shape], materials: vec![material], ..Packed::default() }
}

fn features() -> Features {
    Features {
        shapes: ShapeSet::of(ShapeKind::Plane),
        lights: Lights::None,
        shadows: ShapeSet::NONE,
        two_sided: true,
        glossy: false,
        ambient: false,
        one_sample: true,
        in_uniforms: true,
        counts: None,
    }
}

/// From straight above; `half` of the floor's width is seen to either side.
fn frame(size: (u32, u32), half: f32) -> Frame {
    let height = HALF;
    Frame {
        position: [CENTER[0], CENTER[1], height],
        right: [half / height, 0.0, 0.0],
        up: [0.0, half / height * size.1 as f32 / size.0 as f32, 0.0],
        forward: [0.0, 0.0, -1.0],
        width: size.0 as f32,
        height: size.1 as f32,
        samples: 1.0,
        plane_count: 1.0,
        ..Frame::default()
    }
}

/// Where each pixel's ray meets the floor, by the twin.
fn points(size: (u32, u32), half: f32) -> Vec<Vec3> {
    let (packed, features, frame) = (floor(), features(), frame(size, half));
    let scene = SceneTables::new(&packed, &features);
    let pixels = (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y)));
    let meet = |(x, y): (u32, u32)| {
        let direction = camera_direction(&frame, x as f32 + 0.5, y as f32 + 0.5);
        let hit = scene.closest_hit(frame.position.into(), direction, None)?;
        Some(scene.surface_at(frame.position.into(), direction, hit).position)
    };
    pixels.filter_map(meet).collect()
}

/// Uniform numbers by counter.
fn number(photon: usize, dimension: u32) -> f32 {
    unit_real(hash2_u(photon as u32, dimension))
}

fn map(photons: impl ParallelIterator<Item = ([f32; 2], f32)>) -> PhotonTables {
    let each: Vec<([f32; 2], f32)> = photons.collect();
    PhotonTables {
        positions: each.iter().map(|([x, y], _)| PhotonPosition { position: [*x, *y, 0.0] }).collect(),
        powers: each.iter().map(|(_, power)| PhotonPower { power: [*power, 0.5 * power, 0.25 * power] }).collect(),
        surfaces: vec![PhotonSurface { shape: 0.0, side: 1.0, bounce: 1.0 }; each.len()],
        directions: Vec::new(),
        emitted: each.len() as u32,
    }
}

/// Sums of few terms: half an ulp a term, and the weights' own rounding.
const FEW: f64 = 4e-6;
/// Sums of very many: a third of their own noise of 1/√n at 10⁷.
const MANY: f64 = 1e-4;

fn cases(bench: &Bench) -> Vec<Case> {
    let size = bench.options.by_size((16, 12), (32, 24), (64, 48));
    let around = points(size, HALF);
    let mut cases = Vec::new();
    let mut add = |name: String, radius: f32, photons: PhotonTables, bound: f64| {
        cases.push(Case { name, radius, size, half: HALF, photons, bound });
    };
    for radius in [1e-4f32, 1e-3, 1e-2, 1e-1, 1.0, 10.0] {
        let photons = (0..20 * around.len()).into_par_iter().map(|i| {
            let (away, turn) = (radius * number(i, 1).sqrt(), number(i, 2) * std::f32::consts::TAU);
            let p = around[i % around.len()];
            ([p.x + away * turn.cos(), p.y + away * turn.sin()], number(i, 3) + 0.5)
        });
        add(format!("R = {radius:e}"), radius, map(photons), FEW);
    }
    for count in [1usize, 100, 10_000, bench.options.by_size(20_000, 200_000, 10_000_000)] {
        let photons = (0..count).into_par_iter().map(|i| {
            let [x, y] = [number(i, 4), number(i, 5)].map(|u| HALF * (2.0 * u - 1.0));
            ([CENTER[0] + x, CENTER[1] + y], number(i, 6) + 0.5)
        });
        // Some hundred photons in the disc, or all there are.
        let radius = (20.0 / (count as f32).sqrt()).min(2.0);
        add(format!("N = {count}"), radius, map(photons), FEW);
    }
    // Cells are half a radius wide and begin at the lowest photon: all of these lie on cells' borders.
    let lattice =
        (0..80 * 80usize).into_par_iter().map(|i| ([(i % 80) as f32 / 8.0 - 8.75, (i / 80) as f32 / 8.0 - 6.25], 1.0));
    add("on cells' borders".into(), 0.5, map(lattice), FEW);
    let exactly = around.par_iter().map(|p| ([p.x, p.y], 1.0));
    add("at the query points".into(), 0.05, map(exactly), FEW);
    let p = around[around.len() / 3];
    add("5000 at one point".into(), 0.5, map((0..5000).into_par_iter().map(|_| ([p.x + 0.01, p.y], 1.0))), FEW);
    add("none accepted".into(), 0.5, map((0..1000).into_par_iter().map(|_| ([300.0, 300.0], 1.0))), 0.0);

    // All in one disc, seen by few pixels.
    let many = bench.options.by_size(50_000, 1_000_000, 10_000_000usize);
    let disc = |i: usize| {
        let (away, turn) = (0.5 * number(i, 7).sqrt(), number(i, 8) * std::f32::consts::TAU);
        [CENTER[0] + away * turn.cos(), CENTER[1] + away * turn.sin()]
    };
    let equal = (0..many).into_par_iter().map(|i| (disc(i), 1.3e-3));
    let mixed = (0..many).into_par_iter().map(|i| (disc(i), 10f32.powf(6.0 * number(i, 9) - 3.0)));
    for (what, photons) in [("of equal power", map(equal)), ("of powers from 1e-3 to 1e3", map(mixed))] {
        let name = format!("{many} in one disc, {what}");
        cases.push(Case { name, radius: 0.5, size: (4, 2), half: 0.02, photons, bound: MANY });
    }
    cases
}

/// What each pixel should show, and what its accepted photons would give if all lay at its point.
fn exact(case: &Case) -> Vec<(f64, f64)> {
    let radius = f64::from(case.radius);
    // 2/π is Epanechnikov's peak, and 1/π the BSDF's.
    let scale = 2.0 / std::f64::consts::PI.powi(2) * f64::from(WHITE) / (radius * radius);
    let estimate = |p: &Vec3| {
        let mut sums = (0.0, 0.0);
        for (position, power) in case.photons.positions.iter().zip(&case.photons.powers) {
            let [x, y, _] = position.position;
            let (dx, dy) = (f64::from(x) - f64::from(p.x), f64::from(y) - f64::from(p.y));
            let d2 = (dx * dx + dy * dy) / (radius * radius);
            if d2 < 1.0 {
                let power = f64::from(power.power[0]) * scale;
                sums = (sums.0 + power * (1.0 - d2), sums.1 + power);
            }
        }
        sums
    };
    points(case.size, case.half).par_iter().map(estimate).collect()
}

pub(super) fn run(bench: &mut Bench) -> Result<Found> {
    let mut found = Found::default();
    let mut curves: Vec<Curve> = Vec::new();
    bench.step("estimator: photon maps")?;
    for case in cases(bench) {
        bench.step(&format!("estimator: {} in double precision", case.name))?;
        let expected = bench.pool.clone().install(|| exact(&case));
        for backend in bench.backends() {
            bench.step(&format!("estimator: {}, {}", case.name, backend.name()))?;
            let image = gathered(bench, backend, &case)?;
            let errors: Vec<f64> = image
                .iter()
                .zip(&expected)
                .map(|(found, (expected, whole))| {
                    let error = (f64::from(found[0]) - expected).abs();
                    // Nothing must stay nothing.
                    if error == 0.0 { 0.0 } else { error / whole }
                })
                .collect();
            let coordinate = ulp(f64::from(HALF - CENTER[0]));
            let bound = if case.bound == 0.0 { 0.0 } else { case.bound + 4.0 * coordinate / f64::from(case.radius) };
            let spread = Spread::of(&errors);
            let measure = "error, share of the accepted photons' sum";
            found.rows.push(Row::new(Suite::Estimator, case.name.as_str(), backend, measure, spread, bound));
            if case.name.starts_with("R =") {
                let curve = match curves.iter_mut().position(|curve| curve.name == backend.name()) {
                    Some(place) => &mut curves[place],
                    None => {
                        curves.push(Curve {
                            name: backend.name().into(),
                            points: Vec::new(),
                            marked: None,
                            look: Look::default(),
                        });
                        curves.last_mut().expect("just pushed")
                    }
                };
                curve.points.push((f64::from(case.radius), spread.worst));
            }
        }
    }
    let chart = Chart {
        title: "Density estimate in a scene of 10 m: largest error".into(),
        x: "gather radius, m".into(),
        y: "largest error, share of the photons' sum".into(),
        curves,
    };
    found.charts.push(("estimator".into(), chart));
    Ok(found)
}

/// The floor as a backend shows it.
fn gathered(bench: &Bench, backend: Backend, case: &Case) -> Result<Vec<[f32; 3]>> {
    let packed = floor();
    let frame = frame(case.size, case.half);
    let mut photons = case.photons.clone();
    if bench.options.fault == Some(Fault::LostPhoton) {
        // As an index off by one would.
        if let Some(first) = photons.powers.first_mut() {
            first.power = [0.0; 3];
        }
    }
    let stored = photons.view();
    let bounds = cpu::grid::grid_bounds(&stored, 2);
    let plan = plan(&packed.shapes, false, &bounds, photons.len(), case.radius, CellSize::Auto, Form::Auto)?;
    let gathering = Gathering { hashed: plan.hashed, ..Gathering::of(&packed.shapes, 0, false) };
    let permutation = Permutation { features: features(), gathering: Some(gathering), final_gather: None };
    let host = |tracer: &mut dyn Trace| -> Result<Vec<[f32; 3]>> {
        let grid = cpu::grid::grid(&stored, &plan);
        let view = MapView::Host { plan: &plan, stored, grid: &grid, tiles: None };
        picture(tracer, &packed, &permutation, &view, &gathering, &frame)
    };
    match (backend, bench.lab.gl(), bench.lab.cl()) {
        (Backend::OpenGl, Some(gl), _) => {
            gl.make_current()?;
            host(&mut GlTrace::new(&gl.gl, gl.is_software)?)
        }
        (Backend::OpenCl, _, Some(context)) => {
            let stored = PhotonMap {
                positions: Buffer::from_slice(&context, &photons.positions)?,
                powers: Buffer::from_slice(&context, &photons.powers)?,
                // All on the upper face of object 0; whole texels.
                faces: Buffer::from_slice(&context, &vec![0.0; photons.len().next_multiple_of(3)])?,
                directions: None,
                stored: photons.len(),
                emitted: photons.emitted,
            };
            let mut stage = GridStage::new(&context)?;
            let grid = stage.build(&context, &packed.shapes, stored, &GridSettings::radius(case.radius))?;
            let gathering = Gathering { hashed: grid.plan.hashed, ..gathering };
            let permutation = Permutation { gathering: Some(gathering), ..permutation };
            let view = MapView::Device { context: &context, stored: None, grid, tiles: None };
            let mut tracer = ClTrace::new(Rc::clone(&context))?;
            picture(&mut tracer, &packed, &permutation, &view, &gathering, &frame)
        }
        _ => host(&mut CpuTrace::new(Rc::clone(&bench.pool))),
    }
}

fn picture(
    tracer: &mut dyn Trace,
    packed: &Packed,
    permutation: &Permutation,
    view: &MapView,
    gathering: &Gathering,
    frame: &Frame,
) -> Result<Vec<[f32; 3]>> {
    tracer.compile(permutation)?;
    tracer.upload(&PackedScene::new(packed.clone()))?;
    tracer.upload_map(view, gathering)?;
    tracer.trace(frame, crate::stage::trace::Indirect::Map(view))?;
    Ok(tracer.read()?.pixels)
}
