//! One path's estimate of a pixel: bidirectional path tracing with multiple importance sampling (Veach 1997, ch. 9, 10).
//!
//! A path from the camera is connected, at each of its vertices, to the light itself (next-event estimation) and to
//! the first vertices of a path from the light. A light close to a wall makes a bright patch that paths from the camera
//! seldom find and whose direct light then varies as 1/r²; the path from the light starts in that patch. Point lights
//! and the pinhole cannot be hit, so a path of k edges has the strategies s = 1…S, the number of light-side vertices.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use super::anchors::{Anchor, Anchors};
use super::bsdf::{Bsdf, cosine_hemisphere, uniform_sphere};
use super::geometry::{Hit, SurfaceId, Surfaces};
use super::sampler::{Dimensions, Sampler};
use crate::scene::Scene;

/// How the strategies that can make the same path share it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Heuristic {
    /// Each in proportion to its density (Veach §9.2.2): as good as the power heuristic here.
    #[cfg(test)]
    Balance,
    /// In proportion to the density squared (Veach §9.2.3).
    Power,
    /// Light paths alone wherever they can do it: unbiased, noisier.
    #[cfg(test)]
    LightPathsOnly,
    /// Deliberately wrong: every strategy counts in full. What the tests must notice.
    #[cfg(test)]
    Unweighted,
}

/// Which estimator; every choice converges to the same image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Technique {
    /// S: most vertices on the light's side, the light included; 1 is path tracing with next-event estimation.
    pub light_vertices: usize,
    /// Paths from the light to each path from the camera; all are connected to it.
    pub light_paths: usize,
    /// How strategies share a path.
    pub heuristic: Heuristic,
    /// Index of the first camera-side vertex at which Russian roulette may end the path, ≥ 1.
    pub roulette_from: usize,
    /// Only light → surface → camera.
    pub direct_only: bool,
    /// Most anchors; 0 walks every path to its end. Where there are any, `light_vertices` is at most 2: the strategies
    /// of a path split at its second vertex must not reach across it.
    pub anchors: usize,
    /// Chance of estimating the difference to the anchor.
    pub difference_rate: f64,
}

/// What stands for a path beyond its second vertex.
#[derive(Clone, Copy)]
pub(super) struct Far<'a> {
    pub anchors: &'a Anchors,
    /// Indirect irradiance of each anchor.
    pub irradiance: &'a [DVec3],
}

/// Where a walk starts.
#[derive(Clone, Copy, PartialEq)]
enum Start {
    /// At what the camera sees: all light counts.
    Camera,
    /// At a vertex whose direct light is counted elsewhere.
    Indirect,
}

/// Where a walk gets its numbers from.
#[derive(Clone, Copy)]
struct Numbers {
    sampler: Sampler,
    /// Direction and lobe at the first vertex.
    first: [f64; 3],
    /// Dimensions of the vertices after it.
    next_set: u32,
}

impl Numbers {
    /// Direction (2), lobe and survival at vertex `index`.
    #[inline]
    fn at(&self, index: usize) -> [f64; 4] {
        match index {
            0 => [self.first[0], self.first[1], self.first[2], 0.0],
            _ => self.sampler.get(Dimensions(self.next_set + index as u32 - 1)),
        }
    }
}

/// Difference of two points' kernels, over the density, from which on a direction's radiance is always estimated.
///
/// Of a possible 2π. Half and twice of it took 20% longer to the same error.
const FULL_DIFFERENCE: f64 = 0.5 * PI;

/// Paths that look for places worth an anchor.
const EXPLORED: u64 = 1 << 17;

/// Upper bound of a path's chance to go on; the chance itself is the fourth root of its throughput.
///
/// Gentler than the usual first power: it saved a quarter of the variance in equal time, since a path that ends early is
/// made up for by another's weight. But a path may not grow beyond this chance to go on, else albedo 1 would keep it alive for ever.
const MAX_SURVIVAL: f64 = 0.95;

struct Light {
    position: DVec3,
    intensity: DVec3,
    /// Probability that the light's path starts here: its share of the flux.
    selection: f64,
}

/// A pinhole camera's frame.
struct View {
    position: DVec3,
    forward: DVec3,
    /// Image half width and half height as vectors in the plane at distance 1.
    right: DVec3,
    up: DVec3,
}

/// A vertex of either path, seen from the vertex before it.
#[derive(Clone, Copy)]
struct Vertex {
    position: DVec3,
    /// Unit, on the side of `outgoing`.
    normal: DVec3,
    /// Unit, towards the vertex before.
    outgoing: DVec3,
    /// Radiance weight or flux that arrives here, divided by the density of the path so far.
    throughput: DVec3,
    surface: SurfaceId,
    material: usize,
    /// `outgoing` lies within a solid sphere.
    inside: bool,
    /// Density by area of making this vertex from the one before; 0 after a delta lobe.
    pdf: f64,
    /// Density by area of making this vertex from the one after it.
    pdf_reverse: f64,
    /// |cos|/d² at the vertex before: turns a density by angle here into one by area there.
    to_previous: f64,
    /// The path left here by a delta lobe.
    delta: bool,
}

/// Densities by area, of the end points of a connection, made from its other side.
#[derive(Clone, Copy, Default)]
struct Reverse {
    eye_last: f64,
    eye_before: f64,
    light_last: f64,
    light_before: f64,
}

/// Buffers that one thread reuses from path to path.
#[derive(Default)]
pub(super) struct Scratch {
    eye: Vec<Vertex>,
    light: Vec<Vec<Vertex>>,
}

/// A scene made ready, with the estimator to use.
pub(super) struct Estimator {
    surfaces: Surfaces,
    sphere_count: usize,
    bsdfs: Vec<Bsdf>,
    lights: Vec<Light>,
    view: View,
    technique: Technique,
}

impl Estimator {
    pub fn new(scene: &Scene, size: (u32, u32), technique: Technique) -> Self {
        let flux: f64 = scene.lights.iter().map(|l| l.intensity.element_sum()).sum();
        let camera = &scene.camera;
        let forward = (camera.look_at - camera.position).normalize();
        let right = forward.cross(camera.up).normalize();
        let half_height = (camera.fov_y.to_radians() / 2.0).tan();
        let half_width = half_height * f64::from(size.0) / f64::from(size.1);
        Self {
            surfaces: Surfaces::new(scene),
            sphere_count: scene.spheres.len(),
            bsdfs: scene.materials.iter().map(Bsdf::new).collect(),
            lights: scene
                .lights
                .iter()
                .filter(|l| l.intensity.max_element() > 0.0)
                .map(|l| Light {
                    position: l.position,
                    intensity: l.intensity,
                    selection: l.intensity.element_sum() / flux,
                })
                .collect(),
            view: View {
                position: camera.position,
                forward,
                right: right * half_width,
                up: right.cross(forward) * half_height,
            },
            technique,
        }
    }

    /// Radiance through pixel (`column`, `row`) of an image of `size`, one sample of its box filter.
    ///
    /// `far`: the anchors and their irradiance so far, to stand for what paths find beyond their second vertex.
    pub fn pixel(
        &self,
        (column, row): (u32, u32),
        size: (u32, u32),
        sampler: Sampler,
        far: Option<Far>,
        scratch: &mut Scratch,
    ) -> DVec3 {
        let first = sampler.get(Dimensions(0));
        let x = (f64::from(column) + first[0]) / f64::from(size.0);
        let y = (f64::from(row) + first[1]) / f64::from(size.1);
        let Some(vertex) = self.seen(x, y) else {
            return DVec3::ZERO;
        };
        self.walk_lights(sampler, &mut scratch.light);
        let second = sampler.get(Dimensions(1));
        let numbers = Numbers { sampler, first: [first[2], first[3], second[2]], next_set: 2 };
        self.walk(vertex, numbers, Start::Camera, far, scratch)
    }

    /// What the camera sees at (`x`, `y`) in [0, 1)² of the image, row 0 at the top.
    fn seen(&self, x: f64, y: f64) -> Option<Vertex> {
        let view = &self.view;
        let direction = (view.forward + view.right * (2.0 * x - 1.0) + view.up * (1.0 - 2.0 * y)).normalize();
        let hit = self.surfaces.nearest(view.position, direction, None)?;
        Some(self.vertex(hit, direction, DVec3::ONE))
    }

    /// Radiance that leaves `vertex` towards where it was seen from.
    #[inline]
    fn walk(&self, vertex: Vertex, numbers: Numbers, start: Start, far: Option<Far>, scratch: &mut Scratch) -> DVec3 {
        scratch.eye.clear();
        scratch.eye.push(vertex);
        let mut radiance = DVec3::ZERO;
        let mut seen_directly = start == Start::Camera;
        loop {
            let last = scratch.eye.len() - 1;
            let vertex = scratch.eye[last];
            let bsdf = &self.bsdfs[vertex.material];
            if seen_directly {
                radiance += vertex.throughput * bsdf.ambient;
            }
            if bsdf.connectible() {
                if last > 0 || start == Start::Camera {
                    for light in &self.lights {
                        radiance += self.next_event(&scratch.eye, light);
                    }
                }
                if let Some(far) = far.filter(|_| last == 1)
                    && let Some(anchor) = far.anchors.find(vertex.surface, vertex.normal, vertex.position)
                {
                    let reflected = vertex.throughput * bsdf.diffuse();
                    return radiance + reflected * self.indirect(&vertex, anchor, far, numbers.sampler, scratch);
                }
                for path in &scratch.light {
                    for count in 1..=path.len() {
                        radiance += self.join(&scratch.eye, &path[..count]);
                    }
                }
            }
            if self.technique.direct_only && !bsdf.has_delta() {
                return radiance;
            }
            // Go on: where, and whether at all.
            let [u, v, lobe, survive] = numbers.at(last);
            let Some(scatter) = bsdf.sample(vertex.outgoing, vertex.normal, [u, v], lobe, vertex.inside, true) else {
                return radiance;
            };
            seen_directly &= scatter.delta;
            if self.technique.direct_only && !seen_directly {
                return radiance;
            }
            let mut throughput = vertex.throughput * scatter.weight;
            if last >= self.technique.roulette_from {
                let survival = throughput.max_element().sqrt().sqrt().min(MAX_SURVIVAL);
                if survive >= survival {
                    return radiance;
                }
                throughput /= survival;
            }
            let Some(hit) = self.surfaces.nearest(vertex.position, scatter.direction, Some(vertex.surface)) else {
                return radiance;
            };
            scratch.eye[last].delta = scatter.delta;
            if last > 0 {
                scratch.eye[last - 1].pdf_reverse = scatter.pdf_reverse * vertex.to_previous;
            }
            let next = self.follow(&vertex, hit, scatter.direction, scatter.pdf, throughput);
            scratch.eye.push(next);
        }
    }

    /// Indirect irradiance at `vertex`: that of the anchor and, at times, the difference between the two.
    #[inline]
    fn indirect(&self, vertex: &Vertex, anchor: usize, far: Far, sampler: Sampler, scratch: &mut Scratch) -> DVec3 {
        let known = far.irradiance[anchor];
        let [u, v, decide, _] = sampler.get(Dimensions(2));
        let rate = self.technique.difference_rate;
        if decide >= rate {
            return known;
        }
        let here = Anchor { position: vertex.position, normal: vertex.normal, surface: vertex.surface };
        let there = far.anchors.points()[anchor];
        // Directions come from either point with equal chance.
        let from_there = decide < 0.5 * rate;
        known + self.irradiance(&here, Some((&there, from_there)), [u, v], sampler, scratch) / rate
    }

    /// One estimate of the indirect irradiance at an anchor.
    pub fn anchor(&self, anchor: &Anchor, sampler: Sampler, scratch: &mut Scratch) -> DVec3 {
        self.walk_lights(sampler, &mut scratch.light);
        let [u, v, _, _] = sampler.get(Dimensions(0));
        self.irradiance(anchor, None, [u, v], sampler, scratch)
    }

    /// Indirect irradiance at `here`, less that at `there` if it is given; surfaces must be diffuse.
    ///
    /// Both points gather from the same vertex, made by scattering from one of them or by the light's path, with MIS
    /// as everywhere; the difference of two kernels that are nearly equal has little variance.
    fn irradiance(
        &self,
        here: &Anchor,
        there: Option<(&Anchor, bool)>,
        u: [f64; 2],
        sampler: Sampler,
        scratch: &mut Scratch,
    ) -> DVec3 {
        let kernels = |vertex: &Vertex| {
            let a = self.kernel(here, vertex);
            let b = there.map_or(0.0, |(there, _)| self.kernel(there, vertex));
            let points = if there.is_some() { 2.0 } else { 1.0 };
            (a - b, (a + b) / (points * PI)) // and the density by area of making the vertex from here or there
        };
        let weight = |own: f64, other: f64| 1.0 / (1.0 + (other / own) * (other / own));
        let mut sum = DVec3::ZERO;
        for vertex in scratch.light.iter().filter_map(|path| path.first()) {
            let (kernel, density) = kernels(vertex);
            if kernel != 0.0 {
                let radiosity = vertex.throughput * self.bsdfs[vertex.material].diffuse();
                sum += radiosity * (kernel * weight(vertex.pdf, density));
            }
        }
        let from = there.filter(|(_, from_there)| *from_there).map_or(here, |(there, _)| there);
        let direction = cosine_hemisphere(from.normal, u);
        let Some(hit) = self.surfaces.nearest(from.position, direction, Some(from.surface)) else {
            return sum;
        };
        let vertex = self.vertex(hit, direction, DVec3::ONE);
        let (kernel, density) = kernels(&vertex);
        if kernel == 0.0 || density <= 0.0 {
            return sum;
        }
        // The less the two points differ in this direction, the less often its radiance need be known.
        let [u, v, lobe, survive] = sampler.get(Dimensions(3));
        let ratio = kernel / density;
        let survival = if there.is_some() { (ratio.abs() / FULL_DIFFERENCE).min(1.0) } else { 1.0 };
        if survive >= survival {
            return sum;
        }
        let mut radiance = DVec3::ZERO;
        for light in &self.lights {
            let to_light = light.position - vertex.position;
            let d2 = to_light.length_squared();
            let geometry = vertex.normal.dot(to_light) / (d2 * d2.sqrt());
            if geometry > 0.0 && !self.surfaces.occluded(vertex.position, vertex.surface, light.position, None) {
                let by_light =
                    if self.technique.light_vertices > 1 { self.emission_density(light) * geometry } else { 0.0 };
                radiance +=
                    self.bsdfs[vertex.material].diffuse() * light.intensity * (geometry * weight(density, by_light));
            }
        }
        let numbers = Numbers { sampler, first: [u, v, lobe], next_set: 4 };
        radiance += self.walk(vertex, numbers, Start::Indirect, None, scratch);
        sum + radiance * (ratio / survival)
    }

    /// cos·cos/d² between a point and a vertex, 0 if they do not see each other.
    #[inline]
    fn kernel(&self, point: &Anchor, vertex: &Vertex) -> f64 {
        let segment = vertex.position - point.position;
        let d2 = segment.length_squared();
        let (cos_point, cos_vertex) = (point.normal.dot(segment), -vertex.normal.dot(segment));
        if cos_point <= 0.0
            || cos_vertex <= 0.0
            || self.surfaces.occluded(point.position, point.surface, vertex.position, Some(vertex.surface))
        {
            return 0.0;
        }
        cos_point * cos_vertex / (d2 * d2)
    }

    /// At most `most` anchors for this scene and camera; none if it has other than diffuse surfaces, for which irradiance is not enough.
    pub fn anchors(&self, most: usize) -> Anchors {
        if self.technique.direct_only || most == 0 || !self.bsdfs.iter().all(Bsdf::only_diffuse) {
            return Anchors::default();
        }
        let visited: Vec<_> = (0..EXPLORED)
            .into_par_iter()
            .filter_map(|index| {
                let [x, y, u, v] = Sampler::new(0, 0, 0, index).get(Dimensions(0));
                let first = self.seen(x, y)?;
                let direction = cosine_hemisphere(first.normal, [u, v]);
                let hit = self.surfaces.nearest(first.position, direction, Some(first.surface))?;
                let second = self.vertex(hit, direction, DVec3::ONE);
                Some(Anchor { position: second.position, normal: second.normal, surface: second.surface })
            })
            .collect();
        Anchors::new(&visited, most)
    }

    /// The paths from lights that one path from the camera, or one from an anchor, is connected to.
    fn walk_lights(&self, sampler: Sampler, paths: &mut Vec<Vec<Vertex>>) {
        if self.technique.light_vertices < 2 || self.technique.direct_only || self.lights.is_empty() {
            return;
        }
        paths.resize_with(self.technique.light_paths, Vec::new);
        for (number, path) in paths.iter_mut().enumerate() {
            let sampler = sampler.split(self.technique.light_paths as u32, number as u32);
            self.walk_light(sampler, path);
        }
    }

    /// A path from a light: S − 1 vertices at most.
    fn walk_light(&self, sampler: Sampler, path: &mut Vec<Vertex>) {
        path.clear();
        let [u, v, pick, _] = sampler.get(Dimensions(0));
        let mut below = 0.0;
        let light = self
            .lights
            .iter()
            .find(|light| {
                below += light.selection;
                pick < below
            })
            .unwrap_or(&self.lights[self.lights.len() - 1]);
        let direction = uniform_sphere([u, v]);
        let Some(hit) = self.surfaces.nearest(light.position, direction, None) else {
            return;
        };
        let density = self.emission_density(light);
        let mut vertex = self.vertex(hit, direction, light.intensity / density);
        vertex.pdf = density * vertex.normal.dot(vertex.outgoing) / (hit.distance * hit.distance);
        path.push(vertex);
        while path.len() + 1 < self.technique.light_vertices {
            let last = path.len() - 1;
            let vertex = path[last];
            let [u, v, lobe, _] = sampler.get(Dimensions(1 + last as u32));
            let bsdf = &self.bsdfs[vertex.material];
            let Some(scatter) = bsdf.sample(vertex.outgoing, vertex.normal, [u, v], lobe, vertex.inside, false) else {
                return;
            };
            let Some(hit) = self.surfaces.nearest(vertex.position, scatter.direction, Some(vertex.surface)) else {
                return;
            };
            path[last].delta = scatter.delta;
            if last > 0 {
                path[last - 1].pdf_reverse = scatter.pdf_reverse * vertex.to_previous;
            }
            let throughput = vertex.throughput * scatter.weight;
            path.push(self.follow(&vertex, hit, scatter.direction, scatter.pdf, throughput));
        }
    }

    /// A vertex at `hit`, reached along `direction` from a light or the camera.
    #[inline]
    fn vertex(&self, hit: Hit, direction: DVec3, throughput: DVec3) -> Vertex {
        let outward = hit.normal.dot(direction) < 0.0;
        Vertex {
            position: hit.position,
            normal: if outward { hit.normal } else { -hit.normal },
            outgoing: -direction,
            throughput,
            surface: hit.surface,
            material: hit.material,
            inside: !outward && hit.surface < self.sphere_count,
            pdf: 0.0,
            pdf_reverse: 0.0,
            to_previous: 0.0,
            delta: false,
        }
    }

    /// A vertex at `hit`, reached along `direction` from `previous` with density `pdf` per steradian.
    #[inline]
    fn follow(&self, previous: &Vertex, hit: Hit, direction: DVec3, pdf: f64, throughput: DVec3) -> Vertex {
        let mut vertex = self.vertex(hit, direction, throughput);
        let inverse_d2 = 1.0 / (hit.distance * hit.distance);
        vertex.pdf = pdf * vertex.normal.dot(vertex.outgoing) * inverse_d2;
        vertex.to_previous = previous.normal.dot(direction).abs() * inverse_d2;
        vertex
    }

    /// Expected number of paths from `light`, per steradian, that one path from the camera is connected to.
    fn emission_density(&self, light: &Light) -> f64 {
        self.technique.light_paths as f64 * light.selection / (4.0 * PI)
    }

    /// s = 1: the last vertex of `eye` lit by `light` directly.
    #[inline]
    fn next_event(&self, eye: &[Vertex], light: &Light) -> DVec3 {
        let vertex = &eye[eye.len() - 1];
        let to_light = light.position - vertex.position;
        let d2 = to_light.length_squared();
        let incident = to_light / d2.sqrt();
        let Some(bsdf) = self.bsdfs[vertex.material].evaluate(vertex.outgoing, incident, vertex.normal) else {
            return DVec3::ZERO;
        };
        let geometry = vertex.normal.dot(incident) / d2;
        let unweighted = vertex.throughput * bsdf.value * light.intensity * geometry;
        if unweighted.max_element() <= 0.0
            || self.surfaces.occluded(vertex.position, vertex.surface, light.position, None)
        {
            return DVec3::ZERO;
        }
        let reverse = Reverse {
            eye_last: self.emission_density(light) * geometry,
            eye_before: bsdf.pdf_reverse * vertex.to_previous,
            ..Reverse::default()
        };
        unweighted * self.weight(eye, &[], reverse)
    }

    /// s ≥ 2: the last vertex of `eye` joined to the last vertex of `light`.
    #[inline]
    fn join(&self, eye: &[Vertex], light: &[Vertex]) -> DVec3 {
        let (a, b) = (&eye[eye.len() - 1], &light[light.len() - 1]);
        let segment = b.position - a.position;
        let d2 = segment.length_squared();
        let direction = segment / d2.sqrt();
        let (cos_a, cos_b) = (a.normal.dot(direction), -b.normal.dot(direction));
        if cos_a <= 0.0 || cos_b <= 0.0 || !self.bsdfs[b.material].connectible() {
            return DVec3::ZERO;
        }
        let at_a = self.bsdfs[a.material].evaluate(a.outgoing, direction, a.normal);
        let at_b = self.bsdfs[b.material].evaluate(b.outgoing, -direction, b.normal);
        let (Some(at_a), Some(at_b)) = (at_a, at_b) else {
            return DVec3::ZERO;
        };
        let geometry = cos_a * cos_b / d2;
        let unweighted = a.throughput * at_a.value * at_b.value * b.throughput * geometry;
        if unweighted.max_element() <= 0.0 || self.surfaces.occluded(a.position, a.surface, b.position, Some(b.surface))
        {
            return DVec3::ZERO;
        }
        let reverse = Reverse {
            eye_last: at_b.pdf * cos_a / d2,
            eye_before: at_a.pdf_reverse * a.to_previous,
            light_last: at_a.pdf * cos_b / d2,
            light_before: at_b.pdf_reverse * b.to_previous,
        };
        unweighted * self.weight(eye, light, reverse)
    }

    /// MIS weight of the strategy that made this path, against all others that could have: their densities relative
    /// to its own, found by moving the connection one vertex at a time (Veach §10.2).
    #[inline]
    fn weight(&self, eye: &[Vertex], light: &[Vertex], reverse: Reverse) -> f64 {
        let longest = self.technique.light_vertices;
        #[cfg(test)]
        match self.technique.heuristic {
            Heuristic::Unweighted => return 1.0,
            Heuristic::LightPathsOnly => return if light.is_empty() && eye.len() > 1 { 0.0 } else { 1.0 },
            _ => {}
        }
        let share = |ratio: f64| match self.technique.heuristic {
            #[cfg(test)]
            Heuristic::Balance => ratio,
            _ => ratio * ratio,
        };
        // A delta lobe's density is infinite on both sides of the ratio: 1 stands for it.
        let finite = |pdf: f64| if pdf > 0.0 { pdf } else { 1.0 };
        let mut sum = 1.0;
        // Camera-side vertices handed to the light, from the connection back; the first one must stay.
        let last = eye.len() - 1;
        let mut ratio = 1.0;
        for moved in 0..last.min(longest - 1 - light.len()) {
            let i = last - moved;
            let pdf_reverse = match moved {
                0 => reverse.eye_last,
                1 => reverse.eye_before,
                _ => eye[i].pdf_reverse,
            };
            ratio *= finite(pdf_reverse) / finite(eye[i].pdf);
            if !eye[i - 1].delta && (moved == 0 || !eye[i].delta) {
                sum += share(ratio);
            }
        }
        // Light-side vertices handed to the camera.
        let mut ratio = 1.0;
        for moved in 0..light.len() {
            let i = light.len() - 1 - moved;
            let pdf_reverse = match moved {
                0 => reverse.light_last,
                1 => reverse.light_before,
                _ => light[i].pdf_reverse,
            };
            ratio *= finite(pdf_reverse) / finite(light[i].pdf);
            if (i == 0 || !light[i - 1].delta) && (moved == 0 || !light[i].delta) {
                sum += share(ratio);
            }
        }
        1.0 / sum
    }
}
