//! Where the shared dialect's functions can be asked: each device through a small program of its own.

use std::ops::Range;
use std::rc::Rc;

use crate::device::cl::{self, Buffer};
use crate::device::gl::{Headless, Program, TableTexture, Target};
use crate::error::{Error, Result};
use crate::kinds::{ShapeKind, ShapeSet};
use crate::packing::Packed;
use crate::pipeline::open_device;
use crate::program::features::{Features, Lights};
use crate::program::source::{Options, assemble};
use crate::records::{Frame, TEXTURE_WIDTH_LOG2};
use crate::settings::Backend;
use crate::stage::scene_buffers::SceneBuffers;
use crate::stage::table_textures::SceneTextures;

use super::Fault;

/// An item's answer: eight words.
pub type Answer = [u32; 8];

/// Of scenes that only rays meet, none of them lit; `quads`: some of the shapes are.
pub fn features(two_sided: bool, in_uniforms: bool, quads: bool) -> Features {
    let shapes = ShapeSet::of(ShapeKind::Sphere).and(ShapeSet::of(ShapeKind::Plane));
    Features {
        shapes: if quads { shapes.and(ShapeSet::of(ShapeKind::Quad)) } else { shapes },
        lights: Lights::None,
        shadows: ShapeSet::NONE,
        two_sided,
        glossy: false,
        ambient: false,
        one_sample: true,
        in_uniforms,
        counts: None,
    }
}

/// The devices under test.
#[derive(Default)]
pub struct Lab {
    gl: Option<Headless>,
    cl: Option<Rc<cl::Context>>,
    /// Those that are there, of those that were asked for.
    pub backends: Vec<Backend>,
}

/// One body of `glsl/shared/stress.glsl` and what it reads.
pub struct Task<'a> {
    /// The body's define, such as `STRESS_LEAKS`.
    pub body: &'static str,
    /// Objects that it meets.
    pub packed: &'a Packed,
    /// Each object is a scene of its own: none of them cuts another.
    pub alone: bool,
    /// Objects travel in uniforms on OpenGL, as those of small scenes do.
    pub in_uniforms: bool,
    /// With the code of scenes whose objects are met from both sides.
    pub two_sided: bool,
    /// Further defines.
    pub defines: &'a [&'a str],
    /// OpenCL's arithmetic is as that of other devices: see `kernels/rounding.cl`.
    pub contracted: bool,
    /// What the shader or kernel reads besides the scene: the cases, three floats a texel.
    pub cases: &'a [[f32; 3]],
    /// Most items of one submission.
    pub batch: usize,
    /// What is broken on purpose.
    pub fault: Option<Fault>,
}

/// Pixels in a row of the target.
const COLUMNS: usize = 1024;

impl Lab {
    /// Opens what is there of `wanted`; what is missing is told to `notice`.
    pub fn open(wanted: &[Backend], device: Option<&str>, notice: &mut dyn FnMut(&str)) -> Lab {
        let mut lab = Lab::default();
        for backend in wanted {
            let opened = match backend {
                Backend::OpenGl => Headless::new().map(|gl| lab.gl = Some(gl)),
                Backend::OpenCl => open_device(device, notice).map(|cl| lab.cl = Some(Rc::new(cl))),
                Backend::Cpu => Ok(()),
            };
            match opened {
                Ok(()) => lab.backends.push(*backend),
                Err(error) => notice(&format!("{} is left out: {error}", backend.name())),
            }
        }
        lab
    }

    /// The OpenGL context, where it is open.
    pub fn gl(&self) -> Option<&Headless> {
        self.gl.as_ref()
    }

    /// The OpenCL device, where it is open.
    pub fn cl(&self) -> Option<Rc<cl::Context>> {
        self.cl.clone()
    }

    /// Answers of some items on a device.
    ///
    /// # Errors
    /// [`Error::Build`] and [`Error::Device`] from the device; [`Error::Driver`] where it is not open.
    pub fn ask(&self, backend: Backend, task: &Task, items: Range<usize>) -> Result<Vec<Answer>> {
        let features =
            features(task.two_sided, task.in_uniforms && backend == Backend::OpenGl, !task.packed.quads.is_empty());
        let mut defines = vec![task.body.to_string()];
        defines.extend(task.fault.map(|fault| fault.define()));
        defines.extend(task.alone.then(|| "SHAPES_ALONE".to_string()));
        defines.extend(task.defines.iter().map(|define| define.to_string()));
        let frame = Frame {
            sphere_count: task.packed.sphere_count as f32,
            plane_count: task.packed.plane_count() as f32,
            ..Frame::default()
        };
        match (backend, &self.gl, &self.cl) {
            (Backend::OpenGl, Some(gl), _) => self.ask_gl(gl, task, &features, defines, &frame, items),
            (Backend::OpenCl, _, Some(cl)) => self.ask_cl(cl, task, &features, defines, &frame, items),
            _ => Err(Error::Driver(format!("{} is not open", backend.name()))),
        }
    }

    fn ask_cl(
        &self,
        context: &cl::Context,
        task: &Task,
        features: &Features,
        defines: Vec<String>,
        frame: &Frame,
        items: Range<usize>,
    ) -> Result<Vec<Answer>> {
        let lanes = context.device.lanes;
        let source = assemble(
            "stress.cl",
            Some(features),
            &Options { lanes, defines, contracted: task.contracted, ..Options::default() },
        );
        let kernel = context.kernel(&source, "stress_items")?;
        let frame = Buffer::from_slice(context, std::slice::from_ref(frame))?;
        let scene = SceneBuffers::new(context, task.packed)?;
        let cases = Buffer::from_slice(context, task.cases)?;
        let mut answers = Vec::with_capacity(items.len());
        for first in items.clone().step_by(task.batch) {
            let here = task.batch.min(items.end - first);
            let words = Buffer::<Answer>::new(context, here)?;
            let args = scene.arguments().table(&frame).with("cases", &cases).with("answers", &words);
            let args = args.with("first", first as i32).with("count", here as i32);
            context.launch_paced(&kernel, &args, &[here.div_ceil(lanes as usize)], None)?;
            answers.extend(words.to_vec(context)?);
        }
        Ok(answers)
    }

    fn ask_gl(
        &self,
        headless: &Headless,
        task: &Task,
        features: &Features,
        defines: Vec<String>,
        frame: &Frame,
        items: Range<usize>,
    ) -> Result<Vec<Answer>> {
        headless.make_current()?;
        let source = assemble("stress.frag", Some(features), &Options { defines, ..Options::default() });
        let program = Program::new(&headless.gl, &source)?;
        // Making and filling bind textures too, so the tables are bound when all is made.
        let columns = task.batch.min(items.len()).clamp(1, COLUMNS);
        let rows = task.batch.min(items.len()).div_ceil(columns);
        let target = Target::new(&headless.gl, columns as u32, rows as u32, true)?;
        let batch = columns * rows;
        let mut cases = TableTexture::new(&headless.gl, TEXTURE_WIDTH_LOG2)?;
        let mut scene = SceneTextures::new(&headless.gl)?;
        cases.fill_texels::<[f32; 3]>(task.cases)?;
        scene.upload(task.packed, features.in_uniforms)?;
        program.activate();
        program.set_records(std::slice::from_ref(frame));
        cases.bind(&program, "cases");
        scene.bind(&program);
        program.set_int("stride", columns as i32);
        let mut answers = Vec::with_capacity(items.len());
        for first in items.clone().step_by(batch) {
            let here = batch.min(items.end - first);
            program.set_int("first", first as i32);
            program.set_int("count", here as i32);
            let [low, high] = [0, 1].map(|part| {
                program.set_int("part", part);
                target.draw(&program).map(|()| target.read())
            });
            let (low, high) = (low?, high?);
            let whole = low.iter().zip(&high).take(here);
            answers.extend(whole.map(|([a, b, c, d], [e, f, g, h])| [*a, *b, *c, *d, *e, *f, *g, *h]));
        }
        Ok(answers)
    }
}
