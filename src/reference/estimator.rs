//! One path's estimate of a pixel: bidirectional path tracing with multiple importance sampling (Veach 1997, ch. 9, 10).
//!
//! A path from the camera is connected, at each of its vertices, to the light itself (next-event estimation) and to
//! the first vertices of a path from the light. A light close to a wall makes a bright patch that paths from the camera
//! seldom find and whose direct light then varies as 1/r²; the path from the light starts in that patch. Point lights
//! and the pinhole cannot be hit, so a path of k edges has the strategies s = 1…S, the number of light-side vertices.

use std::f64::consts::PI;

use glam::DVec3;

use super::bsdf::{Bsdf, uniform_sphere};
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
}

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
    pub fn pixel(&self, (column, row): (u32, u32), size: (u32, u32), sampler: Sampler, scratch: &mut Scratch) -> DVec3 {
        let first = sampler.get(Dimensions(0));
        let x = 2.0 * (f64::from(column) + first[0]) / f64::from(size.0) - 1.0;
        let y = 1.0 - 2.0 * (f64::from(row) + first[1]) / f64::from(size.1);
        let direction = (self.view.forward + self.view.right * x + self.view.up * y).normalize();
        let Some(hit) = self.surfaces.nearest(self.view.position, direction, None) else {
            return DVec3::ZERO;
        };
        let second = sampler.get(Dimensions(1));
        self.walk_lights(sampler, &mut scratch.light);
        scratch.eye.clear();
        scratch.eye.push(self.vertex(hit, direction, DVec3::ONE));

        let mut radiance = DVec3::ZERO;
        let mut seen_directly = true;
        loop {
            let last = scratch.eye.len() - 1;
            let vertex = scratch.eye[last];
            let bsdf = &self.bsdfs[vertex.material];
            if seen_directly {
                radiance += vertex.throughput * bsdf.ambient;
            }
            if bsdf.connectible() {
                radiance += self.connect(scratch);
            }
            if self.technique.direct_only && !bsdf.has_delta() {
                return radiance;
            }
            // Go on: where, and whether at all.
            let [u, v, lobe, survive] =
                if last == 0 { [first[2], first[3], second[2], 0.0] } else { sampler.get(Dimensions(1 + last as u32)) };
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

    /// All strategies that end the camera's path at its last vertex.
    #[inline]
    fn connect(&self, scratch: &Scratch) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for light in &self.lights {
            sum += self.next_event(&scratch.eye, light);
        }
        for path in &scratch.light {
            for count in 1..=path.len() {
                sum += self.join(&scratch.eye, &path[..count]);
            }
        }
        sum
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
