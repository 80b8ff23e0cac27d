//! What is drawn over a picture to look into the photon map: photons, cells of the grid, tiles; read from the map that
//! the picture was made with.

use glam::{DVec3, Vec3};

use crate::error::Result;
use crate::pipeline::Pipeline;
use crate::rays::scene::SceneTables;
use crate::records::{Face, Gather, PhotonPosition, PhotonPower, Region, Tile};
use crate::scene::Scene;
use crate::stage::map::MapView;

/// Which markers are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShownMarkers {
    /// Photons as dots of their colour.
    pub photons: bool,
    /// Cells of the grid that hold photons.
    pub cells: bool,
    /// Tiles, coloured by the photons on their lists.
    pub tiles: bool,
}

impl ShownMarkers {
    /// Whether no marker is drawn at all.
    pub fn is_empty(self) -> bool {
        self == ShownMarkers::default()
    }
}

/// A photon: where, world space; and its colour, the largest channel 1.
pub type Dot = (DVec3, [f32; 3]);

/// A cell of the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Corners of the largest rectangle through its middle, world space.
    pub corners: [DVec3; 4],
    /// How many photons lie in it.
    pub count: f32,
}

/// Tiles of a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tiling {
    /// How many tiles stand side by side.
    pub across: usize,
    /// A tile's width and height, pixels of the picture.
    pub size: [f32; 2],
    /// Entries on each tile's lists, row by row.
    pub counts: Vec<f32>,
}

/// Markers as they are drawn over a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Markers {
    /// Visible photons, a sample of the map.
    pub dots: Vec<Dot>,
    /// Occupied cells, not more than can be told apart.
    pub cells: Vec<Cell>,
    /// Tiles, where photons were gathered by tiles.
    pub tiles: Option<Tiling>,
}

/// More dots would cover the picture.
const MOST_DOTS: usize = 12_000;
/// More cells would do the same, and take long to draw.
const MOST_CELLS: usize = 3_000;

impl Markers {
    /// Reads the map that a pipeline holds, as the scene's camera sees it.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the transfer fails.
    pub fn collect(pipeline: &Pipeline, scene: &Scene, wanted: &ShownMarkers) -> Result<Markers> {
        let Some((map, packed, features)) = pipeline.map() else { return Ok(Markers::default()) };
        let mut markers = Markers::default();
        let visible = {
            let eye = (scene.camera.position - packed.origin).as_vec3();
            move |point: Vec3| {
                let away = point - eye;
                let distance = away.length();
                let tables = SceneTables::new(packed, features);
                // 1/1000: a photon lies on its surface to within rounding.
                tables.closest_hit(eye, away / distance, None).is_none_or(|hit| hit.t > distance * 0.999)
            }
        };
        if wanted.photons {
            let (positions, powers) = photons(&map)?;
            let dots = positions.iter().zip(&powers).filter(|(position, _)| visible(position.position.into()));
            markers.dots = dots
                .map(|(position, power)| {
                    let most = power.power.iter().fold(1e-30f32, |a, b| a.max(*b));
                    (packed.origin + Vec3::from(position.position).as_dvec3(), power.power.map(|c| c / most))
                })
                .collect();
        }
        if wanted.cells {
            let (faces, gather, starts) = grid(&map)?;
            let mut cells = occupied(&faces, &gather, &starts);
            cells.retain(|cell| visible(cell.corners.iter().sum::<DVec3>().as_vec3() / 4.0));
            let every = cells.len().div_ceil(MOST_CELLS).max(1);
            markers.cells = cells.into_iter().step_by(every).collect();
            for cell in &mut markers.cells {
                cell.corners = cell.corners.map(|corner| corner + packed.origin);
            }
        }
        if wanted.tiles {
            markers.tiles = tiles(&map)?;
        }
        Ok(markers)
    }
}

/// Photons from all over a map.
fn photons(map: &MapView) -> Result<(Vec<PhotonPosition>, Vec<PhotonPower>)> {
    let every = |count: usize| count.div_ceil(MOST_DOTS).max(1);
    match map {
        // In path order: the first ones are as well spread as the whole.
        MapView::Device { context, stored: Some(stored), .. } => {
            let count = stored.count.min(MOST_DOTS);
            let mut positions = vec![PhotonPosition::default(); count];
            let mut powers = vec![PhotonPower::default(); count];
            stored.positions.read(context, &mut positions)?;
            stored.powers.read(context, &mut powers)?;
            Ok((positions, powers))
        }
        MapView::Device { context, grid, .. } => {
            let Some(sorted) = &grid.sorted else { return Ok(Default::default()) };
            let mut positions = vec![PhotonPosition::default(); grid.count];
            let mut powers = vec![PhotonPower::default(); grid.count];
            sorted.positions.read(context, &mut positions)?;
            sorted.powers.read(context, &mut powers)?;
            let step = every(grid.count);
            Ok((positions.into_iter().step_by(step).collect(), powers.into_iter().step_by(step).collect()))
        }
        MapView::Host { stored, .. } => {
            let step = every(stored.positions.len());
            Ok((
                stored.positions.iter().step_by(step).copied().collect(),
                stored.powers.iter().step_by(step).copied().collect(),
            ))
        }
    }
}

/// Faces, sizes and the table of cells; empty where the grid is hashed or was not built.
fn grid(map: &MapView) -> Result<(Vec<Face>, Gather, Vec<f32>)> {
    match map {
        MapView::Device { context, grid, .. } => {
            let entries = if grid.plan.hashed || grid.plan.cells == 0 { 0 } else { grid.plan.cells + 1 };
            let mut starts = vec![0.0; entries];
            grid.cell_starts.read(context, &mut starts)?;
            Ok((grid.plan.faces.clone(), grid.plan.gather, starts))
        }
        MapView::Host { plan, grid, .. } => {
            let starts = if plan.hashed { Vec::new() } else { grid.cell_starts.clone() };
            Ok((plan.faces.clone(), plan.gather, starts))
        }
    }
}

/// Cells with photons, scene space.
fn occupied(faces: &[Face], gather: &Gather, starts: &[f32]) -> Vec<Cell> {
    let mut cells = Vec::new();
    for face in faces {
        let [along_u, along_v, along_w] = face.counts.map(|count| count as usize);
        let axes = if face.flipped == 1.0 { [1, 0, 2] } else { [0, 1, 2] };
        for index in 0..along_u * along_v * along_w {
            let first = face.base as usize + index;
            let (Some(from), Some(to)) = (starts.get(first), starts.get(first + 1)) else { continue };
            if to <= from {
                continue;
            }
            // Rows of cells along u are contiguous.
            let at = [index % along_u, index / along_u % along_v, index / (along_u * along_v)];
            let mut low = DVec3::ZERO;
            let mut size = DVec3::ZERO;
            for k in 0..3 {
                let cell = f64::from(if gather.by_rows != 0.0 { gather.cell[k] } else { gather.cell[axes[k]] });
                low[axes[k]] = f64::from(face.origin[k]) + at[k] as f64 * cell;
                size[axes[k]] = cell;
            }
            cells.push(Cell { corners: widest(low, size, face.counts, axes), count: to - from });
        }
    }
    cells
}

/// The rectangle through a box's middle that leaves out the axis along which there are the fewest cells.
fn widest(low: DVec3, size: DVec3, counts: [f32; 3], axes: [usize; 3]) -> [DVec3; 4] {
    let fewest = (0..3).min_by(|a, b| counts[*a].total_cmp(&counts[*b])).unwrap_or(2);
    let out = axes[fewest];
    let (a, b) = ((out + 1) % 3, (out + 2) % 3);
    let mut middle = low;
    middle[out] += size[out] / 2.0;
    let step = |axis: usize| {
        let mut v = DVec3::ZERO;
        v[axis] = size[axis];
        v
    };
    [middle, middle + step(a), middle + step(a) + step(b), middle + step(b)]
}

/// How many photons each tile lists.
fn tiles(map: &MapView) -> Result<Option<Tiling>> {
    let (plan, starts) = match map {
        MapView::Device { context, tiles: Some(tiles), .. } if tiles.plan.cells > 0 => {
            let mut starts = vec![0.0; tiles.plan.cells + 1];
            tiles.cell_starts.read(context, &mut starts)?;
            (&tiles.plan, starts)
        }
        MapView::Host { tiles: Some((plan, tables)), .. } => (*plan, tables.cell_starts.clone()),
        _ => return Ok(None),
    };
    Ok(Some(Tiling {
        across: plan.size[0] as usize,
        size: [plan.gather.tile_width, plan.gather.tile_height],
        counts: plan.tiles.iter().map(|tile| listed(tile, &plan.regions, &starts)).collect(),
    }))
}

/// Entries of a tile's regions.
fn listed(tile: &Tile, regions: &[Region], starts: &[f32]) -> f32 {
    let first = tile.first as usize;
    let of_region = |region: &Region| {
        let base = region.base as usize;
        let end = base + region.counts.iter().product::<f32>() as usize;
        match (starts.get(base), starts.get(end)) {
            (Some(from), Some(to)) => to - from,
            _ => 0.0,
        }
    };
    regions.iter().skip(first).take(tile.count as usize).map(of_region).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn occupied_cells_lie_where_the_table_says() {
        let face = Face { origin: [1.0, 10.0, 100.0], counts: [3.0, 2.0, 1.0], base: 0.0, flipped: 0.0, table: 0.0 };
        let gather = Gather { cell: [0.5, 2.0, 4.0], ..Gather::default() };
        // Cells 0 to 5; number 4 (u = 1, v = 1) holds seven photons.
        let starts = [0.0, 0.0, 0.0, 0.0, 0.0, 7.0, 7.0];
        let [cell] = occupied(&[face], &gather, &starts)[..] else { panic!("one cell") };
        assert_eq!(cell.count, 7.0);
        assert_eq!(cell.corners[0], DVec3::new(1.5, 12.0, 102.0));
        assert_eq!(cell.corners[2], DVec3::new(2.0, 14.0, 102.0));
        let flipped = Face { flipped: 1.0, ..face };
        let [cell] = occupied(&[flipped], &gather, &starts)[..] else { panic!("one cell") };
        assert_eq!(cell.corners[0], DVec3::new(10.5, 3.0, 102.0), "u runs along y");
    }

    #[test]
    fn tiles_count_all_their_regions() {
        let region = |base, cells| Region { base, counts: [cells, 1.0, 1.0], ..Region::default() };
        let regions = [region(0.0, 2.0), region(2.0, 1.0), region(3.0, 1.0)];
        let tile = Tile { first: 1.0, count: 2.0, reserved: 0.0 };
        assert_eq!(listed(&tile, &regions, &[0.0, 1.0, 5.0, 9.0, 12.0]), 7.0);
        assert_eq!(listed(&Tile::default(), &regions, &[0.0, 1.0, 5.0, 9.0, 12.0]), 0.0);
    }
}
