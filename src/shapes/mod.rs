//! What rays meet, a file a kind: what the scene file says of it, and what the host asks of it. All in double precision,
//! in whichever space its numbers are: the world's as read, scene space as unpacked from a record.

use glam::DVec3;

use crate::kinds::{KindName, SHAPE_KINDS, ShapeKind, for_each_shape_kind};
use crate::reading::{Names, Read, Saved, Table};
use crate::records;

mod cap;
mod plane;
mod quad;
mod sheet;
mod sphere;

pub use cap::Cap;
pub use sheet::Sheet;

/// What one shape, of any kind, answers.
pub trait Shape: Send + Sync {
    /// Reads a table of the scene file: keys, defaults, checks.
    fn read(table: &Table, names: &Names) -> Read<Self>
    where
        Self: Sized;

    /// What the window may change of it and write back.
    fn saved(&self) -> Vec<Saved>;

    /// Index into the scene's materials.
    fn material(&self) -> usize;

    /// Its surface.
    fn sheet(&self) -> Sheet;

    /// Its record about an origin; its material is the scene's index. `facing`: see [`Shape::facing`].
    fn pack(&self, origin: DVec3, facing: f64) -> records::Shape;

    /// What its kind keeps in a table of its own, about an origin.
    fn row(&self, _origin: DVec3) -> Option<records::Quad> {
        None
    }

    /// Where it ends, if it is flat and does: light goes round that.
    fn edges(&self) -> Option<Edges> {
        None
    }

    /// The shape that a record tells of, with its row of its kind's own table, in scene space.
    fn unpacked(record: &records::Shape, row: Option<&records::Quad>) -> Self
    where
        Self: Sized;

    /// Centre and radius of a sphere around it; none if it has no end. Such spheres are what is flown around, and what
    /// the mouse can take.
    fn bounds(&self) -> Option<(DVec3, f64)>;

    /// How far along a ray of unit `direction` it is met, for picking and estimates; `own`: the ray starts on it.
    fn distance(&self, origin: DVec3, direction: DVec3, own: bool) -> Option<f64>;

    /// Scales it about the origin, then moves it by metres.
    fn place(&mut self, scale: f64, by: DVec3);

    /// Directions from a light in which it can be hit; none if that may be any. In doubt, it can be.
    fn cap(&self, light: DVec3) -> Option<Cap> {
        let (center, radius) = self.bounds()?;
        Cap::around(center - light, radius)
    }

    /// −1 where its record's normal is turned round, towards a light, else 1. Nearly always all lights, and the camera,
    /// then are in front of it, and no program asks which side a ray meets.
    fn facing(&self, _light: DVec3) -> f64 {
        1.0
    }

    /// Whether all of this kind may come between visible points and lights, wherever they are.
    fn always_shadows() -> bool
    where
        Self: Sized,
    {
        true
    }

    /// Whether it may come between a visible point and one of the lights.
    fn may_shadow(&self, _camera: DVec3, _lights: &[DVec3]) -> bool {
        true
    }

    /// `photile plan`, of how many may shadow: `blocking` of `all` ("3 spheres").
    fn shadows_said(_blocking: usize, all: &str, lights: usize) -> String
    where
        Self: Sized,
    {
        format!("{all} may block {lights} lights")
    }

    /// `photile plan`, of so many ("3 spheres") that show their backs to the camera or a light.
    fn backs_said(number: &str) -> String
    where
        Self: Sized,
    {
        format!("in or on {number}")
    }

    /// Where float32 has limits that a picture may show, a sentence each.
    fn warnings(_all: &[Self], _view: &View) -> Vec<String>
    where
        Self: Sized,
    {
        Vec::new()
    }
}

/// Of a flat shape with an end, a parallelogram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edges {
    /// Its middle, metres.
    pub center: DVec3,
    /// From there to the middles of two edges, metres.
    pub half: [DVec3; 2],
}

/// Spacing of float32 numbers, as a share.
pub const ULP: f64 = 1.2e-7;

/// What warnings go by.
pub struct View<'a> {
    /// The camera's place.
    pub camera: DVec3,
    /// Places of the lights.
    pub lights: &'a [DVec3],
    /// How far away things are that are looked at, metres.
    pub size: f64,
}

/// All shapes of one kind, and what is said of them.
#[derive(Clone, Copy)]
pub struct OfKind<'a> {
    /// What they are called.
    pub name: &'static KindName,
    /// See [`Shape::always_shadows`].
    pub always_shadows: bool,
    /// See [`Shape::shadows_said`].
    pub shadows_said: fn(usize, &str, usize) -> String,
    /// See [`Shape::backs_said`].
    pub backs_said: fn(&str) -> String,
    list: &'a dyn List,
}

/// A list of shapes of one kind, which is not told.
trait List {
    fn len(&self) -> usize;
    fn at(&self, i: usize) -> &dyn Shape;
    fn warnings(&self, view: &View) -> Vec<String>;
    fn nearest(&self, origin: DVec3, direction: DVec3) -> Option<(usize, f64)>;
    fn is_met(&self, origin: DVec3, direction: DVec3, own: Option<usize>) -> bool;
}

impl<S: Shape> List for Vec<S> {
    fn len(&self) -> usize {
        self.len()
    }

    fn at(&self, i: usize) -> &dyn Shape {
        &self[i]
    }

    fn warnings(&self, view: &View) -> Vec<String> {
        S::warnings(self, view)
    }

    fn nearest(&self, origin: DVec3, direction: DVec3) -> Option<(usize, f64)> {
        let hits = self.iter().enumerate();
        let hits = hits.filter_map(|(i, shape)| Some((i, shape.distance(origin, direction, false)?)));
        hits.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    fn is_met(&self, origin: DVec3, direction: DVec3, own: Option<usize>) -> bool {
        self.iter().enumerate().rev().any(|(i, shape)| shape.distance(origin, direction, own == Some(i)).is_some())
    }
}

impl<'a> OfKind<'a> {
    /// In the file's order.
    pub fn iter(self) -> impl DoubleEndedIterator<Item = &'a dyn Shape> + Clone {
        (0..self.list.len()).map(move |i| self.list.at(i))
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.list.len()
    }

    /// See [`Shape::warnings`].
    pub fn warnings(&self, view: &View) -> Vec<String> {
        self.list.warnings(view)
    }
}

macro_rules! shapes {
    (() $($module:ident $kind:ident $list:ident,)*) => {
        $(pub use $module::$kind;)*

        /// A scene's shapes, a list a kind.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Shapes {
            $(
                #[doc = concat!("Of `[[", stringify!($list), "]]`, in the file's order; may be empty.")]
                pub $list: Vec<$kind>,
            )*
        }

        /// The surface that a record tells of, in scene space.
        pub fn sheet_of(record: &records::Shape) -> Sheet {
            match ShapeKind::of(record.kind) {
                $(ShapeKind::$kind => $kind::unpacked(record, None).sheet(),)*
            }
        }

        impl Shapes {
            /// The scene file's keys.
            pub const KEYS: &[&str] = &[$(stringify!($list),)*];

            /// Reads all lists of a scene file.
            ///
            /// # Errors
            /// The first thing that is wrong.
            pub fn read(root: &Table, names: &Names) -> Read<Shapes> {
                Ok(Shapes {
                    $($list: root.list(
                        stringify!($list),
                        concat!("[[", stringify!($list), "]]"),
                        |table| $kind::read(table, names),
                    )?,)*
                })
            }

            /// The shapes that records tell of, in scene space.
            pub fn unpacked(records: &[records::Shape], quads: &[records::Quad]) -> Shapes {
                let mut shapes = Shapes::default();
                for record in records {
                    match ShapeKind::of(record.kind) {
                        $(ShapeKind::$kind => {
                            let row = quads.get(shapes.$list.len());
                            shapes.$list.push($kind::unpacked(record, row));
                        })*
                    }
                }
                shapes
            }

            /// Kind by kind, in the order of their records.
            pub fn kinds(&self) -> [OfKind<'_>; SHAPE_KINDS.len()] {
                [$(OfKind {
                    name: ShapeKind::$kind.name(),
                    always_shadows: $kind::always_shadows(),
                    shadows_said: $kind::shadows_said,
                    backs_said: $kind::backs_said,
                    list: &self.$list,
                },)*]
            }

            /// One of them, by its place in [`Shapes::iter`].
            pub fn get_mut(&mut self, mut i: usize) -> Option<&mut dyn Shape> {
                $(
                    if i < self.$list.len() {
                        return Some(&mut self.$list[i]);
                    }
                    i -= self.$list.len();
                )*
                let _ = i;
                None
            }

            /// All of them, in the order of their records.
            pub fn iter(&self) -> impl DoubleEndedIterator<Item = &dyn Shape> + Clone {
                std::iter::empty()$(.chain(self.$list.iter().map(|shape| shape as &dyn Shape)))*
            }

            /// Scales all of them about the origin, then moves them by metres.
            pub fn place(&mut self, scale: f64, by: DVec3) {
                $(self.$list.iter_mut().for_each(|shape| shape.place(scale, by));)*
            }
        }
    };
}
for_each_shape_kind!(shapes);

impl Shapes {
    /// One of them, by its place in [`Shapes::iter`].
    pub fn get(&self, mut i: usize) -> Option<&dyn Shape> {
        for kind in self.kinds() {
            if i < kind.count() {
                return Some(kind.list.at(i));
            }
            i -= kind.count();
        }
        None
    }

    /// The first one along a ray, and where; for picking and estimates.
    pub fn nearest(&self, origin: DVec3, direction: DVec3) -> Option<(usize, DVec3)> {
        let mut first = 0;
        let mut found: Option<(usize, f64)> = None;
        // Kind by kind rather than shape by shape: loops over thousands call nothing.
        for kind in self.kinds() {
            let hit = kind.list.nearest(origin, direction).map(|(i, distance)| (first + i, distance));
            found = found.into_iter().chain(hit).min_by(|a, b| a.1.total_cmp(&b.1));
            first += kind.count();
        }
        found.map(|(number, distance)| (number, origin + direction * distance))
    }

    /// Whether there is any along a ray, which may start on the shape `own`. Those that come last, planes, are what is
    /// hit most often.
    pub fn is_met(&self, origin: DVec3, direction: DVec3, own: Option<usize>) -> bool {
        let mut first = self.len();
        self.kinds().iter().rev().any(|kind| {
            first -= kind.count();
            kind.list.is_met(origin, direction, own.and_then(|own| own.checked_sub(first)))
        })
    }

    /// How many there are, of all kinds.
    pub fn len(&self) -> usize {
        self.kinds().iter().map(OfKind::count).sum()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Some of every kind, none at the origin.
    fn shapes() -> Shapes {
        let scenes = ["gi_ref", "color_bleeding", "many_spheres"];
        let mut all = Shapes::default();
        for name in scenes {
            let scene = crate::scene::load(std::path::Path::new(&format!("scenes/{name}.toml"))).expect("ours");
            all.spheres.extend(scene.shapes.spheres.into_iter().take(10));
            all.planes.extend(scene.shapes.planes);
        }
        for edge in [DVec3::X, DVec3::new(1.0, 0.5, 0.0), DVec3::new(-2.0, 0.3, 0.1)] {
            let edges = [edge, DVec3::new(0.2, -1.0, 3.0)];
            all.quads.push(Quad { corner: DVec3::new(-1.0, 0.5, 0.2), edges, material: 1 });
        }
        all.place(1.5, DVec3::new(20.0, -7.0, 9.0));
        assert!(all.kinds().iter().all(|kind| kind.count() > 2));
        all
    }

    /// Directions all around.
    fn directions() -> impl Iterator<Item = DVec3> {
        (0..500).map(|i| {
            let (height, turn) = (1.0 - (2.0 * f64::from(i) + 1.0) / 500.0, f64::from(i) * 2.399_963);
            let radius = (1.0 - height * height).sqrt();
            DVec3::new(radius * turn.cos(), height, radius * turn.sin())
        })
    }

    #[test]
    fn what_is_hit_lies_on_its_sheet_and_within_its_bounds_and_cap() {
        let origin = DVec3::new(21.0, -6.0, 8.5);
        for (number, shape) in shapes().iter().enumerate() {
            let mut hits = 0;
            for direction in directions() {
                let Some(distance) = shape.distance(origin, direction, false) else { continue };
                hits += 1;
                let point = origin + direction * distance;
                let size = point.length() + shape.sheet().curvature_radius().min(1e6);
                assert!(shape.sheet().height(point).abs() < 1e-9 * size, "shape {number}: {point}");
                if let Some((center, radius)) = shape.bounds() {
                    assert!(point.distance(center) < radius * (1.0 + 1e-9), "shape {number}: {point}");
                }
                let is_in = |cap: Cap| direction.dot(cap.axis) > cap.cosine;
                assert!(shape.cap(origin).is_none_or(is_in), "shape {number}: {direction}");
                // Away from where it starts on the shape, a ray does not meet it again.
                let outwards = shape.sheet().normal(point);
                assert!(shape.distance(point, outwards, true).is_none(), "shape {number}: {point}");
            }
            assert!(hits > 0 || shape.bounds().is_some(), "shape {number} is met nowhere");
        }
    }

    #[test]
    fn records_tell_what_the_shape_was() {
        let (shapes, origin) = (shapes(), DVec3::new(20.0, -7.0, 9.0));
        let records: Vec<_> = shapes.iter().map(|shape| shape.pack(origin, 1.0)).collect();
        let rows: Vec<_> = shapes.iter().filter_map(|shape| shape.row(origin)).collect();
        let unpacked = Shapes::unpacked(&records, &rows);
        assert_eq!(unpacked.len(), shapes.len());
        for (number, (there, here)) in shapes.iter().zip(unpacked.iter()).enumerate() {
            assert_eq!(there.material(), here.material());
            let alone = sheet_of(&records[number]);
            if let (Some(edges), Some(own)) = (there.edges(), here.edges()) {
                for (there, here) in
                    [(edges.center - origin, own.center)].into_iter().chain(edges.half.into_iter().zip(own.half))
                {
                    assert!(there.distance(here) < 1e-5 * (1.0 + there.length()), "shape {number}: {there} {here}");
                }
            }
            for p in directions() {
                let (there, here) = (there.sheet().height(p + origin), here.sheet().height(p));
                assert!((there - here).abs() < 1e-6 * (1.0 + there.abs()), "shape {number}: {there} {here}");
                assert!(
                    (alone.height(p) - here).abs() < 1e-9 * (1.0 + here.abs()),
                    "shape {number}: by its record alone"
                );
            }
        }
    }

    #[test]
    fn a_record_faces_the_light_that_it_was_packed_for() {
        for light in [DVec3::new(20.0, -7.0, 9.0), DVec3::splat(1e3), DVec3::splat(-1e3)] {
            for (number, shape) in shapes().iter().enumerate() {
                let sheet = sheet_of(&shape.pack(light, shape.facing(light)));
                let turned = shape.facing(light) < 0.0;
                // What has an inside keeps its normal; all else shows its front.
                let (before, after) = (shape.sheet().height(light), sheet.height(DVec3::ZERO));
                let expected = if turned { -before } else { before };
                assert!((after - expected).abs() < 1e-3 * (1.0 + before.abs()), "shape {number}: {before} {after}");
                assert!(shape.bounds().is_some() || after >= 0.0, "shape {number} shows its back");
            }
        }
    }

    #[test]
    fn the_two_sides_of_a_sheet_are_told_apart_but_for_rounding() {
        let near = DVec3::new(20.0, -7.0, 9.0);
        for (number, shape) in shapes().iter().enumerate() {
            let sheet = shape.sheet();
            let Some(direction) = directions().find(|d| shape.distance(near, *d, false).is_some()) else { continue };
            let point = near + direction * shape.distance(near, direction, false).expect("just found");
            let normal = sheet.normal(point);
            let off = |by: f64| point + normal * by * (1.0 + point.distance(near));
            assert_eq!(sheet.side(point, near), 0.0, "shape {number}");
            assert_eq!([1e-2, -1e-2].map(|by| sheet.side(off(by), near)), [1.0, -1.0], "shape {number}");
            assert!(sheet.is_lit(off(1e-2), true) && !sheet.is_lit(off(1e-2), false), "shape {number}");
        }
    }
}
