//! Grid: photons as stored in, photons in the order of the grid's cells out, with the table of where cells begin. All
//! on the device but for the faces' boxes, six numbers each, from which the host lays the grid out.
//!
//! Memory goes in a circle. Sorting needs one table's room besides the map's own: first the sort works there, then each
//! table is written, in its new order, over the one that was written before it. The way back is the same, by the
//! order that the sort leaves. `memory.rs` says what that comes to.

use super::longest_cell::LongestCell;
use super::photon_map::{PhotonMap, Photons, first};
use super::sort::{Scratch, Sort, each, share};
use super::trace::draws::{cells_within, touched};
use crate::device::cl::{Arguments, Buffer, Context, Kernel, PART_ALIGNMENT};
use crate::device::submissions;
use crate::error::Result;
use crate::plan::cells::{Bounds, CellSize, Form, GridPlan, photon_density, plan_by_crowd};
use crate::program::gathering::Method;
use crate::program::source::{Options, assemble};
use crate::records::face::faces_of;
use crate::records::{Face, Gather, PhotonDirection, PhotonPosition, PhotonPower, Record, Shape, TEXEL};

/// A texel, whatever it holds.
type Texel = [f32; 3];

/// A photon map on the device, in the order of its grid's cells. Buffers may be longer than what they hold.
pub struct Grid {
    /// Form, faces, radius and cell size.
    pub plan: GridPlan,
    /// How many photons are sorted into it.
    pub count: usize,
    /// [`GridPlan::gather`].
    pub gather: Buffer<Gather>,
    /// [`GridPlan::faces`].
    pub faces: Buffer<Face>,
    /// Whole texels; `plan.cells + 1` entries count.
    pub cell_starts: Buffer<f32>,
    /// Most photons of a cell; none where nobody has to know, as on CPUs.
    pub longest_cell: Option<u64>,
    /// The photons; none where they stay as they were stored.
    pub sorted: Option<Sorted>,
    /// What takes the place of tables that there are not.
    nothing: Buffer<Texel>,
}

/// The photons of a grid, in the order of its cells.
pub struct Sorted {
    /// Scene space, metres.
    pub positions: Buffer<PhotonPosition>,
    /// Watts per channel.
    pub powers: Buffer<PhotonPower>,
    /// Towards where each came from; only where a glossy surface asks.
    pub directions: Option<Buffer<PhotonDirection>>,
    /// In path order, as they were stored: cells know their face.
    faces: Buffer<f32>,
    /// How many paths were emitted for these photons.
    emitted: u32,
}

impl Grid {
    fn empty(context: &Context) -> Result<Grid> {
        Ok(Grid {
            plan: GridPlan::default(),
            count: 0,
            gather: Buffer::new(context, 1)?,
            faces: Buffer::new(context, 0)?,
            cell_starts: Buffer::new(context, 0)?,
            longest_cell: None,
            sorted: None,
            nothing: Buffer::new(context, 0)?,
        })
    }

    /// `PHOTON_GRID` of `table_sets.rs`: the sorted tables or, for brute force, the stored ones. None when the photons
    /// are not in that order.
    pub fn arguments(&self, stored: Option<&Photons>, method: Method) -> Option<Arguments> {
        let args = Arguments::new().table(&self.gather).table(&self.faces).with("cell_starts", &self.cell_starts);
        let (args, directions) = if method.reads_stored() {
            let Photons { positions, powers, faces, directions, .. } = stored?;
            (args.table(positions).table(powers).with("photon_faces", *faces), *directions)
        } else {
            let Sorted { positions, powers, directions, .. } = self.sorted.as_ref()?;
            (args.table(positions).table(powers).with("photon_faces", &self.nothing), directions.as_ref())
        };
        Some(match directions {
            Some(directions) => args.table(directions),
            None => args.with(PhotonDirection::TABLE, &self.nothing),
        })
    }

    /// About the most photons that one query looks at, where the longest cell is known.
    pub fn most_candidates(&self) -> Option<u64> {
        let across = cells_within(&self.plan.gather);
        let cells = match self.plan.hashed {
            true => across[0] * across[1] * 2, // a face is seldom more than two cells thick
            false => self.plan.faces.iter().map(|face| touched(face.counts, across)).max().unwrap_or(0),
        };
        Some((self.longest_cell? * cells).min(self.count as u64))
    }

    /// Bytes held on the device.
    pub fn bytes(&self) -> usize {
        let sorted = self.sorted.as_ref().map_or(0, |sorted| {
            sorted.positions.bytes()
                + sorted.powers.bytes()
                + sorted.directions.as_ref().map_or(0, Buffer::bytes)
                + sorted.faces.bytes()
        });
        self.gather.bytes() + self.faces.bytes() + self.cell_starts.bytes() + self.nothing.bytes() + sorted
    }
}

/// What a grid is laid out by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridSettings {
    /// The gather radius R, metres.
    pub radius: f32,
    /// How large cells are.
    pub size: CellSize,
    /// Whether cells fill boxes or are hashed.
    pub form: Form,
    /// k of the k nearest; other methods ignore it.
    pub nearest: u32,
}

impl GridSettings {
    /// A grid for this radius, all else chosen.
    pub fn radius(radius: f32) -> GridSettings {
        GridSettings { radius, size: CellSize::Auto, form: Form::Auto, nearest: 50 }
    }
}

/// The kernels that one form of the grid takes.
struct Kernels {
    keys: Kernel,
    starts: Kernel,
    reorder: Kernel,
}

impl Kernels {
    fn new(context: &Context, hashed: bool) -> Result<Kernels> {
        let defines = if hashed { vec!["GRID_HASHED".to_string()] } else { Vec::new() };
        let source = assemble("grid.cl", None, &Options { defines, ..Options::default() });
        let kernel = |name| context.kernel(&source, name);
        Ok(Kernels { keys: kernel("grid_keys")?, starts: kernel("grid_starts")?, reorder: kernel("grid_reorder")? })
    }
}

/// The grid stage: its kernels, its scratch memory and the grid that it built last.
pub struct GridStage {
    bounds_kernel: Kernel,
    /// By form: dense, hashed.
    kernels: [Option<Kernels>; 2],
    restore: Kernel,
    sort: Sort,
    longest_cell: LongestCell,
    bounds: Buffer<i32>,
    grid: Grid,
    /// Number that each sorted photon was stored under.
    order: Buffer<u32>,
    /// One table's memory.
    spare: Option<Buffer<Texel>>,
}

/// Work-items that find bounds together: on GPUs, atomics of local memory spare those of the device's.
fn bounds_group(context: &Context) -> usize {
    if context.device.lanes == 1 { 256 } else { 1 }
}

/// Faces that local memory has room for: 6 KiB.
const BOUNDS_FACES: usize = 256;

/// Undoes `ordered` of `grid.cl`: floats as ints that compare alike.
fn from_ordered(i: i32) -> f32 {
    f32::from_bits((i ^ ((i >> 31) & 0x7fff_ffff)) as u32)
}

impl GridStage {
    /// Builds what every grid takes.
    ///
    /// # Errors
    /// [`crate::error::Error::Build`] when the driver refuses a kernel.
    pub fn new(context: &Context) -> Result<GridStage> {
        let source = assemble("grid.cl", None, &Options::default());
        let bounds = match bounds_group(context) {
            1 => source.clone(),
            group => {
                let defines = vec![format!("BOUNDS_GROUP {group}"), format!("BOUNDS_FACES {BOUNDS_FACES}")];
                assemble("grid.cl", None, &Options { defines, ..Options::default() })
            }
        };
        Ok(GridStage {
            bounds_kernel: context.kernel(&bounds, "grid_bounds")?,
            kernels: [None, None],
            sort: Sort::new(context)?,
            longest_cell: LongestCell::new(context)?,
            restore: context.kernel(&source, "grid_restore")?,
            bounds: Buffer::new(context, 0)?,
            grid: Grid::empty(context)?,
            order: Buffer::new(context, 0)?,
            spare: None,
        })
    }

    /// Lays a grid out for a map that stays as it was stored.
    ///
    /// # Errors
    /// As [`GridStage::build`].
    pub fn lay_out(
        &mut self,
        context: &Context,
        shapes: &[Shape],
        photons: &Photons,
        wanted: &GridSettings,
    ) -> Result<&Grid> {
        let bounds = self.bounds(context, faces_of(shapes.len()), photons)?;
        let crowd = || {
            let few = photons.count.min(photon_density::SAMPLE);
            let (positions, faces) = (first(context, photons.positions, few)?, first(context, photons.faces, few)?);
            Ok(photon_density::crowd(&positions, faces.iter().map(|face| *face as u32), photons.count, wanted.radius))
        };
        let size = (wanted.size, wanted.form);
        let mut plan =
            plan_by_crowd(shapes, photons.directions.is_some(), &bounds, photons.count, wanted.radius, size, crowd)?;
        plan.gather.nearest = wanted.nearest as f32;
        self.grid.gather.write(context, &[plan.gather])?;
        self.grid.plan = plan;
        self.grid.count = photons.count;
        Ok(&self.grid)
    }

    /// Sorts a photon map into a grid, which takes over its memory. Only the faces' boxes and, on GPUs, the longest cell
    /// are waited for; the queue is in order.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] when floats cannot count the photons or the cells that were asked for;
    /// [`crate::error::Error::Device`] when memory is short.
    pub fn build(
        &mut self,
        context: &Context,
        shapes: &[Shape],
        map: PhotonMap,
        wanted: &GridSettings,
    ) -> Result<&Grid> {
        self.lay_out(context, shapes, &map.view(), wanted)?;
        let (hashed, cells, count) = (self.grid.plan.hashed, self.grid.plan.cells, map.stored);
        let slot = usize::from(hashed);
        if self.kernels[slot].is_none() {
            self.kernels[slot] = Some(Kernels::new(context, hashed)?);
        }
        let kernels = self.kernels[slot].as_ref().expect("built above");

        let grid = &mut self.grid;
        grid.faces.fit(context, grid.plan.faces.len())?;
        grid.faces.write(context, &grid.plan.faces)?;
        // While the sort counts, cells have no starts yet.
        let starts = (cells + 1).max(self.sort.places(context, count)).next_multiple_of(TEXEL);
        grid.cell_starts.fit(context, starts)?;
        self.order.fit(context, map.positions.len())?;
        let room = map.positions.len().next_multiple_of(PART_ALIGNMENT / 4);
        let spare = match self.spare.take() {
            Some(spare) if spare.len() >= room => spare,
            _ => Buffer::new(context, room)?,
        };
        let scratch = {
            let part = |third: usize| spare.part(third * room * 4, count);
            let values = [self.order.part(0, count)?, part(2)?];
            let [order, other] = values;
            // The order must outlive the sort, whichever of the two it ends in.
            let values = if self.sort.result(cells) == 0 { [order, other] } else { [other, order] };
            let places = grid.cell_starts.part(0, self.sort.places(context, count))?;
            Scratch { keys: [part(0)?, part(1)?], values, places }
        };

        let (items, per_item) = each(context, count);
        let shared = Arguments::new().with("count", count as i32).with("per_item", per_item as i32);
        let args = shared.clone().table(&map.positions).with("photon_faces", &map.faces).table(&grid.faces);
        let args = args.table(&grid.gather).with("keys", &scratch.keys[0]);
        context.launch(&kernels.keys, &args, &[items], None)?;
        let sorted = self.sort.sort(context, &scratch, count, cells)?;
        let args = shared.clone().with("sorted_keys", &scratch.keys[sorted]).with("cells", cells as i32);
        let args = args.with("cell_starts", &grid.cell_starts);
        // One place more than there are photons: it ends the last cell.
        context.launch(&kernels.starts, &args, &[(count + 1).div_ceil(per_item)], None)?;
        drop(scratch);

        let shared = shared.with("order", &self.order);
        let reorder = |from: Buffer<Texel>, to: Buffer<Texel>| -> Result<(Buffer<Texel>, Buffer<Texel>)> {
            let args = shared.clone().with("from", &from).with("to", &to);
            context.launch(&kernels.reorder, &args, &[items], None)?;
            Ok((to, from))
        };
        let (positions, free) = reorder(map.positions.cast(), spare)?;
        let (powers, free) = reorder(map.powers.cast(), free)?;
        let (directions, free) = match map.directions {
            Some(directions) => reorder(directions.cast(), free).map(|(sorted, free)| (Some(sorted), free))?,
            None => (None, free),
        };
        self.spare = Some(free);
        grid.sorted = Some(Sorted {
            positions: positions.cast(),
            powers: powers.cast(),
            directions: directions.map(Buffer::cast),
            faces: map.faces,
            emitted: map.emitted,
        });
        // Last, since the host waits for it.
        grid.longest_cell = match submissions::cuts_all(context.device.is_gpu) {
            true => Some(self.longest_cell.of(context, &grid.cell_starts, cells)?),
            false => None,
        };
        Ok(&self.grid)
    }

    /// The map that was sorted last, as it was stored, byte for byte; none when it was taken before.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when a launch is refused.
    pub fn restore(&mut self, context: &Context) -> Result<Option<PhotonMap>> {
        let (items, per_item) = each(context, self.grid.count);
        let shared = Arguments::new().with("count", self.grid.count as i32).with("per_item", per_item as i32);
        let shared = shared.with("order", &self.order);
        let Some((map, free)) = self.take_tables() else { return Ok(None) };
        let back = |from: Buffer<Texel>, to: Buffer<Texel>| -> Result<(Buffer<Texel>, Buffer<Texel>)> {
            let args = shared.clone().with("from", &from).with("to", &to);
            context.launch(&self.restore, &args, &[items], None)?;
            Ok((to, from))
        };
        let (positions, free) = back(map.positions.cast(), free)?;
        let (powers, free) = back(map.powers.cast(), free)?;
        let (directions, free) = match map.directions {
            Some(directions) => back(directions.cast(), free).map(|(stored, free)| (Some(stored), free))?,
            None => (None, free),
        };
        self.spare = Some(free);
        let directions = directions.map(Buffer::cast);
        Ok(Some(PhotonMap { positions: positions.cast(), powers: powers.cast(), directions, ..map }))
    }

    /// The memory of the map that was sorted last, for another.
    pub fn take_memory(&mut self) -> Option<PhotonMap> {
        let (map, free) = self.take_tables()?;
        self.spare = Some(free);
        Some(map)
    }

    /// Gives back all memory that was there for the last map; what was laid out stays known.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when not even that can be had.
    pub fn release(&mut self, context: &Context) -> Result<()> {
        let plan = std::mem::take(&mut self.grid.plan);
        self.grid = Grid { plan, count: self.grid.count, ..Grid::empty(context)? };
        self.order = Buffer::new(context, 0)?;
        self.spare = None;
        Ok(())
    }

    /// The last map's tables in whatever order, and the memory of one table more.
    fn take_tables(&mut self) -> Option<(PhotonMap, Buffer<Texel>)> {
        let Sorted { positions, powers, directions, faces, emitted } = self.grid.sorted.take()?;
        let free = self.spare.take()?;
        Some((PhotonMap { positions, powers, faces, directions, stored: self.grid.count, emitted }, free))
    }

    /// The grid that was built last.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Bytes held on the device, scratch included.
    pub fn bytes(&self) -> usize {
        self.grid.bytes() + self.order.bytes() + self.bounds.bytes() + self.spare.as_ref().map_or(0, Buffer::bytes)
    }

    fn bounds(&mut self, context: &Context, faces: usize, photons: &Photons) -> Result<Vec<Bounds>> {
        let nothing: Vec<i32> = (0..6 * faces).map(|i| if i % 6 < 3 { i32::MAX } else { i32::MIN }).collect();
        self.bounds.fit(context, nothing.len())?;
        self.bounds.write(context, &nothing)?;
        let (items, per_item) = share(context, photons.count);
        let args = Arguments::new().table(photons.positions).with("photon_faces", photons.faces);
        let args = args.with("bounds", &self.bounds).with("faces", faces as i32);
        let args = args.with("count", photons.count as i32).with("per_item", per_item as i32);
        let group = [bounds_group(context)];
        let local = (group[0] > 1).then_some(&group[..]);
        context.launch(&self.bounds_kernel, &args, &[items], local)?;
        let mut found = nothing;
        self.bounds.read(context, &mut found)?;
        let bounds = |b: &[i32]| match b {
            [i32::MAX, ..] => Bounds::EMPTY,
            _ => Bounds {
                low: [0, 1, 2].map(|axis| from_ordered(b[axis])),
                high: [3, 4, 5].map(|axis| from_ordered(b[axis])),
            },
        };
        Ok(found.chunks(6).map(bounds).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ordered(x: f32) -> i32 {
        let i = x.to_bits() as i32;
        i ^ ((i >> 31) & 0x7fff_ffff)
    }

    #[test]
    fn ordered_ints_compare_as_their_floats() {
        let floats = [f32::NEG_INFINITY, f32::MIN, -2.5, -1e-40, -0.0, 0.0, 1e-40, 2.5, f32::MAX, f32::INFINITY];
        assert!(floats.windows(2).all(|pair| ordered(pair[0]) < ordered(pair[1])));
        assert!(floats.iter().all(|x| from_ordered(ordered(*x)).to_bits() == x.to_bits()));
    }
}
