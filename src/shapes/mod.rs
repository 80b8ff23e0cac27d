//! What rays meet, a file a kind: what the scene file says of it, and what the host asks of it. All in double precision,
//! in whichever space its numbers are: the world's as read, scene space as unpacked from a record.

use glam::DVec3;

use crate::kinds::{KindName, SHAPE_KINDS, ShapeKind, for_each_shape_kind};
use crate::reading::{Names, Read, Saved, Table};
use crate::records;

mod cap;
mod plane;
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

    /// The shape that a record tells of, in scene space.
    fn unpacked(record: &records::Shape) -> Self
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
            pub fn unpacked(records: &[records::Shape]) -> Shapes {
                let mut shapes = Shapes::default();
                for record in records {
                    match ShapeKind::of(record.kind) {
                        $(ShapeKind::$kind => shapes.$list.push($kind::unpacked(record)),)*
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

    /// How many there are, of all kinds.
    pub fn len(&self) -> usize {
        self.kinds().iter().map(OfKind::count).sum()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
