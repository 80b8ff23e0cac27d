//! How good a picture of what moves is: its resolution, its photons.

/// Pixels are this many times as wide and high as the window's, rung by rung: a rung costs a quarter more or less.
pub const COARSE: [f64; 19] =
    [1.0, 1.125, 1.25, 1.4, 1.6, 1.8, 2.0, 2.25, 2.5, 2.8, 3.2, 3.6, 4.0, 4.5, 5.0, 5.6, 6.4, 7.2, 8.0];
/// The rung of half the resolution.
pub const HALF: usize = 6;
/// Paths of a pass are divided by this, rung by rung.
pub const FEWER: [u32; 5] = [1, 2, 4, 10, 25];
/// Quality of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Level {
    /// Index into [`COARSE`].
    pub coarse: usize,
    /// Index into [`FEWER`].
    pub fewer: usize,
    /// Direct light only: the last resort.
    pub no_gathering: bool,
}

impl Level {
    /// As good as asked for.
    pub const FULL: Level = Level { coarse: 0, fewer: 0, no_gathering: false };

    /// A picture's side at this level, pixels.
    pub fn side(self, full: u32) -> u32 {
        ((f64::from(full) / COARSE[self.coarse]).round() as u32).clamp(1, full.max(1))
    }

    /// Paths at this level.
    pub fn paths(self, full: u32) -> u32 {
        (full / FEWER[self.fewer]).max(1)
    }

    /// Pixels, relative to a full picture's.
    pub fn pixels(self) -> f64 {
        COARSE[self.coarse].powi(-2)
    }

    /// As the title and the panel say it.
    pub fn describe(self) -> String {
        let mut parts = Vec::new();
        if self.coarse > 0 {
            parts.push(format!("1/{} resolution", COARSE[self.coarse]));
        }
        if self.fewer > 0 && !self.no_gathering {
            parts.push(format!("1/{} photons", FEWER[self.fewer]));
        }
        if self.no_gathering {
            parts.push("direct light only".into());
        }
        if parts.is_empty() { "full".into() } else { parts.join(", ") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_scale_sides_and_paths() {
        let level = Level { coarse: HALF, fewer: 2, no_gathering: false };
        assert_eq!((level.side(641), level.side(1), level.paths(200_000), level.paths(1)), (321, 1, 50_000, 1));
        assert_eq!(Level::FULL.describe(), "full");
        assert_eq!(level.describe(), "1/2 resolution, 1/4 photons");
    }
}
