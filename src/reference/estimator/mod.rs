//! One path's estimate of a pixel: bidirectional path tracing with multiple importance sampling (Veach 1997, ch. 9, 10).
//!
//! A path from the camera is connected, at each of its vertices, to the light itself (next-event estimation) and to
//! the first vertices of a path from the light. A light close to a wall makes a bright patch that paths from the camera
//! seldom find and whose direct light then varies as 1/r²; the path from the light starts in that patch. Point lights
//! and the pinhole cannot be hit, so a path of k edges has the strategies s = 1…S, the number of light-side vertices.

use glam::DVec3;

use super::bsdf::Bsdf;
use super::sampler::{Dimensions, Sampler};
use super::shapes::Surfaces;
use super::technique::Technique;
use crate::scene::Scene;

mod connection;
mod irradiance;
mod light_path;
mod mis;
mod vertex;

pub(super) use irradiance::Far;
use light_path::Light;
use vertex::Vertex;

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

/// Upper bound of a path's chance to go on; the chance itself is the fourth root of its throughput.
///
/// Gentler than the usual first power: it saved a quarter of the variance in equal time, since a path that ends early is
/// made up for by another's weight. But a path may not grow beyond this chance to go on, else albedo 1 would keep it
/// alive for ever.
const MAX_SURVIVAL: f64 = 0.95;

/// A pinhole camera's frame.
struct View {
    position: DVec3,
    forward: DVec3,
    /// Image half width and half height as vectors in the plane at distance 1.
    right: DVec3,
    up: DVec3,
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
    bsdfs: Vec<Bsdf>,
    lights: Vec<Light>,
    view: View,
    technique: Technique,
}

impl Estimator {
    pub fn new(scene: &Scene, size: (u32, u32), technique: Technique) -> Self {
        let flux: f64 = scene.lights.points.iter().map(|l| l.intensity.element_sum()).sum();
        let camera = &scene.camera;
        let forward = (camera.look_at - camera.position).normalize();
        let right = forward.cross(camera.up).normalize();
        let half_height = (camera.fov_y.to_radians() / 2.0).tan();
        let half_width = half_height * f64::from(size.0) / f64::from(size.1);
        Self {
            surfaces: Surfaces::new(scene),
            bsdfs: scene.materials.iter().map(Bsdf::new).collect(),
            lights: scene
                .lights
                .points
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
}
