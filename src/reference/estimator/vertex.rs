//! A vertex of a path, and how a ray's hit becomes one.

use glam::DVec3;

use super::Estimator;
use crate::reference::shapes::{Hit, SurfaceId};

/// A vertex of either path, seen from the vertex before it.
#[derive(Clone, Copy)]
pub(super) struct Vertex {
    pub(super) position: DVec3,
    /// Unit, on the side of `outgoing`.
    pub(super) normal: DVec3,
    /// Unit, towards the vertex before.
    pub(super) outgoing: DVec3,
    /// Radiance weight or flux that arrives here, divided by the density of the path so far.
    pub(super) throughput: DVec3,
    pub(super) surface: SurfaceId,
    pub(super) material: usize,
    /// `outgoing` lies within a solid sphere.
    pub(super) inside: bool,
    /// Density by area of making this vertex from the one before; 0 after a delta lobe.
    pub(super) pdf: f64,
    /// Density by area of making this vertex from the one after it.
    pub(super) pdf_reverse: f64,
    /// |cos|/d² at the vertex before: turns a density by angle here into one by area there.
    pub(super) to_previous: f64,
    /// The path left here by a delta lobe.
    pub(super) delta: bool,
}

impl Estimator {
    /// A vertex at `hit`, reached along `direction` from a light or the camera.
    #[inline]
    pub(super) fn vertex(&self, hit: Hit, direction: DVec3, throughput: DVec3) -> Vertex {
        let outward = hit.normal.dot(direction) < 0.0;
        Vertex {
            position: hit.position,
            normal: if outward { hit.normal } else { -hit.normal },
            outgoing: -direction,
            throughput,
            surface: hit.surface,
            material: hit.material,
            inside: !outward && hit.is_solid,
            pdf: 0.0,
            pdf_reverse: 0.0,
            to_previous: 0.0,
            delta: false,
        }
    }

    /// A vertex at `hit`, reached along `direction` from `previous` with density `pdf` per steradian.
    #[inline]
    pub(super) fn follow(&self, previous: &Vertex, hit: Hit, direction: DVec3, pdf: f64, throughput: DVec3) -> Vertex {
        let mut vertex = self.vertex(hit, direction, throughput);
        let inverse_d2 = 1.0 / (hit.distance * hit.distance);
        vertex.pdf = pdf * vertex.normal.dot(vertex.outgoing) * inverse_d2;
        vertex.to_previous = previous.normal.dot(direction).abs() * inverse_d2;
        vertex
    }
}
