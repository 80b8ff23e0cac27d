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

/// Traces and gathers by OpenCL's kernels; the film is a buffer.
pub struct ClTrace {
    context: Rc<Context>,
    scene: Option<SceneBuffers>,
    /// How many of the scene's shapes are quads.
    quads: usize,
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
        let quads = 0;
        Ok(ClTrace { context, scene, quads, frame, film, part, slice, lattice, points, sites, active, pause, missing })
    }

    /// Writes what belongs to a frame into buffers, which grow to its size.
    fn write_frame(&mut self, frame: &Frame, indirect: &Indirect) -> Result<()> {
        self.make_film([frame.width as u32, frame.height as u32])?;
        self.frame.write(&self.context, std::slice::from_ref(frame))?;
        let Indirect::Final(_, pass) = indirect else { return Ok(()) };
        self.lattice.write(&self.context, std::slice::from_ref(&pass.lattice))?;
        let points = match self.points.take().filter(|points| points.len() >= pass.points.len()) {
            Some(points) => points,
            None => Buffer::new(&self.context, pass.points.len())?,
        };
        self.points.insert(points).write(&self.context, &pass.points)?;
        let count = count_of_sites(&pass.lattice);
        let wants_sites = self.active.as_ref().is_some_and(|active| active.sites.is_some());
        if wants_sites && self.sites.as_ref().is_none_or(|(sites, _)| sites.len() < count) {
            self.sites = Some((Buffer::new(&self.context, count)?, Buffer::new(&self.context, count)?));
        }
        Ok(())
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
                let walls = self.active.as_ref().map_or(0, |active| active.permutation.walls(frame, self.quads));
                known.map(|candidates| Query { method, across: draws::cells_across(plan)[1], candidates, walls })
            }
            _ => None,
        };
        let rounds = submissions::cuts_all(self.context.device.is_gpu).then_some(draws::GPU);
        Draws::within(rounds, frame, self.quads, indirect, query)
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
        self.quads = packed.quads.len();
        Ok(())
    }

    fn upload_map(&mut self, _map: &MapView, _gathering: &Gathering) -> Result<u64> {
        Ok(0) // it lies on the device already
    }

    fn trace(&mut self, frame: &Frame, indirect: Indirect) -> Result<()> {
        self.write_frame(frame, &indirect)?;
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
                let Some(points) = &self.points else { return Err(out_of_order("OpenCL")) };
                args = args.table(charts).table(&self.lattice).table(texels).table(points);
                if let Some(kernel) = &active.sites {
                    let Some((sites, surfaces)) = &self.sites else { return Err(out_of_order("OpenCL")) };
                    let own = args.clone().with("irradiances", sites).with("surfaces", surfaces);
                    let own = own.with("count", count_of_sites(&pass.lattice) as i32);
                    let work = draws::site_work(frame, self.quads, &pass.lattice);
                    gather_sites(&self.context, kernel, &own, active.lanes, work, &pass.lattice)?;
                    args = args.table(sites).table(surfaces);
                }
            }
            _ => return Err(out_of_order("OpenCL")),
        }
        self.missing.clear();
        let pause = self.pause.clone().unwrap_or_else(|| Rc::new(|| true));
        let gather = plan_of_queries(active, &indirect);
        let picture = Picture::new(&self.context, frame, &indirect, (gather, self.quads), active.lanes, &*pause);
        let Some([sliced, add]) = active.sliced.as_ref().filter(|_| !draws.is_whole(frame)) else {
            // Slices are gathered alone.
            let args = active.queue.into_iter().fold(args, |args, bytes| args.with("queue", Arg::Local(bytes)));
            self.missing = picture.draw(&active.kernel, args, frame, film)?;
            return Ok(());
        };
        if gather.is_some() {
            args = args.replace(&self.slice);
        }
        let part = match &mut self.part {
            Some(part) if part.len() >= film.len() => part,
            none => none.insert(Buffer::new(&self.context, film.len())?),
        };
        let mut changing = Changing { frame: &mut self.frame, slice: &mut self.slice };
        self.missing = picture.draw_slices([sliced, add], &args, &mut changing, draws, part, film)?;
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

/// The layout of the cells in which pixels look for photons, where they do.
fn plan_of_queries(active: &Compiled, indirect: &Indirect) -> Option<Gather> {
    match indirect {
        Indirect::Map(MapView::Device { tiles: Some(tiles), .. })
            if active.permutation.gathering.is_some_and(|gathering| gathering.method.is_tiled()) =>
        {
            Some(tiles.plan.gather)
        }
        Indirect::Map(MapView::Device { grid, .. }) => Some(grid.plan.gather),
        _ => None,
    }
}

fn count_of_sites(lattice: &SiteLattice) -> usize {
    lattice.columns as usize * lattice.rows as usize
}

/// Launches the kernel that gathers at the sites, from which pixels then take irradiance.
fn gather_sites(
    context: &Context,
    kernel: &Kernel,
    args: &Arguments,
    lanes: u32,
    work: f64,
    lattice: &SiteLattice,
) -> Result<()> {
    let local = if lanes == 1 { 64 } else { 8 };
    let items = count_of_sites(lattice).div_ceil(lanes as usize);
    kernel.pace.expect(work);
    context.launch(kernel, args, &[items], Some(&[local]))
}

/// A picture as launches cut it: blocks of pixels, and bands of these.
struct Picture<'a> {
    context: &'a Context,
    frame: &'a Frame,
    indirect: &'a Indirect<'a>,
    gather: Option<Gather>,
    quads: usize,
    /// Rows of pixels in a block.
    rows: u32,
    bands: u32,
    /// Blocks across and down: what is launched.
    blocks: [usize; 2],
    pause: &'a dyn Fn() -> bool,
}

/// Buffers that are written anew for each slice of a picture.
struct Changing<'a> {
    frame: &'a mut Buffer<Frame>,
    slice: &'a mut Buffer<Gather>,
}

impl<'a> Picture<'a> {
    /// 8 × 8 blocks a work-group: enough to share out, small enough that the last ones do not idle.
    const LOCAL: [usize; 2] = [8, BAND as usize];

    fn new(
        context: &'a Context,
        frame: &'a Frame,
        indirect: &'a Indirect<'a>,
        (gather, quads): (Option<Gather>, usize),
        lanes: u32,
        pause: &'a dyn Fn() -> bool,
    ) -> Picture<'a> {
        let (columns, rows) = block(lanes);
        let bands = (frame.height as u32).div_ceil(rows * BAND);
        let blocks = [(frame.width as u32).div_ceil(columns) as usize, (bands * BAND) as usize];
        Picture { context, frame, indirect, gather, quads, rows, bands, blocks, pause }
    }

    /// Draws into `film`; the rows that are missing because the rest was not wanted.
    fn draw(&self, kernel: &Kernel, args: Arguments, frame: &Frame, film: &Buffer<[f32; 3]>) -> Result<Vec<[u32; 2]>> {
        let (bands, height) = (self.bands, self.frame.height as u32);
        kernel
            .pace
            .expect(f64::from(self.frame.width) * draws::work(frame, self.quads, self.indirect, self.gather.as_ref()));
        // What is not cut goes on from a row to the next.
        let stride = if kernel.pace.fits(self.blocks[1]) { 1 } else { submissions::stride(bands as usize) };
        let args = args.with("film", film).with("width", self.frame.width as i32).with("height", height as i32);
        let args = args.with("bands", bands as i32).with("stride", stride as i32);
        let done = self.context.launch_while(kernel, &args, &self.blocks, Some(&Self::LOCAL), self.pause)?;
        let missing = (done as u32 / BAND..bands).map(|band| {
            let first = band * stride as u32 % bands * BAND * self.rows;
            [first, (first + BAND * self.rows).min(height)]
        });
        Ok(missing.collect())
    }

    /// Draws slice after slice into `part`, and adds them up in `film`; what is missing, as [`Picture::draw`] says it.
    fn draw_slices(
        &self,
        [sliced, add]: [&Kernel; 2],
        args: &Arguments,
        changing: &mut Changing,
        draws: Draws,
        part: &Buffer<[f32; 3]>,
        film: &Buffer<[f32; 3]>,
    ) -> Result<Vec<[u32; 2]>> {
        for (number, (frame, weight, slice)) in draws.parts(self.frame).enumerate() {
            changing.frame.write(self.context, &[frame])?;
            if let Some(gather) = self.gather {
                let slices = draws.slices as f32;
                changing.slice.write(self.context, &[Gather { slice: slice as f32, slices, ..gather }])?;
            }
            let missing = self.draw(sliced, args.clone(), &frame, part)?;
            let floats = 3 * film.len();
            let sum = Arguments::new().with("part", part).with("film", film).with("count", floats as i32);
            let sum = sum.with("weight", weight).with("is_first", i32::from(number == 0));
            self.context.launch(add, &sum, &[floats], None)?;
            if !missing.is_empty() || !(self.pause)() {
                // What is there of the others is a part of it.
                return Ok(vec![[0, self.frame.height as u32]]);
            }
        }
        Ok(Vec::new())
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
