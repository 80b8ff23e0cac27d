//! Trace on OpenGL: a fragment shader on a full-screen quad.

use std::collections::HashMap;
use std::rc::Rc;

use super::draws::{self, Draws, Query, Rounds};
use super::gl_final::FinalTextures;
use super::{FinalPass, Indirect, Pause, Permutation, Trace, check_count, out_of_order};
use crate::device::gl::{Functions, Program, Target};
use crate::error::Result;
use crate::film::Image;
use crate::packing::packed_scene::PackedScene;
use crate::program::features::Features;
use crate::program::gathering::Gathering;
use crate::program::source::{Options, Source, assemble};
use crate::records::Frame;
use crate::stage::irradiance::IrradianceView;
use crate::stage::map::MapView;
use crate::stage::photon_textures::PhotonTextures;
use crate::stage::table_textures::SceneTextures;

/// A fragment shader on a full-screen quad.
pub struct GlTrace {
    gl: Functions,
    scene: SceneTextures,
    /// How many of the scene's shapes are quads.
    quads: usize,
    photons: PhotonTextures,
    finals: FinalTextures,
    target: Option<(u32, u32, Target)>,
    /// By permutation, and whether it gathers in slices.
    programs: HashMap<(Permutation, bool), Program>,
    /// Programs that draw sites.
    site_programs: HashMap<Features, Program>,
    active: Option<Permutation>,
    /// Loop rounds of a fragment.
    rounds: Rounds,
    /// Whether a software rasteriser draws: texels are then asked of the sampler rather than fetched by integers (see
    /// `shim.glsl`), and loops over few objects unrolled (see [`crate::program::features::FEW_SHAPES`]).
    is_software: bool,
    /// Called between bands of rows.
    pause: Option<Pause>,
    /// All that is wanted, where that is not all.
    rows: Vec<[u32; 2]>,
    missing: Vec<[u32; 2]>,
}

impl GlTrace {
    /// On the current context; software rasterisers grant a fragment only so many loop rounds.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver gives no textures.
    pub fn new(gl: &Functions, is_software: bool) -> Result<GlTrace> {
        Ok(GlTrace {
            gl: gl.clone(),
            scene: SceneTextures::new(gl)?,
            quads: 0,
            photons: PhotonTextures::new(gl, is_software)?,
            finals: FinalTextures::new(gl)?,
            target: None,
            programs: HashMap::new(),
            site_programs: HashMap::new(),
            active: None,
            rounds: if is_software { draws::LLVMPIPE } else { draws::GPU },
            is_software,
            pause: None,
            rows: Vec::new(),
            missing: Vec::new(),
        })
    }
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
        let source = self.source("trace.frag", &permutation.features, defines);
        self.programs.insert((*permutation, sliced), Program::new(&self.gl, &source)?);
        Ok(())
    }

    /// A fragment shader's text, as this driver reads tables fastest.
    fn source(&self, unit: &str, features: &Features, mut defines: Vec<String>) -> Source {
        defines.extend(self.is_software.then(|| "SAMPLED".into()));
        assemble(unit, Some(features), &Options { defines, ..Options::default() })
    }

    /// Gives the active program the frame and the scene.
    fn bind_scene(&self, program: &Program, frame: &Frame) {
        program.set_records(std::slice::from_ref(frame));
        self.scene.bind(program);
    }

    /// Draws short enough for the driver.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when a single sample is too long.
    fn draws(&self, frame: &Frame, indirect: &Indirect) -> Result<Draws> {
        let query = match (indirect, self.active.and_then(|active| active.gathering)) {
            (Indirect::Map(_), Some(gathering)) => Some(Query {
                method: gathering.method,
                across: draws::cells_across(self.photons.gather())[1],
                candidates: self.photons.most_candidates,
                walls: self.active.map_or(0, |active| active.walls(frame, self.quads)),
            }),
            _ => None,
        };
        Draws::within(Some(self.rounds), frame, self.quads, indirect, query)
    }
}

impl Trace for GlTrace {
    fn make_film(&mut self, [width, height]: [u32; 2]) -> Result<()> {
        if self.target.as_ref().is_none_or(|(w, h, _)| (*w, *h) != (width, height)) {
            self.target = Some((width, height, Target::new(&self.gl, width, height, false)?));
        }
        Ok(())
    }

    fn compile(&mut self, permutation: &Permutation) -> Result<()> {
        let counts = permutation.features.counts.filter(|_| self.is_software);
        let permutation = &Permutation { features: Features { counts, ..permutation.features }, ..*permutation };
        self.program(permutation, false)?;
        if permutation.final_gather == Some(true) && !self.site_programs.contains_key(&permutation.features) {
            let source = self.source("sites.frag", &permutation.features, Vec::new());
            self.site_programs.insert(permutation.features, Program::new(&self.gl, &source)?);
        }
        self.active = Some(*permutation);
        Ok(())
    }

    fn upload(&mut self, packed: &PackedScene) -> Result<()> {
        check_count(packed)?;
        self.quads = packed.quads.len();
        self.scene.upload(packed, packed.in_uniforms())
    }

    fn upload_map(&mut self, map: &MapView, gathering: &Gathering) -> Result<u64> {
        let before = self.photons.uploads();
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
        self.make_film([width, height])?;
        let Some(active) = self.active else { return Err(out_of_order("OpenGL")) };
        let draws = self.draws(frame, &indirect)?;
        self.program(&active, draws.slices > 1)?;
        if let Indirect::Final(_, pass) = indirect {
            self.finals.fill_points(&pass.points)?;
        }
        if let (Indirect::Final(_, FinalPass { lattice, .. }), Some(true)) = (indirect, active.final_gather) {
            let Some(program) = self.site_programs.get(&active.features) else { return Err(out_of_order("OpenGL")) };
            program.activate();
            self.bind_scene(program, frame);
            program.set_records(std::slice::from_ref(lattice));
            self.finals.draw_sites(program, lattice, draws::site_work(frame, self.quads, lattice))?;
        }
        let (Some(program), Some((_, _, target))) = (self.programs.get(&(active, draws.slices > 1)), &self.target)
        else {
            return Err(out_of_order("OpenGL"));
        };
        program.activate();
        self.bind_scene(program, frame);
        match indirect {
            Indirect::None => {}
            Indirect::Map(_) => self.photons.bind(program),
            Indirect::Final(_, pass) => {
                program.set_records(std::slice::from_ref(&pass.lattice));
                self.finals.bind(program);
            }
        }
        let gather = matches!(indirect, Indirect::Map(_)).then(|| self.photons.gather());
        target.pace.expect(draws::work(frame, self.quads, &indirect, gather));
        let pause = self.pause.clone().unwrap_or_else(|| Rc::new(|| true));
        if draws.is_whole(frame) && !self.rows.is_empty() {
            self.missing.clear();
            return target.draw_rows(program, &self.rows);
        }
        if draws.is_whole(frame) {
            self.missing = target.draw_while(program, None, &*pause)?;
            return Ok(());
        }
        target.clear();
        self.missing.clear();
        for (part, weight, slice) in draws.parts(frame) {
            program.set_records(std::slice::from_ref(&part));
            self.photons.set_slice(program, slice, draws.slices);
            if !target.draw_while(program, Some(weight), &*pause)?.is_empty() || !pause() {
                // What is there of the others is a part of it.
                self.missing = vec![[0, height]];
                break;
            }
        }
        Ok(())
    }

    fn set_pause(&mut self, pause: Option<Pause>) {
        self.pause = pause;
    }

    fn set_rows(&mut self, rows: &[[u32; 2]]) {
        self.rows = rows.to_vec();
    }

    fn missing(&self) -> &[[u32; 2]] {
        &self.missing
    }

    fn read(&mut self) -> Result<Image> {
        let Some((width, height, target)) = &self.target else { return Ok(Image::new(0, 0)) };
        let pixels = target.read().iter().map(|[r, g, b, _]| [*r, *g, *b].map(f32::from_bits)).collect();
        Image::from_pixels(*width, *height, pixels)
    }

    fn texture(&self) -> Option<crate::device::gl::Texture> {
        self.target.as_ref().map(|(_, _, target)| target.texture())
    }

    fn bytes(&self) -> usize {
        let target = self.target.as_ref().map_or(0, |(_, _, target)| target.bytes());
        self.scene.bytes() + self.photons.bytes() + self.finals.bytes() + target
    }
}
