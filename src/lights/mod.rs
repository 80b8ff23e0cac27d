//! What light comes from, a file a kind.

use glam::DVec3;

use crate::kinds::for_each_light_kind;
use crate::reading::{Read, Saved, Table};
use crate::records;

mod point;

/// What one light, of any kind, answers.
pub trait Light {
    /// Reads a table of the scene file, which may say its `kind`: keys, defaults, checks.
    fn read(table: &Table) -> Read<Self>
    where
        Self: Sized;

    /// What the window may change of it and write back.
    fn saved(&self) -> Vec<Saved>;

    /// Where its light starts, world space, metres.
    fn origin(&self) -> DVec3;

    /// What all of its light carries, watts per channel.
    fn flux(&self) -> DVec3;

    /// Its record about an origin.
    fn pack(&self, origin: DVec3) -> records::Light;

    /// Scales it about the origin, then moves it by metres. Power grows with the square of lengths, so that what it
    /// lights stays as bright.
    fn place(&mut self, scale: f64, by: DVec3);
}

macro_rules! lights {
    ($($module:ident $kind:ident $list:ident,)*) => {
        $(pub use $module::$kind;)*

        /// A scene's lights, a list a kind.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Lights {
            $(
                #[doc = concat!("Of kind `", stringify!($module), "`, in the file's order; may be empty.")]
                pub $list: Vec<$kind>,
            )*
        }

        impl Lights {
            /// Words of the `kind` key; the first may be left out.
            pub const KINDS: &[&str] = &[$(stringify!($module),)*];

            /// Reads all `[[lights]]`.
            ///
            /// # Errors
            /// The first thing that is wrong.
            pub fn read(root: &Table) -> Read<Lights> {
                let mut lights = Lights::default();
                root.list("lights", "[[lights]]", |table| {
                    let kind = table.get("kind").map_or(Ok(Lights::KINDS[0]), |k| k.word(Lights::KINDS))?;
                    $(
                        if kind == stringify!($module) {
                            lights.$list.push($kind::read(table)?);
                        }
                    )*
                    Ok(())
                })?;
                Ok(lights)
            }

            /// All of them, in the order of their records.
            pub fn iter(&self) -> impl DoubleEndedIterator<Item = &dyn Light> + Clone {
                std::iter::empty()$(.chain(self.$list.iter().map(|light| light as &dyn Light)))*
            }

            /// One of them, by its place in [`Lights::iter`].
            pub fn get_mut(&mut self, mut i: usize) -> Option<&mut dyn Light> {
                $(
                    if i < self.$list.len() {
                        return Some(&mut self.$list[i]);
                    }
                    i -= self.$list.len();
                )*
                let _ = i;
                None
            }

            /// How many there are, of all kinds.
            pub fn len(&self) -> usize {
                0 $(+ self.$list.len())*
            }

            /// Scales all of them about the origin, then moves them by metres; see [`Light::place`].
            pub fn place(&mut self, scale: f64, by: DVec3) {
                $(self.$list.iter_mut().for_each(|light| light.place(scale, by));)*
            }
        }
    };
}
for_each_light_kind!(lights);

impl Lights {
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Where they are, in the order of their records.
    pub fn origins(&self) -> Vec<DVec3> {
        self.iter().map(Light::origin).collect()
    }
}
