//! Trace on OpenGL: a fragment shader on a full-screen quad.

use std::collections::HashMap;
use std::rc::Rc;

use super::gl_final::FinalTextures;
use super::{Indirect, Pause, Permutation, Trace, check_count, out_of_order};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::film::Image;
use crate::gathering::{Gathering, Method};
use crate::gl::{Functions, Program, TableTexture, Target};
use crate::lattice::FinalPass;
use crate::layout::{Frame, Light, Object, Record, TEXTURE_WIDTH_LOG2};
use crate::pack::Packed;
use crate::source::{Options, assemble};
use crate::stage::irradiance::IrradianceView;
use crate::stage::map::MapView;
use crate::stage::photon_textures::{PhotonTextures, cells_across};

/// A fragment shader on a full-screen quad.
pub struct GlTrace {
    gl: Functions,
    objects: TableTexture,
    lights: TableTexture,
    /// The records of a scene that travels in uniforms.
    small: Option<(Vec<Object>, Vec<Light>)>,
    photons: PhotonTextures,
    finals: FinalTextures,
    target: Option<(u32, u32, Target)>,
    /// By permutation, and whether it gathers in slices.
    programs: HashMap<(Permutation, bool), Program>,
    /// Programs that draw sites.
    site_programs: HashMap<Features, Program>,
    active: Option<Permutation>,
    /// Loop rounds that the driver grants a fragment.
    rounds: Option<u64>,
    /// Called between bands of rows.
    pause: Option<Pause>,
    stopped: bool,
}

/// llvmpipe ends a shader's loops, all of them together, after 65,535 rounds; some are left for small loops.
const LLVMPIPE_ROUNDS: u64 = 60_000;

impl GlTrace {
    /// Samplers of `trace.frag` in the order of the texture units: the photon map's, then the scene's, which a small
    /// scene does without.
    const SCENE_SAMPLERS: [&str; 2] = [Object::TABLE, Light::TABLE];

    /// On the current context; software rasterisers grant a fragment only so many loop rounds.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver gives no textures.
    pub fn new(gl: &Functions, is_software: bool) -> Result<GlTrace> {
        Ok(GlTrace {
            gl: gl.clone(),
            objects: TableTexture::new(gl, TEXTURE_WIDTH_LOG2)?,
            lights: TableTexture::new(gl, TEXTURE_WIDTH_LOG2)?,
            small: None,
            photons: PhotonTextures::new(gl, is_software)?,
            finals: FinalTextures::new(gl)?,
            target: None,
            programs: HashMap::new(),
            site_programs: HashMap::new(),
            active: None,
            rounds: is_software.then_some(LLVMPIPE_ROUNDS),
            pause: None,
            stopped: false,
        })
    }
}

/// How a picture is cut into draws.
struct Draws {
    /// Samples of a draw.
    samples: u64,
    /// Parts that the candidates of a query are gathered in.
    slices: u64,
}

impl GlTrace {
    /// Builds a program, or finds it built.
    fn program(&mut self, permutation: &Permutation, sliced: bool) -> Result<()> {
        if self.programs.contains_key(&(*permutation, sliced)) {
            return Ok(());
        }
        let mut defines = permutation.defines();
        if sliced {
            defines.push("SLICED".into());
        }
        let source = assemble("trace.frag", Some(&permutation.features), &Options { defines, ..Options::default() });
        self.programs.insert((*permutation, sliced), Program::new(&self.gl, &source)?);
        Ok(())
    }

    /// The program's samplers in the order of their texture units: these, then the scene's where it has any.
    fn samplers(&self, tables: &[&'static str]) -> Vec<&'static str> {
        let scene = if self.small.is_none() { &Self::SCENE_SAMPLERS[..] } else { &[] };
        tables.iter().chain(scene).copied().collect()
    }

    /// Gives the active program the frame and the scene, whose tables begin at a texture unit.
    fn bind_scene(&self, program: &Program, frame: &Frame, first: u32) {
        program.set_records(std::slice::from_ref(frame));
        match &self.small {
            Some((objects, lights)) => {
                program.set_records(objects);
                program.set_records(lights);
            }
            None => {
                self.objects.bind(first);
                self.lights.bind(first + 1);
            }
        }
    }

    /// Draws short enough for the driver.
    ///
    /// # Errors
    /// [`Error::Device`] when a single sample is too long.
    fn draws(&self, frame: &Frame, indirect: &Indirect) -> Result<Draws> {
        let samples = frame.samples as u64;
        let Some(granted) = self.rounds else { return Ok(Draws { samples, slices: 1 }) };
        let (objects, lights) = ((frame.sphere_count + frame.plane_count) as u64, frame.light_count as u64);
        // Closest hit, the planes' sides, a shadow ray a light, the clipped disc's planes twice; 32 bits of a Sobol'
        // number.
        let mut fixed = objects * (4 + lights) + lights + 64;
        let mut candidates = 0;
        if let Indirect::Final(_, FinalPass { lattice, .. }) = indirect {
            fixed += lattice.rays.max(lattice.own_rays) as u64 * (objects * (2 + lights) + lights + 1);
            fixed += lattice.points as u64 * (objects + 1);
        }
        if let Indirect::Map(_) = indirect {
            let across = cells_across(self.photons.gather());
            fixed += across * (2 * across + 1);
            candidates = self.photons.most_candidates;
            candidates += candidates / 256; // blocks of sums
        }
        let knn = self.active.and_then(|a| a.gathering).is_some_and(|g| g.method == Method::Knn);
        if knn {
            // A candidate may go down the heap; a heap cannot be filled in slices.
            fixed += candidates * 9;
            candidates = 0;
        }
        let Some(left) = granted.checked_sub(fixed).filter(|left| *left > 0) else {
            return Err(Error::Device(format!(
                "OpenGL: a sample of this picture takes up to {fixed} loop rounds, and this software driver ends loops \
                 after {granted}: take --backend opencl, or fewer photons or a smaller radius"
            )));
        };
        let slices = candidates.div_ceil(left).max(1);
        let a_sample = fixed + candidates.div_ceil(slices);
        Ok(Draws { samples: if slices > 1 { 1 } else { (granted / a_sample).clamp(1, samples.max(1)) }, slices })
    }
}

impl Trace for GlTrace {
    fn compile(&mut self, permutation: &Permutation) -> Result<()> {
        self.program(permutation, false)?;
        if permutation.final_gather == Some(true) && !self.site_programs.contains_key(&permutation.features) {
            let source = assemble("sites.frag", Some(&permutation.features), &Options::default());
            self.site_programs.insert(permutation.features, Program::new(&self.gl, &source)?);
        }
        self.active = Some(*permutation);
        Ok(())
    }

    fn upload(&mut self, packed: &Packed) -> Result<()> {
        check_count(packed)?;
        self.small = packed.in_uniforms().then(|| (packed.objects.clone(), packed.lights.clone()));
        if self.small.is_some() {
            return Ok(());
        }
        self.objects.fill(&packed.objects)?;
        self.lights.fill(&packed.lights)
    }

    fn upload_map(&mut self, map: &MapView, gathering: &Gathering) -> Result<u64> {
        let before = self.photons.uploads();
        // Another radius or another number of photons: what rows took says little.
        if let Some((_, _, target)) = &self.target {
            target.pace.forget();
        }
        match map {
            MapView::Device { context, stored, grid, .. } => {
                self.photons.fill(context, grid, stored.as_ref(), gathering)?
            }
            MapView::Host { plan, stored, grid, .. } => self.photons.fill_from_host(plan, stored, grid, gathering)?,
        }
        Ok(self.photons.uploads() - before)
    }

    fn upload_tiles(&mut self, map: &MapView) -> Result<u64> {
        let before = self.photons.uploads();
        match map {
            MapView::Device { context, tiles: Some(tiles), .. } => self.photons.fill_tiles(context, tiles)?,
            MapView::Host { tiles: Some((plan, tables)), .. } => self.photons.fill_tiles_from_host(plan, tables)?,
            _ => return Err(out_of_order("OpenGL")),
        }
        Ok(self.photons.uploads() - before)
    }

    fn upload_irradiance(&mut self, irradiance: &IrradianceView) -> Result<u64> {
        self.finals.fill(irradiance)
    }

    fn trace(&mut self, frame: &Frame, indirect: Indirect) -> Result<()> {
        let (width, height) = (frame.width as u32, frame.height as u32);
        if self.target.as_ref().is_none_or(|(w, h, _)| (*w, *h) != (width, height)) {
            self.target = Some((width, height, Target::new(&self.gl, width, height, false)?));
        }
        let Some(active) = self.active else { return Err(out_of_order("OpenGL")) };
        let draws = self.draws(frame, &indirect)?;
        self.program(&active, draws.slices > 1)?;
        if let Indirect::Final(_, pass) = indirect {
            self.finals.fill_points(&pass.points)?;
        }
        if let (Indirect::Final(_, FinalPass { lattice, .. }), Some(true)) = (indirect, active.final_gather) {
            let Some(program) = self.site_programs.get(&active.features) else { return Err(out_of_order("OpenGL")) };
            program.activate(&self.samplers(&FinalTextures::SAMPLERS[..3]));
            self.bind_scene(program, frame, 3);
            program.set_records(std::slice::from_ref(lattice));
            self.finals.draw_sites(program, lattice)?;
        }
        let (Some(program), Some((_, _, target))) = (self.programs.get(&(active, draws.slices > 1)), &self.target)
        else {
            return Err(out_of_order("OpenGL"));
        };
        let tables: &[&str] = match indirect {
            Indirect::Final(..) => &FinalTextures::SAMPLERS,
            _ => &PhotonTextures::SAMPLERS,
        };
        program.activate(&self.samplers(tables));
        self.bind_scene(program, frame, tables.len() as u32);
        match indirect {
            Indirect::None => {}
            Indirect::Map(_) => self.photons.bind(program, 0),
            Indirect::Final(_, pass) => {
                program.set_records(std::slice::from_ref(&pass.lattice));
                self.finals.bind(0, active.final_gather == Some(true));
            }
        }
        let pause = self.pause.clone().unwrap_or_else(|| Rc::new(|| true));
        let samples = frame.samples as u64;
        if draws.samples >= samples && draws.slices == 1 {
            self.stopped = !target.draw_while(program, None, &*pause)?;
            return Ok(());
        }
        target.clear();
        for first in (0..samples).step_by(draws.samples as usize) {
            let here = draws.samples.min(samples - first);
            let part = Frame { samples: here as f32, first_sample: frame.first_sample + first as f32, ..*frame };
            program.set_records(std::slice::from_ref(&part));
            for slice in 0..draws.slices {
                self.photons.set_slice(program, slice, draws.slices);
                let weight = Some(here as f32 / samples as f32);
                self.stopped = !target.draw_while(program, weight, &*pause)? || !pause();
                if self.stopped {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    fn set_pause(&mut self, pause: Option<Pause>) {
        self.pause = pause;
    }

    fn was_stopped(&self) -> bool {
        self.stopped
    }

    fn read(&mut self) -> Result<Image> {
        let Some((width, height, target)) = &self.target else { return Ok(Image::new(0, 0)) };
        let pixels = target.read().iter().map(|[r, g, b, _]| [*r, *g, *b].map(f32::from_bits)).collect();
        Image::from_pixels(*width, *height, pixels)
    }

    fn texture(&self) -> Option<crate::gl::Texture> {
        self.target.as_ref().map(|(_, _, target)| target.texture())
    }

    fn bytes(&self) -> usize {
        let target = self.target.as_ref().map_or(0, |(_, _, target)| target.bytes());
        self.objects.bytes() + self.lights.bytes() + self.photons.bytes() + self.finals.bytes() + target
    }
}
