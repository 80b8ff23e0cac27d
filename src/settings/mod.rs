//! What the user asks of a picture: size, sampling, who carries the light. Syntax is the command line's business.

mod choices;

pub use choices::{Backend, Choice, ChoiceRow, DensityKernel, GridForm, LightMode, Method, Sampler, TechniqueKind};

/// How long emission goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Amount {
    /// So many paths in every pass, whatever is stored of them.
    Paths(u32),
    /// Until so many photons are stored, as the report's map of fixed size.
    Stored(u32),
}

/// How indirect light becomes radiance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Technique {
    /// Density estimates of the photon map at visible points.
    #[default]
    Map,
    /// A bounce of rays, which see the rest in irradiance texels.
    FinalGather(FinalGather),
}

impl Technique {
    /// Which one it is, whatever its settings.
    pub fn kind(&self) -> TechniqueKind {
        match self {
            Technique::Map => TechniqueKind::Map,
            Technique::FinalGather(_) => TechniqueKind::FinalGather,
        }
    }
}

/// Settings of final gathering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FinalGather {
    /// Rays of a site in one pass.
    pub rays: u32,
    /// Rays of a sample that gathers for itself, because no site is near enough.
    pub own_rays: u32,
    /// Pixels from site to site; 1: every sample of a pixel is a site of its own.
    pub spacing: u32,
    /// Irradiance texels of one side each of all objects, about.
    pub texels: u32,
    /// Lit points of a pass, which all sites share.
    pub points: u32,
}

impl Default for FinalGather {
    /// Measured on the report's scenes: see the README.
    fn default() -> Self {
        FinalGather { rays: 64, own_rays: 16, spacing: 4, texels: 24_576, points: 32 }
    }
}

/// What the user asks of a picture, in one pass or in many.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Of the image, pixels.
    pub width: u32,
    /// Of the image, pixels.
    pub height: u32,
    /// Samples per pixel; 1 is the pixel's centre.
    pub samples: u32,
    /// Keys every random number; passes have seeds of their own, made of this one.
    pub seed: u32,
    /// Who carries direct light.
    pub light: LightMode,
    /// How many photons.
    pub photons: Photons,
    /// How they become radiance.
    pub gather: Gather,
    /// Which technique is used for it.
    pub technique: Technique,
}

/// Which pass a picture is: where it goes on in sequences that other passes of the same settings begin. A picture of its
/// own is the first pass, and the only one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pass {
    /// Number of the pass, from 0: keys emission's random numbers.
    pub index: u32,
    /// Keys all other random numbers.
    pub seed: u32,
    /// How many passes of this seed came before: they go on in the same sequences of rays and lit points.
    pub round: u32,
    /// Number of a pixel's first sample in the seed's sequence of them.
    pub first_sample: u32,
    /// A single sample lies anywhere in its pixel, because other passes bring more; else in its centre.
    pub jittered: bool,
}

impl Pass {
    /// The only one of a picture.
    pub fn single(settings: &Settings) -> Pass {
        Pass { seed: settings.seed, ..Pass::default() }
    }
}

/// Settings of the photon map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photons {
    /// How long a pass emits.
    pub amount: Amount,
    /// Where emission's first numbers come from.
    pub sampler: Sampler,
}

/// Settings of the gathering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gather {
    /// How photons are found.
    pub method: Method,
    /// How they are weighed.
    pub density_kernel: DensityKernel,
    /// R, metres; `None`: chosen from the scene and the number of photons.
    pub radius: Option<f32>,
    /// k of the k nearest.
    pub nearest: u32,
    /// Cells along x, y, z of the photons' box; `None`: cells in proportion to R.
    pub cells: Option<[u32; 3]>,
    /// Whether cells fill boxes or are hashed.
    pub form: GridForm,
    /// Cells on a lattice of the user's, which comes before `cells`; `None`: they begin where photons do.
    pub lattice: Option<CellLattice>,
    /// Width and height of tiles, pixels; `None`: [`crate::plan::tiling::TILE`].
    pub tile: Option<[u32; 2]>,
}

/// Cells that fill space from a corner on, in all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellLattice {
    /// A corner of some cell, world space, metres.
    pub corner: [f64; 3],
    /// Along x, y, z; metres.
    pub cell: [f32; 3],
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            width: 640,
            height: 480,
            samples: 1,
            seed: 0,
            light: LightMode::default(),
            photons: Photons { amount: Amount::Paths(200_000), sampler: Sampler::default() },
            gather: Gather {
                method: Method::Auto,
                density_kernel: DensityKernel::default(),
                radius: None,
                nearest: 50,
                cells: None,
                form: GridForm::Auto,
                lattice: None,
                tile: None,
            },
            technique: Technique::default(),
        }
    }
}
