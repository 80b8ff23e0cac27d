//! Suite: rays bounced in closed boxes with touching spheres. None may escape, hit the surface that it leaves, or end
//! up outside the box or inside a sphere.
//!
//! Every other walk aims half of its rays at the edges and contacts, from a whole room beside them down to less than
//! an ulp: what happens to one of 10¹⁰ rays elsewhere happens there all the time.

use glam::{DQuat, DVec3, Vec3};
use rayon::prelude::*;

use super::lab::{Answer, Task};
use super::{Bench, Found, Progress, Row, Spread, Suite};
use crate::error::Result;
use crate::packing::Packed;
use crate::scene::{Scene, parse};
use crate::settings::Backend;

mod twin;

/// Spheres of the room: one on the floor, one touching it and the floor, one in a corner, one under the ceiling.
const SPHERES: [([f64; 3], f64); 4] =
    [([-0.3, -0.25, -0.3], 0.25), ([0.2, -0.25, -0.3], 0.25), ([-0.9, -0.4, 0.9], 0.1), ([0.7, 0.3, 0.7], 0.2)];

/// Where they touch each other and the walls.
const CONTACTS: [[f64; 3]; 7] = [
    [-0.05, -0.25, -0.3],
    [-0.3, -0.5, -0.3],
    [0.2, -0.5, -0.3],
    [-1.0, -0.4, 0.9],
    [-0.9, -0.5, 0.9],
    [-0.9, -0.4, 1.0],
    [0.7, 0.5, 0.7],
];

/// Half of the box's sizes.
const HALF: DVec3 = DVec3::new(1.0, 0.5, 1.0);

/// What a room is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Walls {
    /// Along the axes.
    Planes,
    /// Quads along the axes, which meet in their edges.
    Quads,
    /// The same turned out of all axes.
    Oblique,
}

impl Walls {
    /// From the room's own axes to the scene's.
    fn turned(self) -> DQuat {
        match self {
            Walls::Planes | Walls::Quads => DQuat::IDENTITY,
            Walls::Oblique => DQuat::from_axis_angle(DVec3::new(0.3, -0.8, 0.5).normalize(), 1.1),
        }
    }
}

/// A box of 2 × 1 × 2 units, with or without spheres.
fn room(walls: Walls, with_spheres: bool) -> Result<Scene> {
    let turned = |p: [f64; 3]| (walls.turned() * DVec3::from(p)).to_array();
    let (from, to, lamp) = (turned([0.0, 0.3, 0.5]), turned([0.0, 0.0, -1.0]), turned([0.1, 0.37, 0.2]));
    let mut text = format!(
        "[camera]\nposition = {from:?}\nlook_at = {to:?}\n[materials.white]\ncolor = [1, 1, 1]\n\
         [[lights]]\nposition = {lamp:?}\nintensity = [1, 1, 1]\n",
    );
    let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * HALF);
    for (i, axis) in axes.into_iter().enumerate() {
        let [u, v] = [axes[(i + 1) % 3], axes[(i + 2) % 3]];
        for side in [-1.0, 1.0] {
            if walls == Walls::Planes {
                let (normal, offset) = (axis.normalize().to_array(), side * axis.length());
                text += &format!("[[planes]]\nnormal = {normal:?}\noffset = {offset}\nmaterial = \"white\"\n");
                continue;
            }
            let (corner, edges) =
                (turned((axis * side - u - v).to_array()), [u, v].map(|e| turned((e * 2.0).to_array())));
            text += &format!("[[quads]]\ncorner = {corner:?}\nedges = {edges:?}\nmaterial = \"white\"\n");
        }
    }
    if with_spheres {
        for (center, radius) in SPHERES {
            let center = turned(center);
            text += &format!("[[spheres]]\ncenter = {center:?}\nradius = {radius}\nmaterial = \"white\"\n");
        }
    }
    Ok(parse(&text, "room")?)
}

/// Edges and contacts of the unmoved room, and the way along each.
fn places(walls: Walls, with_spheres: bool) -> Vec<[DVec3; 2]> {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let mut places = Vec::new();
    for (axis, along) in axes.into_iter().enumerate() {
        let [a, b] = [axes[(axis + 1) % 3], axes[(axis + 2) % 3]];
        for (sign_a, sign_b) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            places.push([(a * sign_a + b * sign_b - along) * HALF, along * HALF * 2.0]);
        }
    }
    if with_spheres {
        places.extend(CONTACTS.map(|contact| [DVec3::from(contact), DVec3::ZERO]));
    }
    places.into_iter().map(|place| place.map(|p| walls.turned() * p)).collect()
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
    places: Vec<[Vec3; 2]>,
    /// The room's size, metres.
    size: f32,
    /// With the code of scenes whose objects are met from both sides.
    two_sided: bool,
    /// With other devices' arithmetic, on OpenCL.
    contracted: bool,
}

/// Where a room stands, and how it is looked at.
#[derive(Clone, Copy)]
struct Place {
    scale: f64,
    offset: f64,
    /// Packed from so many room sizes away.
    away: f64,
}

const fn place(scale: f64, offset: f64, away: f64) -> Place {
    Place { scale, offset, away }
}

impl Case {
    /// Scaled about the origin, then moved.
    fn new(
        (walls, with_spheres): (Walls, bool),
        Place { scale, offset, away }: Place,
        two_sided: bool,
        contracted: bool,
    ) -> Result<Case> {
        let mut scene = room(walls, with_spheres)?;
        let by = DVec3::new(1.0, -0.7, 0.4).normalize() * offset;
        let placed = |p: DVec3| p * scale + by;
        scene.lights.place(scale, by);
        scene.shapes.place(scale, by);
        let origin = placed(scene.camera.position + DVec3::new(-0.6, 0.5, 0.7).normalize() * 2.0 * away);
        let packed = Packed::new(&scene, origin);
        // Of a turned room the box around it: what leaves it meets nothing, mostly, and has then escaped.
        let corners = (0..8).map(|i| {
            let sign = |bit: i32| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
            (placed(walls.turned() * (HALF * DVec3::new(sign(0), sign(1), sign(2)))) - origin).as_vec3()
        });
        let low = corners.clone().fold(Vec3::INFINITY, Vec3::min);
        let high = corners.fold(Vec3::NEG_INFINITY, Vec3::max);
        let start = packed.lights[0].position.into();
        let farthest = low.abs().max(high.abs()).max_element();
        let kind = match walls {
            Walls::Planes => "box",
            Walls::Quads => "box of quads",
            Walls::Oblique => "oblique box of quads",
        };
        let spheres = if with_spheres { " and spheres" } else { "" };
        let mut name = format!("{kind}{spheres}, scale {scale:e}, offset {offset:e}");
        if away > 0.0 {
            name += &format!(", seen from {away} sizes");
        }
        name += if two_sided { ", two-sided" } else { "" };
        name += if contracted { ", other rounding" } else { "" };
        let places = places(walls, with_spheres).into_iter();
        Ok(Case {
            name,
            packed,
            low,
            high,
            start,
            // 16 ulps of the largest coordinate: far beyond what rounding does, far below what is seen.
            tolerance: farthest * f32::EPSILON * 16.0,
            places: places.map(|[p, along]| [(placed(p) - origin).as_vec3(), (along * scale).as_vec3()]).collect(),
            size: (2.0 * scale) as f32,
            two_sided,
            contracted,
        })
    }

    /// The suite's own table of `glsl/shared/stress.glsl`.
    fn table(&self, rays: u32) -> Vec<[f32; 3]> {
        let mut table = vec![
            self.low.to_array(),
            self.high.to_array(),
            [self.tolerance, rays as f32, SEED as f32],
            self.start.to_array(),
            [self.places.len() as f32, self.size, 0.0],
        ];
        table.extend(self.places.iter().flatten().map(Vec3::to_array));
        table
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

/// Rays of an item: llvmpipe ends loops after 65,535 rounds, twenty objects and places a ray.
const RAYS: u32 = 500;

const SEED: u32 = 7;

pub(super) fn run(bench: &mut Bench) -> Result<Found> {
    let few = [place(1.0, 0.0, 0.0), place(1e-3, 1e5, 0.0), place(1e3, 1e5, 0.0)];
    let more = [place(1.0, 0.0, 10.0)];
    let rest = [
        place(1.0, 1e3, 0.0),
        place(1.0, 1e5, 0.0),
        place(1e-3, 0.0, 0.0),
        place(1e3, 0.0, 0.0),
        place(1.0, 0.0, 1000.0),
    ];
    let places = match bench.options.by_size(0, 1, 2) {
        0 => few[..2].to_vec(),
        1 => [&few[..], &more].concat(),
        _ => [&few[..], &more, &rest].concat(),
    };
    let few = &few[..bench.options.by_size(1, 2, 3)];
    let mut found = Found::default();
    let rooms =
        [Walls::Planes, Walls::Quads, Walls::Oblique].map(|walls| [false, true].map(|spheres| (walls, spheres)));
    for room in rooms.into_iter().flatten() {
        // Quads are always met from both sides. Seen from afar, points beside contacts are put farther from them than is
        // tolerated here, as they are of planes that are met from both sides: those rooms are left out.
        let (usual, both, sides): (&[Place], &[Place], &[bool]) = match room.0 {
            Walls::Planes => (&places, few, &[false, true]),
            Walls::Quads | Walls::Oblique if room.1 => (&[], few, &[true]),
            Walls::Quads | Walls::Oblique => (&[], &places, &[true]),
        };
        let usual = usual.iter().map(|place| Case::new(room, *place, false, false));
        let both = both.iter().map(|place| Case::new(room, *place, true, false));
        let contracted = few.iter().flat_map(|place| sides.iter().map(|two| Case::new(room, *place, *two, true)));
        for case in usual.chain(both).chain(contracted).collect::<Result<Vec<Case>>>()? {
            for backend in bench.backends() {
                if case.contracted && backend != Backend::OpenCl {
                    continue;
                }
                found.rows.extend(rows(bench, &case, backend)?);
            }
        }
    }
    Ok(found)
}

fn rows(bench: &mut Bench, case: &Case, backend: Backend) -> Result<[Row; 4]> {
    bench.step(&format!("leaks: {}, {}", case.name, backend.name()))?;
    let rays = match backend {
        Backend::OpenCl => bench.options.by_size(400_000, 2_000_000, 20_000_000u32),
        Backend::OpenGl => bench.options.by_size(100_000, 500_000, 4_000_000),
        Backend::Cpu => bench.options.by_size(100_000, 1_000_000, 10_000_000),
    };
    let answers = ask(bench, case, backend, (rays / RAYS) as usize)?;
    let counts = Counts::sum(&answers);
    if let Some((item, answer)) = answers.iter().enumerate().find(|(_, answer)| answer[5] > 0) {
        let line = first_lost(bench, case, backend, item, answer)?;
        (bench.progress)(Progress::Notice(&line));
    }
    let row = |measure, events| {
        Row::new(Suite::Leaks, case.name.as_str(), backend, measure, Spread::events(events, counts.rays), 0.0)
    };
    Ok([
        row("rays that escape", counts.escaped),
        row("rays that hit what they leave", counts.own),
        row("points outside the box", counts.outside),
        row("points inside a sphere", counts.inside),
    ])
}

/// The first ray that an item lost, in words: whoever mends it wants to see it.
fn first_lost(bench: &Bench, case: &Case, backend: Backend, item: usize, answer: &Answer) -> Result<String> {
    let [_, escaped, own, outside, inside, ray, ..] = *answer;
    let mut line = format!(
        "{}, {}: item {item} lost ray {ray} (it lost {escaped} by escape, {own} to what they left, {outside} outside, \
         {inside} inside)",
        case.name,
        backend.name()
    );
    if backend != Backend::Cpu {
        let task = Task { cases: &case.table(ray), defines: &["STRESS_REPLAY"], ..task(bench, case, &[]) };
        if let [[x, y, z, dx, dy, dz, from, hit]] = bench.lab.ask(backend, &task, item..item + 1)?[..] {
            let [origin, direction] = [[x, y, z], [dx, dy, dz]].map(|v| v.map(f32::from_bits));
            line += &format!(": from {origin:?} along {direction:?}, on {}, hits {}", from as i32, hit as i32);
        }
    }
    Ok(line)
}

fn task<'a>(bench: &Bench, case: &'a Case, cases: &'a [[f32; 3]]) -> Task<'a> {
    Task {
        body: "STRESS_LEAKS",
        packed: &case.packed,
        alone: false,
        in_uniforms: true,
        two_sided: case.two_sided,
        defines: &[],
        contracted: case.contracted,
        cases,
        batch: 1 << 12,
        fault: bench.options.fault,
    }
}

fn ask(bench: &Bench, case: &Case, backend: Backend, items: usize) -> Result<Vec<Answer>> {
    if backend == Backend::Cpu {
        let walk = |item: usize| twin::walk(case, item as u32, bench.options.fault);
        return Ok(bench.pool.install(|| (0..items).into_par_iter().map(walk).collect()));
    }
    bench.lab.ask(backend, &task(bench, case, &case.table(RAYS)), 0..items)
}
