//! Reference images: what the photon-mapping renderers must converge to, made by an independent method.
//!
//! Double precision, bidirectional path tracing (`estimator`) whose deep bounces are shared between pixels without bias
//! (`anchors`), Owen-scrambled Sobol' points (`sampler`), exact intersections (`shapes`);
//! nothing here is shared with the photon-mapping stages beyond the scene itself.
//!
//! ```text
//!     Scene ─► Estimator ─ a sample of every pixel ─► Accumulator ─► Reference ─► EXR with standard errors
//!                                  ▲ pass by pass           └─► checkpoint file
//! ```

use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use glam::DVec3;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::film::fnv1a;
use crate::scene::Scene;

pub mod agreement;
mod anchors;
mod bsdf;
mod estimator;
mod output;
mod sampler;
mod shapes;
mod technique;
#[cfg(test)]
mod tests;

pub use crate::film::{Accumulator, REPLICATES};
use estimator::{Estimator, Far, Scratch};
use sampler::Sampler;
use technique::{TECHNIQUE, Technique};

/// Which light the image holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReferenceLight {
    /// Light of any number of bounces.
    #[default]
    Full,
    /// Light → first diffuse or glossy surface → camera.
    Direct,
}

/// What to render and for how long.
#[derive(Clone, Debug)]
pub struct ReferenceSettings {
    /// Pixels: width, height.
    pub size: (u32, u32),
    /// Full or direct light.
    pub light: ReferenceLight,
    /// Stop at this many samples a pixel, rounded up to a multiple of [`REPLICATES`].
    pub spp: Option<u64>,
    /// Stop after this time, though not before [`REPLICATES`] samples a pixel.
    pub time: Option<Duration>,
    /// Images of different seeds are independent.
    pub seed: u64,
    /// Threads to use; all cores if None. The image does not depend on it.
    pub threads: Option<NonZeroUsize>,
}

impl Default for ReferenceSettings {
    /// 320×240, full light, 256 samples a pixel, seed 0, all cores.
    fn default() -> Self {
        Self { size: (320, 240), light: ReferenceLight::Full, spp: Some(256), time: None, seed: 0, threads: None }
    }
}

/// How far a render has come, after each sample of all pixels.
pub struct Progress<'a> {
    /// The sums so far; may be saved.
    pub accumulator: &'a Accumulator,
    /// Since this call began.
    pub elapsed: Duration,
    /// Samples a pixel at which it will stop, if that was asked.
    pub target: Option<u64>,
}

/// An image with its standard error.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Pixels: width, height.
    pub size: (u32, u32),
    /// Radiance, W·m⁻²·sr⁻¹, linear Rec. 709; row 0 at the top, box filter.
    pub mean: Vec<DVec3>,
    /// Standard error of `mean` per pixel and channel, with `REPLICATES - 1` degrees of freedom.
    pub standard_error: Vec<DVec3>,
    /// Standard error of the whole image's mean; more than the pixels' own errors say, as they share anchors.
    pub overall_error: DVec3,
    /// The sums behind both, to be saved or continued.
    pub accumulator: Accumulator,
}

impl Reference {
    fn new(accumulator: Accumulator) -> Result<Self> {
        let (mean, standard_error) = accumulator.image().ok_or_else(|| {
            Error::Failed(format!(
                "stopped after {} samples a pixel; an image with its error needs {REPLICATES}",
                accumulator.passes()
            ))
        })?;
        let overall_error = accumulator.overall_error();
        Ok(Self { size: accumulator.size(), mean, standard_error, overall_error, accumulator })
    }

    /// Mean over pixels of the luminance's standard error over the luminance; black pixels are left out.
    pub fn relative_noise(&self) -> f64 {
        self.accumulator.relative_noise()
    }
}

/// Render `scene` until a limit of `settings` is reached or `progress` breaks off; the image so far is then returned.
///
/// # Errors
/// [`Error::Usage`] for settings or scenes that cannot be rendered, [`Error::Failed`] if stopped before any image.
pub fn render(
    scene: &Scene,
    settings: &ReferenceSettings,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Reference> {
    resume(scene, settings, start(scene, settings)?, progress)
}

/// An empty image for `scene` and `settings`, to be given to [`resume`].
///
/// # Errors
/// [`Error::Usage`] for settings or scenes that cannot be rendered.
pub fn start(scene: &Scene, settings: &ReferenceSettings) -> Result<Accumulator> {
    check(scene, settings)?;
    Ok(Accumulator::new(settings.size, fingerprint(scene, settings)))
}

/// Go on from `accumulator`, to the same bytes as a render that was never interrupted.
///
/// # Errors
/// As [`render`]; [`Error::Usage`] too if `accumulator` belongs to another scene or other settings.
pub fn resume(
    scene: &Scene,
    settings: &ReferenceSettings,
    accumulator: Accumulator,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Reference> {
    if !accumulator.continues(&start(scene, settings)?) {
        let ((width, height), spp) = (accumulator.size(), accumulator.passes());
        return Err(Error::Usage(format!(
            "unfinished image of {width}x{height} pixels after {spp} samples each: expected one of the same scene, \
             size, light mode and seed as asked for now"
        )));
    }
    let technique = Technique { direct_only: settings.light == ReferenceLight::Direct, ..TECHNIQUE };
    Reference::new(accumulate(scene, settings, technique, accumulator, progress)?)
}

/// Add passes until a limit is reached.
fn accumulate(
    scene: &Scene,
    settings: &ReferenceSettings,
    technique: Technique,
    mut accumulator: Accumulator,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Accumulator> {
    let estimator = Estimator::new(scene, settings.size, technique);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(settings.threads.map_or(0, NonZeroUsize::get))
        .build()
        .map_err(|e| Error::Failed(format!("threads cannot be started: {e}")))?;
    // A small image is not worth many anchors; a large one affords several paths from each in every pass.
    let pixels = settings.size.0 as usize * settings.size.1 as usize;
    let anchors = pool.install(|| estimator.anchors(technique.anchors.min(pixels / 8)));
    let paths = (pixels / 65_536).max(1) as u64;
    let target = settings.spp.map(|spp| spp.next_multiple_of(REPLICATES as u64));
    let replicates = REPLICATES as u64;
    let began = Instant::now();
    let (width, height) = settings.size;
    let mut pass = vec![0.0; width as usize * height as usize * 3];
    while target.is_none_or(|target| accumulator.passes() < target) {
        let (replicate, cycle) = (accumulator.passes() % replicates, accumulator.passes() / replicates);
        // Replicate-major: each has sums of its own.
        let values = anchors.points().len() * 3;
        let anchor_sums = accumulator
            .extras(values * REPLICATES)
            .map(|sums| &mut sums[replicate as usize * values..][..values])
            .ok_or_else(|| Error::Usage("the checkpoint was made by another version of the program".into()))?;
        let render_pass = || {
            // Improve what the anchors know, and use it at once: any state of it is unbiased.
            let refine = |scratch: &mut Scratch, (index, sum): (usize, &mut [f64])| {
                let mut total = DVec3::from_slice(sum);
                for path in 0..paths {
                    let sampler = Sampler::new(!settings.seed, replicate, index as u64, cycle * paths + path);
                    total += estimator.anchor(&anchors.points()[index], sampler, scratch);
                }
                total.write_to_slice(sum);
                total / ((cycle + 1) * paths) as f64
            };
            let irradiance: Vec<_> = anchor_sums
                .par_chunks_mut(3)
                .enumerate()
                .map_init(Scratch::default, |scratch, anchor| refine(scratch, anchor))
                .collect();
            let far = (!irradiance.is_empty()).then_some(Far { anchors: &anchors, irradiance: &irradiance });
            pass.par_chunks_mut(width as usize * 3).enumerate().for_each_init(
                Scratch::default,
                |scratch, (row, out)| {
                    for (column, out) in out.chunks_exact_mut(3).enumerate() {
                        let pixel = (row * width as usize + column) as u64;
                        let sampler = Sampler::new(settings.seed, replicate, pixel, cycle);
                        let radiance =
                            estimator.pixel((column as u32, row as u32), settings.size, sampler, far, scratch);
                        radiance.write_to_slice(out);
                    }
                },
            );
        };
        pool.install(render_pass);
        accumulator.add(pass.iter().copied());
        let elapsed = began.elapsed();
        if progress(&Progress { accumulator: &accumulator, elapsed, target }).is_break() {
            break;
        }
        if settings.time.is_some_and(|time| elapsed >= time) && accumulator.passes() >= replicates {
            break;
        }
    }
    Ok(accumulator)
}

/// Refuse what would give a wrong image or none.
fn check(scene: &Scene, settings: &ReferenceSettings) -> Result<()> {
    let (width, height) = settings.size;
    if width == 0 || height == 0 {
        return Err(Error::Usage(format!("image size {width}x{height}: expected at least 1x1")));
    }
    // One pass, and eight sums, of three doubles a pixel.
    if u64::from(width) * u64::from(height) > 1 << 28 {
        return Err(Error::Usage(format!("image size {width}x{height}: expected at most 2^28 pixels")));
    }
    if settings.spp == Some(0) || (settings.spp.is_none() && settings.time.is_none()) {
        return Err(Error::Usage("reference: expected a number of samples a pixel > 0, or a time, to stop at".into()));
    }
    if settings.light == ReferenceLight::Full {
        for material in scene.shapes.iter().map(|shape| &scene.materials[shape.material()]) {
            if material.transmission > 0.0 || (material.specular > 0.0 && material.roughness <= 0.0) {
                return Err(Error::Usage(format!(
                    "{}: material '{}' is a perfect mirror or glass; the reference renderer has no strategy for their \
                     caustics yet and would leave them out (roughness > 0 or --light direct can be rendered)",
                    scene.name, material.name
                )));
            }
        }
    }
    Ok(())
}

/// Of all that decides a sample's value.
fn fingerprint(scene: &Scene, settings: &ReferenceSettings) -> u64 {
    let Scene { name: _, camera, materials, lights, shapes, render: _ } = scene;
    let ReferenceSettings { size, light, seed, spp: _, time: _, threads: _ } = settings;
    // Debug prints every float in full, and any change of a type's fields changes it too.
    let text = format!("{camera:?}{materials:?}{lights:?}{shapes:?}{size:?}{light:?}{seed}{TECHNIQUE:?}");
    fnv1a(text.as_bytes())
}
