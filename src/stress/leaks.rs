//! Suite: rays bounced in closed boxes with touching spheres. None may escape, hit the surface that it leaves, or end
//! up outside the box or inside a sphere.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::lab::{Answer, Task};
use super::{Bench, Fault, Found, Row, Spread, Suite};
use crate::cpu::random::{hash_u, hash2_u};
use crate::cpu::scene::{Hit, SceneTables, Surface};
use crate::cpu::walk::{sample_cosine, sample_sphere};
use crate::error::Result;
use crate::features::{Features, Lights};
use crate::pack::Packed;
use crate::scene::{Scene, parse};
use crate::settings::Backend;

/// A box of 2 × 1 × 2 units; `spheres` of them: one on the floor, one touching it and the floor, one in a corner.
fn room(with_spheres: bool) -> Result<Scene> {
    let mut text = String::from(
        "[camera]\nposition = [0, 0.3, 0.5]\nlook_at = [0, 0, -1]\n[materials.white]\ncolor = [1, 1, 1]\n\
         [[lights]]\nposition = [0.1, 0.37, 0.2]\nintensity = [1, 1, 1]\n",
    );
    for (normal, offset) in
        [("1, 0, 0", -1.0), ("1, 0, 0", 1.0), ("0, 1, 0", -0.5), ("0, 1, 0", 0.5), ("0, 0, 1", -1.0), ("0, 0, 1", 1.0)]
    {
        text += &format!("[[planes]]\nnormal = [{normal}]\noffset = {offset}\nmaterial = \"white\"\n");
    }
    if with_spheres {
        for (center, radius) in
            [("-0.3, -0.25, -0.3", 0.25), ("0.2, -0.25, -0.3", 0.25), ("-0.9, -0.4, 0.9", 0.1), ("0.7, 0.3, 0.7", 0.2)]
        {
            text += &format!("[[spheres]]\ncenter = [{center}]\nradius = {radius}\nmaterial = \"white\"\n");
        }
    }
    Ok(parse(&text, "room")?)
}

/// One placement of a room.
struct Case {
    name: String,
    packed: Packed,
    low: Vec3,
    high: Vec3,
    start: Vec3,
    /// How far beyond a wall counts as outside, metres.
    tolerance: f32,
}

impl Case {
    /// Scaled about the origin, then moved; seen (and packed) from `away` room sizes off.
    fn new(with_spheres: bool, scale: f64, offset: f64, away: f64) -> Result<Case> {
        let mut scene = room(with_spheres)?;
        let by = DVec3::new(1.0, -0.7, 0.4).normalize() * offset;
        let place = |p: DVec3| p * scale + by;
        let (low, high) = (place(DVec3::new(-1.0, -0.5, -1.0)), place(DVec3::new(1.0, 0.5, 1.0)));
        for light in &mut scene.lights {
            light.position = place(light.position);
        }
        for sphere in &mut scene.spheres {
            sphere.center = place(sphere.center);
            sphere.radius *= scale;
        }
        for plane in &mut scene.planes {
            plane.offset = plane.offset * scale + plane.normal.dot(by);
        }
        let origin = place(scene.camera.position + DVec3::new(-0.6, 0.5, 0.7).normalize() * 2.0 * away);
        let packed = Packed::new(&scene, origin);
        let [low, high] = [low, high].map(|corner| (corner - origin).as_vec3());
        let start = packed.lights[0].position.into();
        let farthest = low.abs().max(high.abs()).max_element();
        let kind = if with_spheres { "box and spheres" } else { "box" };
        let seen = if away > 0.0 { format!(", seen from {away} sizes") } else { String::new() };
        Ok(Case {
            name: format!("{kind}, scale {scale:e}, offset {offset:e}{seen}"),
            packed,
            low,
            high,
            start,
            // 16 ulps of the largest coordinate: far beyond what rounding does, far below what is seen.
            tolerance: farthest * f32::EPSILON * 16.0,
        })
    }
}

/// What went wrong among some rays.
#[derive(Clone, Copy, Default)]
struct Counts {
    rays: u64,
    escaped: u64,
    own: u64,
    outside: u64,
    inside: u64,
}

impl Counts {
    fn sum(answers: &[Answer]) -> Counts {
        answers.iter().fold(Counts::default(), |sum, answer| {
            let [rays, escaped, own, outside, inside, ..] = answer.map(u64::from);
            Counts {
                rays: sum.rays + rays,
                escaped: sum.escaped + escaped,
                own: sum.own + own,
                outside: sum.outside + outside,
                inside: sum.inside + inside,
            }
        })
    }
}

/// Rays of an item: llvmpipe ends loops after 65,535 rounds, ten objects a ray.
const RAYS: u32 = 500;

pub(super) fn run(bench: &mut Bench) -> Result<Found> {
    let places: &[(f64, f64, f64)] = match bench.options.by_size(0, 1, 2) {
        0 => &[(1.0, 0.0, 0.0), (1e-3, 1e5, 0.0)],
        1 => &[(1.0, 0.0, 0.0), (1e-3, 1e5, 0.0), (1e3, 1e5, 0.0), (1.0, 0.0, 10.0)],
        _ => &[
            (1.0, 0.0, 0.0),
            (1.0, 1e3, 0.0),
            (1.0, 1e5, 0.0),
            (1e-3, 0.0, 0.0),
            (1e-3, 1e5, 0.0),
            (1e3, 0.0, 0.0),
            (1e3, 1e5, 0.0),
            (1.0, 0.0, 10.0),
            (1.0, 0.0, 1000.0),
        ],
    };
    let mut found = Found::default();
    for with_spheres in [false, true] {
        for &(scale, offset, away) in places {
            let case = Case::new(with_spheres, scale, offset, away)?;
            for backend in bench.backends() {
                bench.step(&format!("leaks: {}, {}", case.name, backend.name()));
                let rays = match backend {
                    Backend::OpenCl => bench.options.by_size(400_000, 2_000_000, 20_000_000u32),
                    Backend::OpenGl => bench.options.by_size(100_000, 500_000, 4_000_000),
                    Backend::Cpu => bench.options.by_size(100_000, 1_000_000, 10_000_000),
                };
                let counts = Counts::sum(&ask(bench, &case, backend, (rays / RAYS) as usize)?);
                for (measure, events) in [
                    ("rays that escape", counts.escaped),
                    ("rays that hit what they leave", counts.own),
                    ("points outside the box", counts.outside),
                    ("points inside a sphere", counts.inside),
                ] {
                    let spread = Spread::events(events, counts.rays);
                    // A thousand sizes off, an ulp is 10⁻⁴ of the room: float32's own limit.
                    let bound = if away > 100.0 { 3e-5 * counts.rays as f64 } else { 0.0 };
                    found.rows.push(Row::new(Suite::Leaks, case.name.as_str(), backend, measure, spread, bound));
                }
            }
        }
    }
    Ok(found)
}

fn ask(bench: &Bench, case: &Case, backend: Backend, items: usize) -> Result<Vec<Answer>> {
    const SEED: u32 = 7;
    let fault = bench.options.fault;
    if backend == Backend::Cpu {
        let walk = |item: usize| by_twin(case, item as u32, SEED, fault);
        return Ok(bench.pool.install(|| (0..items).into_par_iter().map(walk).collect()));
    }
    let cases =
        [case.low.to_array(), case.high.to_array(), [case.tolerance, RAYS as f32, SEED as f32], case.start.to_array()];
    let (body, packed) = ("STRESS_LEAKS", &case.packed);
    let task = Task { body, packed, alone: false, in_uniforms: true, cases: &cases, batch: 1 << 12, fault };
    bench.lab.ask(backend, &task, items)
}

/// As `stress` in `glsl/shared/stress.glsl`.
fn by_twin(case: &Case, item: u32, seed: u32, fault: Option<Fault>) -> Answer {
    let features = Features {
        spheres: true,
        planes: true,
        lights: Lights::None,
        sphere_shadows: false,
        plane_shadows: false,
        glossy: false,
        ambient: false,
        one_sample: true,
        in_uniforms: true,
    };
    let scene = SceneTables::new(&case.packed, &features);
    let mut key = hash2_u(item, seed);
    let mut answer = [0; 8];
    let (mut position, mut object, mut left_outside) = (case.start, None, false);
    let mut direction = sample_sphere(hash_u(key.wrapping_add(1)), hash_u(key.wrapping_add(2)));
    for _ in 0..RAYS {
        key = hash_u(key);
        let numbers = [1, 2].map(|n| hash_u(key.wrapping_add(n)));
        answer[0] += 1;
        let hit = match fault {
            Some(Fault::FixedEpsilon) => with_epsilon(&scene, position, direction, object),
            _ => scene.closest_hit(position, direction, object),
        };
        let surface = hit.map(|hit| scene.surface_at(position, direction, hit));
        let wrong = match &surface {
            None => Some(1),
            Some(surface) => wrong(case, surface, object, left_outside),
        };
        match (surface, wrong) {
            (Some(surface), None) => {
                direction = sample_cosine(surface.normal, numbers[0], numbers[1]);
                (position, object, left_outside) = (surface.position, Some(surface.object), surface.side > 0.0);
            }
            (_, wrong) => {
                answer[wrong.unwrap_or(1)] += 1;
                direction = sample_sphere(numbers[0], numbers[1]);
                (position, object, left_outside) = (case.start, None, false);
            }
        }
    }
    answer
}

/// Which count a hit belongs to, if any.
fn wrong(case: &Case, surface: &Surface, from: Option<usize>, left_outside: bool) -> Option<usize> {
    let is_sphere = surface.object < case.packed.sphere_count;
    let outside = surface.position.cmplt(case.low - case.tolerance).any()
        || surface.position.cmpgt(case.high + case.tolerance).any();
    match () {
        () if from == Some(surface.object) && (left_outside || !is_sphere) => Some(2),
        () if outside => Some(3),
        () if is_sphere && surface.side < 0.0 => Some(4),
        () => None,
    }
}

/// Planes as they are often written.
fn with_epsilon(scene: &SceneTables, origin: Vec3, direction: Vec3, from: Option<usize>) -> Option<Hit> {
    let mut closest: Option<Hit> = None;
    for (object, record) in scene.objects.iter().enumerate() {
        let anchor = Vec3::from(record.anchor);
        let t = match object < scene.sphere_count {
            true => crate::cpu::intersect::hit_sphere(origin, direction, anchor, record.extent, from == Some(object)),
            false => (record.extent - anchor.dot(origin)) / anchor.dot(direction),
        };
        let least = if object < scene.sphere_count { 0.0 } else { 1e-3 };
        if t > least && t < crate::cpu::intersect::INFINITE && closest.is_none_or(|hit| t < hit.t) {
            closest = Some(Hit { t, next: crate::cpu::intersect::INFINITE, object });
        }
    }
    closest
}
