//! The edge that joins a path from the camera to the light, or to a path from it.

use glam::DVec3;

use super::Estimator;
use super::light_path::Light;
use super::mis::Reverse;
use super::vertex::Vertex;

impl Estimator {
    /// s = 1: the last vertex of `eye` lit by `light` directly.
    #[inline]
    pub(super) fn next_event(&self, eye: &[Vertex], light: &Light) -> DVec3 {
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
    pub(super) fn join(&self, eye: &[Vertex], light: &[Vertex]) -> DVec3 {
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
}
