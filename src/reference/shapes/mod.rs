//! Rays against shapes without an epsilon, a file a kind: a ray knows the surface it starts on and the one it ends on.
//!
//! A plane is never met twice by one line, and the second root of a sphere has a closed form when the first one is the
//! start, so self-intersection is excluded exactly, at every scale of scene.

use glam::DVec3;

use crate::kinds::for_each_shape_kind;
use crate::scene::Scene;
use crate::shapes::Shapes;

mod plane;
mod quad;
mod sphere;

/// What rays ask of a shape.
trait Surface {
    /// Whether what is behind it is its inside.
    const SOLID: bool;

    /// Distance along a unit `direction` to the first intersection after the start, or infinity.
    fn first_hit(&self, origin: DVec3, direction: DVec3, starts_here: bool) -> f64;

    /// A point near it put on it to the last few bits, and its normal there.
    fn placed(&self, point: DVec3) -> (DVec3, DVec3);

    /// Whether the open segment from `a` to `b` crosses it, its own end points on it not counted.
    fn blocks(&self, a: DVec3, b: DVec3, a_on_it: bool, b_on_it: bool) -> bool;
}

/// Index of a surface: kind by kind, each in the scene's order.
pub(super) type SurfaceId = usize;

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Along the (unit) ray, metres.
    pub distance: f64,
    /// World space; on the surface to the last few bits.
    pub position: DVec3,
    /// Unit; out of a sphere, along a plane's own normal.
    pub normal: DVec3,
    /// What was met.
    pub surface: SurfaceId,
    /// Index into the scene's materials.
    pub material: usize,
    /// Behind the surface is its inside.
    pub is_solid: bool,
}

/// All surfaces of a scene.
pub(super) struct Surfaces(Shapes);

impl Surfaces {
    pub fn new(scene: &Scene) -> Self {
        Surfaces(scene.shapes.clone())
    }
}

macro_rules! dispatch {
    (() $($module:ident $kind:ident $list:ident,)*) => {
        impl Surfaces {
            /// The nearest surface along a unit `direction`, for a ray that starts in space or on the surface `from`.
            #[inline]
            pub fn nearest(&self, origin: DVec3, direction: DVec3, from: Option<SurfaceId>) -> Option<Hit> {
                let from = from.unwrap_or(SurfaceId::MAX);
                let mut nearest = f64::INFINITY;
                let mut found = SurfaceId::MAX;
                let mut first = 0;
                $(
                    for (index, shape) in self.0.$list.iter().enumerate() {
                        let t = shape.first_hit(origin, direction, first + index == from);
                        if t < nearest {
                            nearest = t;
                            found = first + index;
                        }
                    }
                    first += self.0.$list.len();
                )*
                let _ = first;
                self.hit(found, origin + direction * nearest, nearest)
            }

            /// What is known of a surface at a point of it; none for [`SurfaceId::MAX`].
            #[inline]
            fn hit(&self, surface: SurfaceId, point: DVec3, distance: f64) -> Option<Hit> {
                let mut index = surface;
                $(
                    if let Some(shape) = self.0.$list.get(index) {
                        let (position, normal) = shape.placed(point);
                        let is_solid = <crate::shapes::$kind as Surface>::SOLID;
                        return Some(Hit { distance, position, normal, surface, material: shape.material, is_solid });
                    }
                    index -= self.0.$list.len();
                )*
                let _ = index;
                None
            }

            /// Whether anything lies strictly between `a` (on the surface `from`) and `b` (on `to`, or a light in space).
            #[inline]
            pub fn occluded(&self, a: DVec3, from: SurfaceId, b: DVec3, to: Option<SurfaceId>) -> bool {
                let to = to.unwrap_or(SurfaceId::MAX);
                let mut first = 0;
                $(
                    for (index, shape) in self.0.$list.iter().enumerate() {
                        if shape.blocks(a, b, first + index == from, first + index == to) {
                            return true;
                        }
                    }
                    first += self.0.$list.len();
                )*
                let _ = first;
                false
            }
        }
    };
}
for_each_shape_kind!(dispatch);
