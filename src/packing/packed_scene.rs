//! A packed scene that several stages share, and that each knows again by its generation.

use std::ops::Deref;
use std::rc::Rc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::Packed;

/// Generations so far, of all scenes of this process: none has another one's.
static GENERATIONS: AtomicU64 = AtomicU64::new(0);

/// A scene as it was packed at some time. Clones share its records.
#[derive(Clone, Debug)]
pub struct PackedScene {
    packed: Rc<Packed>,
    generation: u64,
}

impl PackedScene {
    /// A scene that nothing was made from yet.
    pub fn new(packed: Packed) -> PackedScene {
        PackedScene { packed: Rc::new(packed), generation: GENERATIONS.fetch_add(1, Ordering::Relaxed) }
    }

    /// What is made from one generation is not stale as long as there is no other: records need not be compared.
    pub fn generation(&self) -> u64 {
        self.generation
    }
}

impl Deref for PackedScene {
    type Target = Packed;

    fn deref(&self) -> &Packed {
        &self.packed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn clones_are_the_same_generation_and_equal_records_are_not() {
        let scene = crate::scene::load(std::path::Path::new("scenes/gi_ref.toml")).unwrap();
        let first = PackedScene::new(Packed::new(&scene, DVec3::ZERO));
        let second = PackedScene::new(Packed::new(&scene, DVec3::ZERO));
        assert_eq!(first.clone().generation(), first.generation());
        assert_ne!(first.generation(), second.generation());
        assert_eq!(first.shapes.as_ptr(), first.clone().shapes.as_ptr(), "clones share their records");
    }
}
