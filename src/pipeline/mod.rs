//! The order of the stages, on a backend: what changed is redone, what did not is kept.

pub mod change;
pub mod path_count;
pub mod progressive;

use std::rc::Rc;
use std::time::Instant;

use glam::DVec3;

use crate::cpu::photons::fruitless;
use crate::device::cl;
use crate::device::gl::{self, Headless};
use crate::error::{Error, Result};
use crate::film::Image;
use crate::pipeline::change::{Change, Stage, is_stale};
use crate::plan::cells::{CellSize, Form};
use crate::plan::choice::{self, Class, Question};
use crate::plan::radius;
use crate::plan::site_lattice::FinalPass;
use crate::plan::tiling;
use crate::program::features::{Features, is_divided};
use crate::program::gathering::Gathering;
use crate::rays::emission::Emission;
use crate::rays::scene::SceneTables;
use crate::records::Frame;
use crate::records::packing::Packed;
use crate::scene::Scene;
use crate::settings::{
    Amount, Backend, CellLattice, FinalGather, Gather, GridForm, LightMode, Method, Settings, Technique,
};
use crate::stage::grid::GridSettings;
use crate::stage::irradiance::{IrradianceStage, IrradianceView};
use crate::stage::map::{MapCounts, MapStage, MapView};
use crate::stage::trace::{ClTrace, CpuTrace, GlTrace, Indirect, Pause, Permutation, Trace};

/// Where a picture shall be made.
#[derive(Clone, Debug)]
pub struct Machine {
    /// `None`: the first that works of [`Backend::ALL`].
    pub backend: Option<Backend>,
    /// An OpenCL device's number, such as `#2`, or part of its name or its platform's.
    pub device: Option<String>,
    /// Threads of the CPU twins.
    pub threads: usize,
    /// Lanes of an OpenCL work-item (1, 4, 8 or 16); `None`: what suits the device. 1 gives plain scalar kernels.
    pub lanes: Option<u32>,
}

impl Default for Machine {
    fn default() -> Self {
        Machine { backend: None, device: None, threads: 1, lanes: None }
    }
}

/// Milliseconds by stage; 0 for what was not run.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Times {
    /// Building programs.
    pub compile: f64,
    /// Emission of photons.
    pub emit: f64,
    /// Photons into cells.
    pub grid: f64,
    /// Photons into screen-space tiles.
    pub tiles: f64,
    /// Scene records, and the photon map, to where they are read.
    pub upload: f64,
    /// Rays, shading, gathering.
    pub trace: f64,
    /// Film to the host.
    pub readback: f64,
    /// All of it.
    pub total: f64,
}

impl Times {
    /// Adds another picture's times.
    pub fn add(&mut self, other: &Times) {
        self.compile += other.compile;
        self.emit += other.emit;
        self.grid += other.grid;
        self.tiles += other.tiles;
        self.upload += other.upload;
        self.trace += other.trace;
        self.readback += other.readback;
        self.total += other.total;
    }
}

/// The devices behind a picture, by name.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Devices {
    /// The OpenCL device.
    pub opencl: Option<String>,
    /// Lanes of a work-item there.
    pub lanes: Option<u32>,
    /// The GL renderer and the way to it.
    pub opengl: Option<String>,
}

impl Devices {
    fn name_opencl(&mut self, opened: &cl::Context) {
        self.opencl = Some(opened.device.name.clone());
        self.lanes = Some(opened.device.lanes);
    }
}

/// A picture and how it came about.
pub struct Rendering {
    /// Linear radiance.
    pub image: Image,
    /// By stage.
    pub times: Times,
    /// Stages that had nothing to do.
    pub skipped: Vec<Stage>,
    /// The photon map, where there is one.
    pub photons: Option<MapCounts>,
    /// How photons were gathered, where there are any.
    pub method: Option<Method>,
    /// Size of the tiles, pixels, where photons were gathered by tiles.
    pub tile: Option<[u32; 2]>,
    /// Gather radius, metres, where there are photons.
    pub radius: Option<f32>,
    /// The grid's form, where photons were gathered by a grid.
    pub form: Option<GridForm>,
    /// Tables of the photon map that were moved for this picture.
    pub uploads: u64,
}

/// Where a film lies.
pub enum Film {
    /// RGBA32F, row 0 is the picture's top; the tracer's own, overwritten by its next picture.
    Texture(gl::Texture),
    /// Read back.
    Host(Image),
}

/// What the device holds, and what it was made from.
struct Last {
    scene: Scene,
    settings: Settings,
    features: Features,
    packed: Packed,
    photons: Option<MapCounts>,
    chosen: Chosen,
    /// The film is unfinished: nobody wanted the rest.
    stopped: bool,
}

/// What was chosen for a map where the settings leave it open. It stands until the map changes.
#[derive(Clone, Copy, Debug, Default)]
struct Chosen {
    /// R, metres.
    radius: f32,
    /// The grid is hashed.
    hashed: bool,
    method: Method,
    tile: [u32; 2],
}

/// A backend with a scene on it.
pub struct Pipeline {
    // Declared before `context`, so that GL objects go before their context.
    tracer: Box<dyn Trace>,
    map: MapStage,
    irradiance: IrradianceStage,
    context: Option<Headless>,
    /// What was chosen.
    pub backend: Backend,
    /// By name.
    pub devices: Devices,
    class: Class,
    last: Option<Last>,
    /// Not all rows are wanted.
    partial: bool,
}

impl Pipeline {
    /// Opens a backend; without one asked for, OpenGL, else OpenCL, else the CPU, each fallback told to `notice`.
    ///
    /// # Errors
    /// [`Error::Driver`] when the backend that was asked for is not there.
    pub fn open(machine: &Machine, notice: impl FnMut(&str)) -> Result<Pipeline> {
        Pipeline::open_first(machine, None, notice)
    }

    /// Like [`Pipeline::open`], for pictures of a size: a backend that has no room for them is passed over, too.
    ///
    /// # Errors
    /// As [`Pipeline::open`]; what the backend that was asked for says to the size.
    pub fn open_for(machine: &Machine, size: [u32; 2], notice: impl FnMut(&str)) -> Result<Pipeline> {
        Pipeline::open_first(machine, Some(size), notice)
    }

    fn open_first(machine: &Machine, size: Option<[u32; 2]>, mut notice: impl FnMut(&str)) -> Result<Pipeline> {
        if machine.backend != Some(Backend::Cpu) {
            cl::probing::begin(machine.device.as_deref());
        }
        let open = |backend, notice: &mut dyn FnMut(&str)| {
            let mut pipeline = Pipeline::open_on(backend, machine, notice)?;
            size.map_or(Ok(()), |size| pipeline.tracer.make_film(size))?;
            Ok(pipeline)
        };
        if let Some(backend) = machine.backend {
            return open(backend, &mut notice);
        }
        for (backend, next) in [(Backend::OpenGl, "OpenCL"), (Backend::OpenCl, "the CPU")] {
            match open(backend, &mut notice) {
                Ok(pipeline) => return Ok(pipeline),
                Err(error @ Error::Usage(_)) => return Err(error), // a wrong option is no reason to ignore it
                Err(error) => notice(&format!("falling back from {} to {next}: {error}", backend.name())),
            }
        }
        open(Backend::Cpu, &mut notice)
    }

    /// Opens a backend; OpenGL draws in a context that the caller made current on this thread, and that outlives the
    /// pipeline: a window's own, or one that shares its textures.
    ///
    /// # Errors
    /// [`Error::Driver`] when the backend is not there.
    pub fn open_within(
        backend: Backend,
        machine: &Machine,
        current: &gl::Current,
        mut notice: impl FnMut(&str),
    ) -> Result<Pipeline> {
        Pipeline::open_with(backend, machine, Some(current), &mut notice)
    }

    fn open_on(backend: Backend, machine: &Machine, notice: &mut dyn FnMut(&str)) -> Result<Pipeline> {
        Pipeline::open_with(backend, machine, None, notice)
    }

    fn open_with(
        backend: Backend,
        machine: &Machine,
        current: Option<&gl::Current>,
        notice: &mut dyn FnMut(&str),
    ) -> Result<Pipeline> {
        let mut devices = Devices::default();
        let mut context = None;
        let (tracer, map, irradiance, class): (Box<dyn Trace>, MapStage, IrradianceStage, Class) = match backend {
            Backend::OpenGl => {
                let (gl, is_software) = match current {
                    Some(current) => {
                        devices.opengl = Some(current.renderer.clone());
                        (current.gl.clone(), current.is_software)
                    }
                    None => {
                        let headless = Headless::new()?;
                        // A driver may be there and yet draw nothing: then the next backend is tried.
                        gl::probe(&headless)?;
                        devices.opengl = Some(format!("{} ({})", headless.renderer, headless.route));
                        let Headless { gl, is_software, .. } = context.insert(headless);
                        (gl.clone(), *is_software)
                    }
                };
                let tracer = GlTrace::new(&gl, is_software)?;
                let (map, irradiance) = match open_lanes(machine, notice) {
                    Ok(opened) => {
                        devices.name_opencl(&opened);
                        let opened = Rc::new(opened);
                        (MapStage::on_device(Rc::clone(&opened))?, IrradianceStage::on_device(opened))
                    }
                    Err(error @ Error::Usage(_)) => return Err(error),
                    Err(error) => {
                        notice(&format!("photons come from the CPU: {error}"));
                        let pool = threads(machine)?;
                        (MapStage::on_host(Rc::clone(&pool)), IrradianceStage::on_host(pool))
                    }
                };
                (Box::new(tracer), map, irradiance, Class::of_opengl(is_software))
            }
            Backend::OpenCl => {
                let opened = Rc::new(open_lanes(machine, notice)?);
                devices.name_opencl(&opened);
                let tracer = Box::new(ClTrace::new(Rc::clone(&opened))?);
                let class = Class::of_opencl(opened.device.lanes);
                (tracer, MapStage::on_device(Rc::clone(&opened))?, IrradianceStage::on_device(opened), class)
            }
            Backend::Cpu => {
                let pool = threads(machine)?;
                let tracer = Box::new(CpuTrace::new(Rc::clone(&pool)));
                (tracer, MapStage::on_host(Rc::clone(&pool)), IrradianceStage::on_host(pool), Class::Cpu)
            }
        };
        Ok(Pipeline { tracer, map, irradiance, context, backend, devices, class, last: None, partial: false })
    }

    /// Renders a picture, redoing only what changed since the last one.
    ///
    /// # Errors
    /// [`Error::Build`] and [`Error::Device`] from the backend.
    pub fn render(&mut self, scene: &Scene, settings: &Settings) -> Result<Rendering> {
        let start = Instant::now();
        let mut rendering = self.draw(scene, settings)?;
        let mut stopwatch = Stopwatch::new();
        rendering.image = self.tracer.read()?;
        rendering.times.readback = stopwatch.ms();
        rendering.times.total = start.elapsed().as_secs_f64() * 1e3;
        Ok(rendering)
    }

    /// Like [`Pipeline::render`], but leaves the film where it was made: the image is empty, see [`Pipeline::film`].
    ///
    /// # Errors
    /// As [`Pipeline::render`].
    pub fn draw(&mut self, scene: &Scene, settings: &Settings) -> Result<Rendering> {
        let start = Instant::now();
        let mut times = Times::default();
        let change = self.change(scene, settings);
        let features = Features::of(scene, settings);
        let stale = |stage| is_stale(stage, change);
        // Without lights or objects, or with direct light only, there is nothing to store.
        let wants_photons =
            settings.light != LightMode::Direct && !scene.lights.is_empty() && features.spheres | features.planes;
        if let Amount::Stored(wanted) = settings.photons.amount {
            if settings.light != LightMode::Direct && !wants_photons {
                return Err(fruitless(wanted, 0, 0));
            }
        }

        self.make_current()?;
        let last = self.last.take();
        let mut stopwatch = Stopwatch::new();
        let (packed, mut photons, mut chosen) = match last {
            // The origin stays where it was: a moving camera must not repack the scene.
            Some(last) if !stale(Stage::Upload) => (last.packed, last.photons, last.chosen),
            _ => {
                // Another scene may lie far from the last one, so it gets an origin of its own.
                let packed = Packed::new(scene, scene.camera.position);
                self.tracer.upload(&packed)?;
                times.upload = stopwatch.ms();
                (packed, None, Chosen::default())
            }
        };

        let frame = packed.frame(&scene.camera, settings);
        let mut gathering = None;
        let mut uploads = 0;
        let final_gather = match settings.technique {
            Technique::FinalGather(gather) if wants_photons => Some(gather),
            _ => None,
        };
        let wants_map = wants_photons && final_gather.is_none();
        if let (Some(gather), true) = (final_gather, stale(Stage::Photons)) {
            let emission = emission(settings);
            if stale(Stage::Upload) || stale(Stage::Compile) {
                self.irradiance.upload(&packed, &features.of_photons(scene), &emission, gather.texels)?;
                times.compile += stopwatch.ms();
            }
            photons = Some(self.irradiance.emit(&emission)?);
            times.emit = stopwatch.ms();
        }
        if wants_map {
            if stale(Stage::Photons) {
                let emission = emission(settings);
                self.map.upload(&packed, &features.of_photons(scene), &emission)?;
                times.compile += stopwatch.ms();
                photons = Some(self.map.emit(&emission)?);
                times.emit = stopwatch.ms();
            }
            if stale(Stage::Grid) {
                self.map.restore()?;
                let tables = SceneTables::new(&packed, &features);
                let stored = photons.map_or(0, |counts| counts.stored);
                chosen = self.choose(settings, &tables, &frame, stored)?;
                // Tiles take photons as they were stored.
                if !chosen.method.is_tiled() {
                    chosen.hashed = self.map.sort(
                        &grid_wanted(settings, chosen.radius, self.class().cell_size(), packed.origin),
                        chosen.method,
                    )?;
                }
                times.grid = stopwatch.ms();
            }
            if chosen.method.is_tiled() && stale(Stage::Tiles) {
                let cells = chosen.method == Method::TiledGrid;
                let wanted = tiling::TileSettings { radius: chosen.radius, tile: chosen.tile, cells };
                self.map.tile(&frame, &features, &wanted)?;
                times.tiles = stopwatch.ms();
            }
            gathering = Some(Gathering {
                method: chosen.method,
                density_kernel: settings.gather.density_kernel,
                hashed: chosen.hashed,
                ..Gathering::of(&packed.shapes, packed.sphere_count, is_divided(scene))
            });
        }
        if stale(Stage::Compile) || stale(Stage::Grid) {
            // A new map may take the grid's other form; what was built before is found again.
            let final_gather = final_gather.map(|gather| gather.spacing > 1);
            self.tracer.compile(&Permutation { features, gathering, final_gather })?;
            times.compile += stopwatch.ms();
        }
        let irradiance = final_gather.and_then(|_| self.irradiance.view());
        if let (true, Some(view)) = (stale(Stage::Textures), &irradiance) {
            uploads = self.tracer.upload_irradiance(view)?;
        }
        if let (true, Some(view), Some(gathering)) = (stale(Stage::Textures), &self.map.view(), &gathering) {
            uploads = self.tracer.upload_map(view, gathering)?;
        }
        if uploads > 0 {
            // Two copies of a small map are quicker to change; of a large one they are too much.
            self.map.copied(TWO_COPIES)?;
            times.upload += stopwatch.ms();
        }
        let view = if wants_map { self.map.view() } else { None };
        if let (true, Some(view)) = (wants_map && chosen.method.is_tiled() && stale(Stage::Tiles), &view) {
            uploads += self.tracer.upload_tiles(view)?;
            times.upload += stopwatch.ms();
        }
        if stale(Stage::Trace) {
            let pass = final_gather.and_then(|gather| self.final_pass(&packed, &features, settings, &gather));
            self.tracer.trace(&frame, indirect(&view, &irradiance, &pass))?;
            times.trace = stopwatch.ms();
        }
        times.total = start.elapsed().as_secs_f64() * 1e3;

        let of_photons = [Stage::Photons, Stage::Textures];
        let unwanted = if chosen.method.is_tiled() { Stage::Grid } else { Stage::Tiles };
        let of_map = [Stage::Grid, Stage::Tiles];
        let wanted = |stage: &Stage| match of_map.contains(stage) {
            true => wants_map && *stage != unwanted,
            false => wants_photons || !of_photons.contains(stage),
        };
        let done = |stage: &Stage| stale(*stage) && wanted(stage);
        let skipped = Stage::ALL.into_iter().filter(|stage| !done(stage)).collect();
        let radius = wants_map.then_some(chosen.radius);
        let stopped = self.partial || !self.tracer.missing().is_empty();
        self.last =
            Some(Last { scene: scene.clone(), settings: settings.clone(), features, packed, photons, chosen, stopped });
        let method = wants_map.then_some(chosen.method);
        let tile = method.filter(|method| method.is_tiled()).map(|_| chosen.tile);
        let form = method.filter(|method| !method.reads_stored()).map(|_| match chosen.hashed {
            true => GridForm::Hashed,
            false => GridForm::Dense,
        });
        let image = Image { width: 0, height: 0, pixels: Vec::new() };
        Ok(Rendering { image, times, skipped, photons, method, tile, radius, form, uploads })
    }

    /// The film of the last picture: a texture of the current context where OpenGL drew it, else in host memory.
    ///
    /// # Errors
    /// [`Error::Device`] when the device fails.
    pub fn film(&mut self) -> Result<Film> {
        match self.tracer.texture() {
            Some(texture) => Ok(Film::Texture(texture)),
            None => Ok(Film::Host(self.tracer.read()?)),
        }
    }

    /// The film of the last picture, read back.
    ///
    /// # Errors
    /// [`Error::Device`] when the device fails.
    pub fn read(&mut self) -> Result<Image> {
        self.tracer.read()
    }

    /// Lets pictures be drawn in parts, between which `pause` is called; where it returns false, the rest of the
    /// picture is not wanted. OpenGL and OpenCL heed it.
    pub fn set_pause(&mut self, pause: Option<Pause>) {
        self.tracer.set_pause(pause);
    }

    /// Of the next picture only these rows are wanted, from and to; none: all of them. Others may be drawn or not.
    pub fn set_rows(&mut self, rows: &[[u32; 2]]) {
        self.tracer.set_rows(rows);
        self.partial = !rows.is_empty();
    }

    /// Rows of the last picture, from and to, that are not there because the rest was not wanted.
    pub fn missing(&self) -> &[[u32; 2]] {
        self.tracer.missing()
    }

    /// The last photon map, and where its positions' origin lies in the world; for those who look at photons.
    pub fn map(&self) -> Option<(MapView<'_>, &Packed)> {
        let last = self.last.as_ref()?;
        last.photons?;
        Some((self.map.view()?, &last.packed))
    }

    /// Traces the same picture again and tells the milliseconds it took: for timings, apart from all else.
    ///
    /// # Errors
    /// As [`Pipeline::render`].
    pub fn retrace(&mut self, scene: &Scene, settings: &Settings) -> Result<f64> {
        if self.change(scene, settings) != Change::NONE {
            self.render(scene, settings)?;
        }
        self.make_current()?;
        let Some(last) = &self.last else { return Ok(0.0) };
        let final_gather = match settings.technique {
            Technique::FinalGather(gather) => Some(gather),
            Technique::Map => None,
        };
        let view = last.photons.filter(|_| final_gather.is_none()).and_then(|_| self.map.view());
        let irradiance = last.photons.and(final_gather).and_then(|_| self.irradiance.view());
        let pass = final_gather.and_then(|gather| self.final_pass(&last.packed, &last.features, settings, &gather));
        let mut stopwatch = Stopwatch::new();
        self.tracer.trace(&last.packed.frame(&scene.camera, settings), indirect(&view, &irradiance, &pass))?;
        Ok(stopwatch.ms())
    }

    /// What final gathering takes along in this pass.
    fn final_pass(
        &self,
        packed: &Packed,
        features: &Features,
        settings: &Settings,
        gather: &FinalGather,
    ) -> Option<FinalPass> {
        let plan = self.irradiance.plan()?;
        Some(FinalPass::new(&SceneTables::new(packed, features), plan, settings, gather))
    }

    /// What gathering costs are known for on this backend.
    pub fn class(&self) -> Class {
        self.class
    }

    /// Whether a GPU makes the pictures.
    pub fn is_on_gpu(&self) -> bool {
        matches!(self.class(), Class::OpenClGpu | Class::OpenGlGpu)
    }

    /// Makes the GL context the thread's own again: another pipeline may have worked in between.
    fn make_current(&self) -> Result<()> {
        self.context.as_ref().map_or(Ok(()), Headless::make_current)
    }

    /// Settles what the settings leave open about a new map's gathering.
    fn choose(&self, settings: &Settings, tables: &SceneTables, frame: &Frame, stored: u64) -> Result<Chosen> {
        let Gather { method, tile, cells, form, radius, .. } = settings.gather;
        // Who asks for cells asks for a grid.
        let wants_grid = cells.is_some() || form != GridForm::Auto;
        let method = if method == Method::Auto && wants_grid { Method::Grid } else { method };
        // What is left open is judged by a sample of the map.
        let sample = match (radius, method) {
            (Some(_), method) if method != Method::Auto => None,
            _ => Some(self.map.sample(radius::SAMPLE)?),
        };
        let radius = match (radius, &sample) {
            (None, Some(sample)) => radius::choose(tables, frame, sample, stored),
            (radius, _) => radius.unwrap_or_default(),
        };
        let asked = Chosen { radius, hashed: false, method, tile: tile.unwrap_or(tiling::TILE) };
        let Some(sample) = sample.filter(|_| method == Method::Auto) else { return Ok(asked) };
        let question = Question { stored, radius, tile, class: self.class() };
        let estimates = choice::estimates(tables, frame, &sample, &question);
        let Some(best) = estimates.first() else { return Ok(Chosen { method: Method::Grid, ..asked }) };
        Ok(Chosen { method: best.method, tile: best.tile.unwrap_or(asked.tile), ..asked })
    }

    /// Bytes held on the device.
    pub fn bytes(&self) -> usize {
        self.tracer.bytes() + self.map.bytes() + self.irradiance.bytes()
    }

    /// Most bytes that OpenCL's buffers ever held; none where there is no OpenCL.
    pub fn most_bytes(&self) -> Option<usize> {
        self.map.most_bytes()
    }

    /// What changed since the last picture.
    fn change(&self, scene: &Scene, settings: &Settings) -> Change {
        let Some(last) = &self.last else { return Change::ALL };
        let (before, was) = (&last.scene, &last.settings);
        let technique = |s: &Settings| match s.technique {
            Technique::Map => None,
            Technique::FinalGather(gather) => Some((gather.spacing > 1, gather.texels)),
        };
        let size = |s: &Settings| (s.width, s.height, s.samples, s.first_sample, s.jittered, s.seed);
        let emitted = |s: &Settings| (s.photons, s.seed, s.light);
        Change::CAMERA
            .when(before.camera != scene.camera || size(was) != size(settings))
            .and(Change::CAMERA.when(last.stopped))
            .and(Change::LIGHTS.when(before.lights != scene.lights))
            .and(Change::MATERIALS.when(before.materials != scene.materials))
            .and(Change::GEOMETRY.when(before.spheres != scene.spheres || before.planes != scene.planes))
            .and(Change::PHOTONS.when(emitted(was) != emitted(settings)))
            .and(Change::GATHER.when(was.gather != settings.gather))
            // Another technique has tables of its own; another pass of the same one has another lattice.
            .and(Change::TECHNIQUE.when(technique(was) != technique(settings)))
            .and(Change::CAMERA.when(was.technique != settings.technique))
            // Moving the camera can put a plane between it and the lights, which gathering has to know.
            .and(Change::FEATURES.when(is_divided(before) != is_divided(scene)))
            .and(Change::FEATURES.when(last.features != Features::of(scene, settings)))
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // GL objects go next and belong to this context. An error means that it is gone already, and they with it.
        let _ = self.make_current();
    }
}

/// Where the indirect light comes from, of what there is.
fn indirect<'a>(
    map: &'a Option<MapView>,
    irradiance: &'a Option<IrradianceView>,
    pass: &'a Option<FinalPass>,
) -> Indirect<'a> {
    match (map, irradiance, pass) {
        (_, Some(irradiance), Some(pass)) => Indirect::Final(irradiance, pass),
        (Some(map), ..) => Indirect::Map(map),
        _ => Indirect::None,
    }
}
/// Bytes of OpenCL's buffers beyond which they are given back as soon as OpenGL has a copy: of half a million photons.
const TWO_COPIES: usize = 32_000_000;

/// The grid that these settings ask for, with cells of a `usual` size where they ask for none.
fn grid_wanted(settings: &Settings, radius: f32, usual: CellSize, origin: DVec3) -> GridSettings {
    let size = match (settings.gather.lattice, settings.gather.cells) {
        (Some(CellLattice { corner, cell }), _) => {
            CellSize::Lattice { corner: (DVec3::from(corner) - origin).as_vec3().to_array(), cell }
        }
        (None, Some(counts)) => CellSize::Counts(counts),
        (None, None) => usual,
    };
    let form = match settings.gather.form {
        GridForm::Auto => Form::Auto,
        GridForm::Dense => Form::Dense,
        GridForm::Hashed => Form::Hashed(None),
    };
    GridSettings { radius, size, form, nearest: settings.gather.nearest }
}

/// What one pass emits at these settings.
pub(crate) fn emission(settings: &Settings) -> Emission {
    Emission {
        amount: settings.photons.amount,
        seed: settings.seed,
        pass: settings.photons.pass,
        sampler: settings.photons.sampler,
        store_direct: settings.light == LightMode::Photons,
    }
}

/// Milliseconds since the last call.
struct Stopwatch(Instant);

impl Stopwatch {
    fn new() -> Stopwatch {
        Stopwatch(Instant::now())
    }

    fn ms(&mut self) -> f64 {
        let now = Instant::now();
        let elapsed = now - std::mem::replace(&mut self.0, now);
        elapsed.as_secs_f64() * 1e3
    }
}

/// The pool that the twins run on.
fn threads(machine: &Machine) -> Result<Rc<rayon::ThreadPool>> {
    let threads = machine.threads;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map(Rc::new).map_err(|error| Error::Device(format!("{threads} threads: {error}")))
}

/// The class of devices that a backend would render with here, told without building its kernels.
///
/// # Errors
/// [`Error::Driver`] when the backend is not there.
pub fn class_of(backend: Backend, machine: &Machine) -> Result<Class> {
    Ok(match backend {
        Backend::OpenGl => {
            let headless = Headless::new()?;
            gl::probe(&headless)?;
            Class::of_opengl(headless.is_software)
        }
        Backend::OpenCl => Class::of_opencl(open_lanes(machine, &mut |_| {})?.device.lanes),
        Backend::Cpu => Class::Cpu,
    })
}

/// The machine's OpenCL device, with the lanes asked for.
fn open_lanes(machine: &Machine, notice: &mut dyn FnMut(&str)) -> Result<cl::Context> {
    let mut opened = open_device(machine.device.as_deref(), notice)?;
    opened.device.lanes = machine.lanes.unwrap_or(opened.device.lanes);
    Ok(opened)
}

/// The first OpenCL device that builds a kernel; one that cannot is reported and passed over.
///
/// # Errors
/// [`Error::Driver`] when no device is there, or none builds.
pub fn open_device(wanted: Option<&str>, notice: &mut dyn FnMut(&str)) -> Result<cl::Context> {
    let mut last = None;
    for device in cl::devices(wanted)? {
        let name = device.name.clone();
        match cl::Context::new(device).and_then(|context| cl::probe(&context).map(|()| context)) {
            Ok(context) => return Ok(context),
            Err(error) => {
                notice(&format!("OpenCL device '{name}' passed over: {error}"));
                last = Some(error);
            }
        }
    }
    Err(last.unwrap_or_else(|| Error::Driver(cl::MISSING.into())))
}
