//! Paths that start at a light: they begin in the bright patch of a light close to a wall, which others seldom find.

use std::f64::consts::PI;

use glam::DVec3;

use super::Estimator;
use super::vertex::Vertex;
use crate::reference::bsdf::uniform_sphere;
use crate::reference::sampler::{Dimensions, Sampler};

/// A light, and how often paths start there.
pub(super) struct Light {
    pub(super) position: DVec3,
    pub(super) intensity: DVec3,
    /// Probability that the light's path starts here: its share of the flux.
    pub(super) selection: f64,
}

impl Estimator {
    /// The paths from lights that one path from the camera, or one from an anchor, is connected to.
    pub(super) fn walk_lights(&self, sampler: Sampler, paths: &mut Vec<Vec<Vertex>>) {
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
    pub(super) fn walk_light(&self, sampler: Sampler, path: &mut Vec<Vertex>) {
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

    /// Expected number of paths from `light`, per steradian, that one path from the camera is connected to.
    pub(super) fn emission_density(&self, light: &Light) -> f64 {
        self.technique.light_paths as f64 * light.selection / (4.0 * PI)
    }
}
