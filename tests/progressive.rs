//! Progressive passes and final gathering: backends against each other, pictures against references, sums resumed.

use std::io::{BufRead as _, BufReader, Read as _};
use std::process::{Command, Stdio};

use photile::film::metrics::Within;
use photile::film::{Accumulator, Image};
use photile::pipeline::Pipeline;
use photile::pipeline::progressive::{Progressive, bound_90};
use photile::settings::{Amount, FinalGather, Settings, Technique};

use crate::common::{backends, golden, one_at_a_time, scene_path, shipped};

fn settings(width: u32, height: u32, technique: Technique) -> Settings {
    let mut settings = Settings { width, height, technique, ..Settings::default() };
    settings.photons.amount = Amount::Paths(16_384);
    settings
}

fn final_gather(rays: u32, spacing: u32) -> Technique {
    Technique::FinalGather(FinalGather { rays, spacing, ..FinalGather::default() })
}

/// A render of so many passes.
fn render(pipeline: &mut Pipeline, name: &str, settings: &Settings, passes: u64) -> Progressive {
    let scene = shipped(name);
    let mut progressive = Progressive::new(&scene, settings).unwrap();
    while progressive.passes() < passes {
        progressive.step(pipeline, &scene).unwrap_or_else(|error| panic!("{error}"));
    }
    progressive
}

/// Half of the golden image's size: means of four pixels.
fn half_golden(name: &str) -> Image {
    let whole = golden(name);
    Image::from_fn(whole.width / 2, whole.height / 2, |x, y| {
        let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| whole.at(2 * x + dx, 2 * y + dy));
        [0, 1, 2].map(|channel| four.iter().map(|pixel| pixel[channel]).sum::<f32>() / 4.0)
    })
}

fn rel_mse(image: &Image, reference: &Image) -> f64 {
    let settings = photile::film::metrics::Settings::default();
    photile::film::metrics::measure(image, reference, &settings).unwrap().rel_mse
}

#[test]
fn backends_gather_alike() {
    one_at_a_time();
    // Rays that graze an edge may go either way where compilers round differently: a few pixels, not the picture.
    let tolerance = Within { abs: 1e-4, rel: 1e-4 };
    let mut pipelines = backends();
    for name in ["gi_ref", "gi_two_lights", "sphere_and_plane", "color_bleeding"] {
        for technique in [final_gather(8, 4), final_gather(4, 1)] {
            let settings = settings(64, 48, technique);
            let images: Vec<Image> =
                pipelines.iter_mut().map(|p| render(p, name, &settings, 2).image().unwrap()).collect();
            let cpu = images.last().unwrap();
            for (image, pipeline) in images.iter().zip(&pipelines) {
                let apart = image.pixels.iter().zip(&cpu.pixels).filter(|(a, b)| tolerance.apart(**a, **b)).count();
                assert!(apart <= 12, "{name}, {technique:?}: {apart} pixels of {} apart", pipeline.backend.name());
                assert!(rel_mse(image, cpu) < 1e-6, "{name}, {}", pipeline.backend.name());
            }
            let other = render(pipelines.last_mut().unwrap(), name, &Settings { seed: 1, ..settings }, 2);
            assert!(rel_mse(&other.image().unwrap(), cpu) > 1e-5, "{name}: another seed must differ");
        }
    }
}

#[test]
fn final_gathering_converges_to_the_references() {
    one_at_a_time();
    let Some(mut pipeline) = crate::common::open(photile::settings::Backend::OpenCl) else { return };
    for name in ["gi_ref", "gi_two_lights", "sphere_and_plane", "color_bleeding"] {
        let reference = half_golden(name);
        let mut progressive = render(&mut pipeline, name, &settings(160, 120, final_gather(32, 4)), 64);
        let image = progressive.image().unwrap();
        let error = rel_mse(&image, &reference);
        // Measured 2e-5 to 1.5e-4, most of it noise of edges; one pass has thirty times as much.
        assert!(error < 4e-4, "{name}: {error}");
        let other = half_golden(if name == "gi_ref" { "gi_two_lights" } else { "gi_ref" });
        assert!(rel_mse(&image, &other) > 0.01, "{name}: another scene's reference must differ");

        // The truth lies within the 90% bound about as often as the bound says.
        let estimate = progressive.estimate().unwrap();
        let values = image.pixels.len() * 3;
        let inside = |scale: f32| {
            let within = (0..values).filter(|i| {
                let (pixel, channel) = (i / 3, i % 3);
                let wrong = (image.pixels[pixel][channel] - reference.pixels[pixel][channel]).abs();
                wrong <= scale * bound_90(&estimate, pixel, channel)
            });
            within.count() as f64 / values as f64
        };
        let covered = inside(1.0);
        assert!((0.85..=0.97).contains(&covered), "{name}: {covered}");
        assert!(inside(0.3) < 0.7, "{name}: a bound a third as wide must not cover");
        let mean = reference.pixels.iter().flatten().sum::<f32>() / values as f32;
        assert!(estimate.relative > 1e-4 && estimate.relative < 0.1, "{name}: {} of {mean}", estimate.relative);
    }
}

/// Lit points share the light with rays: they take noise away, and nothing else.
#[test]
fn lit_points_leave_the_mean_and_lessen_the_noise() {
    one_at_a_time();
    let Some(mut pipeline) = crate::common::open(photile::settings::Backend::OpenCl) else { return };
    // The lamp of gi_ref hangs 0.8 m below the ceiling, those of the others 2.5 m and more from anything.
    for (name, most) in [("gi_ref", 0.8), ("gi_two_lights", 1.0), ("color_bleeding", 1.0)] {
        let mut render_with = |points, passes| {
            let gather = FinalGather { rays: 16, spacing: 1, points, ..FinalGather::default() };
            let settings = settings(40, 30, Technique::FinalGather(gather));
            let mut progressive = render(&mut pipeline, name, &settings, passes);
            (progressive.image().unwrap(), progressive.estimate().unwrap().relative)
        };
        let (truth, _) = render_with(0, 512);
        let ((without, noise_without), (with, noise_with)) = (render_with(0, 32), render_with(32, 32));
        let mean = |image: &Image| image.pixels.iter().flatten().map(|v| f64::from(*v)).sum::<f64>();
        // 32 passes of 16 rays at 1200 pixels: a few thousandths of noise, most of it the photons', which all pixels share.
        assert!((mean(&with) / mean(&truth) - 1.0).abs() < 4e-3, "{name}: {} {}", mean(&with), mean(&truth));
        let (error_without, error_with) = (rel_mse(&without, &truth), rel_mse(&with, &truth));
        assert!(error_with < most * error_without, "{name}: {error_with} with lit points, {error_without} without");
        assert!(noise_with < noise_without, "{name}: {noise_with} {noise_without}");
        // Four times as many points for each ray weigh otherwise, and bring the same.
        let (many, _) = render_with(128, 32);
        assert!((mean(&many) / mean(&truth) - 1.0).abs() < 4e-3, "{name}: {} {}", mean(&many), mean(&truth));
    }
}

#[test]
fn both_techniques_have_the_same_mean() {
    one_at_a_time();
    let Some(mut pipeline) = crate::common::open(photile::settings::Backend::OpenCl) else { return };
    let map = settings(80, 60, Technique::Map);
    let gathered = render(&mut pipeline, "gi_ref", &settings(80, 60, final_gather(32, 2)), 32).image().unwrap();
    let map_of = |pipeline: &mut Pipeline, passes| render(pipeline, "gi_ref", &map, passes).image().unwrap();
    let (few, many) = (map_of(&mut pipeline, 2), map_of(&mut pipeline, 128));
    let (first, last) = (rel_mse(&few, &gathered), rel_mse(&many, &gathered));
    // N^(−2/3) from 2 to 128 passes is a sixteenth; the other technique's own noise is in both.
    assert!(last < first / 4.0, "{first} after 2 passes, {last} after 128");
    let mean = |image: &Image| image.pixels.iter().flatten().map(|v| f64::from(*v)).sum::<f64>();
    assert!((mean(&many) / mean(&gathered) - 1.0).abs() < 3e-3, "{} {}", mean(&many), mean(&gathered));
}

#[test]
fn a_resumed_render_has_the_bytes_of_one_that_went_through() {
    one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    for (technique, backend) in [("map", "cpu"), ("final-gather", "cpu"), ("final-gather", "opencl")] {
        if backend == "opencl" && crate::common::open(photile::settings::Backend::OpenCl).is_none() {
            continue;
        }
        let photile = |output: &str, passes: &str, further: &[&str]| {
            let mut command = Command::new(env!("CARGO_BIN_EXE_photile"));
            command.args(["render", "--size", "48x36", "--photons", "2k", "--json", "--backend", backend]);
            command.args(["--technique", technique, "--passes", passes, "-o", output]).args(further);
            let output = command.arg(scene_path("gi_ref")).current_dir(&folder).output().unwrap();
            (output.status.code(), output.stdout, String::from_utf8_lossy(&output.stderr).into_owned())
        };
        let sums = format!("{technique}-{backend}");
        assert_eq!(photile("part.exr", "5", &["--checkpoint", &sums]).0, Some(0));
        let (code, json, said) = photile("part.exr", "12", &["--checkpoint", &sums]);
        assert_eq!(code, Some(0), "{said}");
        assert!(said.contains("after 5 passes"), "{said}");
        let report: serde_json::Value = serde_json::from_slice(&json).unwrap();
        assert_eq!((&report["passes"], &report["technique"]), (&12.into(), &technique.into()));
        assert!(report["error"].as_f64().unwrap() > 0.0);
        assert_eq!(photile("whole.exr", "12", &[]).0, Some(0));
        let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
        assert!(bytes("part.exr") == bytes("whole.exr"), "{technique} on {backend}");
        assert_eq!(photile("other.exr", "13", &[]).0, Some(0));
        assert!(bytes("other.exr") != bytes("whole.exr"), "one more pass must show");

        // Sums of other settings are bad input, and so are damaged ones.
        let (code, _, said) = photile("other.exr", "14", &["--checkpoint", &sums, "--seed", "9"]);
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains("expected an image of the same scene and settings"), "{said}");
        std::fs::write(folder.path().join(&sums), b"photacc2 but no sums").unwrap();
        assert_eq!(photile("other.exr", "14", &["--checkpoint", &sums]).0, Some(2));
    }
}

#[test]
fn limits_stop_a_render_and_its_exr_tells_the_error() {
    let folder = tempfile::tempdir().unwrap();
    let render = |limit: [&str; 2]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_photile"));
        command.args(["render", "--size", "48x36", "--backend", "cpu", "--rays", "4", "--json", "-o", "out.exr"]);
        let output = command.args(limit).arg(scene_path("gi_ref")).current_dir(&folder).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()
    };
    let number = |report: &serde_json::Value, key: &str| report[key].as_f64().unwrap();
    let coarse = render(["--until-error", "0.08"]);
    assert!(number(&coarse, "error") <= 0.08);
    let fine = render(["--until-error", "0.02"]);
    assert!(number(&fine, "error") <= 0.02 && number(&fine, "passes") > number(&coarse, "passes"), "{fine}");
    let timed = render(["--time", "0.3"]);
    let seconds = number(&timed, "render_seconds");
    assert!(seconds >= 0.3, "{timed}");
    let exr = photile::film::load_exr(&folder.path().join("out.exr")).unwrap();
    let errors: Vec<&str> = exr.channels.iter().map(|channel| channel.name.as_str()).collect();
    assert_eq!(errors, ["stderr.B", "stderr.G", "stderr.R"]);
    assert!(exr.channels.iter().all(|channel| channel.samples.iter().any(|error| *error > 0.0)));
}

/// Ctrl-C keeps picture and sums, says how to go on and fails; going on gives the bytes of a render that nobody stopped.
#[cfg(unix)]
#[test]
fn an_interrupted_render_is_saved_and_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let photile = |output: &str, limit: [&str; 2], further: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_photile"));
        command
            .args(["render", "--size", "64x48", "--backend", "cpu", "--json", "-o", output])
            .args(limit)
            .args(further);
        command.arg(scene_path("gi_ref")).current_dir(&folder).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    let mut running = photile("part.exr", ["--time", "600"], &["--checkpoint", "sums"]).spawn().unwrap();
    let mut stderr = BufReader::new(running.stderr.take().unwrap());
    let mut said = String::new();
    while !said.contains("Ctrl-C") {
        assert!(stderr.read_line(&mut said).unwrap() > 0, "ended before it was stopped: {said}");
    }
    // The shell's own kill: the program of that name is no part of a minimal system.
    let kill = Command::new("sh").args(["-c", &format!("kill -INT {}", running.id())]).status().unwrap();
    assert!(kill.success());
    stderr.read_to_string(&mut said).unwrap();
    assert_eq!(running.wait().unwrap().code(), Some(1), "{said}");
    assert!(said.contains("go on with --checkpoint sums"), "{said}");
    assert!(Image::load(&folder.path().join("part.exr")).is_ok());
    let passes = Accumulator::load(&folder.path().join("sums")).unwrap().passes() + 3;
    let wanted = passes.to_string();
    assert!(photile("part.exr", ["--passes", &wanted], &["--checkpoint", "sums"]).status().unwrap().success());
    assert!(photile("whole.exr", ["--passes", &wanted], &[]).status().unwrap().success());
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert!(bytes("part.exr") == bytes("whole.exr"));
}

#[test]
fn sums_may_be_grouped_as_one_likes() {
    // Passes depend on their index alone: the mean of 16 is that of the first 8 and the next 8, within rounding.
    let Some(mut pipeline) = crate::common::open(photile::settings::Backend::Cpu) else { return };
    let scene = shipped("gi_ref");
    let settings = settings(32, 24, final_gather(4, 4));
    let mut progressive = Progressive::new(&scene, &settings).unwrap();
    let mut passes: Vec<Image> = Vec::new();
    for _ in 0..16 {
        passes.push(progressive.step(&mut pipeline, &scene).unwrap().image);
    }
    let mean_of = |images: &[&Image], pixel: usize| {
        images.iter().map(|image| f64::from(image.pixels[pixel][0])).sum::<f64>() / images.len() as f64
    };
    let whole = progressive.image().unwrap();
    let odd_first: Vec<&Image> = passes.iter().skip(1).step_by(2).chain(passes.iter().step_by(2)).collect();
    for pixel in 0..whole.pixels.len() {
        let other = mean_of(&odd_first, pixel) as f32;
        assert!((whole.pixels[pixel][0] - other).abs() <= 2e-7 * other.abs(), "pixel {pixel}");
    }
    // Saved sums go through a file unchanged.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sums");
    progressive.sums().save(&path).unwrap();
    assert_eq!(&Accumulator::load(&path).unwrap(), progressive.sums());
}
