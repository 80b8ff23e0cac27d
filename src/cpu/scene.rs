//! Twin of `glsl/shared/scene.glsl`: the scene as rays see it.

use glam::Vec3;

use super::camera::normalize3;
use super::intersect::{INFINITE, hit_plane, hit_sphere};
use crate::features::Features;
use crate::layout::{Light, Object};
use crate::pack::Packed;

/// What the twins read: the very records that devices get.
#[derive(Clone, Copy)]
pub struct SceneTables<'a> {
    /// Spheres first, then planes.
    pub objects: &'a [Object],
    /// How many of the objects are spheres.
    pub sphere_count: usize,
    /// Point lights.
    pub lights: &'a [Light],
    /// What this permutation contains.
    pub features: &'a Features,
}

/// First object along a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance.
    pub t: f32,
    /// Distance of what would be hit without this object, or [`INFINITE`].
    pub next: f32,
    /// Index into the object table.
    pub object: usize,
}

/// A point on a surface with all that shading needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Scene space, back on the surface to an ulp.
    pub position: Vec3,
    /// Unit, towards the side the ray came from.
    pub normal: Vec3,
    /// Index into the object table.
    pub object: usize,
    /// +1 on the side that the stored normal points to, else −1.
    pub side: f32,
}

impl<'a> SceneTables<'a> {
    /// A packed scene at a permutation.
    pub fn new(packed: &'a Packed, features: &'a Features) -> Self {
        SceneTables { objects: &packed.objects, sphere_count: packed.sphere_count, lights: &packed.lights, features }
    }

    /// Distance to one object, or [`INFINITE`].
    fn hit(&self, i: usize, origin: Vec3, direction: Vec3, origin_object: Option<usize>) -> f32 {
        let object = &self.objects[i];
        let on = origin_object == Some(i);
        if i < self.sphere_count {
            hit_sphere(origin, direction, object.anchor.into(), object.extent, on)
        } else {
            hit_plane(origin, direction, object.anchor.into(), object.extent, on)
        }
    }

    /// First object along the ray; `origin_object` is the one that the ray starts on.
    pub fn closest_hit(&self, origin: Vec3, direction: Vec3, origin_object: Option<usize>) -> Option<Hit> {
        let mut closest = Hit { t: INFINITE, next: INFINITE, object: usize::MAX };
        for object in 0..self.objects.len() {
            let t = self.hit(object, origin, direction, origin_object);
            closest.next = closest.next.min(t.max(closest.t));
            if t < closest.t {
                closest = Hit { t, object, ..closest };
            }
        }
        (closest.object != usize::MAX).then_some(closest)
    }

    /// Whether anything lies between the origin and a light at `distance` along the ray, or a lit point on
    /// `target_object` (`None` for a light).
    pub fn occluded(
        &self,
        origin: Vec3,
        light: Vec3,
        direction: Vec3,
        distance: f32,
        origin_object: usize,
        target_object: Option<usize>,
    ) -> bool {
        // Half an ulp of the distance: a light that lies on a sphere is not shadowed by it.
        let reach = distance * 0.999_999_9;
        let others = (0..self.sphere_count).filter(|i| Some(*i) != target_object);
        if others.map(|i| self.hit(i, origin, direction, Some(origin_object))).any(|t| t < reach) {
            return true;
        }
        // By sides rather than distances, which lose all digits where a ray grazes a plane that the light lies on.
        let size = light.dot(light).sqrt();
        let between = |plane: &Object| {
            let [here, there] = [origin, light].map(|p| Vec3::from(plane.anchor).dot(p) - plane.extent);
            // A light within rounding of the plane (a few ulps of the numbers that cancel) lies on it.
            here * there < 0.0 && there.abs() > 1e-6 * (size + plane.extent.abs())
        };
        let planes = || self.objects.iter().enumerate().skip(self.sphere_count);
        self.features.plane_shadows
            && planes().any(|(i, plane)| i != origin_object && Some(i) != target_object && between(plane))
    }

    /// A hit point an ulp beside an edge, put back to the side of the other plane on which the ray travelled.
    fn keep_side(&self, origin: Vec3, direction: Vec3, hit: Hit, mut position: Vec3) -> Vec3 {
        let size = origin.x.abs() + origin.y.abs() + origin.z.abs() + hit.t;
        // Rounding reaches a few 1e-7 of the size past a plane; even at a grazing 1e-3 that is this far along the ray.
        // The edge is one with what the ray would meet next, or with what it has just left.
        if (hit.next - hit.t).min(hit.t) < 5e-4 * size {
            for (i, plane) in self.objects.iter().enumerate().skip(self.sphere_count) {
                let normal = Vec3::from(plane.anchor);
                let [here, there] = [position, origin].map(|p| normal.dot(p) - plane.extent);
                // Of what the ray starts on, the direction knows the side.
                let there = if there.abs() < 5e-7 * size { normal.dot(direction) } else { there };
                if i != hit.object && here * there <= 0.0 {
                    // Back, and eight ulps farther: then its side is known on the next ray too.
                    position += normal * (here.abs() + 1e-6 * size).copysign(there);
                }
            }
        }
        position
    }

    /// The hit point, put back on its surface: rounding along a long ray leaves it beside.
    pub fn surface_at(&self, origin: Vec3, direction: Vec3, hit: Hit) -> Surface {
        let p = origin + direction * hit.t;
        let object = &self.objects[hit.object];
        let anchor = Vec3::from(object.anchor);
        let (position, normal) = if hit.object < self.sphere_count {
            let outward = normalize3(p - anchor);
            (anchor + outward * object.extent, outward)
        } else {
            (p + anchor * (object.extent - anchor.dot(p)), anchor)
        };
        let position = self.keep_side(origin, direction, hit, position);
        let side = if normal.dot(direction) > 0.0 { -1.0 } else { 1.0 };
        Surface { position, normal: normal * side, object: hit.object, side }
    }
}
