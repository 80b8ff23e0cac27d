//! Trace on the CPU: the twin.

use std::rc::Rc;

use super::{Indirect, Permutation, Trace, out_of_order};
use crate::cpu;
use crate::cpu::final_gather::Gatherer;
use crate::cpu::gather::PhotonMap;
use crate::error::Result;
use crate::film::Image;
use crate::packing::packed_scene::PackedScene;
use crate::program::gathering::Gathering;
use crate::records::{Frame, Site, SiteSurface};
use crate::stage::irradiance::IrradianceView;
use crate::stage::map::MapView;

/// The twin, on a pool of threads.
pub struct CpuTrace {
    pool: Rc<rayon::ThreadPool>,
    packed: Option<PackedScene>,
    film: Image,
    active: Option<Permutation>,
    /// Of the last pass with final gathering.
    sites: (Vec<Site>, Vec<SiteSurface>),
}

impl CpuTrace {
    /// On a pool of threads.
    pub fn new(pool: Rc<rayon::ThreadPool>) -> CpuTrace {
        CpuTrace { pool, packed: None, film: Image::new(0, 0), active: None, sites: Default::default() }
    }
}

impl Trace for CpuTrace {
    fn compile(&mut self, permutation: &Permutation) -> Result<()> {
        self.active = Some(*permutation);
        Ok(())
    }

    fn upload(&mut self, packed: &PackedScene) -> Result<()> {
        self.packed = Some(packed.clone());
        Ok(())
    }

    fn upload_map(&mut self, _map: &MapView, _gathering: &Gathering) -> Result<u64> {
        Ok(0) // it lies in host memory already
    }

    fn trace(&mut self, frame: &Frame, indirect: Indirect) -> Result<()> {
        let (width, height) = (frame.width as u32, frame.height as u32);
        if (self.film.width, self.film.height) != (width, height) {
            self.film = Image::new(width, height);
        }
        let (Some(packed), Some(active)) = (&self.packed, &self.active) else { return Err(out_of_order("CPU")) };
        let scene = crate::rays::scene::SceneTables::new(packed, &active.features);
        let indirect = match (indirect, &active.gathering, active.final_gather) {
            (Indirect::None, None, None) => cpu::trace::Indirect::None,
            (Indirect::Map(MapView::Host { plan, stored, grid, tiles }), Some(gathering), None) => {
                let tiles = tiles.filter(|_| gathering.method.is_tiled());
                cpu::trace::Indirect::Map(PhotonMap { gathering, plan, stored: *stored, grid, tiles })
            }
            (Indirect::Final(IrradianceView::Host { charts, texels }, pass), None, Some(sited)) => {
                let (lattice, points) = (&pass.lattice, &pass.points);
                let gatherer = Gatherer { charts, texels, lattice, points, sites: None };
                if sited {
                    self.sites = self.pool.install(|| cpu::final_gather::sites(&scene, &gatherer, frame));
                }
                let sites = sited.then_some((&self.sites.0[..], &self.sites.1[..]));
                cpu::trace::Indirect::Final(Gatherer { sites, ..gatherer })
            }
            _ => return Err(out_of_order("CPU")),
        };
        let film = &mut self.film.pixels;
        self.pool.install(|| cpu::trace::trace(&scene, &indirect, frame, film));
        Ok(())
    }

    fn read(&mut self) -> Result<Image> {
        Ok(self.film.clone())
    }

    fn bytes(&self) -> usize {
        self.packed.as_ref().map_or(0, |p| size_of_val(&p.shapes[..]) + size_of_val(&p.lights[..]))
            + size_of_val(&self.film.pixels[..])
    }
}
