//! How the strategies that can make one and the same path share it (Veach 1997, ch. 9, 10).

use super::Estimator;
use super::vertex::Vertex;
#[cfg(test)]
use crate::reference::technique::Heuristic;

/// Densities by area, of the end points of a connection, made from its other side.
#[derive(Clone, Copy, Default)]
pub(super) struct Reverse {
    pub(super) eye_last: f64,
    pub(super) eye_before: f64,
    pub(super) light_last: f64,
    pub(super) light_before: f64,
}

impl Estimator {
    /// MIS weight of the strategy that made this path, against all others that could have: their densities relative
    /// to its own, found by moving the connection one vertex at a time (Veach §10.2).
    #[inline]
    pub(super) fn weight(&self, eye: &[Vertex], light: &[Vertex], reverse: Reverse) -> f64 {
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
