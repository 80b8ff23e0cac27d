//! Trace on OpenCL: `kernels/trace.cl`.

use std::rc::Rc;

use super::{Indirect, Permutation, Trace, check_count, out_of_order};
use crate::cl::{Arg, Buffer, Context, Kernel};
use crate::error::Result;
use crate::film::Image;
use crate::gathering::Gathering;
use crate::layout::{Frame, Light, LitPoint, Object, Site, SiteLattice, SiteSurface};
use crate::pack::Packed;
use crate::source::{Options, assemble};
use crate::stage::irradiance::IrradianceView;
use crate::stage::map::MapView;

/// Kernels alone.
pub struct ClTrace {
    context: Rc<Context>,
    objects: Option<Buffer<Object>>,
    lights: Option<Buffer<Light>>,
    frame: Buffer<Frame>,
    film: Option<(u32, u32, Buffer<[f32; 3]>)>,
    lattice: Buffer<SiteLattice>,
    points: Option<Buffer<LitPoint>>,
    sites: Option<(Buffer<Site>, Buffer<SiteSurface>)>,
    active: Option<Compiled>,
}

/// A kernel, and what it was built for.
struct Compiled {
    permutation: Permutation,
    lanes: u32,
    /// Bytes of the queue in which a work-group's photons wait (`group.cl`).
    queue: Option<usize>,
    kernel: Kernel,
    /// Gathers the sites, where pixels take irradiance from these.
    sites: Option<Kernel>,
}

impl ClTrace {
    /// On an open device.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the device has no room.
    pub fn new(context: Rc<Context>) -> Result<ClTrace> {
        let (frame, lattice) = (Buffer::new(&context, 1)?, Buffer::new(&context, 1)?);
        let (objects, lights, film, points, sites, active) = Default::default();
        Ok(ClTrace { context, objects, lights, frame, film, lattice, points, sites, active })
    }
}

impl Trace for ClTrace {
    fn compile(&mut self, permutation: &Permutation) -> Result<()> {
        if self.active.as_ref().is_some_and(|active| active.permutation == *permutation) {
            return Ok(());
        }
        let device_lanes = self.context.device.lanes;
        let lanes = permutation.gathering.map_or(device_lanes, |gathering| gathering.lanes(device_lanes));
        let is_gpu = self.context.device.is_gpu;
        let grouped = permutation.gathering.is_some_and(|gathering| gathering.is_grouped(lanes, is_gpu));
        let mut defines = permutation.defines();
        defines.extend(grouped.then(Gathering::group_defines).into_iter().flatten());
        let queue = grouped.then(|| Gathering::queue_bytes(permutation.features.glossy));
        let options = Options { lanes, defines, ..Options::default() };
        let kernel = self.context.kernel(&assemble("trace.cl", Some(&permutation.features), &options), "trace")?;
        let sites = match permutation.final_gather {
            Some(true) => {
                let options = Options { lanes, ..Options::default() };
                let source = assemble("sites.cl", Some(&permutation.features), &options);
                Some(self.context.kernel(&source, "sites")?)
            }
            _ => None,
        };
        self.active = Some(Compiled { permutation: *permutation, lanes, queue, kernel, sites });
        Ok(())
    }

    fn upload(&mut self, packed: &Packed) -> Result<()> {
        check_count(packed)?;
        self.objects = Some(Buffer::from_slice(&self.context, &packed.objects)?);
        self.lights = Some(Buffer::from_slice(&self.context, &packed.lights)?);
        Ok(())
    }

    fn upload_map(&mut self, _map: &MapView, _gathering: &Gathering) -> Result<u64> {
        // Another radius or another number of photons: what pixels took says little.
        if let Some(active) = &self.active {
            active.kernel.pace.forget();
        }
        Ok(0) // it lies on the device already
    }

    fn trace(&mut self, frame: &Frame, indirect: Indirect) -> Result<()> {
        let (width, height) = (frame.width as u32, frame.height as u32);
        if self.film.as_ref().is_none_or(|(w, h, _)| (*w, *h) != (width, height)) {
            self.film = Some((width, height, Buffer::new(&self.context, width as usize * height as usize)?));
        }
        self.frame.write(&self.context, std::slice::from_ref(frame))?;
        let (Some(active), Some(objects), Some(lights), Some((_, _, film))) =
            (&self.active, &self.objects, &self.lights, &self.film)
        else {
            return Err(out_of_order("OpenCL"));
        };
        let mut args: Vec<Arg> = vec![(&self.frame).into(), objects.into(), lights.into()];
        match (active.permutation.gathering, indirect) {
            (None, Indirect::None) => {}
            (Some(gathering), Indirect::Map(MapView::Device { stored: Some(stored), tiles: Some(tiles), .. }))
                if gathering.method.is_tiled() =>
            {
                args.extend(tiles.args(stored));
            }
            (Some(gathering), Indirect::Map(MapView::Device { stored, grid, .. })) if !gathering.method.is_tiled() => {
                let photons = grid.args(stored.as_ref(), gathering.method);
                args.extend(photons.ok_or_else(|| out_of_order("OpenCL"))?);
            }
            (None, Indirect::Final(IrradianceView::Device { charts, texels, .. }, pass)) => {
                let lattice = &pass.lattice;
                self.lattice.write(&self.context, std::slice::from_ref(lattice))?;
                let points = match self.points.take().filter(|points| points.len() >= pass.points.len()) {
                    Some(points) => points,
                    None => Buffer::new(&self.context, pass.points.len())?,
                };
                let points = self.points.insert(points);
                points.write(&self.context, &pass.points)?;
                args.extend([Arg::from(*charts), (&self.lattice).into(), (*texels).into(), (&*points).into()]);
                if let Some(kernel) = &active.sites {
                    let count = lattice.columns as usize * lattice.rows as usize;
                    if self.sites.as_ref().is_none_or(|(sites, _)| sites.len() < count) {
                        self.sites = Some((Buffer::new(&self.context, count)?, Buffer::new(&self.context, count)?));
                    }
                    let Some((sites, surfaces)) = &self.sites else { return Err(out_of_order("OpenCL")) };
                    let tables = [Arg::from(sites), surfaces.into()];
                    let mut own = args.clone();
                    own.extend(tables);
                    own.push((count as i32).into());
                    let local = if active.lanes == 1 { 64 } else { 8 };
                    let items = count.div_ceil(active.lanes as usize);
                    self.context.launch(kernel, &own, &[items], Some(&[local]))?;
                    args.extend(tables);
                }
            }
            _ => return Err(out_of_order("OpenCL")),
        }
        args.extend(active.queue.map(Arg::Local));
        args.extend([Arg::from(film), (width as i32).into(), (height as i32).into()]);
        let (columns, rows) = block(active.lanes);
        let blocks = [width.div_ceil(columns) as usize, height.div_ceil(rows) as usize];
        // 8 × 8 blocks a work-group: enough to share out, small enough that the last ones do not idle.
        self.context.launch_paced(&active.kernel, &args, &blocks, Some(&[8, 8]))
    }

    fn read(&mut self) -> Result<Image> {
        let Some((width, height, film)) = &self.film else { return Ok(Image::new(0, 0)) };
        Image::from_pixels(*width, *height, film.to_vec(&self.context)?)
    }

    fn bytes(&self) -> usize {
        0 // the context counts its buffers
    }
}

/// The pixels that a work-item's lanes cover, across and down: as `LANE_COLUMNS` and `LANE_ROWS` in `shim.cl`.
fn block(lanes: u32) -> (u32, u32) {
    match lanes {
        1 => (1, 1),
        4 => (2, 2),
        8 => (4, 2),
        _ => (4, 4),
    }
}
