//! How stored photons become radiance: the method, the density kernel, and what the scene asks of the code.

use crate::kinds::ShapeKind;
use crate::records::Shape;
pub use crate::settings::{DensityKernel, Method};

/// Farthest that queries which walk together may lie apart, in radii. Measured at 0.5, 1, 2 and 4.
pub const GATHER_SPREAD: f32 = 4.0;

/// The permutation of the gathering code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub struct Gathering {
    /// How photons are found.
    pub method: Method,
    /// How they are weighed.
    pub density_kernel: DensityKernel,
    /// The grid is in its hashed form.
    pub hashed: bool,
    /// A plane may cut the disc around some point.
    pub clip: bool,
    /// Photons may lie on both sides of a plane.
    pub both_sides: bool,
    /// Some shape has an edge that photons lie on both sides of, wherever the camera is.
    pub edges: bool,
    /// A sphere cuts a plane and covers a circle of it.
    pub footprints: bool,
}

/// Whether some sphere cuts some plane.
fn footprints(spheres: &[Shape], planes: &[Shape]) -> bool {
    let cuts = |sphere: &Shape, plane: &Shape| {
        let height = (0..3).map(|axis| plane.anchor[axis] * sphere.anchor[axis]).sum::<f32>() - plane.extent;
        height.abs() < sphere.extent
    };
    planes.iter().any(|plane| spheres.iter().any(|sphere| cuts(sphere, plane)))
}

/// Most photons that the k-nearest method takes (`KNN_MAX`).
pub const MAX_NEAREST: u32 = 256;

/// Photons of a work-group's queue. Measured at 64, 128 and 256 on an H100: within 5% of each other.
const QUEUE_LENGTH: usize = 128;

impl Gathering {
    /// Lanes that a work-item may have: a heap of nearest photons serves one query.
    pub fn lanes(&self, device_lanes: u32) -> u32 {
        if self.method == Method::Knn { 1 } else { device_lanes }
    }

    /// Whether the work-items of a group gather together, in local memory (`group.cl`). On CPUs one lane is what other
    /// code is measured against: there only tiles do, so that tests run it.
    pub fn is_grouped(&self, lanes: u32, is_gpu: bool) -> bool {
        lanes == 1 && (self.method.is_tiled() || self.method == Method::Grid && is_gpu)
    }

    /// The `#define`s of groups.
    pub fn group_defines() -> [String; 2] {
        ["GATHER_GROUP".into(), format!("QUEUE_LENGTH {QUEUE_LENGTH}")]
    }

    /// Bytes of a group's queue.
    pub fn queue_bytes(glossy: bool) -> usize {
        let vectors = if glossy { 3 } else { 2 };
        vectors * QUEUE_LENGTH * size_of::<[f32; 4]>()
    }

    /// What a scene's objects need.
    ///
    /// A plane cuts discs of other surfaces only: it takes two objects. Photons lie on both sides of a plane only
    /// where the scene is `divided`: one separates camera and lights. All else starts in one half-space of every plane
    /// and stays there.
    pub fn of(shapes: &[Shape], sphere_count: usize, divided: bool) -> Gathering {
        let planes = shapes.len() - sphere_count;
        let edges = shapes.iter().any(|shape| ShapeKind::of(shape.kind) == ShapeKind::Quad);
        Gathering {
            clip: planes > 0 && (shapes.len() > 1 || edges),
            edges,
            footprints: footprints(&shapes[..sphere_count], &shapes[sphere_count..]),
            ..Gathering::default()
        }
        .divided(divided)
    }

    /// The same seen from elsewhere: the camera decides whether the scene is divided.
    pub fn divided(self, divided: bool) -> Gathering {
        Gathering { both_sides: self.clip && (divided || self.edges), ..self }
    }

    /// The `#define`s of this permutation.
    pub fn defines(&self) -> Vec<String> {
        let kernel = format!("KERNEL_{}", self.density_kernel.name().to_uppercase());
        let mut defines = vec!["HAS_PHOTONS".to_string(), kernel];
        let mut add = |on: bool, name: &str| {
            if on {
                defines.push(name.to_string());
            }
        };
        add(self.method == Method::Brute, "GATHER_BRUTE");
        add(self.method == Method::Knn, "GATHER_KNN");
        add(self.method.is_tiled(), "GATHER_TILES");
        add(self.hashed, "GRID_HASHED");
        add(self.clip, "HAS_CLIP");
        add(self.both_sides, "HAS_BOTH_SIDES");
        add(self.footprints, "HAS_FOOTPRINTS");
        defines.push(format!("GATHER_SPREAD {GATHER_SPREAD:.1}f"));
        defines
    }

    /// Every permutation there is, for the test that compiles them all.
    pub fn reachable() -> Vec<Gathering> {
        let all = [false, true];
        let mut reachable = Vec::new();
        for density_kernel in DensityKernel::ALL {
            for (method, hashed) in [
                (Method::Grid, false),
                (Method::Grid, true),
                // A tiled grid takes the same code.
                (Method::Tiles, false),
                (Method::Knn, false),
                (Method::Knn, true),
                (Method::Brute, false),
            ] {
                for (clip, both_sides) in all.into_iter().flat_map(|a| all.map(|b| (a, b))) {
                    for footprints in all {
                        if clip || !(both_sides || footprints) {
                            reachable.push(Gathering {
                                method,
                                density_kernel,
                                hashed,
                                clip,
                                both_sides,
                                footprints,
                                edges: false,
                            });
                        }
                    }
                }
            }
        }
        reachable
    }
}
