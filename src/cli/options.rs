//! Options that several commands share, and how they meet the scene's own defaults.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};

use crate::error::Result;
use crate::pipeline::Machine;
use crate::scene::{self, Scene};
use crate::settings::{Backend, LightMode, Settings};

/// The scene, and how it is rendered.
#[derive(Args, Clone, Debug)]
pub struct RenderOptions {
    /// Scene file (TOML)
    pub scene: PathBuf,
    /// Who carries direct light
    #[arg(long, value_enum)]
    pub light: Option<LightArg>,
    /// Samples per pixel
    #[arg(long, value_name = "S", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    pub spp: u32,
    /// Keys every random number
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u32,
    /// Image size in pixels, such as 640x480
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// Threads of the CPU backend
    #[arg(long, value_name = "T", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: u16,
    /// Part of the name of the OpenCL device to use
    #[arg(long, value_name = "SUBSTRING")]
    pub device: Option<String>,
}

/// Direct light, as on the command line.
#[derive(ValueEnum, Clone, Copy, Debug)]
pub enum LightArg {
    /// Shadow rays for direct light, photons for the rest
    Hybrid,
    /// All light from the photon map
    Photons,
    /// No photons at all
    Direct,
}

/// A backend, as on the command line.
#[derive(ValueEnum, Clone, Copy, Debug)]
pub enum BackendArg {
    /// A fragment shader on a full-screen quad
    Opengl,
    /// Kernels alone
    Opencl,
    /// The twins in Rust
    Cpu,
}

impl From<BackendArg> for Backend {
    fn from(arg: BackendArg) -> Self {
        match arg {
            BackendArg::Opengl => Backend::OpenGl,
            BackendArg::Opencl => Backend::OpenCl,
            BackendArg::Cpu => Backend::Cpu,
        }
    }
}

/// Pixels, `WIDTHxHEIGHT`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    /// Across.
    pub width: u32,
    /// Down.
    pub height: u32,
}

/// Largest side of an image: what GL drivers of today can draw into.
const MAX_SIDE: u32 = 32_768;

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let expected = || format!("found '{text}', expected WIDTHxHEIGHT with sides from 1 to {MAX_SIDE}, such as 640x480");
        let (width, height) = text.split_once(['x', '×']).ok_or_else(expected)?;
        match (width.parse(), height.parse()) {
            (Ok(width @ 1..=MAX_SIDE), Ok(height @ 1..=MAX_SIDE)) => Ok(Size { width, height }),
            _ => Err(expected()),
        }
    }
}

impl RenderOptions {
    /// Reads the scene file.
    ///
    /// # Errors
    /// [`crate::error::Error::Scene`] with line and column.
    pub fn load(&self) -> Result<Scene> {
        Ok(scene::load(&self.scene)?)
    }

    /// The command line's word, else the scene's, else the default.
    pub fn settings(&self, scene: &Scene) -> Settings {
        let default = Settings::default();
        let size = self.size.map(|s| (s.width, s.height)).or(scene.render.size);
        let (width, height) = size.unwrap_or((default.width, default.height));
        let light = match (self.light, scene.render.light.as_deref()) {
            (Some(LightArg::Direct), _) | (None, Some("direct")) => LightMode::Direct,
            (Some(LightArg::Photons), _) | (None, Some("photons")) => LightMode::Photons,
            _ => LightMode::Hybrid,
        };
        Settings { width, height, samples: self.spp, first_sample: 0, seed: self.seed, light }
    }

    /// Where to run.
    pub fn machine(&self, backend: Option<Backend>) -> Machine {
        Machine { backend, device: self.device.clone(), threads: usize::from(self.threads) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_or_refused() {
        assert_eq!("640x480".parse(), Ok(Size { width: 640, height: 480 }));
        for bad in ["", "640", "0x480", "640x0", "640x-1", "40000x10", "axb", "640x480x3"] {
            let error = bad.parse::<Size>().unwrap_err();
            assert!(error.contains("expected WIDTHxHEIGHT"), "{bad}: {error}");
        }
    }
}
