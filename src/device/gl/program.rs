//! A linked program: the full-screen quad's vertex shader and one fragment shader.

use glow::HasContext;

use super::Functions;
use crate::device::live_objects::{Api, Counted};
use crate::error::{Error, Result};
use crate::program::source::{Options, Source, assemble};
use crate::records::Record;

/// A linked program; deleted when dropped.
pub struct Program {
    gl: Functions,
    handle: glow::NativeProgram,
    _counted: Counted,
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
            let program = Program { gl: gl.clone(), handle, _counted: Counted::new(Api::OpenGl) };
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
            Ok(program)
        }
    }

    /// Makes this the program that draws, and binds each named sampler to its place in the list.
    pub fn activate(&self, samplers: &[&str]) {
        // SAFETY: the context is current and the program is linked; absent uniforms are ignored.
        unsafe {
            self.gl.use_program(Some(self.handle));
            for (unit, name) in samplers.iter().enumerate() {
                let location = self.gl.get_uniform_location(self.handle, name);
                self.gl.uniform_1_i32(location.as_ref(), unit as i32);
            }
        }
    }

    /// Sets records that travel in uniforms: the frame, and the tables of a small scene. The program must be active.
    pub fn set_records<R: Record>(&self, records: &[R]) {
        self.set_texels(R::TABLE, bytemuck::cast_slice(records));
    }

    /// The same for loose floats, three a texel, by the table's name.
    pub fn set_texels(&self, table: &str, floats: &[f32]) {
        if floats.is_empty() {
            return;
        }
        // SAFETY: the context is current; a program that does not read the table has no such uniform, and nothing
        // happens; what lies beyond the array's end is ignored by GL.
        unsafe {
            let location = self.gl.get_uniform_location(self.handle, table);
            self.gl.uniform_3_f32_slice(location.as_ref(), floats);
        }
    }

    /// Sets an integer uniform. The program must be active.
    pub fn set_int(&self, name: &str, value: i32) {
        // SAFETY: the context is current; an absent uniform is ignored.
        unsafe {
            let location = self.gl.get_uniform_location(self.handle, name);
            self.gl.uniform_1_i32(location.as_ref(), value);
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // SAFETY: the context outlives its objects: whoever owns both drops it last.
        unsafe { self.gl.delete_program(self.handle) }
    }
}
