//! What every kernel that walks photon paths needs (`kernels/paths.cl`): the scene as emission sees it, and launches.

use std::cell::RefCell;
use std::rc::Rc;

use super::scene_buffers::SceneBuffers;
use crate::device::cl::{Arguments, Buffer, Context, Kernel};
use crate::error::Result;
use crate::packing::Packed;
use crate::rays::emission::{COLUMNS_LOG2, Emission, EmissionPlan, PART_BITS, ROWS_LOG2, Sampler};
use crate::records::{Emitter, Frame};

/// A scene's lights and objects on the device.
pub struct Paths {
    frame: Buffer<Frame>,
    scene: SceneBuffers,
    counts: Buffer<[u32; 3]>,
    slots: Buffer<u32>,
    cells: Buffer<u32>,
    /// Emitters of the last two numbers of paths: what is counted to store so many photons, and what stores them.
    emitters: RefCell<Vec<(u32, Rc<Buffer<Emitter>>)>>,
    /// How the lights share their paths.
    pub plan: EmissionPlan,
}

/// Consecutive paths that a launch walks, in runs of `length`, one run a lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Range {
    /// The number of the first path.
    pub first: u32,
    /// One past the last path.
    pub end: u32,
    /// How many paths a lane walks one after the other.
    pub length: u32,
}

impl Range {
    /// Long runs waste few lanes at their ends, but there must be enough of them to fill the device. No result depends
    /// on this.
    pub fn new(context: &Context, first: u32, end: u32) -> Range {
        let device = &context.device;
        // GPUs: half the threads that a multiprocessor holds; longer runs keep more of a warp busy (on an H200, 1M paths of
        // gi_ref are counted in 256, 220, 199 and 190 µs by runs of 1, 2, 4 and 8). CPUs: 16 work-items a core to share
        // out evenly.
        let (wanted, longest) = if device.lanes == 1 { (1024, 8) } else { (16 * device.lanes, 256) };
        let length = ((end - first) / (device.compute_units.max(1) * wanted)).clamp(1, longest);
        Range { first, end, length }
    }

    /// How many runs there are; the last may be shorter.
    pub fn runs(&self) -> u32 {
        (self.end - self.first).div_ceil(self.length)
    }
}

impl Paths {
    /// Takes over a scene's records, and how its lights share their paths.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the device has no room.
    pub fn new(context: &Context, packed: &Packed, plan: EmissionPlan) -> Result<Paths> {
        let frame = Frame {
            sphere_count: packed.sphere_count as f32,
            plane_count: packed.plane_count() as f32,
            light_count: packed.lights.len() as f32,
            ..Frame::default()
        };
        Ok(Paths {
            frame: Buffer::from_slice(context, &[frame])?,
            scene: SceneBuffers::new(context, packed)?,
            counts: Buffer::from_slice(context, &plan.counts)?,
            slots: Buffer::from_slice(context, &plan.slots)?,
            cells: Buffer::from_slice(context, &plan.cells)?,
            emitters: RefCell::default(),
            plan,
        })
    }

    /// What a path of each light is worth, of so many in all. The same memory as long as the number is the same: fresh
    /// memory costs a GPU's driver 0.1 ms.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the device has no room.
    pub fn emitters(&self, context: &Context, paths: u32) -> Result<Rc<Buffer<Emitter>>> {
        let mut known = self.emitters.borrow_mut();
        if let Some((_, emitters)) = known.iter().find(|(of, _)| *of == paths) {
            return Ok(Rc::clone(emitters));
        }
        let emitters = Rc::new(Buffer::from_slice(context, &self.plan.emitters(paths))?);
        known.truncate(1);
        known.insert(0, (paths, Rc::clone(&emitters)));
        Ok(emitters)
    }

    /// The defines of a walk at these settings.
    pub fn defines(&self, emission: &Emission) -> Vec<String> {
        let mut defines = vec![
            format!("SLOTS_LOG2 {}u", self.plan.slots_log2),
            format!("EMISSION_ROWS_LOG2 {ROWS_LOG2}u"),
            format!("EMISSION_COLUMNS_LOG2 {COLUMNS_LOG2}u"),
            format!("EMISSION_PART_BITS {PART_BITS}u"),
        ];
        let mut add = |on: bool, name: &str| {
            if on {
                defines.push(name.into());
            }
        };
        // Not ONE_LIGHT: that is about shading, which has no lights where photons carry all.
        add(self.plan.counts.len() == 1, "ONE_EMITTER");
        add(!self.plan.cells.is_empty(), "HAS_EMISSION_MAP");
        add(emission.store_direct, "STORE_DIRECT");
        add(emission.sampler == Sampler::Random, "SAMPLER_RANDOM");
        defines
    }

    /// `WALK` of `table_sets.rs`, which all such kernels take.
    pub fn arguments(&self, emitters: &Buffer<Emitter>, range: &Range, stream: u32) -> Arguments {
        let tables = self.scene.arguments().table(&self.frame).table(emitters);
        let tables = tables.with("emitter_counts", &self.counts).with("slots", &self.slots);
        let tables = tables.with("emission_cells", &self.cells);
        let numbers = tables.with("first_path", range.first).with("end_path", range.end);
        numbers.with("run_length", range.length).with("stream", stream)
    }

    /// Launches one work-item for each `lanes` runs of a range.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the launch is refused.
    pub fn launch(&self, context: &Context, kernel: &Kernel, args: &Arguments, range: &Range) -> Result<()> {
        let items = range.runs().div_ceil(context.device.lanes) as usize;
        let local = if context.device.lanes == 1 { 128 } else { 1 };
        self.launch_items(context, kernel, args, range, [items, local])
    }

    /// The same for so many work-items, in work-groups of so many, each of which walks `range.length` paths.
    ///
    /// # Errors
    /// As [`Paths::launch`].
    pub fn launch_items(
        &self,
        context: &Context,
        kernel: &Kernel,
        args: &Arguments,
        range: &Range,
        [items, local]: [usize; 2],
    ) -> Result<()> {
        kernel.pace.expect(self.scene.shapes as f64 * f64::from(range.length));
        context.launch(kernel, args, &[items], Some(&[local]))
    }
}
