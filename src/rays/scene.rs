//! Twin of `glsl/shared/scene.glsl`: the scene as rays see it.

use glam::Vec3;

use super::shapes::{self, INFINITE, KeepSide, Placed, ShadowRay, ShapeAt, Sides};
use crate::kinds::ShapeKind;
use crate::packing::Packed;
use crate::program::features::Features;
use crate::records::face::{self, face_of, shape_of_sheet, sheet_of, sheet_of_shape};
use crate::records::{Light, Material, Quad, Shape};

/// What the twins read: the very records that devices get.
#[derive(Clone, Copy)]
pub struct SceneTables<'a> {
    /// Spheres first, then planes, then quads.
    pub shapes: &'a [Shape],
    /// Rows that shapes name.
    pub materials: &'a [Material],
    /// How many of the objects are spheres.
    pub sphere_count: usize,
    /// What quads, which come last, have besides their planes.
    pub quads: &'a [Quad],
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
    pub shape: usize,
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
    pub shape: usize,
    /// +1 on the side that the stored normal points to, else −1.
    pub side: f32,
}

/// Shape i has face 2i, where its normal points, and 2i + 1 behind.
fn shape_of(face: Option<usize>) -> Option<usize> {
    face.map(|face| shape_of_sheet(sheet_of(face)))
}

fn is_behind(face: Option<usize>) -> bool {
    face.is_some_and(face::is_behind)
}

impl Surface {
    /// Face that a ray leaves which goes on from here: 2i for the side of object i that its normal points to, 2i + 1
    /// behind.
    pub fn face_left(&self) -> usize {
        face_of(sheet_of_shape(self.shape), self.side < 0.0)
    }
}

impl<'a> SceneTables<'a> {
    /// A packed scene at a permutation.
    pub fn new(packed: &'a Packed, features: &'a Features) -> Self {
        SceneTables {
            shapes: &packed.shapes,
            materials: &packed.materials,
            sphere_count: packed.sphere_count,
            quads: &packed.quads,
            lights: &packed.lights,
            features,
        }
    }

    /// A shape by its number.
    #[inline]
    pub fn at(&self, number: usize) -> ShapeAt<'a> {
        let first_quad = self.shapes.len() - self.quads.len();
        ShapeAt { shape: &self.shapes[number], number, quads: self.quads, first_quad }
    }

    /// All shapes, in the order of their numbers.
    #[inline]
    pub fn all(&self) -> impl Iterator<Item = ShapeAt<'a>> {
        let scene = *self;
        (0..self.shapes.len()).map(move |number| scene.at(number))
    }

    /// The material of a shape.
    pub fn material_of(&self, shape: usize) -> &'a Material {
        &self.materials[self.shapes[shape].material as usize]
    }

    /// Whether some material has a lobe.
    pub fn is_glossy(&self) -> bool {
        self.materials.iter().any(|material| material.specular > 0.0)
    }

    /// The sides that rays meet; `from`: the face that this one leaves.
    fn sides(&self, from: Option<usize>) -> Sides {
        if self.features.two_sided { Sides::Both { behind: is_behind(from) } } else { Sides::Front }
    }

    /// First object along the ray; `origin_face` is the one that the ray leaves.
    pub fn closest_hit(&self, origin: Vec3, direction: Vec3, origin_face: Option<usize>) -> Option<Hit> {
        let mut closest = Hit { t: INFINITE, shape: usize::MAX, from: origin_face };
        let (origin_shape, sides) = (shape_of(origin_face), self.sides(origin_face));
        for shape in self.all() {
            let t = shapes::hit(&shape, origin, direction, origin_shape == Some(shape.number), sides);
            if t < closest.t {
                closest = Hit { t, shape: shape.number, ..closest };
            }
        }
        (closest.shape != usize::MAX).then_some(closest)
    }

    /// Whether anything lies between the origin and a light at `distance` along the ray, or a lit point on
    /// `target_shape` (`None` for a light).
    pub fn occluded(
        &self,
        origin: Vec3,
        light: Vec3,
        direction: Vec3,
        distance: f32,
        origin_face: usize,
        target_shape: Option<usize>,
    ) -> bool {
        let ray = ShadowRay { origin, light, direction, distance };
        let (origin_shape, sides) = (shape_of(Some(origin_face)), self.sides(Some(origin_face)));
        self.all().any(|shape| {
            self.features.casts_shadows(ShapeKind::of(shape.kind))
                && Some(shape.number) != target_shape
                && shapes::blocks(&shape, &ray, origin_shape == Some(shape.number), sides)
        })
    }

    /// A hit point beside an edge or a contact, put to the side of every other surface from which the ray came.
    fn keep_side(&self, origin: Vec3, direction: Vec3, hit: Hit, mut position: Vec3) -> Vec3 {
        let leaves = if is_behind(hit.from) { -1.0 } else { 1.0 };
        for shape in self.all() {
            let leaves = (shape_of(hit.from) == Some(shape.number)).then_some(leaves);
            let ray = KeepSide { origin, direction, leaves, is_hit: shape.number == hit.shape };
            position = shapes::keep_side(&shape, &ray, position);
        }
        position
    }

    /// The hit point, put back on its surface: rounding along a long ray leaves it beside.
    pub fn surface_at(&self, origin: Vec3, direction: Vec3, hit: Hit) -> Surface {
        let p = origin + direction * hit.t;
        let shape = &self.at(hit.shape);
        let Placed { position, normal } = shapes::place(shape, p);
        if !self.features.two_sided {
            return Surface { position, normal, shape: hit.shape, side: 1.0 };
        }
        let position = self.keep_side(origin, direction, hit, position);
        let from_behind = shapes::met_behind(shape, origin, direction, shape_of(hit.from) == Some(hit.shape));
        let side = if from_behind { -1.0 } else { 1.0 };
        Surface { position, normal: normal * side, shape: hit.shape, side }
    }
}
