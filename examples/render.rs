//! The library used from another program: a picture in one pass, then the same scene in eight passes with what they tell of
//! their error.
//!
//! ```text
//! cargo run --release --example render -- scenes/gi_ref.toml
//! ```

use std::path::PathBuf;
use std::process::ExitCode;

use photile::error::Result;
use photile::film::{REPLICATES, SaveOptions};
use photile::pipeline::progressive::{self, Progressive};
use photile::pipeline::{Machine, Pipeline};
use photile::scene;
use photile::settings::Settings;
use photile::techniques::Wish;

fn main() -> ExitCode {
    let scene = std::env::args().nth(1).map_or_else(|| PathBuf::from("scenes/gi_ref.toml"), PathBuf::from);
    match render(scene) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("render: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

fn render(file: PathBuf) -> Result<()> {
    // Errors of a scene file name line, column, what was found and what was expected.
    let scene = scene::load(&file)?;
    let exposure = scene.render.exposure.unwrap_or(0.0) as f32;

    // OpenGL with OpenCL's photons, else OpenCL, else the CPU, with the reason for each step down.
    let machine =
        Machine { threads: std::thread::available_parallelism().map_or(1, usize::from), ..Machine::default() };
    let mut pipeline = Pipeline::open(&machine, |notice| eprintln!("{notice}"))?;
    println!("{}: {:?}", pipeline.backend.name(), pipeline.devices);

    // One picture. A second call would redo only what changed in between: a moved camera neither emits photons nor
    // uploads anything.
    let settings = Settings { width: 320, height: 240, samples: 4, ..Settings::default() };
    let picture = pipeline.render(&scene, &settings)?;
    picture.image.save("one.png".as_ref(), &SaveOptions { exposure, ..SaveOptions::default() })?;
    println!("one.png: {:.0} ms, {:?}, radius {:?} m", picture.times.total, picture.photons, picture.radius);

    // Passes, by the technique that suits the scene; eight are the fewest that tell how wrong their mean is.
    let mut settings = Settings { samples: 1, ..settings };
    Wish { on_gpu: pipeline.is_on_gpu(), ..Wish::default() }.settle(&scene, &mut settings)?;
    let mut passes = Progressive::new(&scene, &settings)?;
    while passes.passes() < REPLICATES as u64 {
        passes.step(&mut pipeline, &scene)?;
    }
    // Each pixel's standard error goes into the file beside its radiance.
    let estimate = passes.estimate();
    let channels = estimate.as_ref().map(progressive::channels).unwrap_or_default();
    passes.image()?.save("passes.exr".as_ref(), &SaveOptions { channels: &channels, ..SaveOptions::default() })?;
    let error = estimate.map_or(f64::NAN, |estimate| 100.0 * estimate.relative);
    println!("passes.exr: {} passes, error about {error:.1}%", passes.passes());
    Ok(())
}
