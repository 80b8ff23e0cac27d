//! Trace on the CPU: the twin.

use std::rc::Rc;

use super::{Permutation, Trace, out_of_order};
use crate::cpu;
use crate::cpu::gather::PhotonMap;
use crate::error::Result;
use crate::film::Image;
use crate::gathering::Gathering;
use crate::layout::Frame;
use crate::pack::Packed;
use crate::stage::map::MapView;

/// The twin, on a pool of threads.
pub struct CpuTrace {
    pool: Rc<rayon::ThreadPool>,
    packed: Option<Packed>,
    film: Image,
    active: Option<Permutation>,
}

impl CpuTrace {
    /// On a pool of threads.
    pub fn new(pool: Rc<rayon::ThreadPool>) -> CpuTrace {
        CpuTrace { pool, packed: None, film: Image::new(0, 0), active: None }
    }
}

impl Trace for CpuTrace {
    fn compile(&mut self, permutation: &Permutation) -> Result<()> {
        self.active = Some(*permutation);
        Ok(())
    }

    fn upload(&mut self, packed: &Packed) -> Result<()> {
        self.packed = Some(packed.clone());
        Ok(())
    }

    fn upload_map(&mut self, _map: &MapView, _gathering: &Gathering) -> Result<u64> {
        Ok(0) // it lies in host memory already
    }

    fn trace(&mut self, frame: &Frame, map: Option<&MapView>) -> Result<()> {
        let (width, height) = (frame.width as u32, frame.height as u32);
        if (self.film.width, self.film.height) != (width, height) {
            self.film = Image::new(width, height);
        }
        let (Some(packed), Some(active)) = (&self.packed, &self.active) else { return Err(out_of_order("CPU")) };
        let scene = cpu::scene::SceneTables::new(packed, &active.features);
        let map = match (&active.gathering, map) {
            (None, _) => None,
            (Some(gathering), Some(MapView::Host { plan, stored, grid, tiles })) => {
                let tiles = tiles.filter(|_| gathering.method.is_tiled());
                Some(PhotonMap { gathering, plan, stored: *stored, grid, tiles })
            }
            (Some(_), _) => return Err(out_of_order("CPU")),
        };
        let film = &mut self.film.pixels;
        self.pool.install(|| cpu::trace::trace(&scene, map.as_ref(), frame, film));
        Ok(())
    }

    fn read(&mut self) -> Result<Image> {
        Ok(self.film.clone())
    }

    fn bytes(&self) -> usize {
        self.packed.as_ref().map_or(0, |p| size_of_val(&p.objects[..]) + size_of_val(&p.lights[..]))
            + size_of_val(&self.film.pixels[..])
    }
}
