//! Whole pictures: against the independent references, and of both light modes against each other.

use std::f64::consts::PI;

use photile::error::Error;
use photile::film::Image;
use photile::film::metrics::{self, measure};
use photile::pipeline::{Machine, Pipeline};
use photile::scene::{Scene, load, parse};
use photile::settings::{Amount, Backend, Gather, GridForm, LightMode, Method, Pass, Photons, Settings};

use crate::common::one_at_a_time;

fn scene(name: &str) -> Scene {
    load(format!("{}/scenes/{name}.toml", env!("CARGO_MANIFEST_DIR")).as_ref()).unwrap()
}

fn open(backend: Backend) -> Pipeline {
    let machine = Machine { backend: Some(backend), ..Machine::default() };
    Pipeline::open(&machine, |_| {}).unwrap()
}

fn rel_mse(image: &Image, reference: &Image) -> f64 {
    measure(image, reference, &metrics::Settings::default()).unwrap().rel_mse
}

/// The report's scenes, and the relMSE that one pass of 200k paths at 16 samples a pixel must stay below.
const BOUNDS: [(&str, f64); 4] =
    [("gi_ref", 3e-3), ("gi_two_lights", 3e-3), ("color_bleeding", 3e-3), ("sphere_and_plane", 1e-3)];

#[test]
fn the_reports_scenes_are_the_independent_tracers() {
    one_at_a_time();
    let mut pipeline = open(Backend::OpenCl);
    for (name, bound) in BOUNDS {
        let path = format!("{}/tests/golden/{name}.exr", env!("CARGO_MANIFEST_DIR"));
        let reference = Image::load(path.as_ref()).unwrap();
        let settings =
            Settings { width: reference.width, height: reference.height, samples: 16, ..Settings::default() };
        let found = pipeline.render(&scene(name), &settings).unwrap();
        let error = rel_mse(&found.image, &reference);
        eprintln!("{name}: relMSE {error:.2e}, bound {bound:.0e}, {:?}", found.photons);
        assert!(error <= bound, "{name}: relMSE {error}");
        // The bound tells indirect light from none at all.
        let direct = Settings { light: LightMode::Direct, samples: 1, ..settings };
        let without = rel_mse(&pipeline.render(&scene(name), &direct).unwrap().image, &reference);
        assert!(without > bound, "{name}: without indirect light {without} passes");
    }
}

/// The mean of some passes.
fn passes(pipeline: &mut Pipeline, scene: &Scene, light: LightMode, paths: u32, radius: f32, passes: u32) -> Image {
    let mut sum = Image::new(48, 36);
    for index in 0..passes {
        let mut settings = Settings { width: 48, height: 36, samples: 4, light, ..Settings::default() };
        settings.photons = Photons { amount: Amount::Paths(paths), ..settings.photons };
        settings.gather = Gather { method: Method::Grid, radius: Some(radius), ..settings.gather };
        let pass = Pass { index, ..Pass::single(&settings) };
        let image = pipeline.render_pass(scene, &settings, &pass).unwrap().image;
        for (sum, pixel) in sum.pixels.iter_mut().zip(&image.pixels) {
            for (sum, channel) in sum.iter_mut().zip(pixel) {
                *sum += channel / passes as f32;
            }
        }
    }
    sum
}

fn mean(image: &Image) -> f64 {
    image.pixels.iter().flatten().map(|channel| f64::from(*channel)).sum::<f64>() / (3 * image.pixels.len()) as f64
}

#[test]
fn both_light_modes_converge_to_the_same_picture() {
    one_at_a_time();
    let mut pipeline = open(Backend::OpenCl);
    let scene = scene("gi_two_lights");
    let hybrid = passes(&mut pipeline, &scene, LightMode::Hybrid, 200_000, 0.25, 4);
    let [coarse, fine] = [(50_000, 0.4, 1), (200_000, 0.15, 8)]
        .map(|(paths, radius, number)| passes(&mut pipeline, &scene, LightMode::Photons, paths, radius, number));
    let [far, near] = [&coarse, &fine].map(|image| rel_mse(image, &hybrid));
    eprintln!(
        "photons against hybrid: relMSE {far:.2e} coarse, {near:.2e} fine; means {} {}",
        mean(&fine),
        mean(&hybrid)
    );
    // Some hundred photons a disc are 5% of noise; what is left is light blurred across shadows' edges.
    assert!(near < 6e-3, "{near}");
    assert!(near < 0.5 * far, "{near} from {far}: more photons in smaller discs come closer");
    // Noise and blur leave the mean alone.
    assert!((mean(&fine) / mean(&hybrid) - 1.0).abs() < 0.01, "{} for {}", mean(&fine), mean(&hybrid));

    // The comparison tells light that is counted twice, or not at all.
    let mut brighter = scene.clone();
    brighter.lights.points.iter_mut().for_each(|light| light.intensity *= 1.03);
    let wrong = passes(&mut pipeline, &brighter, LightMode::Photons, 200_000, 0.15, 2);
    assert!((mean(&wrong) / mean(&hybrid) - 1.0).abs() > 0.01);
    let direct = passes(&mut pipeline, &scene, LightMode::Direct, 1, 0.15, 1);
    assert!(rel_mse(&direct, &hybrid) > 6e-3);
}

#[test]
fn the_grids_form_is_chosen_or_asked_for() {
    one_at_a_time();
    let mut pipeline = open(Backend::OpenCl);
    let mut render = |name: &str, method: Method, form: GridForm| {
        let mut settings = Settings { width: 64, height: 48, ..Settings::default() };
        settings.photons.amount = Amount::Paths(20_000);
        settings.gather = Gather { method, form, radius: Some(0.4), ..settings.gather };
        pipeline.render(&scene(name), &settings)
    };
    // The same photons in either form; only the order of the sums differs. Who asks for a form asks for a grid.
    let [dense, hashed] = [GridForm::Dense, GridForm::Hashed].map(|form| render("gi_ref", Method::Auto, form).unwrap());
    assert_eq!((dense.form, hashed.form), (Some(GridForm::Dense), Some(GridForm::Hashed)));
    assert_eq!((dense.method, hashed.method), (Some(Method::Grid), Some(Method::Grid)));
    let apart = measure(&dense.image, &hashed.image, &metrics::Settings::default()).unwrap().rmse;
    assert!(apart < 1e-5 * mean(&dense.image), "RMSE {apart}");
    // Left open, it goes by the scene: photons of an open plane lie kilometres out, where no box can be filled with cells.
    for (name, form) in [("gi_ref", GridForm::Dense), ("sphere_and_plane", GridForm::Hashed)] {
        assert_eq!(render(name, Method::Grid, GridForm::Auto).unwrap().form, Some(form), "{name}");
    }
    let refused = render("sphere_and_plane", Method::Grid, GridForm::Dense).map(|picture| picture.form);
    assert!(matches!(&refused, Err(Error::Usage(why)) if why.contains("hashed")), "{refused:?}");
}

#[test]
fn the_inside_of_a_sphere_lit_from_its_centre_is_one_brightness() {
    one_at_a_time();
    let (albedo, radius, intensity) = (0.5, 2.0, 3.0);
    let scene = parse(
        &format!(
            "[camera]\nposition = [1, 2.5, 3.5]\nlook_at = [1.5, 1.5, 0]\nfov_y = 80\n\
             [materials.grey]\ncolor = [{albedo}, {albedo}, {albedo}]\n\
             [[lights]]\nposition = [1, 2, 3]\nintensity = [{intensity}, {intensity}, {intensity}]\n\
             [[spheres]]\ncenter = [1, 2, 3]\nradius = {radius}\nmaterial = \"grey\"\n"
        ),
        "sphere.toml",
    )
    .unwrap();
    // E = Φ/(4πR²)/(1−ρ), Φ = 4πI; L = ρE/π.
    let radiance = |albedo: f64| albedo / PI * intensity / (radius * radius) / (1.0 - albedo);
    let mut settings = Settings { width: 64, height: 48, light: LightMode::Photons, ..Settings::default() };
    settings.photons.amount = Amount::Paths(500_000);
    settings.gather = Gather { method: Method::Grid, radius: Some(0.3), ..settings.gather };
    for backend in Backend::ALL {
        let found = open(backend).render(&scene, &settings).unwrap();
        let (name, mean) = (backend.name(), mean(&found.image));
        // 500k paths store 2 ± √2 photons each: 0.1%. A sixth of them is seen: 0.25%.
        assert!((mean / radiance(albedo) - 1.0).abs() < 0.01, "{name}: {mean} for {}", radiance(albedo));
        for wrong in [albedo - 0.01, albedo + 0.01] {
            assert!((mean / radiance(wrong) - 1.0).abs() > 0.01, "{name}: albedo {wrong} must show");
        }
        // A disc is 1/178 of the sphere and holds 5600 of them, which this kernel's weights make 1.5%. Five times that is
        // too much wherever a pixel looks.
        for channel in found.image.pixels.iter().flatten() {
            let share = f64::from(*channel) / radiance(albedo);
            assert!((share - 1.0).abs() < 0.08, "{name}: {share} of the radiance");
        }
    }
}

#[test]
fn fragments_gather_in_corners_what_opencl_does() {
    // Where pixels beside each other see discs that different walls cut, a software rasteriser's lanes part ways.
    one_at_a_time();
    let mut settings = Settings { width: 160, height: 120, ..Settings::default() };
    settings.photons.amount = Amount::Paths(50_000);
    settings.gather.method = Method::Grid;
    let [mut opengl, mut opencl] = [Backend::OpenGl, Backend::OpenCl].map(open);
    for name in ["color_bleeding", "gi_two_lights", "gi_ref"] {
        let fragments = opengl.render(&scene(name), &settings).unwrap().image;
        let lanes = opencl.render(&scene(name), &settings).unwrap().image;
        let most = |a: &Image, b: &Image| measure(a, b, &metrics::Settings::default()).unwrap().max_abs;
        // Before its loops were put right, 13 pixels were off by up to half of the mean.
        assert!(most(&fragments, &lanes) < 1e-4 * mean(&lanes), "{name}: {}", most(&fragments, &lanes));
        let other = opencl.render(&scene(name), &Settings { seed: 1, ..settings.clone() }).unwrap().image;
        assert!(most(&other, &lanes) > 1e-2 * mean(&lanes), "{name}: other photons show");
    }
}
