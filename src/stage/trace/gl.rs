//! Trace on OpenGL: a fragment shader on a full-screen quad.

use std::collections::HashMap;

use super::{Permutation, Trace, check_count, out_of_order};
use crate::error::Result;
use crate::film::Image;
use crate::gathering::Gathering;
use crate::gl::{Functions, Program, TableTexture, Target};
use crate::layout::{Frame, Light, Object, Record, TEXTURE_WIDTH_LOG2};
use crate::pack::Packed;
use crate::source::{Options, assemble};
use crate::stage::map::MapView;
use crate::stage::photon_textures::PhotonTextures;

/// A fragment shader on a full-screen quad.
pub struct GlTrace {
    gl: Functions,
    objects: TableTexture,
    lights: TableTexture,
    /// The records of a scene that travels in uniforms.
    small: Option<(Vec<Object>, Vec<Light>)>,
    photons: PhotonTextures,
    target: Option<(u32, u32, Target)>,
    programs: HashMap<Permutation, Program>,
    active: Option<Permutation>,
}

impl GlTrace {
    /// Samplers of `trace.frag` in the order of the texture units: the photon map's, then the scene's, which a small
    /// scene does without.
    const SCENE_SAMPLERS: [&str; 2] = [Object::TABLE, Light::TABLE];

    /// On the current context.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver gives no textures.
    pub fn new(gl: &Functions) -> Result<GlTrace> {
        Ok(GlTrace {
            gl: gl.clone(),
            objects: TableTexture::new(gl, TEXTURE_WIDTH_LOG2)?,
            lights: TableTexture::new(gl, TEXTURE_WIDTH_LOG2)?,
            small: None,
            photons: PhotonTextures::new(gl)?,
            target: None,
            programs: HashMap::new(),
            active: None,
        })
    }
}

impl Trace for GlTrace {
    fn compile(&mut self, permutation: &Permutation) -> Result<()> {
        if !self.programs.contains_key(permutation) {
            let options = Options { defines: permutation.defines(), ..Options::default() };
            let source = assemble("trace.frag", Some(&permutation.features), &options);
            self.programs.insert(*permutation, Program::new(&self.gl, &source)?);
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
        match map {
            MapView::Device { context, stored, grid, .. } => self.photons.fill(context, grid, stored, gathering)?,
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

    fn trace(&mut self, frame: &Frame, map: Option<&MapView>) -> Result<()> {
        let (width, height) = (frame.width as u32, frame.height as u32);
        if self.target.as_ref().is_none_or(|(w, h, _)| (*w, *h) != (width, height)) {
            self.target = Some((width, height, Target::new(&self.gl, width, height, false)?));
        }
        let program = self.active.and_then(|permutation| self.programs.get(&permutation));
        let (Some(program), Some((_, _, target))) = (program, &self.target) else {
            return Err(out_of_order("OpenGL"));
        };
        let mut samplers = PhotonTextures::SAMPLERS.to_vec();
        if self.small.is_none() {
            samplers.extend(Self::SCENE_SAMPLERS);
        }
        program.activate(&samplers);
        program.set_records(std::slice::from_ref(frame));
        if map.is_some() {
            self.photons.bind(program, 0);
        }
        match &self.small {
            Some((objects, lights)) => {
                program.set_records(objects);
                program.set_records(lights);
            }
            None => {
                let first = PhotonTextures::SAMPLERS.len() as u32;
                self.objects.bind(first);
                self.lights.bind(first + 1);
            }
        }
        target.draw(program)
    }

    fn read(&mut self) -> Result<Image> {
        let Some((width, height, target)) = &self.target else { return Ok(Image::new(0, 0)) };
        let pixels = target.read().iter().map(|[r, g, b, _]| [*r, *g, *b].map(f32::from_bits)).collect();
        Image::from_pixels(*width, *height, pixels)
    }

    fn bytes(&self) -> usize {
        let target = self.target.as_ref().map_or(0, |(_, _, target)| target.bytes());
        self.objects.bytes() + self.lights.bytes() + self.photons.bytes() + target
    }
}
