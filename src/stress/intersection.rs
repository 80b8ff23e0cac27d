//! Suite: roots, hit points and normals of single rays, against double precision.
//!
//! Errors are counted in ulps of the largest length that takes part (distance to the centre or the origin, radius,
//! t): a float32 ray cannot know more, since origin, direction and centre are themselves rounded to that. A ray that
//! meets a surface at a cosine c turns a sidewise error into one of 1/c along the ray, so errors are multiplied by c;
//! for rays with c > ½ they stand without that factor too.

use glam::{DVec3, Vec3};

use super::exact::{Meeting, plane, sphere, ulp};
use super::lab::{Answer, Task, features};
use super::{Bench, Fault, Found, Row, Spread, Suite};
use crate::bench::plot::{Chart, Curve, Look};
use crate::error::Result;
use crate::packing::Packed;
use crate::program::features::Features;
use crate::rays::random::{hash2_u, unit_real};
use crate::rays::scene::{Hit, SceneTables};
use crate::rays::shapes::plane::hit_plane;
use crate::rays::shapes::sphere::hit_sphere;
use crate::rays::shapes::{INFINITE, Sides};
use crate::records::{PLANE, SPHERE, Shape};
use crate::settings::Backend;
use rayon::prelude::*;

/// Kinds of rays, by where they begin and how they meet the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    /// From 1 to 10⁶ radii away.
    Outside,
    /// From the centre to the last ulp below the surface.
    Inside,
    /// Within 10⁻⁶ to 1 radii above or below the surface.
    Close,
    /// Past the rim, 10⁻⁷ to 10⁻² radii beside it on either side.
    Rim,
    /// In a room of 10 m whose walls are spheres of radius 10⁵ m.
    Wall,
    /// From the sphere's own surface into it.
    Leaving,
    /// At planes 10⁻⁶ to 10⁶ m away.
    Plane,
    /// The same at cosines down to 10⁻⁵.
    GrazingPlane,
}

impl Class {
    const ALL: [Class; 8] = [
        Class::Outside,
        Class::Inside,
        Class::Close,
        Class::Rim,
        Class::Wall,
        Class::Leaving,
        Class::Plane,
        Class::GrazingPlane,
    ];

    fn name(self) -> &'static str {
        match self {
            Class::Outside => "spheres from outside",
            Class::Inside => "spheres from inside",
            Class::Close => "spheres close by",
            Class::Rim => "spheres' rims",
            Class::Wall => "walls of radius 1e5",
            Class::Leaving => "leaving a sphere",
            Class::Plane => "planes",
            Class::GrazingPlane => "planes, grazing",
        }
    }

    fn is_plane(self) -> bool {
        matches!(self, Class::Plane | Class::GrazingPlane)
    }
}

/// One ray and its object, as the machines get them.
struct Case {
    class: Class,
    shape: Shape,
    origin: Vec3,
    direction: Vec3,
    on: bool,
    /// Distance to the centre in radii, or to the plane in metres.
    ratio: f64,
}

/// Uniform numbers by counter.
struct Random(u32, u32);

impl Random {
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.1 += 1;
        low + f64::from(unit_real(hash2_u(self.1, self.0))) * (high - low)
    }

    /// Evenly spread logarithm.
    fn decades(&mut self, low: f64, high: f64) -> f64 {
        10f64.powf(self.uniform(low, high))
    }

    fn direction(&mut self) -> DVec3 {
        let (z, turn) = (self.uniform(-1.0, 1.0), self.uniform(0.0, std::f64::consts::TAU));
        let around = (1.0 - z * z).sqrt();
        DVec3::new(around * turn.cos(), around * turn.sin(), z)
    }

    fn sign(&mut self) -> f64 {
        if self.uniform(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 }
    }
}

impl Case {
    fn of(class: Class, number: u32) -> Case {
        let mut random = Random(hash2_u(class as u32, 0x5eed), number.wrapping_mul(16));
        let scale = random.decades(-6.0, 6.0);
        if class.is_plane() {
            return Case::plane(class, &mut random);
        }
        let (radius, ratio) = match class {
            Class::Outside => (scale, random.decades(1e-3, 6.0)),
            // Anywhere inside, or near the centre.
            Class::Inside => (scale, random.uniform(0.0, 1.0).min(random.decades(-6.0, 3.0))),
            Class::Close => (scale, 1.0 + random.decades(-6.0, 0.0) * random.sign()),
            Class::Rim => (scale, random.decades(0.01, 4.0)),
            Class::Wall => (1e5, 1.0 - random.decades(-6.0, -4.0)),
            Class::Leaving => (scale, 1.0),
            Class::Plane | Class::GrazingPlane => unreachable!("handled above"),
        };
        let away = random.direction();
        // The origin of coordinates stands about as far from the ray as the scene is large.
        let origin = match class {
            Class::Wall => random.direction() * 5.0,
            _ => random.direction() * radius * random.uniform(0.0, 2.0),
        };
        let (origin, center) = match class {
            // What leaves a surface starts where a hit was put back onto it.
            Class::Leaving => {
                let center = origin.as_vec3();
                (center + away.as_vec3() * radius as f32, center)
            }
            _ => (origin.as_vec3(), (origin - away * radius * ratio).as_vec3()),
        };
        let target = match class {
            Class::Outside | Class::Close | Class::Rim => {
                // Where the line passes the centre: anywhere on the disc, or beside its rim.
                let rim = match class {
                    Class::Rim => 1.0 + random.decades(-7.0, -2.0) * random.sign(),
                    _ => random.uniform(0.0, 1.0).sqrt() * 1.02,
                };
                let across = away.cross(random.direction()).normalize();
                let sine = (rim / ratio).min(1.0);
                // A line at distance `rim` from the centre makes this angle with the way to it.
                -away * (1.0 - sine * sine).max(0.0).sqrt() + across * sine
            }
            Class::Leaving => {
                let inward = -away + random.direction() * 0.999;
                inward.normalize()
            }
            _ => random.direction(),
        };
        let shape = Shape { anchor: center.to_array(), extent: radius as f32, kind: SPHERE, ..Shape::default() };
        Case { class, shape, origin, direction: target.as_vec3(), on: class == Class::Leaving, ratio }
    }

    fn plane(class: Class, random: &mut Random) -> Case {
        let normal = random.direction();
        let distance = random.decades(-6.0, 6.0);
        let around = random.direction() * random.decades(-1.0, 1.0);
        let across = normal.cross(random.direction()).normalize();
        let cosine = match class {
            Class::GrazingPlane => random.decades(-5.0, -1.0),
            _ => random.uniform(0.1, 1.0),
        };
        let direction = normal * cosine + across * (1.0 - cosine * cosine).sqrt();
        let shape = Shape {
            anchor: normal.as_vec3().to_array(),
            extent: (normal.dot(around) + distance) as f32,
            kind: PLANE,
            ..Shape::default()
        };
        let (origin, direction) = (around.as_vec3(), direction.as_vec3());
        Case { class, shape, origin, direction, on: false, ratio: distance }
    }

    fn exact(&self) -> Meeting {
        let (origin, direction) = (self.origin.as_dvec3(), self.direction.as_dvec3());
        let anchor = Vec3::from(self.shape.anchor).as_dvec3();
        match self.class.is_plane() {
            true => plane(origin, direction, anchor, f64::from(self.shape.extent)),
            false => sphere(origin, direction, anchor, f64::from(self.shape.extent), self.on),
        }
    }

    /// The largest length that takes part.
    fn length(&self, t: Option<f64>) -> f64 {
        let origin = self.origin.as_dvec3().length();
        let extent = f64::from(self.shape.extent).abs();
        let to_anchor = match self.class.is_plane() {
            true => origin,
            // The start's own rounding off the surface counts on both ends of a chord.
            false if self.on => 2.0 * extent,
            false => (self.origin.as_dvec3() - Vec3::from(self.shape.anchor).as_dvec3()).length(),
        };
        to_anchor.max(extent).max(t.unwrap_or(0.0))
    }

    fn by_twin(&self, features: &Features, fault: Option<Fault>) -> Answer {
        let (anchor, extent) = (Vec3::from(self.shape.anchor), self.shape.extent);
        let sides = Sides::Both { behind: self.on };
        let t = match (self.class.is_plane(), fault) {
            (true, _) => hit_plane(self.origin, self.direction, anchor, extent, self.on, sides),
            (false, Some(Fault::NaiveSphere)) => naive_sphere(self.origin, self.direction, anchor, extent),
            (false, _) => hit_sphere(self.origin, self.direction, anchor, extent, self.on, sides),
        };
        // A scene of this object alone.
        let shapes = std::slice::from_ref(&self.shape);
        let sphere_count = usize::from(!self.class.is_plane());
        let scene = SceneTables { shapes, materials: &[], quads: &[], sphere_count, lights: &[], features };
        let surface = scene.surface_at(self.origin, self.direction, Hit { t, shape: 0, from: self.on.then_some(1) });
        let ([px, py, pz], [nx, ny, nz]) = (surface.position.to_array(), surface.normal.to_array());
        [t, px, py, pz, nx, ny, nz, surface.side].map(f32::to_bits)
    }
}

/// The school's formula: what cancels there.
fn naive_sphere(origin: Vec3, direction: Vec3, center: Vec3, radius: f32) -> f32 {
    let from_center = origin - center;
    let (b, c) = (from_center.dot(direction), from_center.dot(from_center) - radius * radius);
    let discriminant = b * b - c;
    if discriminant < 0.0 {
        return INFINITE;
    }
    let root = discriminant.sqrt();
    let t = if -b - root > 0.0 { -b - root } else { -b + root };
    if t > 0.0 { t } else { INFINITE }
}

/// Errors of a class on one machine.
#[derive(Default)]
struct Errors {
    /// Ulps, of rays with a cosine above ½.
    root: Vec<f64>,
    /// Ulps times cosine, of all rays.
    root_by_cosine: Vec<f64>,
    /// Of the distance, as a share of itself.
    relative: Vec<f64>,
    /// From the hit point to the surface, in ulps of the largest coordinate.
    off_surface: Vec<f64>,
    /// Units of what float32 rays can know.
    normal: Vec<f64>,
    /// Hits for misses and misses for hits, by their margin in ulps.
    flips: Vec<f64>,
    cases: u64,
}

impl Errors {
    fn add(&mut self, case: &Case, exact: &Meeting, answer: &Answer) {
        let [t, px, py, pz, nx, ny, nz, side] = answer.map(f32::from_bits);
        let hit = t < INFINITE; // false for NaN
        self.cases += 1;
        let length = case.length(exact.t);
        let Some(expected) = exact.t.filter(|_| hit) else {
            if hit != exact.t.is_some() {
                self.flips.push(exact.margin / ulp(length));
            }
            return;
        };
        let error = (f64::from(t) - expected).abs();
        if exact.cosine > 0.5 {
            self.root.push(error / ulp(length));
        }
        self.root_by_cosine.push(error * exact.cosine / ulp(length));
        self.relative.push(error / expected);
        let position = DVec3::new(px.into(), py.into(), pz.into());
        let (anchor, extent) = (Vec3::from(case.shape.anchor).as_dvec3(), f64::from(case.shape.extent));
        let (off, size) = match case.class.is_plane() {
            true => ((anchor.dot(position) - extent).abs(), position.length().max(extent.abs())),
            false => (((position - anchor).length() - extent).abs(), anchor.length() + extent),
        };
        self.off_surface.push(off / ulp(size));
        let normal = DVec3::new(nx.into(), ny.into(), nz.into()) * f64::from(side);
        // A sidewise error of an ulp of the length turns the normal by this much.
        let lever = if case.class.is_plane() { 1.0 } else { (length / (extent * exact.cosine)).max(1.0) };
        self.normal.push((normal - exact.normal).length() / (f64::from(f32::EPSILON) * lever));
    }

    fn rows(&self, class: Class, backend: Backend) -> Vec<Row> {
        let row = |measure, values: &[f64], bound| {
            Row::new(Suite::Intersection, class.name(), backend, measure, Spread::of(values), bound)
        };
        let mut rows = Vec::new();
        if !self.root.is_empty() {
            rows.push(row("root, ulp", &self.root, ROOT));
        }
        rows.push(row("root·cos, ulp", &self.root_by_cosine, ROOT));
        rows.push(row("point off surface, ulp", &self.off_surface, OFF_SURFACE));
        rows.push(row("normal, ulp of its lever", &self.normal, NORMAL));
        if !class.is_plane() {
            let worst = self.flips.iter().copied().fold(0.0, f64::max);
            let spread = Spread { worst, ..Spread::events(0, self.cases) };
            rows.push(Row::new(
                Suite::Intersection,
                class.name(),
                backend,
                "margin of hit/miss flips, ulp",
                spread,
                FLIP,
            ));
        }
        rows
    }
}

/// Ulps of the largest length: dot product, two sums and a root, each half an ulp or one, and up to √3 as much where a
/// ray meets the surface at 60°. Measured: 3.85 at worst among 14 million rays, 1.6 for 99 of 100.
const ROOT: f64 = 4.0;
/// Ulps of the largest coordinate: three coordinates' rounding, and a normal whose length is off by an ulp and a half.
/// Measured: 2.8 at worst among 400,000.
const OFF_SURFACE: f64 = 4.0;
/// The root's error and the normalisation's.
const NORMAL: f64 = 6.0;
/// Ulps by which a ray may miss what it should hit, and the reverse: as much as the root is off.
const FLIP: f64 = 4.0;

pub(super) fn run(bench: &mut Bench) -> Result<Found> {
    let each = bench.options.by_size(4_000, 40_000, 400_000u32);
    bench.step("intersection: cases in double precision")?;
    let fault = bench.options.fault;
    let cases: Vec<Case> = bench.pool.install(|| {
        let classes = Class::ALL.into_par_iter();
        classes.flat_map(|class| (0..each).into_par_iter().map(move |number| Case::of(class, number))).collect()
    });
    let exact: Vec<Meeting> = bench.pool.install(|| cases.par_iter().map(Case::exact).collect());
    let packed = Packed {
        origin: DVec3::ZERO,
        shapes: cases.iter().map(|case| case.shape).collect(),
        sphere_count: cases.iter().filter(|case| !case.class.is_plane()).count(),
        lights: Vec::new(),
        materials: Vec::new(),
        quads: Vec::new(),
    };
    let rays: Vec<[f32; 3]> = cases
        .iter()
        .flat_map(|case| [case.origin.to_array(), case.direction.to_array(), [f32::from(case.on), 0.0, 0.0]])
        .collect();
    let mut found = Found::default();
    let mut curves = Vec::new();
    for backend in bench.backends() {
        bench.step(&format!("intersection: {}", backend.name()))?;
        let answers = match backend {
            Backend::Cpu => by_twin(bench, &cases, fault),
            _ => {
                let body = "STRESS_INTERSECTION";
                let task = Task {
                    body,
                    packed: &packed,
                    alone: true,
                    in_uniforms: false,
                    two_sided: true,
                    defines: &[],
                    contracted: false,
                    cases: &rays,
                    batch: 1 << 20,
                    fault,
                };
                bench.lab.ask(backend, &task, 0..cases.len())?
            }
        };
        for class in Class::ALL {
            let mut errors = Errors::default();
            for ((case, exact), answer) in cases.iter().zip(&exact).zip(&answers).filter(|((c, _), _)| c.class == class)
            {
                errors.add(case, exact, answer);
            }
            found.rows.extend(errors.rows(class, backend));
        }
        curves.push(curve(backend.name(), &cases, &exact, &answers));
    }
    // For comparison, what is usually written.
    let naive = by_twin(bench, &cases, Some(Fault::NaiveSphere));
    curves.push(curve("school's formula", &cases, &exact, &naive));
    let chart = Chart {
        title: "Ray against sphere: largest error of t".into(),
        x: "distance from the centre, radii".into(),
        y: "largest relative error of t".into(),
        curves,
    };
    found.charts.push(("intersection".into(), chart));
    Ok(found)
}

fn by_twin(bench: &Bench, cases: &[Case], fault: Option<Fault>) -> Vec<Answer> {
    let features = features(true, false, false);
    bench.pool.install(|| cases.par_iter().map(|case| case.by_twin(&features, fault)).collect())
}

/// The largest relative error of t by distance in radii, of rays from outside that do not graze.
fn curve(name: &str, cases: &[Case], exact: &[Meeting], answers: &[Answer]) -> Curve {
    const BINS: usize = 24; // four a decade
    let mut worst = [0.0f64; BINS];
    for ((case, exact), answer) in cases.iter().zip(exact).zip(answers) {
        let (Class::Outside, Some(expected)) = (case.class, exact.t) else { continue };
        let t = f32::from_bits(answer[0]);
        let bin = (case.ratio.log10() * 4.0) as usize;
        if exact.cosine > 0.5 && bin < BINS {
            // A miss is an error of all of t.
            let error = if t < INFINITE { (f64::from(t) - expected).abs() / expected } else { 1.0 };
            worst[bin] = worst[bin].max(error);
        }
    }
    let points = worst.iter().enumerate().map(|(bin, worst)| (10f64.powf((bin as f64 + 0.5) / 4.0), *worst));
    Curve {
        name: name.into(),
        points: points.filter(|(_, worst)| *worst > 0.0).collect(),
        marked: None,
        look: Look::default(),
    }
}
