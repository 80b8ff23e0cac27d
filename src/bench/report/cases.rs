//! What the suite measures: the report's settings, and Photile's own choice beside them.

use crate::settings::{Backend, CellLattice, Gather, LightMode, Method, Settings};

/// The report's radius, metres.
pub const RADIUS: f32 = 1.0;

/// The lowest corner of the report's box, x, y ∈ [−10, 10], z ∈ [−20, 10]; and the box's depth, metres.
const CORNER: [f64; 3] = [-10.0, -10.0, -20.0];
const DEPTH: f32 = 30.0;

/// The report's image sizes, pixels.
pub const SIZES: [[u32; 2]; 3] = [[160, 160], [320, 240], [640, 480]];

/// Photons and image of its sweeps.
const SWEPT: (u32, [u32; 2]) = (12_000, [640, 480]);

/// Cells and tiles of its main tables, and of its sweeps.
const CELLS: Cells = Cells(0.5);
const TILE: [u32; 2] = [80, 80];
const SWEPT_CELLS: [Cells; 4] = [Cells(2.0), Cells(1.0), Cells(0.5), Cells(0.25)];
const SWEPT_TILES: [[u32; 2]; 4] = [[80, 80], [40, 40], [20, 20], [10, 10]];

/// Cubic cells over the report's box, by their side in metres.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Cells(pub f32);

impl Cells {
    /// As the report names them: how many fill its box, along z, x and y.
    pub fn name(self) -> String {
        let [z, x] = [DEPTH, 20.0].map(|side| (side / self.0).round());
        format!("{z}x{x}x{x}")
    }

    /// How the grid is asked for them. Where photons lie outside the box, as on a plane that never ends, they have cells
    /// like those in it: none is lost.
    fn lattice(self) -> CellLattice {
        CellLattice { corner: CORNER, cell: [self.0; 3] }
    }
}

/// How a picture is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Direct light only, without photons.
    Direct,
    /// All light by photons, as the report has it, found in its grid.
    Grid,
    /// The same by its tiles.
    Tiles,
    /// As Photile does it unasked, with the least radius whose error is no worse than the report's settings'.
    Auto,
}

impl Way {
    /// As rows have it.
    pub fn name(self) -> &'static str {
        match self {
            Way::Direct => "direct",
            Way::Grid => "grid",
            Way::Tiles => "tiles",
            Way::Auto => "auto",
        }
    }
}

/// One thing that is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The scene's name.
    pub scene: String,
    /// Width and height of the image, pixels.
    pub size: [u32; 2],
    /// Photons that the report's map stores; with [`Way::Auto`] as many paths are emitted as such a map takes,
    /// or more where its error would be the worse.
    pub photons: Option<u32>,
    /// How the picture is made.
    pub way: Way,
    /// The grid's cells, with [`Way::Grid`].
    pub grid: Option<Cells>,
    /// Width and height of tiles in pixels, with [`Way::Tiles`].
    pub tile: Option<[u32; 2]>,
    /// Which machine makes it.
    pub backend: Backend,
}

impl Case {
    /// What the report's settings are here; of [`Way::Auto`] but for its radius and number of paths.
    pub fn settings(&self) -> Settings {
        let default = Settings { width: self.size[0], height: self.size[1], ..Settings::default() };
        let gather = |method| Gather { method, radius: Some(RADIUS), ..default.gather };
        match self.way {
            Way::Direct => Settings { light: LightMode::Direct, ..default },
            Way::Auto => default,
            Way::Grid => {
                let gather = Gather { lattice: self.grid.map(Cells::lattice), ..gather(Method::Grid) };
                Settings { light: LightMode::Photons, gather, ..default }
            }
            Way::Tiles => {
                let gather = Gather { tile: self.tile, ..gather(Method::Tiles) };
                Settings { light: LightMode::Photons, gather, ..default }
            }
        }
    }

    /// For a progress bar.
    pub fn label(&self) -> String {
        let photons = self.photons.map(|photons| format!(", {photons} photons")).unwrap_or_default();
        let grid = self.grid.map(|cells| format!(" {}", cells.name())).unwrap_or_default();
        let tile = self.tile.map(|[w, h]| format!(" {w}x{h}")).unwrap_or_default();
        let [width, height] = self.size;
        format!("{} {width}x{height}{photons}, {}{grid}{tile} on {}", self.scene, self.way.name(), self.backend.name())
    }
}

/// The report's main tables and sweeps for these scenes, backends and maps, with the automatic choice beside them. What
/// shares a photon map stands together.
pub fn cases(scenes: &[&str], backends: &[Backend], photons: &[u32]) -> Vec<Case> {
    let mut all: Vec<Case> = Vec::new();
    let mut add = |case: Case| {
        if !all.contains(&case) {
            all.push(case);
        }
    };
    for backend in backends {
        for scene in scenes {
            let case = |size, photons, way| Case {
                scene: scene.to_string(),
                size,
                photons,
                way,
                grid: (way == Way::Grid).then_some(CELLS),
                tile: (way == Way::Tiles).then_some(TILE),
                backend: *backend,
            };
            SIZES.into_iter().for_each(|size| add(case(size, None, Way::Direct)));
            for photons in photons {
                for way in [Way::Grid, Way::Tiles, Way::Auto] {
                    SIZES.into_iter().for_each(|size| add(case(size, Some(*photons), way)));
                }
                if *photons == SWEPT.0 {
                    let swept = |way| case(SWEPT.1, Some(SWEPT.0), way);
                    for cells in SWEPT_CELLS {
                        add(Case { grid: Some(cells), ..swept(Way::Grid) });
                    }
                    for tile in SWEPT_TILES {
                        add(Case { tile: Some(tile), ..swept(Way::Tiles) });
                    }
                }
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_have_the_reports_names() {
        let names = SWEPT_CELLS.map(Cells::name);
        assert_eq!(names, ["15x10x10", "30x20x20", "60x40x40", "120x80x80"]);
        assert_eq!(CELLS.lattice(), CellLattice { corner: [-10.0, -10.0, -20.0], cell: [0.5; 3] });
    }

    #[test]
    fn nothing_is_measured_twice_and_all_of_the_report_is_there() {
        let all = cases(&["gi_ref", "sphere_and_plane"], &[Backend::Cpu, Backend::OpenCl], &[12_000, 200_000]);
        // A scene and backend: 3 sizes of direct, 2 maps × 3 sizes × 3 ways, 3 more cells and 3 more tiles.
        assert_eq!(all.len(), 4 * (3 + 18 + 6));
        for (i, case) in all.iter().enumerate() {
            assert!(!all[..i].contains(case), "{}", case.label());
        }
        let grid = all.iter().find(|case| case.way == Way::Grid).unwrap().settings();
        assert_eq!((grid.gather.radius, grid.light), (Some(1.0), LightMode::Photons));
    }
}
