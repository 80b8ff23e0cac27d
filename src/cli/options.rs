//! Options that several commands share, and how they meet the scene's own defaults.

use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use crate::error::Result;
use crate::pipeline::Machine;
use crate::pipeline::path_count;
use crate::program::gathering::MAX_NEAREST;
use crate::scene::{self, Scene};
use crate::settings::{
    Amount, Backend, Choice, DensityKernel, Gather, GridForm, LightMode, Method, Photons, Sampler, Settings, Technique,
};

/// The scene, and how it is rendered.
#[derive(Args, Clone, Debug)]
pub struct RenderOptions {
    /// Scene file (TOML)
    pub scene: PathBuf,
    /// Who carries direct light
    #[arg(long, value_parser = choice::<LightMode>())]
    pub light: Option<LightMode>,
    /// Samples per pixel, in every pass [default: 1; 2 or 4 in passes with final gathering]
    #[arg(long, value_name = "S", value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    pub spp: Option<u32>,
    /// Keys every random number
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u32,
    /// Image size in pixels, such as 640x480
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// How photons are found around a point [default: grid, tiles or tiled-grid, whichever should be the fastest]
    #[arg(long, value_parser = choice::<Method>())]
    pub gather: Option<Method>,
    /// Paths emitted per pass, such as 200k or 1M [default: chosen from the scene, size, samples and radius]
    #[arg(long, value_name = "N", value_parser = parse_count, conflicts_with = "stored")]
    pub photons: Option<u32>,
    /// Emit until so many photons are stored, such as 12k
    #[arg(long, value_name = "N", value_parser = parse_count)]
    pub stored: Option<u32>,
    /// Gather radius in metres [default: chosen from the scene and the number of photons]
    #[arg(long, value_name = "R", value_parser = parse_radius)]
    pub radius: Option<f32>,
    /// Kernel of the density estimate
    #[arg(long, value_parser = choice::<DensityKernel>())]
    pub kernel: Option<DensityKernel>,
    /// How many photons knn gathers
    #[arg(long, value_name = "K", default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_NEAREST)))]
    pub k: u32,
    /// Cells of the grid along x, y, z of the photons' box, such as 60x40x40, or its form with cells by the radius: dense or
    /// hashed [default: what suits scene and radius]
    #[arg(long, value_name = "NXxNYxNZ|dense|hashed", value_parser = parse_grid)]
    pub grid: Option<GridArg>,
    /// Size of screen-space tiles in pixels, such as 80x80 [default: 32x32]
    #[arg(long, value_name = "WxH")]
    pub tile: Option<Size>,
    /// Where emission's numbers come from
    #[arg(long, value_parser = choice::<Sampler>(), default_value = Sampler::default().name())]
    pub sampler: Sampler,
    /// Threads of the CPU backend
    #[arg(long, value_name = "T", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: u16,
    /// OpenCL device to use: its number as doctor counts them, such as #2 or 2, or part of its name
    #[arg(long, value_name = "DEVICE", value_parser = parse_device)]
    pub device: Option<String>,
}

/// Reads the name of one of the ways that users choose among; help and errors list them all.
pub fn choice<T: Choice>() -> impl TypedValueParser<Value = T> {
    let shown = T::offered().map(|row| PossibleValue::new(row.name).help(row.help));
    PossibleValuesParser::new(shown).map(|name| T::named(&name).expect("the parser lets no other name through"))
}

/// Pixels, `WIDTHxHEIGHT`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    /// Columns of pixels.
    pub width: u32,
    /// Rows of pixels.
    pub height: u32,
}

/// Largest side of an image: what GL drivers of today can draw into.
const MAX_SIDE: u32 = 32_768;

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let expected =
            || format!("found '{text}', expected WIDTHxHEIGHT with sides from 1 to {MAX_SIDE}, such as 640x480");
        let (width, height) = text.split_once(['x', 'X', '×']).ok_or_else(expected)?;
        match (width.parse(), height.parse()) {
            (Ok(width @ 1..=MAX_SIDE), Ok(height @ 1..=MAX_SIDE)) => Ok(Size { width, height }),
            _ => Err(expected()),
        }
    }
}

/// A count with an optional k or M behind it.
pub fn parse_count(text: &str) -> std::result::Result<u32, String> {
    let expected = || format!("found '{text}', expected a number of photons from 1 to 2147483647, such as 200k or 1M");
    let (digits, unit) = match text.char_indices().last() {
        Some((at, 'k' | 'K')) => (&text[..at], 1e3),
        Some((at, 'M')) => (&text[..at], 1e6),
        _ => (text, 1.0),
    };
    let count = digits.parse::<f64>().map_err(|_| expected())? * unit;
    if count.fract() == 0.0 && (1.0..=f64::from(i32::MAX)).contains(&count) {
        Ok(count as u32)
    } else {
        Err(expected())
    }
}

/// Part of a device's name, or its number: nothing is part of every name, and means none of them.
pub fn parse_device(text: &str) -> std::result::Result<String, String> {
    match text.trim() {
        "" => Err("found nothing, expected a device's number, such as #2, or part of its name".into()),
        wanted => Ok(wanted.to_string()),
    }
}

pub fn parse_radius(text: &str) -> std::result::Result<f32, String> {
    match text.parse::<f32>() {
        // Squares of smaller and larger radii leave float32's normal range.
        Ok(radius) if (1e-15..=1e15).contains(&radius) => Ok(radius),
        _ => Err(format!("found '{text}', expected a radius in metres, > 0")),
    }
}

/// What `--grid` asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GridArg {
    /// So many cells along x, y, z.
    Cells([u32; 3]),
    /// Cells by the radius.
    Form(GridForm),
}

fn parse_grid(text: &str) -> std::result::Result<GridArg, String> {
    if let Some(form) = GridForm::named(text) {
        return Ok(GridArg::Form(form));
    }
    let numbers: Vec<u32> = text.split(['x', 'X', '×']).filter_map(|n| n.parse().ok().filter(|n| *n > 0)).collect();
    let cells = <[u32; 3]>::try_from(numbers);
    cells.map(GridArg::Cells).map_err(|_| {
        let forms: Vec<_> = GridForm::offered().map(|row| row.name).collect();
        format!("found '{text}', expected NXxNYxNZ, such as 60x40x40, {}", forms.join(" or "))
    })
}

/// A positive, finite number of seconds.
pub fn parse_seconds(text: &str) -> std::result::Result<Duration, String> {
    let seconds = text.parse::<f64>().ok().filter(|&s| s > 0.0);
    seconds.and_then(|s| Duration::try_from_secs_f64(s).ok()).ok_or_else(|| "expected a number of seconds > 0".into())
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
        let stored = self.stored.map(Amount::Stored);
        let paths = self.photons.or(scene.render.photons.map(|n| n.min(u64::from(u32::MAX)) as u32)).map(Amount::Paths);
        let (cells, form) = match self.grid {
            Some(GridArg::Cells(counts)) => (Some(counts), GridForm::Auto),
            Some(GridArg::Form(form)) => (None, form),
            None => (None, GridForm::Auto),
        };
        Settings {
            width,
            height,
            samples: self.spp.unwrap_or(1),
            seed: self.seed,
            light: self.light.or(scene.render.light).unwrap_or_default(),
            photons: Photons { amount: stored.or(paths).unwrap_or(default.photons.amount), sampler: self.sampler },
            gather: Gather {
                method: self.gather.or(scene.render.gather).unwrap_or(default.gather.method),
                density_kernel: self.kernel.unwrap_or_default(),
                radius: self.radius.or(scene.render.radius.map(|r| r as f32)),
                nearest: self.k,
                cells,
                form,
                lattice: None,
                tile: self.tile.map(|tile| [tile.width, tile.height]),
            },
            ..default
        }
    }

    /// Chooses the number of paths where neither the command line nor the scene says one, and tells why; none where one
    /// is said, and with final gathering, which has a number of its own.
    ///
    /// # Errors
    /// As [`path_count::choose`].
    pub fn choose_paths(&self, scene: &Scene, settings: &mut Settings) -> Result<Option<String>> {
        let said = self.photons.is_some() || self.stored.is_some() || scene.render.photons.is_some();
        if said || settings.technique != Technique::Map {
            return Ok(None);
        }
        let Some(chosen) = path_count::choose(scene, settings)? else { return Ok(None) };
        settings.photons.amount = Amount::Paths(chosen.paths);
        Ok(Some(format!("{} paths, since {}", chosen.paths, chosen.why)))
    }

    /// The backend, device and threads to run on.
    pub fn machine(&self, backend: Option<Backend>) -> Machine {
        Machine { backend, device: self.device.clone(), threads: usize::from(self.threads), lanes: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_read_or_refused() {
        assert_eq!(parse_count("200k"), Ok(200_000));
        assert_eq!(parse_count("1M"), Ok(1_000_000));
        assert_eq!(parse_count("1.5k"), Ok(1500));
        for bad in ["", "0", "-1", "1.5", "k", "3G", "nan", "2147483648"] {
            assert!(parse_count(bad).unwrap_err().contains("expected a number of photons"), "{bad}");
        }
        assert_eq!(parse_grid("60x40x40"), Ok(GridArg::Cells([60, 40, 40])));
        assert_eq!(parse_grid("hashed"), Ok(GridArg::Form(GridForm::Hashed)));
        assert!(parse_grid("60x40").is_err() && parse_grid("0x1x1").is_err() && parse_radius("nan").is_err());
    }

    #[test]
    fn sizes_are_read_or_refused() {
        for good in ["640x480", "640X480", "640×480"] {
            assert_eq!(good.parse(), Ok(Size { width: 640, height: 480 }), "{good}");
        }
        assert_eq!(parse_grid("60X40X40"), parse_grid("60x40x40"));
        assert!(parse_device("").is_err() && parse_device(" ").is_err());
        for bad in ["", "640", "0x480", "640x0", "640x-1", "40000x10", "axb", "640x480x3"] {
            let error = bad.parse::<Size>().unwrap_err();
            assert!(error.contains("expected WIDTHxHEIGHT"), "{bad}: {error}");
        }
    }
}
