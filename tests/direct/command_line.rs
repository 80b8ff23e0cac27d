//! The built program as a user runs it: exit codes, what stdout and stderr say, what is written.

use std::path::Path;
use std::process::{Command, Output};

use photile::film::Image;
use serde_json::Value;

use crate::common::{missing, one_at_a_time, scene_path};

/// What hides OpenCL from the ICD loader and OpenGL from libglvnd.
pub const HIDDEN: [(&str, &str); 2] =
    [("OCL_ICD_VENDORS", "/nonexistent"), ("__EGL_VENDOR_LIBRARY_FILENAMES", "/nonexistent")];

/// How one run ended.
pub struct Run {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Run {
    /// The one JSON object that stdout holds.
    #[track_caller]
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {}{}", self.stdout, self.stderr))
    }

    #[track_caller]
    pub fn ends(self, code: i32, said: &[&str]) -> Run {
        let all = format!("{}{}", self.stdout, self.stderr);
        assert_eq!(self.code, code, "{all}");
        for words in said {
            assert!(self.stderr.contains(words), "not said: {words}\n{all}");
        }
        assert!(!self.stderr.contains("panicked"), "{all}");
        self
    }
}

pub fn run_with(folder: &Path, environment: &[(&str, &str)], arguments: &[&str]) -> Run {
    let mut command = Command::new(env!("CARGO_BIN_EXE_photile"));
    command.current_dir(folder).args(arguments).envs(environment.iter().copied());
    let Output { status, stdout, stderr } = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Run { code: status.code().expect("ended by itself"), stdout: text(stdout), stderr: text(stderr) }
}

/// In a folder of its own, gone afterwards.
pub fn run(arguments: &[&str]) -> Run {
    run_with(tempfile::tempdir().unwrap().path(), &[], arguments)
}

pub const GI_REF: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/gi_ref.toml");

const SMALL: [&str; 4] = ["--light", "direct", "--size", "48x32"];

#[test]
fn render_writes_an_image_and_tells_about_it() {
    let folder = tempfile::tempdir().unwrap();
    let arguments =
        [&["render", GI_REF, "--backend", "cpu", "-o", "out.exr", "--seed", "7", "--json"], &SMALL[..]].concat();
    let json = run_with(folder.path(), &[], &arguments).ends(0, &["out.exr"]).json();
    assert_eq!(json["scene"], "gi_ref");
    assert_eq!(json["backend"], "cpu");
    assert_eq!(json["light"], "direct");
    assert_eq!(json["size"], serde_json::json!([48, 32]));
    assert_eq!(json["seed"], 7);
    assert_eq!(json["output"], "out.exr");
    assert!(json["skipped"].is_array() && json["devices"].is_object());
    assert!(json["memory_bytes"].as_u64().unwrap() >= 48 * 32 * 12);
    for key in ["compile", "upload", "trace", "readback", "total"] {
        assert!(json["time_ms"][key].as_f64().unwrap() >= 0.0, "{key}");
    }
    let image = Image::load(&folder.path().join("out.exr")).unwrap();
    assert_eq!((image.width, image.height), (48, 32));
    assert!(image.pixels.iter().filter(|pixel| pixel[0] > 0.1).count() > 1000);
    // Nothing but the image is left behind.
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn the_default_output_is_named_after_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    run_with(folder.path(), &[], &[&["render", GI_REF], &SMALL[..]].concat()).ends(0, &["gi_ref.png"]);
    assert!(Image::load(&folder.path().join("gi_ref.png")).is_ok());
}

#[test]
fn every_backend_renders_the_same_file() {
    let folder = tempfile::tempdir().unwrap();
    for backend in ["cpu", "opencl", "opengl"] {
        let output = format!("{backend}.exr");
        let arguments = [&["render", GI_REF, "--backend", backend, "-o", &output], &SMALL[..]].concat();
        let run = run_with(folder.path(), &[], &arguments);
        if run.code != 0 {
            missing(backend, &run.stderr);
            continue;
        }
        run.ends(0, &[backend, "asked for"]);
        run_with(folder.path(), &[], &["compare", &output, "cpu.exr", "--max-rmse", "1e-2"]).ends(0, &[]);
    }
}

#[test]
fn an_image_that_exists_is_replaced_whole_or_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.png");
    std::fs::write(&path, "something else").unwrap();
    let write = |scene: &str| {
        run_with(folder.path(), &[], &[&["render", scene, "--backend", "cpu", "-o", "out.png"], &SMALL[..]].concat())
    };
    std::fs::write(folder.path().join("broken.toml"), "[camera]\nposition = 3\n").unwrap();
    write("broken.toml").ends(2, &["broken.toml:2:12"]);
    assert_eq!(std::fs::read(&path).unwrap(), b"something else");
    write(GI_REF).ends(0, &[]);
    assert_eq!(Image::load(&path).unwrap().width, 48);
}

#[test]
fn wrong_usage_and_bad_input_exit_with_2() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    std::fs::write(at("bad.toml"), "[camera]\nposition = [0, 0, 1]\nlook_at = [0, 0, 0]\nfov = 45\n").unwrap();
    std::fs::write(
        at("misspelt.toml"),
        "[camera]\nposition = [0, 0, 1]\nlook_at = [0, 0, 0]\n[materials.m]\ncolr = [1, 1, 1]\n",
    )
    .unwrap();
    let good = GI_REF;
    let [bad, misspelt, none, hidden, a, b] =
        ["bad.toml", "misspelt.toml", "none.toml", ".png", "a.png", "b.png"].map(at);
    let here = at("");
    let cases: &[(&[&str], &[&str])] = &[
        (&["render", &bad], &["bad.toml:4:1", "fov", "fov_y"]),
        (&["render", &misspelt], &["misspelt.toml:5:1", "colr", "color"]),
        (&["render", &none], &["none.toml"]),
        (&["render", &here], &["directory"]),
        (&["render", good, "--size", "640"], &["WIDTHxHEIGHT"]),
        (&["render", good, "--size", "0x480"], &["WIDTHxHEIGHT"]),
        (&["render", good, "--size", "99999x1"], &["WIDTHxHEIGHT"]),
        (&["render", good, "--spp", "0"], &["--spp"]),
        (&["render", good, "--threads", "0"], &["--threads"]),
        (&["render", good, "--seed", "-1"], &["-1"]),
        (&["render", good, "--seed", "4294967296"], &["--seed"]),
        (&["render", good, "--light", "sun"], &["sun", "direct"]),
        (&["render", good, "--backend", "vulkan"], &["vulkan", "opencl"]),
        (&["render", good, "--nope"], &["--nope"]),
        (&["render", good, "-o", "out.jpg"], &["out.jpg", ".png or .exr"]),
        (&["render", good, "-o", "out"], &[".png or .exr"]),
        (&["render", good, "-o", "no/such/folder/out.png"], &["no/such/folder"]),
        (&["render", good, "-o", &hidden], &[".png"]),
        (&["render", good, "--exposure", "nan"], &["exposure", "finite"]),
        (&["render", good, "--exposure", "inf", "-o", "x.exr"], &["exposure", "finite"]),
        (&["plan", good, "--source", "nope.frag"], &["nope.frag", "trace.frag", "trace.cl"]),
        (&["plan", good, "--source", "trace.cl", "--lanes", "3"], &["--lanes 3"]),
        (&["validate", "--inject", "object.colour"], &["object.colour", "object.color"]),
        (&["compare", &a, &b], &["a.png"]),
        (&["compare", good, good], &["gi_ref.toml"]),
        (&["compare", good, "--light", "direct", "-o", "no/such/map.png"], &["no/such"]),
        (&["nothing"], &["nothing"]),
        (&[], &["Usage"]),
    ];
    for (arguments, said) in cases {
        let run = run_with(folder.path(), &[], arguments).ends(2, said);
        assert!(run.stdout.is_empty(), "{arguments:?}: {}", run.stdout);
    }
    // Refused before the work, so nothing was written.
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn photons_are_not_waited_for_where_none_can_be_stored() {
    let folder = tempfile::tempdir().unwrap();
    let scene = |name: &str, intensity: u32| {
        let text = format!(
            "[camera]\nposition = [0, 0, 4]\nlook_at = [0, 0, 0]\n[materials.m]\ncolor = [1, 1, 1]\n\
             [[lights]]\nposition = [0, 3, 3]\nintensity = [{intensity}, {intensity}, {intensity}]\n\
             [[spheres]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"m\"\n"
        );
        std::fs::write(folder.path().join(name), text).unwrap();
    };
    scene("dark.toml", 0);
    scene("grey.toml", 1);
    std::fs::write(
        folder.path().join("empty.toml"),
        "[camera]\nposition = [0, 0, 4]\nlook_at = [0, 0, 0]\n\
         [[lights]]\nposition = [0, 3, 3]\nintensity = [1, 1, 1]\n",
    )
    .unwrap();
    let arguments = |scene, backend, light| {
        ["render", scene, "--backend", backend, "--light", light, "--stored", "5", "--size", "16x12", "-o", "out.exr"]
    };
    for backend in ["cpu", "opencl", "opengl"] {
        // No light, nothing at all, and light that meets nothing a second time.
        for (scene, light) in [("dark.toml", "photons"), ("empty.toml", "photons"), ("grey.toml", "hybrid")] {
            let run = run_with(folder.path(), &[], &arguments(scene, backend, light));
            if run.code == 1 {
                missing(backend, &run.stderr);
                continue;
            }
            run.ends(2, &["--stored 5: 0 photons", "reaches a diffuse or glossy surface"]);
            assert!(!folder.path().join("out.exr").exists(), "{backend}, {scene}");
        }
        let run = run_with(folder.path(), &[], &arguments("grey.toml", backend, "photons"));
        if run.code == 1 {
            missing(backend, &run.stderr);
            continue;
        }
        run.ends(0, &["out.exr"]);
        std::fs::remove_file(folder.path().join("out.exr")).unwrap();
    }
}

#[test]
fn a_folder_that_cannot_be_written_to_is_refused_at_once() {
    // Not even root makes files in /proc.
    let arguments = [&["render", GI_REF, "-o", "/proc/out.png"], &SMALL[..]].concat();
    run(&arguments).ends(2, &["/proc", "cannot write"]);
}

#[test]
fn an_unknown_device_is_refused_with_those_that_are_there() {
    one_at_a_time();
    if let Err(error) = photile::device::cl::devices(None) {
        return missing("OpenCL", &error);
    }
    for backend in [&["--backend", "opencl"][..], &[]] {
        run(&[&["render", GI_REF, "--device", "no such device"], backend, &SMALL].concat())
            .ends(2, &["no OpenCL device matches 'no such device'", "there are #1 '"]);
    }
}

#[test]
fn without_drivers_the_cpu_renders_and_says_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [&["render", GI_REF, "-o", "out.exr", "--json"], &SMALL[..]].concat();
    let run = run_with(folder.path(), &HIDDEN, &arguments);
    let run =
        run.ends(0, &["falling back from opengl", "libegl1", "falling back from opencl", "pocl-opencl-icd", "cpu"]);
    let json = run.json();
    assert_eq!(json["backend"], "cpu");
    assert_eq!(json["devices"], serde_json::json!({ "opencl": null, "lanes": null, "opengl": null }));
    let hidden = Image::load(&folder.path().join("out.exr")).unwrap();
    let asked = [&["render", GI_REF, "-o", "cpu.exr", "--backend", "cpu"], &SMALL[..]].concat();
    run_with(folder.path(), &[], &asked).ends(0, &[]);
    assert!(hidden == Image::load(&folder.path().join("cpu.exr")).unwrap());
    // With OpenGL gone, OpenCL is next, if it is there.
    let half = run_with(folder.path(), &HIDDEN[1..], &arguments).ends(0, &["falling back from opengl"]);
    match half.json()["backend"].as_str() {
        Some("opencl") => assert!(!half.stderr.contains("falling back from opencl")),
        other => missing("OpenCL", &format!("{other:?}")),
    }
    // A backend that was asked for by name is not replaced.
    for (backend, package) in [("opengl", "libegl1"), ("opencl", "pocl-opencl-icd")] {
        let arguments = [&["render", GI_REF, "--backend", backend], &SMALL[..]].concat();
        run_with(folder.path(), &HIDDEN, &arguments).ends(1, &[package, "apt-get install"]);
    }
    run_with(folder.path(), &HIDDEN, &["validate"]).ends(1, &["neither OpenGL nor OpenCL"]);
    let compared = [&["compare", GI_REF, "--repeat", "1"], &SMALL[..]].concat();
    run_with(folder.path(), &HIDDEN, &compared).ends(1, &["nothing was compared", "libegl1"]);
}

#[test]
fn doctor_runs_something_on_every_device() {
    let findings = run(&["doctor", "--json"]).ends(0, &[]).json()["findings"].clone();
    for api in ["OpenGL", "OpenCL"] {
        let of_api = || findings.as_array().unwrap().iter().filter(|finding| finding["api"] == api);
        assert!(of_api().count() > 0, "{api} is not even mentioned");
        match of_api().find(|finding| finding["works"] == true) {
            Some(works) => assert!(works["detail"].as_str().unwrap().contains("and "), "{works}"),
            None => missing(api, &findings),
        }
    }
    let hidden = run_with(Path::new("/"), &HIDDEN, &["doctor"]).ends(0, &[]);
    assert_eq!(
        hidden.stdout.matches("FAILS").count(),
        hidden.stdout.matches("Open").count().min(2),
        "{}",
        hidden.stdout
    );
    assert!(!hidden.stdout.contains("works") && hidden.stdout.contains("pocl-opencl-icd"), "{}", hidden.stdout);
}

#[test]
fn plan_lists_what_is_used_and_prints_what_the_driver_gets() {
    let json = run(&["plan", GI_REF, "--light", "direct", "--json"]).ends(0, &[]).json();
    let feature = |name: &str| {
        let features = json["features"].as_array().unwrap();
        features.iter().find(|feature| feature["feature"] == name).unwrap_or_else(|| panic!("{name}")).clone()
    };
    assert_eq!(feature("HAS_SPHERES")["used"], true);
    assert_eq!(feature("HAS_GLOSSY")["used"], false);
    assert_eq!(feature("HAS_PLANE_SHADOWS")["used"], false, "nothing but walls around camera and light");
    assert!(feature("HAS_PLANE_SHADOWS")["why"].as_str().unwrap().contains("0 of 6 planes"));
    let uploads = json["uploads"].as_array().unwrap();
    // Six floats in two texels each, and nine in three.
    for (name, texels, bytes) in [("shapes", 16, 192), ("materials", 24, 288)] {
        let table = uploads.iter().find(|table| table["table"] == name).unwrap();
        let found = ["records", "texels", "bytes"].map(|key| table[key].as_u64());
        assert_eq!(found, [Some(8), Some(texels), Some(bytes)], "{name}");
    }

    let furnace = scene_path("furnace").display().to_string();
    let shader = run(&["plan", &furnace, "--light", "direct", "--source", "trace.frag"]).ends(0, &[]).stdout;
    assert!(shader.starts_with("#version 330 core\n") && shader.contains("void main()"), "{shader}");
    assert!(shader.contains("#define HAS_SPHERES\n") && !shader.contains("#define HAS_PLANES\n"));
    assert!(shader.contains("#define ONE_LIGHT\n") && !shader.contains("#include"));
    for lanes in ["1", "16"] {
        let kernel = run(&["plan", &furnace, "--source", "trace.cl", "--lanes", lanes]).ends(0, &[]).stdout;
        assert!(kernel.starts_with(&format!("#define LANES {lanes}\n")) && kernel.contains("__kernel void trace("));
    }
}

#[test]
fn compare_measures_two_images_and_holds_them_to_bounds() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let options = photile::film::SaveOptions::default();
    Image::from_fn(8, 8, |_, _| [0.5; 3]).save(&path("a.exr"), &options).unwrap();
    Image::from_fn(8, 8, |x, y| [if (x, y) == (3, 4) { 0.75 } else { 0.5 }; 3]).save(&path("b.exr"), &options).unwrap();
    Image::from_fn(8, 9, |_, _| [0.5; 3]).save(&path("c.exr"), &options).unwrap();
    let compare = |arguments: &[&str]| run_with(folder.path(), &[], &[&["compare"], arguments].concat());
    let json = compare(&["a.exr", "b.exr", "--json", "-o", "map.png"]).ends(0, &[]).json();
    // One pixel of 64 off by 1/4: RMSE is 1/32.
    assert!((json["rmse"].as_f64().unwrap() - 0.031_25).abs() < 1e-9, "{json}");
    assert_eq!((json["max_abs"].as_f64(), json["pixels_over"].as_u64()), (Some(0.25), Some(1)));
    assert_eq!(Image::load(&path("map.png")).unwrap().width, 8);
    compare(&["a.exr", "a.exr", "--max-rmse", "0"]).ends(0, &[]);
    compare(&["a.exr", "b.exr", "--max-rmse", "0.032"]).ends(0, &[]);
    compare(&["a.exr", "b.exr", "--max-rmse", "0.031"]).ends(1, &["found RMSE 3.125e-2", "expected at most 3.100e-2"]);
    // A bound that is no number is met by nothing.
    compare(&["a.exr", "b.exr", "--max-rmse", "nan"]).ends(1, &["found RMSE"]);
    compare(&["a.exr", "c.exr"]).ends(2, &["8x8", "8x9"]);
}

#[test]
fn compare_renders_on_every_backend() {
    let arguments =
        ["compare", GI_REF, "--light", "direct", "--size", "160x120", "--repeat", "1", "--json", "-o", "map.png"];
    let bounds = ["--max-rmse", "1e-5", "--max-flips", "10"];
    let folder = tempfile::tempdir().unwrap();
    let run = run_with(folder.path(), &[], &[&arguments[..], &bounds].concat());
    if run.code == 1 && run.stderr.contains("nothing was compared") {
        return missing("OpenGL or OpenCL", &run.stderr);
    }
    let json = run.ends(0, &[]).json();
    let pairs = json["pairs"].as_array().unwrap();
    let sides = json["sides"].as_array().unwrap().len();
    if sides < 3 {
        missing("OpenGL or OpenCL", &json);
    }
    assert_eq!(pairs.len(), sides * (sides - 1) / 2);
    for pair in pairs {
        for key in ["max_abs", "rmse", "rel_mse", "pixels_over", "flipped_pixels", "time_ratio"] {
            assert!(pair[key].is_number(), "{key}: {pair}");
        }
    }
    assert_eq!(Image::load(&folder.path().join("map.png")).unwrap().width, 160);
    // Different compilers leave some ulps between OpenGL and the others, so a bound of 0 cannot hold.
    run_with(folder.path(), &[], &[&arguments[..], &["--max-rmse", "0"]].concat()).ends(1, &["found RMSE", "opengl"]);
}

#[test]
fn an_injected_fault_fails_validation_and_is_named() {
    let run = run(&["validate", "--inject", "object.color", "--json"]);
    if run.stderr.contains("not checked") {
        return missing("OpenGL or OpenCL", &run.stderr);
    }
    let run = run.ends(1, &["checks failed", "object 0, field color: expected"]);
    let json = run.json();
    let wrong: Vec<&str> = json["wrong"].as_array().unwrap().iter().map(|wrong| wrong.as_str().unwrap()).collect();
    // By every way of reading, and for no other field.
    assert!(wrong.iter().all(|wrong| wrong.contains("field color")), "{wrong:?}");
    for way in ["GlFetch", "GlSample", "GlUniform", "ClEach", "ClSame"] {
        assert!(wrong.iter().any(|wrong| wrong.starts_with(way)), "{way}");
    }
}
