//! The photon map in device memory, in the order in which it was stored.

use bytemuck::Pod;

use crate::device::cl::{Arguments, Buffer, Context};
use crate::device::memory::capacity;
use crate::error::Result;
use crate::records::{PhotonDirection, PhotonPosition, PhotonPower, TEXEL};

/// A photon map on the device, in path order, then bounce order. 28 bytes a photon, 40 where some surface is glossy.
pub struct PhotonMap {
    /// Scene space, metres.
    pub positions: Buffer<PhotonPosition>,
    /// Watts per channel.
    pub powers: Buffer<PhotonPower>,
    /// 2·object + (0 the side that the object's normal points to | 1 the other); whole texels.
    pub faces: Buffer<f32>,
    /// Towards where the photon came from; only where some surface is glossy.
    pub directions: Option<Buffer<PhotonDirection>>,
    /// Photons in the map; the buffers may have room for more.
    pub stored: usize,
    /// How many paths were emitted for these photons.
    pub emitted: u32,
}

/// A photon map's buffers, lent to a stage.
#[derive(Clone, Copy)]
pub struct Photons<'a> {
    /// Scene space, metres.
    pub positions: &'a Buffer<PhotonPosition>,
    /// Watts per channel.
    pub powers: &'a Buffer<PhotonPower>,
    /// The face that each lies on, as in [`PhotonMap::faces`].
    pub faces: &'a Buffer<f32>,
    /// Towards where each came from; only where a glossy surface asks.
    pub directions: Option<&'a Buffer<PhotonDirection>>,
    /// Photons stored: the buffers may be longer.
    pub count: usize,
}

impl PhotonMap {
    /// Uninitialised memory for `stored` photons. `old` gives its own where that is large enough: fresh memory costs
    /// as much as a third of an emission.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when memory is short.
    pub fn new(
        context: &Context,
        old: Option<PhotonMap>,
        glossy: bool,
        stored: usize,
        emitted: u32,
    ) -> Result<PhotonMap> {
        if let Some(old) = old.filter(|old| old.has_room(glossy, stored)) {
            return Ok(PhotonMap { stored, emitted, ..old });
        }
        let capacity = capacity(stored);
        Ok(PhotonMap {
            positions: Buffer::new(context, capacity)?,
            powers: Buffer::new(context, capacity)?,
            faces: Buffer::new(context, capacity.next_multiple_of(TEXEL))?,
            directions: glossy.then(|| Buffer::new(context, capacity)).transpose()?,
            stored,
            emitted,
        })
    }

    /// Room for `room` photons, of which the first `kept` are those of `old`.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when memory is short.
    pub fn with_room(
        context: &Context,
        old: Option<PhotonMap>,
        glossy: bool,
        kept: usize,
        room: usize,
    ) -> Result<PhotonMap> {
        let Some(old) = old else { return PhotonMap::new(context, None, glossy, room, 0) };
        if old.has_room(glossy, room) {
            return Ok(old);
        }
        if kept == 0 {
            drop(old);
            return PhotonMap::new(context, None, glossy, room, 0);
        }
        let mut map = PhotonMap::new(context, None, glossy, room, 0)?;
        map.positions.copy_from(context, &old.positions, kept)?;
        map.powers.copy_from(context, &old.powers, kept)?;
        map.faces.copy_from(context, &old.faces, kept)?;
        if let (Some(to), Some(from)) = (&mut map.directions, &old.directions) {
            to.copy_from(context, from, kept)?;
        }
        Ok(map)
    }

    /// Whether it keeps directions.
    pub fn glossy(&self) -> bool {
        self.directions.is_some()
    }

    /// Photons that there is memory for.
    pub fn room(&self) -> usize {
        let tables = [self.positions.len(), self.powers.len(), self.faces.len()];
        tables.into_iter().chain(self.directions.as_ref().map(Buffer::len)).min().unwrap_or(0)
    }

    /// Whether `stored` photons fit.
    fn has_room(&self, glossy: bool, stored: usize) -> bool {
        self.glossy() == glossy && self.room() >= stored
    }

    /// A map with these photons.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when memory is short.
    ///
    /// # Panics
    /// When the tables differ in length, but for directions where there are none.
    pub fn from_tables(
        context: &Context,
        positions: &[PhotonPosition],
        powers: &[PhotonPower],
        faces: &[f32],
        directions: &[PhotonDirection],
    ) -> Result<PhotonMap> {
        let stored = positions.len();
        assert!([powers.len(), faces.len()] == [stored; 2] && [0, stored].contains(&directions.len()));
        let mut map = PhotonMap::new(context, None, !directions.is_empty(), stored, 0)?;
        map.positions.write(context, positions)?;
        map.powers.write(context, powers)?;
        map.faces.write(context, faces)?;
        if let Some(table) = &mut map.directions {
            table.write(context, directions)?;
        }
        Ok(map)
    }

    /// The map as tiles, gathering and uploads take it.
    pub fn view(&self) -> Photons<'_> {
        Photons {
            positions: &self.positions,
            powers: &self.powers,
            faces: &self.faces,
            directions: self.directions.as_ref(),
            count: self.stored,
        }
    }

    /// The tables, for kernels that store photons: `MAP` of `table_sets.rs`.
    pub fn arguments(&self) -> Arguments {
        let args = Arguments::new().table(&self.positions).table(&self.powers).with("photon_faces", &self.faces);
        self.directions.iter().fold(args, |args, directions| args.table(directions))
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> usize {
        let directions = self.directions.as_ref().map_or(0, Buffer::bytes);
        self.positions.bytes() + self.powers.bytes() + self.faces.bytes() + directions
    }
}

/// The first `count` records of a table, on the host.
///
/// # Errors
/// [`crate::error::Error::Device`] when the transfer fails.
pub fn first<T: Pod>(context: &Context, table: &Buffer<T>, count: usize) -> Result<Vec<T>> {
    let mut records = vec![T::zeroed(); count];
    table.read(context, &mut records)?;
    Ok(records)
}
