//! Trace on OpenCL: `kernels/trace.cl`.

use std::rc::Rc;

use super::draws::{self, Draws, Query};
use super::{Indirect, Pause, Permutation, Trace, check_count, out_of_order};
use crate::device::cl::{Arg, Arguments, Buffer, Context, Kernel};
use crate::device::submissions;
use crate::error::Result;
use crate::film::Image;
use crate::packing::packed_scene::PackedScene;
use crate::program::gathering::Gathering;
use crate::program::source::{Options, assemble};
use crate::records::{Frame, Gather, LitPoint, Site, SiteLattice, SiteSurface};
use crate::stage::irradiance::IrradianceView;
use crate::stage::map::MapView;
use crate::stage::scene_buffers::SceneBuffers;

/// Kernels alone.
pub struct ClTrace {
    context: Rc<Context>,
    scene: Option<SceneBuffers>,
    frame: Buffer<Frame>,
    film: Option<(u32, u32, Buffer<[f32; 3]>)>,
    /// Of a picture that is cut within its pixels: a part of it.
    part: Option<Buffer<[f32; 3]>>,
    /// Of a picture that is cut within its queries: which slice of the candidates they gather.
    slice: Buffer<Gather>,
    lattice: Buffer<SiteLattice>,
    points: Option<Buffer<LitPoint>>,
    sites: Option<(Buffer<Site>, Buffer<SiteSurface>)>,
    active: Option<Compiled>,
    /// Called between pieces of a picture.
    pause: Option<Pause>,
    missing: Vec<[u32; 2]>,
}

/// A kernel, and what it was built for.
struct Compiled {
    permutation: Permutation,
    lanes: u32,
    /// Bytes of the queue in which a work-group's photons wait (`group.cl`).
    queue: Option<usize>,
    kernel: Kernel,
    /// Traces slices, and adds them up: built when a picture has to be cut within its pixels.
    sliced: Option<[Kernel; 2]>,
    /// Gathers the sites, where pixels take irradiance from these.
    sites: Option<Kernel>,
}

/// Rows of blocks that are traced together, as in `trace.cl`.
const BAND: u32 = 8;

impl Compiled {
    fn build_sliced(&mut self, context: &Context) -> Result<()> {
        if self.sliced.is_none() {
            let mut defines = self.permutation.defines();
            // Without queries there are only samples to share out.
            let slices = if self.permutation.gathering.is_some() { "SLICED" } else { "PARTS" };
            defines.push(slices.into());
            let options = Options { lanes: self.lanes, defines, ..Options::default() };
            let source = assemble("trace.cl", Some(&self.permutation.features), &options);
            self.sliced = Some([context.kernel(&source, "trace")?, context.kernel(&source, "trace_add")?]);
        }
        Ok(())
    }
}

impl ClTrace {
    /// On an open device.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the device has no room.
    pub fn new(context: Rc<Context>) -> Result<ClTrace> {
        let (frame, lattice, slice) = (Buffer::new(&context, 1)?, Buffer::new(&context, 1)?, Buffer::new(&context, 1)?);
        let (scene, film, part, points, sites, active) = Default::default();
        let (pause, missing) = Default::default();
        Ok(ClTrace { context, scene, frame, film, part, slice, lattice, points, sites, active, pause, missing })
    }

    /// How a picture is cut within its pixels: on CPUs, where nothing has to be, never.
    fn draws(&self, frame: &Frame, indirect: &Indirect) -> Result<Draws> {
        let gathering = self.active.as_ref().and_then(|active| active.permutation.gathering);
        let query = match (indirect, gathering) {
            (Indirect::Map(MapView::Device { grid, tiles, .. }), Some(gathering)) => {
                let method = gathering.method;
                let tiles = tiles.filter(|_| method.is_tiled());
                let plan = tiles.map_or(&grid.plan.gather, |tiles| &tiles.plan.gather);
                let known = match tiles {
                    Some(tiles) => tiles.most_candidates(),
                    None if method.reads_stored() => Some(grid.count as u64),
                    None => grid.most_candidates(),
                };
                known.map(|candidates| Query { method, across: draws::cells_across(plan)[1], candidates })
            }
            _ => None,
        };
        let rounds = submissions::cuts_all(self.context.device.is_gpu).then_some(draws::GPU);
        Draws::within(rounds, frame, indirect, query)
    }
}

impl Trace for ClTrace {
    fn make_film(&mut self, [width, height]: [u32; 2]) -> Result<()> {
        if self.film.as_ref().is_none_or(|(w, h, _)| (*w, *h) != (width, height)) {
            self.film = Some((width, height, Buffer::new(&self.context, width as usize * height as usize)?));
        }
        Ok(())
    }

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
        self.active = Some(Compiled { permutation: *permutation, lanes, queue, kernel, sliced: None, sites });
        Ok(())
    }

    fn upload(&mut self, packed: &PackedScene) -> Result<()> {
        check_count(packed)?;
        self.scene = Some(SceneBuffers::new(&self.context, packed)?);
        Ok(())
    }

    fn upload_map(&mut self, _map: &MapView, _gathering: &Gathering) -> Result<u64> {
        Ok(0) // it lies on the device already
    }

    fn trace(&mut self, frame: &Frame, indirect: Indirect) -> Result<()> {
        let (width, height) = (frame.width as u32, frame.height as u32);
        self.make_film([width, height])?;
        self.frame.write(&self.context, std::slice::from_ref(frame))?;
        let draws = self.draws(frame, &indirect)?;
        if let (Some(active), false) = (&mut self.active, draws.is_whole(frame)) {
            active.build_sliced(&self.context)?;
        }
        let (Some(active), Some(scene), Some((_, _, film))) = (&self.active, &self.scene, &self.film) else {
            return Err(out_of_order("OpenCL"));
        };
        let mut args = scene.arguments().table(&self.frame);
        match (active.permutation.gathering, indirect) {
            (None, Indirect::None) => {}
            (Some(gathering), Indirect::Map(MapView::Device { stored: Some(stored), tiles: Some(tiles), .. }))
                if gathering.method.is_tiled() =>
            {
                args = args.and(&tiles.arguments(stored));
            }
            (Some(gathering), Indirect::Map(MapView::Device { stored, grid, .. })) if !gathering.method.is_tiled() => {
                let photons = grid.arguments(stored.as_ref(), gathering.method);
                args = args.and(&photons.ok_or_else(|| out_of_order("OpenCL"))?);
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
                args = args.table(charts).table(&self.lattice).table(texels).table(points);
                if let Some(kernel) = &active.sites {
                    let count = lattice.columns as usize * lattice.rows as usize;
                    if self.sites.as_ref().is_none_or(|(sites, _)| sites.len() < count) {
                        self.sites = Some((Buffer::new(&self.context, count)?, Buffer::new(&self.context, count)?));
                    }
                    let Some((sites, surfaces)) = &self.sites else { return Err(out_of_order("OpenCL")) };
                    let own = args.clone().with("irradiances", sites).with("surfaces", surfaces);
                    let own = own.with("count", count as i32);
                    let local = if active.lanes == 1 { 64 } else { 8 };
                    let items = count.div_ceil(active.lanes as usize);
                    kernel.pace.expect(draws::site_work(frame, lattice));
                    self.context.launch(kernel, &own, &[items], Some(&[local]))?;
                    args = args.table(sites).table(surfaces);
                }
            }
            _ => return Err(out_of_order("OpenCL")),
        }
        let (columns, rows) = block(active.lanes);
        let bands = height.div_ceil(rows * BAND);
        let blocks = [width.div_ceil(columns) as usize, (bands * BAND) as usize];
        let context = &self.context;
        // 8 × 8 blocks a work-group: enough to share out, small enough that the last ones do not idle.
        let local = [8, BAND as usize];
        let gather = match indirect {
            Indirect::Map(MapView::Device { tiles: Some(tiles), .. })
                if active.permutation.gathering.is_some_and(|gathering| gathering.method.is_tiled()) =>
            {
                Some(tiles.plan.gather)
            }
            Indirect::Map(MapView::Device { grid, .. }) => Some(grid.plan.gather),
            _ => None,
        };
        let pause = self.pause.clone().unwrap_or_else(|| Rc::new(|| true));
        let trace =
            |kernel: &Kernel, args: Arguments, frame: &Frame, film: &Buffer<[f32; 3]>| -> Result<Vec<[u32; 2]>> {
                kernel.pace.expect(f64::from(width) * draws::work(frame, &indirect, gather.as_ref()));
                // What is not cut goes on from a row to the next.
                let stride = if kernel.pace.fits(blocks[1]) { 1 } else { submissions::stride(bands as usize) };
                let args = args.with("film", film).with("width", width as i32).with("height", height as i32);
                let args = args.with("bands", bands as i32).with("stride", stride as i32);
                let done = context.launch_while(kernel, &args, &blocks, Some(&local), &*pause)?;
                let missing = (done as u32 / BAND..bands).map(|band| {
                    let first = band * stride as u32 % bands * BAND * rows;
                    [first, (first + BAND * rows).min(height)]
                });
                Ok(missing.collect())
            };
        self.missing.clear();
        let Some([sliced, add]) = active.sliced.as_ref().filter(|_| !draws.is_whole(frame)) else {
            // Slices are gathered alone.
            let args = active.queue.into_iter().fold(args, |args, bytes| args.with("queue", Arg::Local(bytes)));
            self.missing = trace(&active.kernel, args, frame, film)?;
            return Ok(());
        };
        if gather.is_some() {
            args = args.replace(&self.slice);
        }
        let part = match &mut self.part {
            Some(part) if part.len() >= film.len() => part,
            none => none.insert(Buffer::new(context, film.len())?),
        };
        for (number, (frame, weight, slice)) in draws.parts(frame).enumerate() {
            self.frame.write(context, &[frame])?;
            if let Some(gather) = gather {
                let slices = draws.slices as f32;
                self.slice.write(context, &[Gather { slice: slice as f32, slices, ..gather }])?;
            }
            let missing = trace(sliced, args.clone(), &frame, part)?;
            let floats = 3 * film.len();
            let sum = Arguments::new().with("part", &*part).with("film", film).with("count", floats as i32);
            let sum = sum.with("weight", weight).with("is_first", i32::from(number == 0));
            context.launch(add, &sum, &[floats], None)?;
            if !missing.is_empty() || !pause() {
                // What is there of the others is a part of it.
                self.missing = vec![[0, frame.height as u32]];
                break;
            }
        }
        Ok(())
    }

    fn set_pause(&mut self, pause: Option<Pause>) {
        self.pause = pause;
    }

    fn missing(&self) -> &[[u32; 2]] {
        &self.missing
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
