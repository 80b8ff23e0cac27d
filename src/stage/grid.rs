//! Grid: photons as stored in, photons in the order of the grid's cells out, with the table of where cells begin. All
//! on the device but for the faces' boxes, six numbers each, from which the host lays the grid out.

use super::sort::{Sort, share};
use crate::cells::{Bounds, CellSize, Form, Plan, plan};
use crate::cl::{Arg, Buffer, Context, Kernel};
use crate::error::Result;
use crate::gathering::Method;
use crate::layout::{
    Face, Gather, Object, PhotonCell, PhotonDirection, PhotonPosition, PhotonPower, PhotonSurface, TEXEL,
};
use crate::source::{Options, assemble};

/// A photon map on the device, in path order.
#[derive(Clone, Copy)]
pub struct Photons<'a> {
    /// Where.
    pub positions: &'a Buffer<PhotonPosition>,
    /// What.
    pub powers: &'a Buffer<PhotonPower>,
    /// On what.
    pub surfaces: &'a Buffer<PhotonSurface>,
    /// From where; only where a glossy surface asks.
    pub directions: Option<&'a Buffer<PhotonDirection>>,
    /// Photons stored: the buffers may be longer.
    pub count: usize,
}

/// A photon map on the device, in the order of its grid's cells. Buffers may be longer than what they hold.
pub struct Grid {
    /// Form, faces, radius and cell size.
    pub plan: Plan,
    /// Photons in it.
    pub count: usize,
    /// [`Plan::gather`].
    pub gather: Buffer<Gather>,
    /// [`Plan::faces`].
    pub faces: Buffer<Face>,
    /// Whole texels; `plan.cells + 1` entries count.
    pub cell_starts: Buffer<f32>,
    /// Sorted.
    pub positions: Buffer<PhotonPosition>,
    /// Sorted.
    pub powers: Buffer<PhotonPower>,
    /// Sorted; empty unless a glossy surface asks.
    pub directions: Buffer<PhotonDirection>,
    /// Rows of sorted photons; empty in the dense form.
    pub cells: Buffer<PhotonCell>,
}

impl Grid {
    fn empty(context: &Context) -> Result<Grid> {
        let plan = Plan { hashed: false, cells: 0, faces: Vec::new(), gather: Gather::default() };
        Ok(Grid {
            plan,
            count: 0,
            gather: Buffer::new(context, 1)?,
            faces: Buffer::new(context, 0)?,
            cell_starts: Buffer::new(context, 0)?,
            positions: Buffer::new(context, 0)?,
            powers: Buffer::new(context, 0)?,
            directions: Buffer::new(context, 0)?,
            cells: Buffer::new(context, 0)?,
        })
    }

    /// `PHOTON_PARAMS` of `shim.cl`, in their order: the sorted tables or, for brute force, the stored ones.
    pub fn args(&self, stored: &Photons, method: Method) -> [Arg; 8] {
        let brute = method == Method::Brute;
        let directions = if brute { stored.directions.unwrap_or(&self.directions) } else { &self.directions };
        [
            (&self.gather).into(),
            (&self.faces).into(),
            (&self.cell_starts).into(),
            (&self.cells).into(),
            if brute { stored.positions.into() } else { (&self.positions).into() },
            if brute { stored.powers.into() } else { (&self.powers).into() },
            stored.surfaces.into(),
            directions.into(),
        ]
    }

    /// Bytes held on the device.
    pub fn bytes(&self) -> usize {
        self.gather.bytes()
            + self.faces.bytes()
            + self.cell_starts.bytes()
            + self.positions.bytes()
            + self.powers.bytes()
            + self.directions.bytes()
            + self.cells.bytes()
    }
}

/// How a grid is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// R, metres.
    pub radius: f32,
    /// How large cells are.
    pub size: CellSize,
    /// Which form.
    pub form: Form,
    /// k of the k nearest; other methods ignore it.
    pub nearest: u32,
}

impl Wanted {
    /// A grid for this radius, all else chosen.
    pub fn radius(radius: f32) -> Wanted {
        Wanted { radius, size: CellSize::Auto, form: Form::Auto, nearest: 50 }
    }
}

/// The kernels that one form of the grid takes.
struct Kernels {
    keys: Kernel,
    starts: Kernel,
    reorder: Kernel,
    rows: Option<Kernel>,
}

impl Kernels {
    fn new(context: &Context, hashed: bool) -> Result<Kernels> {
        let defines = if hashed { vec!["GRID_HASHED".to_string()] } else { Vec::new() };
        let source = assemble("grid.cl", None, &Options { defines, ..Options::default() });
        let kernel = |name| context.kernel(&source, name);
        Ok(Kernels {
            keys: kernel("grid_keys")?,
            starts: kernel("grid_starts")?,
            reorder: kernel("grid_reorder")?,
            rows: if hashed { Some(kernel("grid_rows")?) } else { None },
        })
    }
}

/// The grid stage: its kernels, its scratch memory and the grid that it built last.
pub struct GridStage {
    bounds_kernel: Kernel,
    /// By form: dense, hashed.
    kernels: [Option<Kernels>; 2],
    sort: Sort,
    bounds: Buffer<i32>,
    grid: Grid,
}

/// Undoes `ordered` of `grid.cl`: floats as ints that compare alike.
fn from_ordered(i: i32) -> f32 {
    f32::from_bits((i ^ ((i >> 31) & 0x7fff_ffff)) as u32)
}

/// Makes a buffer at least so long; its content is lost when it grows.
pub(super) fn fit<T: bytemuck::Pod>(context: &Context, buffer: &mut Buffer<T>, len: usize) -> Result<()> {
    if buffer.len() < len {
        *buffer = Buffer::new(context, len)?;
    }
    Ok(())
}

impl GridStage {
    /// Builds what every grid takes.
    ///
    /// # Errors
    /// [`crate::error::Error::Build`] when the driver refuses a kernel.
    pub fn new(context: &Context) -> Result<GridStage> {
        let source = assemble("grid.cl", None, &Options::default());
        Ok(GridStage {
            bounds_kernel: context.kernel(&source, "grid_bounds")?,
            kernels: [None, None],
            sort: Sort::new(context)?,
            bounds: Buffer::new(context, 0)?,
            grid: Grid::empty(context)?,
        })
    }

    /// Sorts a photon map into a grid. Only the faces' boxes are waited for; the queue is in order.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] when floats cannot count the photons or the cells that were asked for;
    /// [`crate::error::Error::Device`] when memory is short.
    pub fn build(
        &mut self,
        context: &Context,
        objects: &[Object],
        photons: &Photons,
        wanted: &Wanted,
    ) -> Result<&Grid> {
        let bounds = self.bounds(context, 2 * objects.len(), photons)?;
        let mut plan = plan(objects, &bounds, photons.count, wanted.radius, wanted.size, wanted.form)?;
        plan.gather.nearest = wanted.nearest as f32;
        let slot = usize::from(plan.hashed);
        if self.kernels[slot].is_none() {
            self.kernels[slot] = Some(Kernels::new(context, plan.hashed)?);
        }
        let kernels = self.kernels[slot].as_ref().expect("built above");

        let count = photons.count;
        let grid = &mut self.grid;
        fit(context, &mut grid.faces, plan.faces.len())?;
        fit(context, &mut grid.cell_starts, (plan.cells + 1).next_multiple_of(TEXEL))?;
        fit(context, &mut grid.positions, count)?;
        fit(context, &mut grid.powers, count)?;
        fit(context, &mut grid.directions, if photons.directions.is_some() { count } else { 0 })?;
        fit(context, &mut grid.cells, if plan.hashed { count } else { 0 })?;
        grid.faces.write(context, &plan.faces)?;
        grid.gather.write(context, &[plan.gather])?;

        let (items, per_item) = share(context, count);
        let tail: [Arg; 2] = [(count as i32).into(), (per_item as i32).into()];
        self.sort.reserve(context, count)?;
        let args = [
            photons.positions.into(),
            photons.surfaces.into(),
            (&grid.faces).into(),
            (&grid.gather).into(),
            (&self.sort.keys[0]).into(),
            tail[0],
            tail[1],
        ];
        context.launch(&kernels.keys, &args, &[items], None)?;
        let sorted = self.sort.sort(context, count, plan.cells)?;

        let args = [
            (&self.sort.keys[sorted]).into(),
            (&grid.cell_starts).into(),
            tail[0],
            (plan.cells as i32).into(),
            tail[1],
        ];
        // One place more than there are photons: it ends the last cell.
        context.launch(&kernels.starts, &args, &[(count + 1).div_ceil(per_item)], None)?;
        let order: Arg = (&self.sort.values[sorted]).into();
        let mut tables: Vec<(Arg, Arg)> =
            vec![(photons.positions.into(), (&grid.positions).into()), (photons.powers.into(), (&grid.powers).into())];
        if let Some(directions) = photons.directions {
            tables.push((directions.into(), (&grid.directions).into()));
        }
        for (from, to) in tables {
            context.launch(&kernels.reorder, &[order, from, to, tail[0], tail[1]], &[items], None)?;
        }
        if let Some(rows) = &kernels.rows {
            let args = [
                order,
                photons.positions.into(),
                photons.surfaces.into(),
                (&grid.faces).into(),
                (&grid.gather).into(),
                (&grid.cells).into(),
                tail[0],
                tail[1],
            ];
            context.launch(rows, &args, &[items], None)?;
        }
        grid.plan = plan;
        grid.count = count;
        Ok(&self.grid)
    }

    /// The grid that was built last.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Bytes held on the device, scratch included.
    pub fn bytes(&self) -> usize {
        self.grid.bytes() + self.sort.bytes() + self.bounds.bytes()
    }

    fn bounds(&mut self, context: &Context, faces: usize, photons: &Photons) -> Result<Vec<Bounds>> {
        let nothing: Vec<i32> = (0..6 * faces).map(|i| if i % 6 < 3 { i32::MAX } else { i32::MIN }).collect();
        fit(context, &mut self.bounds, nothing.len())?;
        self.bounds.write(context, &nothing)?;
        let (items, per_item) = share(context, photons.count);
        let args = [
            photons.positions.into(),
            photons.surfaces.into(),
            (&self.bounds).into(),
            (photons.count as i32).into(),
            (per_item as i32).into(),
        ];
        context.launch(&self.bounds_kernel, &args, &[items], None)?;
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
