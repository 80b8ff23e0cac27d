//! Tiles: a camera's view and photons as stored in, lists of photons by tile out. All on the device but for the boxes
//! of what tiles see, seven numbers each, from which the host lays the regions out.

use super::longest_cell::LongestCell;
use super::photon_map::Photons;
use super::scan::Scan;
use super::scene_buffers::SceneBuffers;
use super::sort::{Scratch, Sort, each, share};
use super::trace::draws::{cells_within, touched};
use crate::device::cl::{Arguments, Buffer, Context, Kernel};
use crate::device::submissions;
use crate::error::Result;
use crate::packing::Packed;
use crate::plan::cells::Bounds;
use crate::plan::tiling::{Seen, TilePlan, TileSettings, check_pairs, plan, tiles_of, within};
use crate::program::features::Features;
use crate::program::source::{Options, assemble};
use crate::records::{Frame, Gather, PhotonDirection, Region, Shape, TEXEL, Tile};

/// The tiles' lists on the device. Buffers may be longer than what they hold.
pub struct Tiles {
    /// Regions, radius, cells.
    pub plan: TilePlan,
    /// Entries of the list.
    pub pairs: usize,
    /// [`TilePlan::gather`].
    pub gather: Buffer<Gather>,
    /// [`TilePlan::tiles`].
    pub tiles: Buffer<Tile>,
    /// [`TilePlan::regions`].
    pub regions: Buffer<Region>,
    /// Whole texels; `plan.cells + 1` entries count.
    pub cell_starts: Buffer<f32>,
    /// Whole texels; `pairs` entries count.
    pub tile_photons: Buffer<f32>,
    /// Most entries of a cell; none where nobody has to know, as on CPUs.
    pub longest_cell: Option<u64>,
    /// What takes the place of directions where no photon has one.
    no_directions: Buffer<PhotonDirection>,
}

impl Tiles {
    fn empty(context: &Context) -> Result<Tiles> {
        Ok(Tiles {
            plan: TilePlan::default(),
            pairs: 0,
            gather: Buffer::new(context, 1)?,
            tiles: Buffer::new(context, 0)?,
            regions: Buffer::new(context, 0)?,
            cell_starts: Buffer::new(context, 0)?,
            tile_photons: Buffer::new(context, 0)?,
            longest_cell: None,
            no_directions: Buffer::new(context, 0)?,
        })
    }

    /// `PHOTON_TILES` of `table_sets.rs`.
    pub fn arguments(&self, stored: &Photons) -> Arguments {
        let lists = Arguments::new().table(&self.gather).table(&self.tiles).table(&self.regions);
        let lists = lists.with("cell_starts", &self.cell_starts).with("tile_photons", &self.tile_photons);
        let photons = lists.table(stored.positions).table(stored.powers).with("photon_faces", stored.faces);
        photons.table(stored.directions.unwrap_or(&self.no_directions))
    }

    /// About the most entries that one query looks at, where the longest cell is known.
    pub fn most_candidates(&self) -> Option<u64> {
        let photons = self.plan.gather.photon_count as u64;
        let across = cells_within(&self.plan.gather);
        let cells = self.plan.regions.iter().map(|region| touched(region.counts, across)).max().unwrap_or(0);
        // A point that its tile does not know asks the whole map: few do, so that may take thrice as long.
        Some((self.longest_cell? * cells).max(photons / 3).min(photons))
    }

    /// Bytes held on the device.
    pub fn bytes(&self) -> usize {
        self.gather.bytes()
            + self.tiles.bytes()
            + self.regions.bytes()
            + self.cell_starts.bytes()
            + self.tile_photons.bytes()
    }
}

/// A strip's slot as `tiles_seen` writes it: face, lowest x, y, z, highest x, y, z.
type Slot = [f32; 7];

/// Whether lists of one kind take about as long to make as those of another.
fn takes_alike(one: &TileSettings, other: &TileSettings) -> bool {
    one.tile == other.tile && one.cells == other.cells && (0.9..1.1).contains(&(one.radius / other.radius))
}

/// The tile stage: its kernels, its scratch memory and the tiles that it built last.
pub struct TileStage {
    seen_kernel: Option<(Features, Kernel)>,
    count: Kernel,
    fill: Kernel,
    photons: Kernel,
    starts: Kernel,
    scan: Scan,
    sort: Sort,
    longest_cell: LongestCell,
    /// What lists were last made for: count and fill take another time for others.
    paced_for: Option<TileSettings>,
    scratch: Scratch,
    scene: SceneBuffers,
    frame: Buffer<Frame>,
    seen: Buffer<Slot>,
    seen_counts: Buffer<u32>,
    /// Slots of a strip: grows with the scene.
    seen_slots: usize,
    counts: Buffer<u32>,
    /// [`TilePlan::lines`].
    slots: Buffer<i32>,
    starts_of_lines: Buffer<u32>,
    columns: Buffer<u32>,
    boxes: Buffer<[f32; 8]>,
    /// What each photon enters.
    entered: Buffer<[u32; 4]>,
    pair_photons: Buffer<u32>,
    tiles: Tiles,
}

impl TileStage {
    /// Builds what does not depend on the scene.
    ///
    /// # Errors
    /// [`crate::error::Error::Build`] when the driver refuses a kernel.
    pub fn new(context: &Context) -> Result<TileStage> {
        let lanes = Options { lanes: context.device.lanes, ..Options::default() };
        let counting = assemble("tiles.cl", None, &lanes);
        let source = assemble("tiles.cl", None, &Options::default());
        let grid = assemble("grid.cl", None, &Options::default());
        Ok(TileStage {
            seen_kernel: None,
            count: context.kernel(&counting, "tiles_count")?,
            fill: context.kernel(&source, "tiles_fill")?,
            photons: context.kernel(&source, "tiles_photons")?,
            starts: context.kernel(&grid, "grid_starts")?,
            scan: Scan::new(context)?,
            sort: Sort::new(context)?,
            longest_cell: LongestCell::new(context)?,
            paced_for: None,
            scratch: Scratch::empty(context)?,
            scene: SceneBuffers::default(),
            frame: Buffer::new(context, 1)?,
            seen: Buffer::new(context, 0)?,
            seen_counts: Buffer::new(context, 0)?,
            seen_slots: 8,
            counts: Buffer::new(context, 0)?,
            slots: Buffer::new(context, 0)?,
            starts_of_lines: Buffer::new(context, 0)?,
            columns: Buffer::new(context, 0)?,
            boxes: Buffer::new(context, 0)?,
            entered: Buffer::new(context, 0)?,
            pair_photons: Buffer::new(context, 0)?,
            tiles: Tiles::empty(context)?,
        })
    }

    /// Takes over the scene, and builds the kernel that looks at it where that is not the last one.
    ///
    /// # Errors
    /// [`crate::error::Error::Build`] and [`crate::error::Error::Device`] from the driver.
    pub fn upload(&mut self, context: &Context, packed: &Packed, features: &Features) -> Result<()> {
        self.scene.upload(context, packed)?;
        if self.seen_kernel.as_ref().is_none_or(|(built, _)| built != features) {
            let options = Options { lanes: context.device.lanes, ..Options::default() };
            let source = assemble("tiles.cl", Some(features), &options);
            self.seen_kernel = Some((*features, context.kernel(&source, "tiles_seen")?));
        }
        Ok(())
    }

    /// What each tile sees of each face, in parts.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when memory is short.
    ///
    /// # Panics
    /// Before [`TileStage::upload`].
    pub fn seen(&mut self, context: &Context, frame: &Frame, tile: [u32; 2]) -> Result<Vec<Seen>> {
        let (_, kernel) = self.seen_kernel.as_ref().expect("uploaded before");
        self.frame.write(context, std::slice::from_ref(frame))?;
        let tiles = tiles_of(frame, tile);
        // Strips are parts of what is in the image: what hangs over would take a slot for every 64 pixels of nothing.
        let tile = within(frame, tile);
        // A CPU's work-item is a long loop of 16 pixels at a time; a GPU wants many of few pixels.
        let side = if context.device.lanes == 1 { 8 } else { 64 };
        let strip = tile.map(|pixels| pixels.min(side));
        let strips = tile[0].div_ceil(strip[0]) * tile[1].div_ceil(strip[1]);
        let work_items = (tiles[0] * tiles[1] * strips) as usize;
        self.seen_counts.fit(context, work_items)?;
        let samples = frame.samples.max(1.0) as usize;
        loop {
            // No strip sees more faces than it has rays.
            let slots = self.seen_slots.min(strip[0] as usize * strip[1] as usize * samples);
            self.seen.fit(context, work_items * slots)?;
            let args = self.scene.arguments().table(&self.frame).with("slots", slots as i32);
            let args = args.with("seen", &self.seen).with("counts", &self.seen_counts);
            let args = args.with("tile_width", tile[0] as i32).with("tile_height", tile[1] as i32);
            let args = args.with("tiles_across", tiles[0] as i32).with("tile_count", (tiles[0] * tiles[1]) as i32);
            let args = args.with("strip_width", strip[0] as i32).with("strip_height", strip[1] as i32);
            kernel.pace.expect((strip[0] * strip[1]) as f64 * samples as f64 * self.scene.shapes as f64);
            context.launch(kernel, &args, &[work_items], None)?;
            let mut counts = vec![0; work_items];
            self.seen_counts.read(context, &mut counts)?;
            if counts.iter().any(|used| *used as usize > slots) {
                self.seen_slots *= 4;
                continue;
            }
            let mut boxes = vec![Slot::default(); work_items * slots];
            self.seen.read(context, &mut boxes)?;
            let mut seen = Vec::new();
            for (number, (used, slots)) in counts.iter().zip(boxes.chunks(slots)).enumerate() {
                let tile = number as u32 / strips;
                seen.extend(slots[..*used as usize].iter().map(|&[face, a, b, c, d, e, f]| Seen {
                    tile,
                    face: face as u32,
                    bounds: Bounds { low: [a, b, c], high: [d, e, f] },
                }));
            }
            return Ok(seen);
        }
    }

    /// Sorts a photon map into the tiles of a view. The host waits for what tiles see and for the lists' length; the
    /// queue is in order.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] when floats cannot count the lists' entries; [`crate::error::Error::Device`]
    /// when memory is short.
    pub fn build(
        &mut self,
        context: &Context,
        shapes: &[Shape],
        frame: &Frame,
        photons: &Photons,
        wanted: &TileSettings,
    ) -> Result<&Tiles> {
        let seen = self.seen(context, frame, wanted.tile)?;
        let plan = plan(shapes, frame, seen, photons.count, wanted)?;
        if self.paced_for.replace(*wanted).is_some_and(|last| !takes_alike(&last, wanted)) {
            self.count.pace.forget();
            self.fill.pace.forget();
        }
        self.fill(context, plan, frame, photons)
    }

    /// The same for tiles that are laid out.
    ///
    /// # Errors
    /// As [`TileStage::build`].
    pub fn fill(&mut self, context: &Context, plan: TilePlan, frame: &Frame, photons: &Photons) -> Result<&Tiles> {
        self.frame.write(context, std::slice::from_ref(frame))?;
        let tiles = &mut self.tiles;
        tiles.tiles.fit(context, plan.tiles.len())?;
        tiles.regions.fit(context, plan.regions.len())?;
        tiles.cell_starts.fit(context, (plan.cells + 1).next_multiple_of(TEXEL))?;
        tiles.tiles.write(context, &plan.tiles)?;
        tiles.regions.write(context, &plan.regions)?;
        tiles.gather.write(context, &[plan.gather])?;

        let lines = &plan.lines;
        self.slots.fit(context, lines.slots.len())?;
        self.starts_of_lines.fit(context, lines.starts.len())?;
        self.columns.fit(context, lines.columns.len())?;
        self.boxes.fit(context, lines.boxes.len())?;
        self.slots.write(context, &lines.slots)?;
        self.starts_of_lines.write(context, &lines.starts)?;
        self.columns.write(context, &lines.columns)?;
        self.boxes.write(context, &lines.boxes)?;

        // How many regions each run of photons enters, and in all.
        let (items, per_item) = share(context, photons.count);
        self.counts.fit(context, items)?;
        self.entered.fit(context, photons.count)?;
        let shared = Arguments::new().table(photons.positions).with("photon_faces", photons.faces);
        let shared = shared.with("tiles_down", plan.size[1] as i32).with("slots", &self.slots);
        let shared = shared.with("starts", &self.starts_of_lines).with("columns", &self.columns);
        let shared = shared.with("boxes", &self.boxes).with("entered", &self.entered);
        let shared = shared.with("count", photons.count as i32).with("per_item", per_item as i32);
        let args = shared.clone().table(&self.frame).table(&tiles.gather).with("counts", &self.counts);
        context.launch(&self.count, &args, &[items], None)?;
        let mut counts = vec![0u32; items];
        self.counts.read(context, &mut counts)?;
        // In 64 bits: what is refused may not fit into the scan's 32.
        let pairs = counts.iter().map(|count| u64::from(*count)).sum();
        check_pairs(pairs, &plan)?;
        let pairs = pairs as usize;
        self.scan.exclusive(context, &self.counts, items)?;

        // The pairs, sorted by cell.
        self.pair_photons.fit(context, pairs)?;
        tiles.tile_photons.fit(context, pairs.next_multiple_of(TEXEL))?;
        self.sort.reserve(context, &mut self.scratch, pairs)?;
        let args = shared.table(&tiles.regions).with("celled", i32::from(plan.cells > plan.regions.len()));
        let args = args.with("places", &self.counts).with("keys", &self.scratch.keys[0]);
        let args = args.with("photons", &self.pair_photons);
        context.launch(&self.fill, &args, &[items], None)?;
        let sorted = self.sort.sort(context, &self.scratch, pairs, plan.cells)?;
        let (items, per_item) = each(context, pairs);
        let shared = Arguments::new().with("count", pairs as i32).with("per_item", per_item as i32);
        let args = shared.clone().with("sorted_keys", &self.scratch.keys[sorted]).with("cells", plan.cells as i32);
        let args = args.with("cell_starts", &tiles.cell_starts);
        // One place more than there are pairs: it ends the last cell.
        context.launch(&self.starts, &args, &[(pairs + 1).div_ceil(per_item)], None)?;
        let args = shared.with("order", &self.scratch.values[sorted]).with("photons", &self.pair_photons);
        let args = args.with("tile_photons", &tiles.tile_photons);
        context.launch(&self.photons, &args, &[items], None)?;
        tiles.longest_cell = match submissions::cuts_all(context.device.is_gpu) {
            true => Some(self.longest_cell.of(context, &tiles.cell_starts, plan.cells)?),
            false => None,
        };
        tiles.plan = plan;
        tiles.pairs = pairs;
        Ok(&self.tiles)
    }

    /// The tiles that were built last.
    pub fn tiles(&self) -> &Tiles {
        &self.tiles
    }

    /// Bytes held on the device, scratch included.
    pub fn bytes(&self) -> usize {
        self.tiles.bytes()
            + self.scratch.bytes()
            + self.seen.bytes()
            + self.seen_counts.bytes()
            + self.counts.bytes()
            + self.slots.bytes()
            + self.starts_of_lines.bytes()
            + self.columns.bytes()
            + self.boxes.bytes()
            + self.entered.bytes()
            + self.pair_photons.bytes()
    }
}
