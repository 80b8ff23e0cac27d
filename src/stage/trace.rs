//! Trace: packed scene and frame in, film out; on OpenGL, OpenCL or the CPU.

use std::collections::HashMap;

use crate::cl::{Buffer, Context};
use crate::cpu;
use crate::error::{Error, Result};
use crate::features::Features;
use crate::film::Image;
use crate::gl::{Functions, Program, TableTexture, Target};
use crate::layout::{Frame, Light, MAX_EXACT_INDEX, Object, Record, TEXTURE_WIDTH_LOG2};
use crate::pack::Packed;
use crate::source::{Options, assemble};

/// The trace stage on one machine.
pub trait Trace {
    /// Builds what this permutation needs; nothing when it was built before.
    ///
    /// # Errors
    /// [`Error::Build`] with the driver's log.
    fn compile(&mut self, features: &Features) -> Result<()>;

    /// Takes over the scene's records.
    ///
    /// # Errors
    /// [`Error::Device`] when the device has no room.
    fn upload(&mut self, packed: &Packed) -> Result<()>;

    /// Traces a picture with the permutation compiled last, and waits for it.
    ///
    /// # Errors
    /// [`Error::Device`] when the device fails.
    fn trace(&mut self, frame: &Frame) -> Result<()>;

    /// The film of the last [`Trace::trace`].
    ///
    /// # Errors
    /// [`Error::Device`] when the device fails.
    fn read(&mut self) -> Result<Image>;

    /// Bytes held on the device.
    fn bytes(&self) -> usize;
}

fn check_count(packed: &Packed) -> Result<()> {
    match packed.objects.len().max(packed.lights.len()) as u64 {
        count if count >= MAX_EXACT_INDEX => Err(Error::Usage(format!(
            "{count} objects: indices travel as float values, which are exact below {MAX_EXACT_INDEX} only"
        ))),
        _ => Ok(()),
    }
}

/// A fragment shader on a full-screen quad.
pub struct GlTrace {
    gl: Functions,
    objects: TableTexture,
    lights: TableTexture,
    target: Option<(u32, u32, Target)>,
    programs: HashMap<Features, Program>,
    active: Option<Features>,
}

impl GlTrace {
    /// Samplers of `trace.frag`, in the order of the texture units.
    const SAMPLERS: [&str; 2] = [Object::TABLE, Light::TABLE];

    /// On the current context.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver gives no textures.
    pub fn new(gl: &Functions) -> Result<GlTrace> {
        Ok(GlTrace {
            gl: gl.clone(),
            objects: TableTexture::new(gl, TEXTURE_WIDTH_LOG2)?,
            lights: TableTexture::new(gl, TEXTURE_WIDTH_LOG2)?,
            target: None,
            programs: HashMap::new(),
            active: None,
        })
    }
}

impl Trace for GlTrace {
    fn compile(&mut self, features: &Features) -> Result<()> {
        if !self.programs.contains_key(features) {
            let source = assemble("trace.frag", Some(features), &Options::default());
            self.programs.insert(*features, Program::new(&self.gl, &source)?);
        }
        self.active = Some(*features);
        Ok(())
    }

    fn upload(&mut self, packed: &Packed) -> Result<()> {
        check_count(packed)?;
        self.objects.fill(&packed.objects)?;
        self.lights.fill(&packed.lights)
    }

    fn trace(&mut self, frame: &Frame) -> Result<()> {
        let (width, height) = (frame.width as u32, frame.height as u32);
        if self.target.as_ref().is_none_or(|(w, h, _)| (*w, *h) != (width, height)) {
            self.target = Some((width, height, Target::new(&self.gl, width, height, false)?));
        }
        let program = self.active.and_then(|features| self.programs.get(&features));
        let (Some(program), Some((_, _, target))) = (program, &self.target) else {
            return Err(Error::Device("OpenGL: traced before anything was compiled".into()));
        };
        program.activate(&Self::SAMPLERS);
        program.set_frame(frame);
        self.objects.bind(0);
        self.lights.bind(1);
        target.draw(program)
    }

    fn read(&mut self) -> Result<Image> {
        let Some((width, height, target)) = &self.target else { return Ok(Image::new(0, 0)) };
        let pixels = target.read().iter().map(|[r, g, b, _]| [*r, *g, *b].map(f32::from_bits)).collect();
        Image::from_pixels(*width, *height, pixels)
    }

    fn bytes(&self) -> usize {
        self.objects.bytes() + self.lights.bytes() + self.target.as_ref().map_or(0, |(_, _, t)| t.bytes())
    }
}

/// Kernels alone.
pub struct ClTrace {
    context: std::rc::Rc<Context>,
    objects: Option<Buffer<Object>>,
    lights: Option<Buffer<Light>>,
    frame: Buffer<Frame>,
    film: Option<(u32, u32, Buffer<[f32; 3]>)>,
    active: Option<Features>,
}

impl ClTrace {
    /// On an open device.
    ///
    /// # Errors
    /// [`Error::Device`] when the device has no room.
    pub fn new(context: std::rc::Rc<Context>) -> Result<ClTrace> {
        let frame = Buffer::new(&context, 1)?;
        Ok(ClTrace { context, objects: None, lights: None, frame, film: None, active: None })
    }

    fn kernel(&self, features: &Features) -> Result<crate::cl::Kernel> {
        let options = Options { lanes: self.context.device.lanes, ..Options::default() };
        self.context.kernel(&assemble("trace.cl", Some(features), &options), "trace")
    }
}

impl Trace for ClTrace {
    fn compile(&mut self, features: &Features) -> Result<()> {
        self.kernel(features)?;
        self.active = Some(*features);
        Ok(())
    }

    fn upload(&mut self, packed: &Packed) -> Result<()> {
        check_count(packed)?;
        self.objects = Some(Buffer::from_slice(&self.context, &packed.objects)?);
        self.lights = Some(Buffer::from_slice(&self.context, &packed.lights)?);
        Ok(())
    }

    fn trace(&mut self, frame: &Frame) -> Result<()> {
        let (width, height) = (frame.width as u32, frame.height as u32);
        if self.film.as_ref().is_none_or(|(w, h, _)| (*w, *h) != (width, height)) {
            self.film = Some((width, height, Buffer::new(&self.context, width as usize * height as usize)?));
        }
        self.frame.write(&self.context, std::slice::from_ref(frame))?;
        let (Some(features), Some(objects), Some(lights), Some((_, _, film))) =
            (&self.active, &self.objects, &self.lights, &self.film)
        else {
            return Err(Error::Device("OpenCL: traced before anything was compiled or uploaded".into()));
        };
        let kernel = self.kernel(features)?;
        let (columns, rows) = block(self.context.device.lanes);
        let blocks = [width.div_ceil(columns) as usize, height.div_ceil(rows) as usize];
        // 8 × 8 blocks a work-group: enough to share out, small enough that the last ones do not idle.
        let args = [
            (&self.frame).into(),
            objects.into(),
            lights.into(),
            film.into(),
            (width as i32).into(),
            (height as i32).into(),
        ];
        self.context.launch(&kernel, &args, &blocks, Some(&[8, 8]))?;
        self.context.finish()
    }

    fn read(&mut self) -> Result<Image> {
        let Some((width, height, film)) = &self.film else { return Ok(Image::new(0, 0)) };
        Image::from_pixels(*width, *height, film.to_vec(&self.context)?)
    }

    fn bytes(&self) -> usize {
        self.objects.as_ref().map_or(0, Buffer::bytes)
            + self.lights.as_ref().map_or(0, Buffer::bytes)
            + self.frame.bytes()
            + self.film.as_ref().map_or(0, |(_, _, film)| film.bytes())
    }
}

/// The pixels that a work-item's lanes cover, across and down: as `LANE_COLUMNS` and `LANE_ROWS` in `shim.cl`.
fn block(lanes: u32) -> (u32, u32) {
    match lanes {
        1 => (1, 1),
        4 => (2, 2),
        8 => (4, 2),
        _ => (4, 4),
    }
}

/// The twin, on a pool of threads.
pub struct CpuTrace {
    pool: rayon::ThreadPool,
    packed: Option<Packed>,
    film: Image,
    active: Option<Features>,
}

impl CpuTrace {
    /// With so many threads.
    ///
    /// # Errors
    /// [`Error::Device`] when the system gives no threads.
    pub fn new(threads: usize) -> Result<CpuTrace> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|error| Error::Device(format!("{threads} threads: {error}")))?;
        Ok(CpuTrace { pool, packed: None, film: Image::new(0, 0), active: None })
    }
}

impl Trace for CpuTrace {
    fn compile(&mut self, features: &Features) -> Result<()> {
        self.active = Some(*features);
        Ok(())
    }

    fn upload(&mut self, packed: &Packed) -> Result<()> {
        self.packed = Some(packed.clone());
        Ok(())
    }

    fn trace(&mut self, frame: &Frame) -> Result<()> {
        let (width, height) = (frame.width as u32, frame.height as u32);
        if (self.film.width, self.film.height) != (width, height) {
            self.film = Image::new(width, height);
        }
        let (Some(packed), Some(features)) = (&self.packed, &self.active) else {
            return Err(Error::Device("CPU: traced before anything was uploaded".into()));
        };
        let scene = cpu::scene::SceneTables::new(packed, features);
        let film = &mut self.film.pixels;
        self.pool.install(|| cpu::trace::trace(&scene, frame, film));
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
