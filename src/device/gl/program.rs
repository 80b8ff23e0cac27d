//! A linked program: the full-screen quad's vertex shader and one fragment shader.

use std::cell::Cell;

use glow::HasContext;

use super::{Functions, Texture};
use crate::device::live_objects::{Api, Counted};
use crate::error::{Error, Result};
use crate::program::source::{Options, Source, assemble};
use crate::records::Record;

/// A linked program; deleted when dropped.
pub struct Program {
    gl: Functions,
    handle: glow::NativeProgram,
    /// The fragment shader's.
    unit: String,
    uniforms: Vec<Uniform>,
    _counted: Counted,
}

/// A uniform that the linked program reads.
struct Uniform {
    name: String,
    location: glow::NativeUniformLocation,
    /// A sampler's texture unit.
    unit: Option<u32>,
    /// Whether it has a value; a sampler, whether a texture was bound since the program became active.
    given: Cell<bool>,
}

impl Program {
    /// Compiles and links.
    ///
    /// # Errors
    /// [`Error::Build`] with the driver's log in terms of our files.
    pub fn new(gl: &Functions, fragment: &Source) -> Result<Program> {
        let vertex = assemble("quad.vert", None, &Options::default());
        // SAFETY: the context is current; every object made here is deleted here or owned by the result.
        unsafe {
            let device = gl.get_parameter_string(glow::RENDERER);
            let refused = |source: &Source, log: String| Error::Build {
                unit: source.unit.clone(),
                permutation: source.permutation.clone(),
                device: device.clone(),
                log: source.map_log(&log),
            };
            let out_of_memory = |what| Error::Device(format!("OpenGL: {what}"));
            let handle = gl.create_program().map_err(out_of_memory)?;
            let mut program = Program {
                gl: gl.clone(),
                handle,
                unit: fragment.unit.clone(),
                uniforms: Vec::new(),
                _counted: Counted::new(Api::OpenGl),
            };
            for (kind, source) in [(glow::VERTEX_SHADER, &vertex), (glow::FRAGMENT_SHADER, fragment)] {
                let shader = gl.create_shader(kind).map_err(out_of_memory)?;
                gl.shader_source(shader, &source.text);
                gl.compile_shader(shader);
                let log = gl.get_shader_info_log(shader);
                let compiled = gl.get_shader_compile_status(shader);
                gl.attach_shader(handle, shader);
                gl.delete_shader(shader); // once detached, that is with the program
                if !compiled {
                    return Err(refused(source, log));
                }
            }
            gl.link_program(handle);
            if !gl.get_program_link_status(handle) {
                return Err(refused(fragment, gl.get_program_info_log(handle)));
            }
            program.find_uniforms();
            Ok(program)
        }
    }

    /// Makes this the program that draws: its samplers wait for textures, its uniforms are as they were.
    pub fn activate(&self) {
        // SAFETY: the context is current and the program is linked.
        unsafe { self.gl.use_program(Some(self.handle)) };
        self.uniforms.iter().filter(|uniform| uniform.unit.is_some()).for_each(|sampler| sampler.given.set(false));
    }

    /// Names of the samplers that the program reads.
    pub fn samplers(&self) -> impl Iterator<Item = &str> {
        self.uniforms.iter().filter(|uniform| uniform.unit.is_some()).map(|sampler| &*sampler.name)
    }

    /// Binds a texture of a kind, such as `TEXTURE_2D`, to a sampler of the active program; one that it does not read is
    /// left alone. Texture unit 0 is active afterwards.
    pub fn bind(&self, sampler: &str, kind: u32, texture: Texture) {
        let Some((uniform, unit)) = self.uniform(sampler).and_then(|found| Some((found, found.unit?))) else { return };
        uniform.given.set(true);
        // SAFETY: the context is current, and the texture is its own or of one that shares with it.
        unsafe {
            self.gl.active_texture(glow::TEXTURE0 + unit);
            self.gl.bind_texture(kind, Some(texture));
            self.gl.active_texture(glow::TEXTURE0);
        }
    }

    /// Sets records that travel in uniforms: the frame, and the tables of a small scene. The program must be active.
    pub fn set_records<R: Record>(&self, records: &[R]) {
        self.set_texels(R::TABLE, bytemuck::cast_slice(records));
    }

    /// The same for loose floats, three a texel, by the table's name.
    pub fn set_texels(&self, table: &str, floats: &[f32]) {
        let Some(uniform) = self.uniform(table) else { return };
        uniform.given.set(true);
        if floats.is_empty() {
            return;
        }
        // SAFETY: the context is current; what lies beyond the array's end is ignored by GL.
        unsafe { self.gl.uniform_3_f32_slice(Some(&uniform.location), floats) };
    }

    /// Sets an integer uniform, where the program reads it. The program must be active.
    pub fn set_int(&self, name: &str, value: i32) {
        let Some(uniform) = self.uniform(name) else { return };
        uniform.given.set(true);
        // SAFETY: the context is current.
        unsafe { self.gl.uniform_1_i32(Some(&uniform.location), value) };
    }

    /// Whether all that the program reads was given: uniforms at any time, textures since it was made active.
    ///
    /// # Errors
    /// [`Error::Device`] with the name of what was not.
    pub fn check(&self) -> Result<()> {
        match self.uniforms.iter().find(|uniform| !uniform.given.get()) {
            None => Ok(()),
            Some(Uniform { name, unit, .. }) => {
                let what = if unit.is_some() { "sampler" } else { "uniform" };
                Err(Error::Device(format!("OpenGL: {}: {what} '{name}' is not given", self.unit)))
            }
        }
    }

    fn uniform(&self, name: &str) -> Option<&Uniform> {
        self.uniforms.iter().find(|uniform| uniform.name == name)
    }

    /// What the linked program reads, and a texture unit for each sampler.
    fn find_uniforms(&mut self) {
        let mut units = 0..;
        // SAFETY: the context is current and the program is linked.
        unsafe {
            self.gl.use_program(Some(self.handle));
            for index in 0..self.gl.get_active_uniforms(self.handle) {
                let Some(glow::ActiveUniform { utype, name, .. }) = self.gl.get_active_uniform(self.handle, index)
                else {
                    continue;
                };
                let Some(location) = self.gl.get_uniform_location(self.handle, &name) else { continue };
                let is_sampler = [glow::SAMPLER_2D, glow::SAMPLER_2D_RECT].contains(&utype);
                let unit = if is_sampler { units.next() } else { None };
                if let Some(unit) = unit {
                    self.gl.uniform_1_i32(Some(&location), unit as i32);
                }
                // Arrays are listed by their first element.
                let name = name.strip_suffix("[0]").unwrap_or(&name).to_string();
                self.uniforms.push(Uniform { name, location, unit, given: Cell::new(false) });
            }
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // SAFETY: the context outlives its objects: whoever owns both drops it last.
        unsafe { self.gl.delete_program(self.handle) }
    }
}
