//! Errors of the report's settings, and the automatic choice whose error is no worse.

use super::cases::RADIUS;
use super::{Bench, STEP, Steps};
use crate::error::{Error, Result};
use crate::film::Image;
use crate::film::metrics::{self, measure};
use crate::scene::Scene;
use crate::settings::{Amount, Backend, LightMode, Settings};

/// Factors by which the automatic radius is lowered while the error allows it.
const FACTORS: [f32; 7] = [1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.125];

/// Paths beyond which an error that is still the worse is taken as it is.
const MOST_PATHS: u32 = 1 << 24;

/// Errors of a scene's map.
pub struct Errors {
    /// The scene's name.
    pub scene: String,
    /// Photons that the report's map stores.
    pub photons: u32,
    /// Paths that the report's map takes; more where the automatic choice needs them for an error no worse.
    pub paths: u32,
    /// relMSE of the report's settings.
    pub report: f64,
    /// The automatic radius at an error no worse, and that error.
    pub auto: (f32, f64),
}

impl Bench<'_> {
    /// Errors against the reference at the report's settings and at the automatic radius, lowered as long as the error is
    /// no worse. `None` where there is no reference image.
    pub fn errors(&mut self, scene: &Scene, photons: u32, steps: &mut Steps) -> Result<Option<&Errors>> {
        let known = |errors: &Option<Errors>| {
            errors.as_ref().is_some_and(|errors| errors.scene == scene.name && errors.photons == photons)
        };
        if let Some(place) = self.errors.iter().position(known) {
            return Ok(self.errors[place].as_ref());
        }
        let path = match &self.options.reference {
            Some(path) => path.clone(),
            None => format!("tests/golden/{}.exr", scene.name).into(),
        };
        if !path.exists() {
            steps.notice(&format!(
                "{}: no reference image here: errors and the automatic choice are left out for {}",
                path.display(),
                scene.name
            ));
            return Ok(None);
        }
        let reference = Image::load(&path)?;
        let samples = self.plan.samples;
        // The fastest that is there: all of them make the same picture.
        let judge = [Backend::OpenCl, Backend::OpenGl, Backend::Cpu];
        let wanted = judge.into_iter().filter(|backend| self.options.backends.contains(backend)).collect::<Vec<_>>();
        let Some(judge) = wanted.into_iter().find(|backend| self.pipeline(*backend, steps).is_some()) else {
            return Ok(None);
        };
        let Some(pipeline) = self.pipeline(judge, steps) else { return Ok(None) };
        let size = Settings { width: reference.width, height: reference.height, samples, ..Settings::default() };
        let mut settings = Settings { light: LightMode::Photons, ..size.clone() };
        settings.photons.amount = Amount::Stored(photons);
        settings.gather.radius = Some(RADIUS);
        let judged = pipeline.render(scene, &settings)?;
        let error = |image: &Image| Ok::<_, Error>(measure(image, &reference, &metrics::Settings::default())?.rel_mse);
        let report = error(&judged.image)?;
        let paths = judged.photons.map_or(1, |counts| counts.emitted as u32);

        let mut settings = size;
        settings.photons.amount = Amount::Paths(paths);
        // The first radius is the one that nobody asked for. Of the smaller ones that are good enough the fastest.
        let mut auto: Option<(f64, f32, f64)> = None;
        let mut chosen = None;
        let mut paths = paths;
        for factor in FACTORS {
            settings.gather.radius = chosen.map(|radius: f32| radius * factor);
            let mut rendered = pipeline.render(scene, &settings)?;
            let mut found = error(&rendered.image)?;
            // Few photons, all of them indirect light's, may show noise where the report's settings blur: take more.
            while chosen.is_none() && found > report && paths < MOST_PATHS {
                paths *= 2;
                settings.photons.amount = Amount::Paths(paths);
                rendered = pipeline.render(scene, &settings)?;
                found = error(&rendered.image)?;
            }
            let radius = rendered.radius.unwrap_or(RADIUS);
            if chosen.is_some() && found > report {
                break;
            }
            chosen = chosen.or(Some(radius));
            // Once more: the first picture built programs.
            let mut moved = scene.clone();
            moved.camera.position.x += STEP;
            let times = pipeline.render(&moved, &settings)?.times;
            let ms = times.tiles + times.trace;
            if auto.is_none_or(|(least, ..)| ms < least) {
                auto = Some((ms, radius, found));
            }
        }
        let (_, radius, found) = auto.expect("the first factor always counts");
        let auto = (radius, found);
        self.errors.push(Some(Errors { scene: scene.name.clone(), photons, paths, report, auto }));
        Ok(self.errors.last().and_then(Option::as_ref))
    }
}
