//! What the user asks of a picture: size, sampling, who carries the light. Syntax is the command line's business.

/// Who carries direct light (DESIGN §2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LightMode {
    /// Shadow rays for direct light, photons of at least one bounce for the rest.
    #[default]
    Hybrid,
    /// All light from the photon map, as in the 2016 report.
    Photons,
    /// No photons at all.
    Direct,
}

/// Which machine traces and gathers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Backend {
    /// A fragment shader on a full-screen quad.
    OpenGl,
    /// Kernels alone.
    OpenCl,
    /// The twins in Rust.
    Cpu,
}

impl Backend {
    /// In the order in which a backend is chosen when none is asked for.
    pub const ALL: [Backend; 3] = [Backend::OpenGl, Backend::OpenCl, Backend::Cpu];

    /// As users write it.
    pub fn name(self) -> &'static str {
        match self {
            Backend::OpenGl => "opengl",
            Backend::OpenCl => "opencl",
            Backend::Cpu => "cpu",
        }
    }
}

/// Settings of one picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Samples per pixel; 1 is the pixel's centre.
    pub samples: u32,
    /// Number of the first sample, so that passes continue one sequence.
    pub first_sample: u32,
    /// Keys every random number.
    pub seed: u32,
    /// Who carries direct light.
    pub light: LightMode,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { width: 640, height: 480, samples: 1, first_sample: 0, seed: 0, light: LightMode::default() }
    }
}
