//! Twin of `glsl/shared/scene.glsl`: the scene as rays see it.

use glam::Vec3;

use super::camera::normalize3;
use super::intersect::{INFINITE, Sides, hit_plane, hit_sphere};
use crate::program::features::Features;
use crate::records::packing::Packed;
use crate::records::{Light, Object};

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
    /// Index into the object table.
    pub object: usize,
    /// Face that the ray leaves, see [`Surface::face_left`].
    pub from: Option<usize>,
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

/// Object i has face 2i, where its normal points, and 2i + 1 behind.
fn object_of(face: Option<usize>) -> Option<usize> {
    face.map(|face| face / 2)
}

fn is_behind(face: Option<usize>) -> bool {
    face.is_some_and(|face| face % 2 == 1)
}

impl Surface {
    /// Face that a ray leaves which goes on from here: 2i for the side of object i that its normal points to, 2i + 1
    /// behind.
    pub fn face_left(&self) -> usize {
        self.object * 2 + usize::from(self.side < 0.0)
    }
}

/// Of a point's size: so far from all other surfaces that its side is known.
const MARGIN: f32 = 1e-6;
/// Nearer than this it is moved.
const UNSURE: f32 = 6e-7;

/// Sum of a point's coordinates: what rounding is measured by.
fn size_of(p: Vec3) -> f32 {
    p.x.abs() + p.y.abs() + p.z.abs()
}

impl<'a> SceneTables<'a> {
    /// A packed scene at a permutation.
    pub fn new(packed: &'a Packed, features: &'a Features) -> Self {
        SceneTables { objects: &packed.objects, sphere_count: packed.sphere_count, lights: &packed.lights, features }
    }

    /// Distance to one object, or [`INFINITE`].
    fn hit(&self, i: usize, origin: Vec3, direction: Vec3, origin_face: Option<usize>) -> f32 {
        let object = &self.objects[i];
        let on = object_of(origin_face) == Some(i);
        let sides = if self.features.two_sided { Sides::Both { behind: is_behind(origin_face) } } else { Sides::Front };
        if i < self.sphere_count {
            hit_sphere(origin, direction, object.anchor.into(), object.extent, on, sides)
        } else {
            hit_plane(origin, direction, object.anchor.into(), object.extent, on, sides)
        }
    }

    /// First object along the ray; `origin_face` is the one that the ray leaves.
    pub fn closest_hit(&self, origin: Vec3, direction: Vec3, origin_face: Option<usize>) -> Option<Hit> {
        let mut closest = Hit { t: INFINITE, object: usize::MAX, from: origin_face };
        for object in 0..self.objects.len() {
            let t = self.hit(object, origin, direction, origin_face);
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
        origin_face: usize,
        target_object: Option<usize>,
    ) -> bool {
        // Half an ulp of the distance: a light that lies on a sphere is not shadowed by it.
        let reach = distance * 0.999_999_9;
        let others = (0..self.sphere_count).filter(|i| Some(*i) != target_object);
        if others.map(|i| self.hit(i, origin, direction, Some(origin_face))).any(|t| t < reach) {
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
            && planes()
                .any(|(i, plane)| Some(i) != object_of(Some(origin_face)) && Some(i) != target_object && between(plane))
    }

    /// A hit point beside an edge or a contact, put to the side of every other surface from which the ray came.
    fn keep_side(&self, origin: Vec3, direction: Vec3, hit: Hit, mut position: Vec3) -> Vec3 {
        let leaves = if is_behind(hit.from) { -1.0 } else { 1.0 };
        let side = |i, there: f32| if object_of(hit.from) == Some(i) { leaves } else { 1f32.copysign(there) };
        for (i, object) in self.objects.iter().enumerate() {
            let (anchor, extent, size) = (Vec3::from(object.anchor), object.extent, size_of(position));
            if i < self.sphere_count {
                let (away, before) = (position - anchor, origin - anchor);
                let [here, there] = [away, before].map(|p| p.dot(p) - extent * extent);
                let reach = extent + size;
                if i == hit.object || here.abs() >= 4.0 * UNSURE * extent * reach {
                    continue;
                }
                // Of a camera on the sphere, the direction tells the side.
                let unsure = there.abs() <= UNSURE * (extent * extent);
                let side = side(i, if unsure { before.dot(direction) } else { there });
                if here * side < 2.0 * UNSURE * extent * reach {
                    position += away * ((side * MARGIN * reach - here / (2.0 * extent)) / extent);
                }
            } else {
                let [here, there] = [position, origin].map(|p| anchor.dot(p) - extent);
                let unsure = there.abs() <= 2.5e-7 * size_of(origin);
                let side = side(i, if unsure { anchor.dot(direction) } else { there });
                if i != hit.object && here * side < UNSURE * size {
                    position += anchor * (side * MARGIN * size - here);
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
        if !self.features.two_sided {
            return Surface { position, normal, object: hit.object, side: 1.0 };
        }
        let position = self.keep_side(origin, direction, hit, position);
        let from_center = origin - anchor;
        let from_behind = if hit.object < self.sphere_count {
            // Where a ray grazes a sphere its angle is rounding: where it starts tells, as it did the root.
            object_of(hit.from) == Some(hit.object) || from_center.dot(from_center) <= object.extent * object.extent
        } else {
            normal.dot(direction) > 0.0
        };
        let side = if from_behind { -1.0 } else { 1.0 };
        Surface { position, normal: normal * side, object: hit.object, side }
    }
}
