//! Emission on GPUs: paths are walked twice, first to count what each stores, then to store it (`photons_count` and
//! `photons_store` of `kernels/photons.cl`).

use super::paths::Range;
use super::photon_map::PhotonMap;
use super::walks::{Walks, batch_that_stores, check_stored};
use crate::device::cl::{Arguments, Buffer, Context, Kernel};
use crate::error::Result;
use crate::program::source::Source;
use crate::records::{Emitter, PhotonDirection, PhotonPosition, PhotonPower};

/// Work-items that walk together.
const GROUP: u32 = 128;

/// Most paths of a group for each of its work-items. On an H100, 1M paths of gi_ref take 0.37 ms with 2 and 0.30 with 4,
/// those of the open sphere_and_plane 0.16 and 0.12.
const MOST_PATHS: u32 = 4;

/// Bytes of local memory in which a group gathers what it stores: with what it counts in, the 32 KiB that every device has.
/// On an H100, 1M paths of gi_ref take 0.30 ms with room for two photons a path, 0.31 for three and
/// 0.41 for none.
const STAGED: usize = (32 << 10) - size_of::<u32>() * (GROUP * (MOST_PATHS + 1) + 1) as usize;

/// Bytes of counts that are worth keeping for the next pass: fresh memory costs a GPU's driver 0.1 ms and more.
const KEPT: usize = 4 << 20;

/// Kernels, and the memory that photons are counted in.
pub struct Counter {
    count: Kernel,
    store: Kernel,
    glossy: bool,
    /// Photons of each path.
    counts: Buffer<u16>,
    /// Photons of each group's paths; once scanned, where they begin.
    totals: Buffer<u32>,
}

impl Counter {
    /// The `#define`s that the kernels take.
    pub fn defines(glossy: bool) -> [String; 3] {
        let photon = size_of::<PhotonPosition>() + size_of::<PhotonPower>() + size_of::<f32>();
        let photon = photon + if glossy { size_of::<PhotonDirection>() } else { 0 };
        [
            format!("PHOTONS_GROUP {GROUP}u"),
            format!("PHOTONS_RUN {MOST_PATHS}u"),
            format!("PHOTONS_STAGED {}u", STAGED / photon),
        ]
    }

    /// With the kernels of a permutation.
    ///
    /// # Errors
    /// [`crate::error::Error::Build`] with the driver's log.
    pub fn new(context: &Context, glossy: bool, source: &Source) -> Result<Counter> {
        Ok(Counter {
            count: context.kernel(source, "photons_count")?,
            store: context.kernel(source, "photons_store")?,
            glossy,
            counts: Buffer::new(context, 0)?,
            totals: Buffer::new(context, 0)?,
        })
    }

    /// Emits paths `[0, paths)`. At most `limit` photons are kept.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] when more are stored than indices can tell apart,
    /// [`crate::error::Error::Device`] from the device.
    pub fn emit(&mut self, walks: &Walks, paths: u32, limit: u32, old: Option<PhotonMap>) -> Result<PhotonMap> {
        let emitters = walks.scene.emitters(walks.context, paths)?;
        let range = Counter::range(walks.context, 0, paths);
        let groups = self.count(walks, &emitters, &range)?;
        // Passes store about as much as those before: into the old map's memory they can, while the host waits for what they
        // count. Should there be more, they are stored once more.
        let old = old.filter(|old| old.glossy() == self.glossy);
        let room = old.as_ref().map_or(0, |old| old.room().min(limit as usize));
        if let Some(old) = old.as_ref().filter(|_| room > 0) {
            self.store(walks, &emitters, &range, old, room as u32)?;
        }
        let stored = self.stored(walks, groups)?.min(limit);
        check_stored(paths, stored.into())?;
        let map = PhotonMap::new(walks.context, old, self.glossy, stored as usize, paths)?;
        if stored as usize > room {
            self.store(walks, &emitters, &range, &map, stored)?;
        }
        if self.counts.bytes() > KEPT {
            self.counts = Buffer::new(walks.context, 0)?;
        }
        Ok(map)
    }

    /// How many paths it takes to store `wanted` photons.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] where nothing can be hit, [`crate::error::Error::Device`] from the device.
    pub fn paths_to_store(&mut self, walks: &Walks, wanted: u32) -> Result<u32> {
        let (mut group_paths, mut groups) = (0, 0);
        let (first, missing) = batch_that_stores(walks, wanted, |emitters, first, end| {
            let range = Counter::range(walks.context, first, end);
            (group_paths, groups) = (GROUP * range.length, Counter::groups(&range) as usize);
            self.count(walks, emitters, &range)?;
            self.stored(walks, groups)
        })?;
        // The last group that begins before the missing photon, and in it the path that stores it.
        let mut offsets = vec![0; groups];
        self.totals.read(walks.context, &mut offsets)?;
        let group = offsets.partition_point(|offset| *offset < missing).saturating_sub(1);
        let counts = self.counts.to_vec(walks.context)?;
        let before = group as u32 * group_paths;
        let mut stored = offsets[group];
        let last = counts[before as usize..].iter().position(|count| {
            stored += u32::from(*count);
            stored >= missing
        });
        Ok(first + before + last.expect("counts add up to their total") as u32 + 1)
    }

    /// As many paths for each work-item as leave some hundred work-items for each multiprocessor.
    fn range(context: &Context, first: u32, end: u32) -> Range {
        let length = ((end - first) / (context.device.compute_units.max(1) * 512)).clamp(1, MOST_PATHS);
        Range { first, end, length }
    }

    fn groups(range: &Range) -> u32 {
        (range.end - range.first).div_ceil(GROUP * range.length)
    }

    fn launch(walks: &Walks, kernel: &Kernel, args: &Arguments, range: &Range) -> Result<()> {
        let items = (Counter::groups(range) * GROUP) as usize;
        walks.scene.launch_items(walks.context, kernel, args, range, [items, GROUP as usize])
    }

    /// Counts what a range of paths stores, group by group, whose number it returns. Returns at once.
    fn count(&mut self, walks: &Walks, emitters: &Buffer<Emitter>, range: &Range) -> Result<usize> {
        let groups = Counter::groups(range) as usize;
        self.counts.fit(walks.context, (range.end - range.first) as usize)?;
        self.totals.fit(walks.context, groups + 1)?;
        if groups == 0 {
            return Ok(0);
        }
        let args = walks.arguments(emitters, range).with("counts", &self.counts).with("totals", &self.totals);
        Counter::launch(walks, &self.count, &args, range)?;
        walks.scan.exclusive(walks.context, &self.totals, groups + 1)?;
        Ok(groups)
    }

    /// How many photons these are.
    fn stored(&self, walks: &Walks, groups: usize) -> Result<u32> {
        if groups == 0 { Ok(0) } else { self.totals.get(walks.context, groups) }
    }

    /// Stores what was counted, the first `limit` photons. Returns at once.
    fn store(
        &self,
        walks: &Walks,
        emitters: &Buffer<Emitter>,
        range: &Range,
        map: &PhotonMap,
        limit: u32,
    ) -> Result<()> {
        let args = walks.arguments(emitters, range).and(&map.arguments());
        let args = args.with("counts", &self.counts).with("offsets", &self.totals).with("limit", limit);
        Counter::launch(walks, &self.store, &args, range)
    }
}
