//! Twins of `glsl/shared/shapes/`: what rays ask of each kind of shape, without any epsilon, and the dispatch among the
//! kinds.

mod flat;
pub mod plane;
pub mod quad;
pub mod sphere;

use glam::Vec3;

use crate::kinds::{ShapeKind, for_each_shape_kind};
use crate::records::{Chart, Quad, Shape};

/// Farther than any hit; finite, so that 0 · INFINITE stays a number.
pub const INFINITE: f32 = 3.0e38;

/// Of a hit: a root that rounding has brought to nothing or behind is still in front.
pub const LEAST_DISTANCE: f32 = 1e-18;

/// Of a point's size: so far from all other surfaces that its side is known.
pub const MARGIN: f32 = 1e-6;
/// Nearer than this it is moved.
pub const UNSURE: f32 = 6e-7;

/// Sum of a point's coordinates: what rounding is measured by.
pub fn size_of(p: Vec3) -> f32 {
    p.x.abs() + p.y.abs() + p.z.abs()
}

/// Which side of a shape rays meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// The one that normals point to, or behind it by rounding alone.
    Front,
    /// Either.
    Both {
        /// A ray that starts on the shape leaves behind it.
        behind: bool,
    },
}

/// A ray towards a light, or to a point that light falls on.
#[derive(Clone, Copy, Debug)]
pub struct ShadowRay {
    /// Where it starts, scene space.
    pub origin: Vec3,
    /// Where it ends.
    pub light: Vec3,
    /// Unit.
    pub direction: Vec3,
    /// Between the ends, metres.
    pub distance: f32,
}

/// A hit point on its way to the side of other shapes from which its ray came.
#[derive(Clone, Copy, Debug)]
pub struct KeepSide {
    /// Where the ray began.
    pub origin: Vec3,
    /// Unit.
    pub direction: Vec3,
    /// −1 or +1 where the ray leaves the very shape that is asked, by the side that it leaves.
    pub leaves: Option<f32>,
    /// What the ray hit is this shape: it stays.
    pub is_hit: bool,
}

/// A hit point put back on its shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Scene space.
    pub position: Vec3,
    /// Unit, the shape's own.
    pub normal: Vec3,
}

/// The line in which a shape cuts the tangent plane around a query point: points p (from the query point, in radii) with
/// dot(across, p) = beyond.
#[derive(Clone, Copy, Debug)]
pub struct Cut {
    /// The part in the tangent plane of the shape's normal, from the query point towards it.
    pub across: Vec3,
    /// Its length: the line is beyond/sine away.
    pub sine: f32,
    /// More than 0.
    pub beyond: f32,
}

impl Cut {
    /// A line that crosses no disc.
    pub const NONE: Cut = Cut { across: Vec3::ZERO, sine: 1.0, beyond: f32::INFINITY };
}

/// The point around which a disc is cut.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceOf<'a> {
    /// The shape that it lies on.
    pub shape: &'a Shape,
    /// That is the shape which is asked for its cuts.
    pub is_own: bool,
    /// Scene space.
    pub position: Vec3,
    /// Unit.
    pub normal: Vec3,
}

/// A shape among the others, with what its kind keeps in a table of its own. It is its record as well.
#[derive(Clone, Copy, Debug)]
pub struct ShapeAt<'a> {
    /// Its record.
    pub shape: &'a Shape,
    /// Its place in the table of shapes.
    pub number: usize,
    /// Rows of the quads, of which the first is shape `first_quad`'s.
    pub quads: &'a [Quad],
    /// See `quads`.
    pub first_quad: usize,
}

impl ShapeAt<'_> {
    /// The row of a quad.
    pub fn quad(&self) -> &Quad {
        &self.quads[self.number - self.first_quad]
    }
}

impl std::ops::Deref for ShapeAt<'_> {
    type Target = Shape;

    fn deref(&self) -> &Shape {
        self.shape
    }
}

macro_rules! dispatch {
    (() $($kind:ident $type:ident $plural:ident,)*) => {
        /// Distance along a ray, or [`INFINITE`]. `on`: the ray starts on the shape.
        #[inline]
        pub fn hit(shape: &ShapeAt, origin: Vec3, direction: Vec3, on: bool, sides: Sides) -> f32 {
            match ShapeKind::of(shape.kind) { $(ShapeKind::$type => $kind::hit(shape, origin, direction, on, sides),)* }
        }

        /// A hit point put back on the shape.
        pub fn place(shape: &ShapeAt, p: Vec3) -> Placed {
            match ShapeKind::of(shape.kind) { $(ShapeKind::$type => $kind::place(shape, p),)* }
        }

        /// Whether a ray met the shape from the side that normals do not point to. `on`: it starts there.
        pub fn met_behind(shape: &ShapeAt, origin: Vec3, direction: Vec3, on: bool) -> bool {
            match ShapeKind::of(shape.kind) { $(ShapeKind::$type => $kind::met_behind(shape, origin, direction, on),)* }
        }

        /// Another shape's hit point, put to the side of this one from which the ray came.
        #[inline]
        pub fn keep_side(shape: &ShapeAt, ray: &KeepSide, position: Vec3) -> Vec3 {
            match ShapeKind::of(shape.kind) { $(ShapeKind::$type => $kind::keep_side(shape, ray, position),)* }
        }

        /// Whether the shape comes between a point and a light, or another point. `on`: the ray starts on it.
        #[inline]
        pub fn blocks(shape: &ShapeAt, ray: &ShadowRay, on: bool, sides: Sides) -> bool {
            match ShapeKind::of(shape.kind) { $(ShapeKind::$type => $kind::blocks(shape, ray, on, sides),)* }
        }

        /// Distance from a point to the shape's surface, metres.
        #[inline]
        pub fn distance(shape: &ShapeAt, position: Vec3) -> f32 {
            match ShapeKind::of(shape.kind) { $(ShapeKind::$type => $kind::distance(shape, position),)* }
        }

        /// Whether the shape is a wall between a point and a photon.
        #[inline]
        pub fn parts(shape: &ShapeAt, point: Vec3, photon: Vec3) -> bool {
            match ShapeKind::of(shape.kind) { $(ShapeKind::$type => $kind::parts(shape, point, photon),)* }
        }

        /// How many lines the shape cuts discs with.
        pub fn cuts(shape: &ShapeAt) -> usize {
            match ShapeKind::of(shape.kind) { $(ShapeKind::$type => $kind::CUTS,)* }
        }

        /// One of its cuts of the disc around a point.
        pub fn cut(shape: &ShapeAt, number: usize, on: &SurfaceOf, inverse_radius: f32) -> Cut {
            match ShapeKind::of(shape.kind) { $(ShapeKind::$type => $kind::cut(shape, number, on, inverse_radius),)* }
        }

        /// Whether two points of the shape may see each other, whatever rounding says of their angles.
        pub fn sees_itself(shape: &ShapeAt) -> bool {
            match ShapeKind::of(shape.kind) { $(ShapeKind::$type => $kind::SEES_ITSELF,)* }
        }

        /// How much a site counts at a point `apart` of it for its normal's sake. `reach`: see `SiteLattice`.
        pub fn likeness(shape: &ShapeAt, apart: Vec3, reach: f32) -> f32 {
            match ShapeKind::of(shape.kind) { $(ShapeKind::$type => $kind::likeness(shape, apart, reach),)* }
        }

        /// A point's coordinates in its sheet's chart, in [−1, 1]² where the chart has an end. `normal`: the shape's own.
        pub fn chart_point(shape: &ShapeAt, chart: &Chart, position: Vec3, normal: Vec3) -> (f32, f32) {
            match ShapeKind::of(shape.kind) { $(ShapeKind::$type => $kind::chart_point(chart, position, normal),)* }
        }
    };
}
for_each_shape_kind!(dispatch);
