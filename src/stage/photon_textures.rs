//! Where the photon map's OpenCL buffers become GL textures.

use bytemuck::Pod;

use super::grid::{Grid, Sorted};
use super::photon_map::Photons;
use super::table_textures::TableTextures;
use super::tiles::Tiles;
use super::trace::draws::{cells_across, touched};
use crate::cpu::grid::{GridTables, PhotonTables, face_of};
use crate::cpu::tiles::TileTables;
use crate::device::cl::{Buffer, Context};
use crate::device::gl::{Functions, PixelBuffer, Program};
use crate::error::{Error, Result};
use crate::plan::cells::GridPlan;
use crate::plan::tiling;
use crate::program::gathering::{Gathering, Method};
use crate::records::table_sets::{PHOTON_GRID, PHOTON_TILES};
use crate::records::{Face, Gather, PhotonDirection, PhotonPosition, PhotonPower, Record, Region, TEXEL, Tile};

/// The photon map as textures, one a property; what a permutation does not read is neither read back nor uploaded.
pub struct PhotonTextures {
    tables: TableTextures,
    gather: Gather,
    /// Bound on the candidates of any query, for drivers that end long loops.
    pub most_candidates: u64,
    /// Whether `most_candidates` has to be met exactly: that takes the cells to the host.
    is_bounded: bool,
    pixels: PixelBuffer,
}

impl PhotonTextures {
    /// Empty tables on the current context; `is_bounded`: for a driver that ends long loops.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver gives no textures.
    pub fn new(gl: &Functions, is_bounded: bool) -> Result<PhotonTextures> {
        Ok(PhotonTextures {
            tables: TableTextures::new(gl, &[&PHOTON_GRID, &PHOTON_TILES])?,
            gather: Gather::default(),
            most_candidates: 0,
            is_bounded,
            pixels: PixelBuffer::new(gl)?,
        })
    }

    /// Takes over a map made by the CPU.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when a table is larger than the driver's textures.
    pub fn fill_from_host(
        &mut self,
        plan: &GridPlan,
        stored: &PhotonTables,
        grid: &GridTables,
        gathering: &Gathering,
    ) -> Result<()> {
        self.gather = plan.gather;
        self.most_candidates = match gathering.method {
            Method::Grid | Method::Knn => most_candidates(plan, &grid.cell_starts, grid.positions.len() as u64),
            // A point that its tile does not know asks the whole map, as brute force does.
            _ => stored.positions.len() as u64,
        };
        if gathering.method.reads_stored() {
            self.tables.table(PhotonPosition::TABLE).fill(stored.positions)?;
            self.tables.table(PhotonPower::TABLE).fill(stored.powers)?;
            let faces: Vec<f32> = stored.surfaces.iter().map(|surface| face_of(surface) as f32).collect();
            self.tables.table("photon_faces").fill_texels(&whole_texels(faces))?;
            return self.tables.table(PhotonDirection::TABLE).fill(stored.directions);
        }
        self.tables.table(Face::TABLE).fill(&plan.faces)?;
        self.tables.table("cell_starts").fill_texels(&whole_texels(grid.cell_starts.clone()))?;
        self.tables.table(PhotonPosition::TABLE).fill(&grid.positions)?;
        self.tables.table(PhotonPower::TABLE).fill(&grid.powers)?;
        self.tables.table(PhotonDirection::TABLE).fill(&grid.directions)
    }

    /// Takes over a map; `gathering` says which tables its method reads.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when a transfer fails, or a table is larger than the driver's textures.
    pub fn fill(
        &mut self,
        context: &Context,
        grid: &Grid,
        stored: Option<&Photons>,
        gathering: &Gathering,
    ) -> Result<()> {
        self.gather = grid.plan.gather;
        if gathering.method.reads_stored() {
            let Some(Photons { positions, powers, faces, directions, count }) = stored else { return Err(unordered()) };
            self.most_candidates = *count as u64;
            self.copy(PhotonPosition::TABLE, context, positions, *count)?;
            self.copy(PhotonPower::TABLE, context, powers, *count)?;
            self.copy("photon_faces", context, faces, count.div_ceil(TEXEL))?;
            return directions
                .map_or(Ok(()), |directions| self.copy(PhotonDirection::TABLE, context, directions, *count));
        }
        let Some(Sorted { positions, powers, directions, .. }) = &grid.sorted else { return Err(unordered()) };
        let count = grid.count;
        self.tables.table(Face::TABLE).fill(&grid.plan.faces)?;
        self.copy("cell_starts", context, &grid.cell_starts, (grid.plan.cells + 1).div_ceil(TEXEL))?;
        self.most_candidates = match grid.most_candidates() {
            Some(most) if !self.is_bounded => most,
            _ => {
                let most = |starts: &[f32]| Ok(most_candidates(&grid.plan, starts, count as u64));
                grid.cell_starts.mapped(context, grid.plan.cells + 1, most)?
            }
        };
        self.copy(PhotonPosition::TABLE, context, positions, count)?;
        self.copy(PhotonPower::TABLE, context, powers, count)?;
        directions.as_ref().map_or(Ok(()), |directions| self.copy(PhotonDirection::TABLE, context, directions, count))
    }

    /// Takes over the tiles of a map that was taken over before.
    ///
    /// # Errors
    /// As [`PhotonTextures::fill`].
    pub fn fill_tiles(&mut self, context: &Context, tiles: &Tiles) -> Result<()> {
        self.gather = tiles.plan.gather;
        if let (Some(most), false) = (tiles.most_candidates(), self.is_bounded) {
            self.most_candidates = most;
        }
        self.copy("cell_starts", context, &tiles.cell_starts, (tiles.plan.cells + 1).div_ceil(3))?;
        self.tables.table(Tile::TABLE).fill(&tiles.plan.tiles)?;
        self.tables.table(Region::TABLE).fill(&tiles.plan.regions)?;
        self.copy("tile_photons", context, &tiles.tile_photons, tiles.pairs.div_ceil(3))
    }

    /// The same for tiles made by the CPU.
    ///
    /// # Errors
    /// As [`PhotonTextures::fill`].
    pub fn fill_tiles_from_host(&mut self, plan: &tiling::TilePlan, tables: &TileTables) -> Result<()> {
        self.gather = plan.gather;
        self.tables.table("cell_starts").fill_texels(&whole_texels(tables.cell_starts.clone()))?;
        self.tables.table(Tile::TABLE).fill(&plan.tiles)?;
        self.tables.table(Region::TABLE).fill(&plan.regions)?;
        self.tables.table("tile_photons").fill_texels(&whole_texels(tables.tile_photons.clone()))
    }

    /// The first `texels` texels of a buffer: where the device is the CPU, straight from its memory; else by DMA into a
    /// pixel buffer, and from there.
    fn copy<T: Pod>(&mut self, table: &str, context: &Context, from: &Buffer<T>, texels: usize) -> Result<()> {
        let records = texels * TEXEL * 4 / size_of::<T>();
        let table = self.tables.table(table);
        if !context.device.is_gpu {
            return from.mapped(context, records, |records| table.fill_texels(records));
        }
        table.fill_through(&mut self.pixels, texels, |bytes| from.read_bytes(context, bytes))
    }

    /// Radius and cells of the map that lies here.
    pub fn gather(&self) -> &Gather {
        &self.gather
    }

    /// Sets which slice of the candidates the next draw gathers. The program must be active.
    pub fn set_slice(&self, program: &Program, slice: u64, slices: u64) {
        program.set_records(&[Gather { slice: slice as f32, slices: slices as f32, ..self.gather }]);
    }

    /// Gives the active program the map.
    pub fn bind(&self, program: &Program) {
        program.set_records(std::slice::from_ref(&self.gather));
        self.tables.bind(program);
    }

    /// How often a table was filled.
    pub fn uploads(&self) -> u64 {
        self.tables.uploads()
    }

    /// Bytes in textures, padding included, and in the pixel buffer.
    pub fn bytes(&self) -> usize {
        self.tables.bytes() + self.pixels.bytes()
    }
}

/// Photons in another order than the method reads: the pipeline's fault, said rather than drawn wrong.
fn unordered() -> Error {
    Error::Device("OpenGL: the photon map is not in the order that this method reads".into())
}

/// A list, filled up to whole texels.
fn whole_texels(mut list: Vec<f32>) -> Vec<f32> {
    list.resize(list.len().next_multiple_of(TEXEL), 0.0);
    list
}

/// A bound on the photons that one query looks at: the longest cell's, for all cells that its ball can touch.
fn most_candidates(plan: &GridPlan, cell_starts: &[f32], photons: u64) -> u64 {
    let across = cells_across(&plan.gather);
    let longest_cell =
        |cells: std::ops::Range<usize>| cells.map(|c| (cell_starts[c + 1] - cell_starts[c]) as u64).max().unwrap_or(0);
    if plan.hashed {
        // Rows may share buckets, and a face is seldom more than two cells thick.
        return (longest_cell(0..plan.cells) * across[0] * across[1] * 2).min(photons);
    }
    let of_face = |face: &Face| {
        let [u, v, w] = face.counts.map(|count| count as u64);
        let base = face.base as usize;
        longest_cell(base..base + (u * v * w) as usize) * touched(face.counts, across)
    };
    plan.faces.iter().map(of_face).max().unwrap_or(0).min(photons)
}
