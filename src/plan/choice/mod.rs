//! Grid, tiles or tiled grid, where the user names none: what a picture would cost by each, from counts.
//!
//! The model is a sum: counts of what a method does, from a raster of visible points and a sample of the map, times
//! what one of each costs on this class of devices. `photile bench --suite choice` measures both, and fits the costs.

use crate::plan::cells::CellSize;
use crate::settings::Method;

mod counting;
mod fit;
mod view;

pub use counting::{SIZES, estimates};
pub use fit::{Taken, fit, fit_choice};

/// Who gathers: devices on which things cost about the same, but for a common factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    /// The twins in Rust, on the CPU's threads.
    Cpu,
    /// OpenCL with several lanes a work-item: blocks of pixels walk together.
    OpenClLanes,
    /// OpenCL with one lane a work-item, as on GPUs.
    OpenClGpu,
    /// Fragments of a software rasteriser.
    OpenGlSoftware,
    /// Fragments of a GPU.
    OpenGlGpu,
}

impl Class {
    /// Every class, in the order of the tables that name them.
    pub const ALL: [Class; 5] =
        [Class::Cpu, Class::OpenClLanes, Class::OpenClGpu, Class::OpenGlSoftware, Class::OpenGlGpu];

    /// OpenCL with so many lanes a work-item.
    pub fn of_opencl(lanes: u32) -> Class {
        if lanes == 1 { Class::OpenClGpu } else { Class::OpenClLanes }
    }

    /// Fragments of such a renderer.
    pub fn of_opengl(is_software: bool) -> Class {
        if is_software { Class::OpenGlSoftware } else { Class::OpenGlGpu }
    }

    /// As files have it.
    pub fn name(self) -> &'static str {
        match self {
            Class::Cpu => "cpu",
            Class::OpenClLanes => "opencl-lanes",
            Class::OpenClGpu => "opencl-gpu",
            Class::OpenGlSoftware => "opengl-software",
            Class::OpenGlGpu => "opengl-gpu",
        }
    }

    /// Nanoseconds of one of each of [`TERMS`]: only their ratios matter. Fitted by `bench --suite choice`, on two cores
    /// of a Xeon (PoCL, llvmpipe, the twin) and on an H200. A cost of 0 is one that others of the terms account for.
    pub fn costs(self) -> &'static Counts {
        match self {
            Class::Cpu => {
                &[0.0, 3.77, 0.0, 9.15, 49.8, 250.0, 8.7, 2.11, 97.4, 0.0, 107.0, 46.2, 1.57e6, 0.0, 326.0, 87.9, 0.0]
            }
            Class::OpenClLanes => &[
                0.0, 0.0922, 0.0, 0.0495, 1.48, 4.75, 0.386, 0.111, 2.02, 3.83e5, 25.6, 2.57, 3.02e5, 3.83, 55.4, 12.9,
                0.0,
            ],
            Class::OpenClGpu => &[
                0.0, 0.0, 0.000638, 0.0, 0.0, 0.151, 0.00081, 0.000361, 0.0, 3.74e5, 0.797, 0.262, 1.16e6, 1.05, 0.842,
                2.52, 48.4,
            ],
            Class::OpenGlSoftware => {
                &[25.0, 2.48, 0.0, 0.278, 7.67, 19.8, 4.6, 2.06, 16.0, 2.28e6, 44.0, 0.0, 0.0, 29.9, 477.0, 0.0, 0.0]
            }
            Class::OpenGlGpu => &[
                0.0, 0.0448, 0.0, 0.0384, 0.196, 0.545, 0.0459, 0.000775, 0.00429, 6.18e5, 7.37, 1.46, 4.76e6, 1.64,
                6.13, 44.7, 190.0,
            ],
        }
    }

    /// How large the grid's cells are made for it.
    pub fn cell_size(self) -> CellSize {
        match self {
            Class::OpenGlSoftware => CellSize::Fragments,
            Class::OpenGlGpu => CellSize::Alone,
            Class::Cpu | Class::OpenClLanes | Class::OpenClGpu => CellSize::Auto,
        }
    }
}

/// What is counted, for the whole picture.
pub const TERMS: [&str; 17] = [
    // Any method's share: rays, shadows, direct light.
    "pixels",
    // Photons within R of visible points, however they are found.
    "accepted",
    // Candidates in the cells around points, of a dense grid and of a hashed one.
    "candidates",
    "candidates-hashed",
    // Rows of cells that queries walk through.
    "rows",
    "rows-hashed",
    // Entries of lists that tiles look through; in tiled grids those in the cells around points, and rows of these.
    "listed",
    "celled",
    "rows-celled",
    // A grid, photons sorted into it, and its cells.
    "grid",
    "sorted",
    "cells",
    // A tiling, photons looked at for tiles, what of them enters lists, rays that look what tiles see, and tiles.
    "tiling",
    "projected",
    "entered",
    "seen",
    "tiles",
];

/// A number of each of [`TERMS`].
pub type Counts = [f64; TERMS.len()];

/// What is known when the choice is made.
#[derive(Clone, Copy, Debug)]
pub struct Question {
    /// Photons of the map.
    pub stored: u64,
    /// The gather radius R, metres.
    pub radius: f32,
    /// Tiles of this size only, pixels.
    pub tile: Option<[u32; 2]>,
    /// What kind of device would gather.
    pub class: Class,
}

/// What one method would take.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// How photons are found.
    pub method: Method,
    /// Width and height of tiles, where there are any.
    pub tile: Option<[u32; 2]>,
    /// Photons looked at, a visible pixel.
    pub candidates: f64,
    /// Entries of the tiles' lists, or photons of the grid.
    pub entries: f64,
    /// Building and gathering, milliseconds on the machine where costs were measured: others differ by a factor.
    pub cost: f64,
    /// How much of each of [`TERMS`] there is to do, in their order.
    pub counts: Counts,
}

impl Estimate {
    /// The cost with other costs of the terms, milliseconds.
    pub fn cost_at(&self, costs: &Counts) -> f64 {
        cost(&self.counts, costs)
    }

    /// The term that costs most, and its share of the cost.
    pub fn dearest(&self, class: Class) -> (&'static str, f64) {
        let terms = TERMS.iter().zip(self.counts.iter().zip(class.costs()).map(|(count, cost)| count * cost));
        let (name, most) = terms.max_by(|a, b| a.1.total_cmp(&b.1)).expect("there are terms");
        (name, most * 1e-6 / self.cost)
    }
}

/// Milliseconds of so many of each term.
fn cost(counts: &Counts, costs: &Counts) -> f64 {
    counts.iter().zip(costs).map(|(count, cost)| count * cost).sum::<f64>() * 1e-6
}
