//! The photon map: emission and grid, on an OpenCL device or by the twins on the CPU.

use crate::plan::photon_sample::Sample;
use std::rc::Rc;

use super::grid::{Grid, GridSettings, GridStage};
use super::photon_map::{PhotonMap, Photons as StoredPhotons, first};
use super::photons::Photons;
use super::scan::Scan;
use super::tiles::{TileStage, Tiles};
use crate::cpu;
use crate::cpu::grid::face_of;
use crate::device::cl::Context;
use crate::error::{Error, Result};
use crate::packing::packed_scene::PackedScene;
use crate::plan::cells::{self, photon_density};
use crate::plan::tiling;
use crate::program::features::Features;
use crate::rays::emission::{self, Emission};
use crate::records::Frame;
use crate::records::face::faces_of;
use crate::settings::Method;

/// Makes photon maps on one machine and holds the last one.
pub enum MapStage {
    /// By OpenCL's kernels.
    Device(Box<DeviceMap>),
    /// By the twins in Rust.
    Host(Box<HostMap>),
}

/// See [`MapStage::Device`].
pub struct DeviceMap {
    context: Rc<Context>,
    photons: Photons,
    grid: GridStage,
    /// Made when tiles are first asked for.
    tiles: Option<Box<TileStage>>,
    /// In path order; none while the grid has it.
    stored: Option<PhotonMap>,
    packed: Option<PackedScene>,
    /// Whether light straight from the lamps is stored, as the last upload's plan has it.
    stores_direct: Option<bool>,
    /// What the last map came from.
    emission: Option<Emission>,
}

/// See [`MapStage::Host`].
pub struct HostMap {
    pool: Rc<rayon::ThreadPool>,
    scene: Option<(PackedScene, Features, emission::EmissionPlan)>,
    stores_direct: Option<bool>,
    stored: cpu::photons::PhotonTables,
    plan: cells::GridPlan,
    grid: cpu::grid::GridTables,
    tiles: Option<(tiling::TilePlan, cpu::tiles::TileTables)>,
}

/// A finished map, as the trace stage takes it.
pub enum MapView<'a> {
    /// In device memory.
    Device {
        /// What the buffers belong to.
        context: &'a Context,
        /// In path order; none where the grid has taken it over.
        stored: Option<StoredPhotons<'a>>,
        /// In the order of cells.
        grid: &'a Grid,
        /// The tiles that were laid out last, where photons are gathered by them.
        tiles: Option<&'a Tiles>,
    },
    /// In host memory.
    Host {
        /// Form, faces, radius, cell size.
        plan: &'a cells::GridPlan,
        /// The photons in path order.
        stored: cpu::grid::PhotonTables<'a>,
        /// In the order of cells.
        grid: &'a cpu::grid::GridTables,
        /// The tiles that were laid out last, where photons are gathered by them.
        tiles: Option<(&'a tiling::TilePlan, &'a cpu::tiles::TileTables)>,
    },
}

/// A map in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct MapCounts {
    /// How many paths were emitted.
    pub emitted: u64,
    /// How many photons they left on surfaces.
    pub stored: u64,
}

impl MapStage {
    /// On an open device.
    ///
    /// # Errors
    /// [`Error::Build`] when the driver refuses a kernel.
    pub fn on_device(context: Rc<Context>) -> Result<MapStage> {
        let scan = Rc::new(Scan::new(&context)?);
        Ok(MapStage::Device(Box::new(DeviceMap {
            photons: Photons::new(Rc::clone(&context), scan),
            grid: GridStage::new(&context)?,
            context,
            tiles: None,
            stored: None,
            packed: None,
            stores_direct: None,
            emission: None,
        })))
    }

    /// On a pool of threads.
    pub fn on_host(pool: Rc<rayon::ThreadPool>) -> MapStage {
        let plan = cells::GridPlan { hashed: false, cells: 0, faces: Vec::new(), gather: Default::default() };
        let (stored, grid) = Default::default();
        MapStage::Host(Box::new(HostMap { pool, scene: None, stores_direct: None, stored, plan, grid, tiles: None }))
    }

    /// Takes over the scene and builds what an emission needs; passes of one scene find it done.
    ///
    /// # Errors
    /// [`Error::Build`] and [`Error::Device`] from the device; [`Error::Usage`] for too many lights.
    pub fn upload(&mut self, packed: &PackedScene, features: &Features, emission: &Emission) -> Result<()> {
        let direct = Some(emission.store_direct);
        match self {
            MapStage::Device(map) => {
                let known = map.packed.as_ref().map(PackedScene::generation);
                if known != Some(packed.generation()) || map.stores_direct != direct {
                    map.photons.upload(packed, emission::EmissionPlan::of(packed, emission.store_direct)?)?;
                    (map.packed, map.stores_direct) = (Some(packed.clone()), direct);
                }
                map.photons.compile(features, emission)
            }
            MapStage::Host(map) => {
                let plan = match map.scene.take() {
                    Some((known, _, plan))
                        if known.generation() == packed.generation() && map.stores_direct == direct =>
                    {
                        plan
                    }
                    _ => emission::EmissionPlan::of(packed, emission.store_direct)?,
                };
                (map.scene, map.stores_direct) = (Some((packed.clone(), *features, plan)), direct);
                Ok(())
            }
        }
    }

    /// Emits one pass and waits for it.
    ///
    /// # Errors
    /// [`Error::Usage`] when photons shall be stored where nothing can be hit; [`Error::Device`] from the device.
    pub fn emit(&mut self, emission: &Emission) -> Result<MapCounts> {
        match self {
            MapStage::Device(map) => {
                let old = map.stored.take().or_else(|| map.grid.take_memory());
                let stored = map.photons.emit(emission, old)?;
                map.context.finish()?;
                let counts = MapCounts { emitted: stored.emitted.into(), stored: stored.stored as u64 };
                map.stored = Some(stored);
                map.emission = Some(*emission);
                Ok(counts)
            }
            MapStage::Host(map) => {
                let Some((packed, features, plan)) = &map.scene else { return Err(no_scene()) };
                let scene = crate::rays::scene::SceneTables::new(packed, features);
                map.stored = map.pool.install(|| cpu::photons::photons(&scene, plan, emission))?;
                Ok(MapCounts { emitted: map.stored.emitted.into(), stored: map.stored.len() as u64 })
            }
        }
    }

    /// The first photons of the map, at most `most`. Emission sequences make any beginning as well spread as the whole.
    ///
    /// # Errors
    /// [`Error::Device`] when the transfer fails.
    pub fn sample(&self, most: usize) -> Result<Sample> {
        match self {
            MapStage::Device(map) => {
                let Some(stored) = &map.stored else { return Err(no_scene()) };
                let count = stored.stored.min(most);
                let faces = first(&map.context, &stored.faces, count)?.into_iter().map(|face| face as u32).collect();
                Ok(Sample { positions: first(&map.context, &stored.positions, count)?, faces })
            }
            MapStage::Host(map) => {
                let count = map.stored.len().min(most);
                Ok(Sample {
                    positions: map.stored.positions[..count].to_vec(),
                    faces: map.stored.surfaces[..count].iter().map(|s| face_of(s) as u32).collect(),
                })
            }
        }
    }

    /// Puts the map back into path order where a grid has taken it over; one that was given back is emitted again, to
    /// the same bytes.
    ///
    /// # Errors
    /// [`Error::Device`] from the device.
    pub fn restore(&mut self) -> Result<()> {
        if let MapStage::Device(map) = self
            && map.stored.is_none()
        {
            map.stored = map.grid.restore(&map.context)?;
            if let (None, Some(emission)) = (&map.stored, map.emission) {
                map.stored = Some(map.photons.emit(&emission, None)?);
            }
        }
        Ok(())
    }

    /// Gives back the memory of a sorted map of which the trace stage has a copy of its own, where it is `large`.
    ///
    /// # Errors
    /// [`Error::Device`] from the device.
    pub fn copied(&mut self, large: usize) -> Result<()> {
        match self {
            // The map's own memory: lists of tiles that were once made are no reason to make the map's anew for every frame.
            MapStage::Device(map) if map.stored.is_none() && map.grid.bytes() > large => map.grid.release(&map.context),
            _ => Ok(()),
        }
    }

    /// Sorts the map into a grid and waits for it; for methods that read it as it was stored, the grid is only laid
    /// out. Tells whether the grid is in its hashed form.
    ///
    /// # Errors
    /// [`Error::Usage`] when floats cannot count the photons or the cells; [`Error::Device`] from the device.
    pub fn sort(&mut self, wanted: &GridSettings, method: Method) -> Result<bool> {
        self.restore()?;
        match self {
            MapStage::Device(map) => {
                let (Some(stored), Some(packed)) = (map.stored.take(), &map.packed) else { return Err(no_scene()) };
                if method.reads_stored() {
                    map.grid.lay_out(&map.context, &packed.shapes, &stored.view(), wanted)?;
                    map.stored = Some(stored);
                    return Ok(false);
                }
                let hashed = map.grid.build(&map.context, &packed.shapes, stored, wanted)?.plan.hashed;
                map.context.finish()?;
                Ok(hashed)
            }
            MapStage::Host(map) => {
                let Some((packed, ..)) = &map.scene else { return Err(no_scene()) };
                let stored = map.stored.view();
                let bounds = cpu::grid::grid_bounds(&stored, faces_of(packed.shapes.len()));
                let GridSettings { radius, size, form, nearest } = *wanted;
                let faces = stored.surfaces.iter().map(|surface| cpu::grid::face_of(surface) as u32);
                let count = map.stored.len();
                let crowd = || Ok(photon_density::crowd(stored.positions, faces, count, radius));
                map.plan = cells::plan_by_crowd(
                    &packed.shapes,
                    packed.is_glossy(),
                    &bounds,
                    count,
                    radius,
                    (size, form),
                    crowd,
                )?;
                map.plan.gather.nearest = nearest as f32;
                map.grid = cpu::grid::grid(&map.stored.view(), &map.plan);
                Ok(map.plan.hashed)
            }
        }
    }

    /// Sorts the map into the tiles of a view and waits for it. Tells how many entries their lists have.
    ///
    /// # Errors
    /// [`Error::Usage`] when floats cannot count the entries; [`Error::Device`] and [`Error::Build`] from the device.
    pub fn tile(&mut self, frame: &Frame, features: &Features, wanted: &tiling::TileSettings) -> Result<u64> {
        self.restore()?;
        match self {
            MapStage::Device(map) => {
                let (Some(stored), Some(packed)) = (&map.stored, &map.packed) else { return Err(no_scene()) };
                let stage = match &mut map.tiles {
                    Some(stage) => stage,
                    none => none.insert(Box::new(TileStage::new(&map.context)?)),
                };
                stage.upload(&map.context, packed, features)?;
                let pairs = stage.build(&map.context, &packed.shapes, frame, &stored.view(), wanted)?.pairs;
                map.context.finish()?;
                Ok(pairs as u64)
            }
            MapStage::Host(map) => {
                let Some((packed, ..)) = &map.scene else { return Err(no_scene()) };
                let scene = crate::rays::scene::SceneTables::new(packed, features);
                let seen = map.pool.install(|| cpu::tiles::tiles_seen(&scene, frame, wanted.tile));
                let plan = tiling::plan(&packed.shapes, frame, seen, map.stored.len(), wanted)?;
                let tables = cpu::tiles::tiles(&map.stored.view(), &plan, frame)?;
                map.plan.gather = plan.gather;
                let pairs = tables.tile_photons.len() as u64;
                map.tiles = Some((plan, tables));
                Ok(pairs)
            }
        }
    }

    /// Most bytes that the device's buffers ever held; none on the host.
    pub fn most_bytes(&self) -> Option<usize> {
        match self {
            MapStage::Device(map) => Some(map.context.memory.most()),
            MapStage::Host(_) => None,
        }
    }

    /// The map that was made last, for the trace stage.
    pub fn view(&self) -> Option<MapView<'_>> {
        match self {
            MapStage::Device(map) => Some(MapView::Device {
                context: &map.context,
                stored: map.stored.as_ref().map(PhotonMap::view),
                grid: map.grid.grid(),
                tiles: map.tiles.as_ref().map(|stage| stage.tiles()),
            }),
            MapStage::Host(map) => Some(MapView::Host {
                plan: &map.plan,
                stored: map.stored.view(),
                grid: &map.grid,
                tiles: map.tiles.as_ref().map(|(plan, tables)| (plan, tables)),
            }),
        }
    }

    /// Bytes held, scratch included: on a device, by all that share its context.
    pub fn bytes(&self) -> usize {
        match self {
            MapStage::Device(map) => map.context.memory.held(),
            MapStage::Host(map) => {
                let (stored, grid) = (&map.stored, &map.grid);
                let tables = size_of_val(&stored.positions[..]) * 2
                    + size_of_val(&stored.surfaces[..])
                    + size_of_val(&stored.directions[..]);
                let sorted = size_of_val(&grid.positions[..]) * 2
                    + size_of_val(&grid.directions[..])
                    + size_of_val(&grid.order[..]);
                let lists = map
                    .tiles
                    .as_ref()
                    .map_or(0, |(_, tiles)| size_of_val(&tiles.cell_starts[..]) + size_of_val(&tiles.tile_photons[..]));
                tables + sorted + size_of_val(&grid.cell_starts[..]) + lists
            }
        }
    }
}

fn no_scene() -> Error {
    Error::Device("photon map: asked for before there was a scene".into())
}
