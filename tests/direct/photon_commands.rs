//! The built program where pictures have photons: what `plan` foresees, that gathers agree, what `render` counts.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use super::command_line::{GI_REF, HIDDEN, run, run_with};
use crate::common::{missing, scene_path};

/// Few pixels, few photons.
const SMALL: [&str; 4] = ["--size", "48x36", "--photons", "3000"];

/// A scene's path.
fn path(name: &str) -> String {
    scene_path(name).display().to_string()
}

/// Key of a class's estimates in the plan's JSON, by the class's name.
const CLASSES: [(&str, &str); 5] = [
    ("opengl-gpu", "opengl"),
    ("opengl-software", "opengl_software"),
    ("opencl-gpu", "opencl"),
    ("opencl-lanes", "opencl_cpu"),
    ("cpu", "cpu"),
];

/// Of a class's estimates the method that costs least; checks that nothing is missing.
fn cheapest(plan: &Value, key: &str) -> String {
    let estimates = plan["gather"][key].as_array().unwrap_or_else(|| panic!("{key}: {plan}"));
    let methods: BTreeSet<_> = estimates.iter().map(|estimate| estimate["method"].as_str().unwrap()).collect();
    assert_eq!(methods, BTreeSet::from(["grid", "tiled-grid", "tiles"]), "{key}");
    for number in ["cost", "candidates", "entries"] {
        assert!(estimates.iter().all(|estimate| estimate[number].as_f64().unwrap() > 0.0), "{key}, {number}");
    }
    let costs: Vec<f64> = estimates.iter().map(|estimate| estimate["cost"].as_f64().unwrap()).collect();
    assert!(costs.is_sorted() && costs[0] < costs[costs.len() - 1], "{key}: {costs:?}");
    estimates[0]["method"].as_str().unwrap().to_string()
}

#[test]
fn plan_shows_for_every_class_which_method_is_used_and_render_uses_it() {
    let mut used = BTreeSet::new();
    for name in ["gi_ref", "sphere_and_plane"] {
        let scene = path(name);
        // No two methods' costs are within a tenth of each other.
        let setting = ["--size", "90x65", "--photons", "20k"];
        let planned = |more: &[&str]| run(&[&["plan", &scene], &setting[..], more].concat()).ends(0, &[]);
        let plan = planned(&["--json"]).json();
        let text = planned(&[]).stdout;
        for (class, key) in CLASSES {
            let method = cheapest(&plan, key);
            let words = |line: &str, verdict| line.split_whitespace().take(2).eq([verdict, class]);
            let marked = |verdict| text.lines().filter(move |line| words(line, verdict));
            let lines: Vec<&str> = marked("used").chain(marked("skipped")).collect();
            assert_eq!(lines.len(), 3, "a line a method: {text}");
            let chosen: Vec<&str> = marked("used").collect();
            assert_eq!(chosen.len(), 1, "{class}: {text}");
            assert!(chosen[0].contains(&format!(" {method} ")), "{class}: {method} is not what is marked: {text}");
            assert!(lines.iter().all(|line| line.contains("candidates a pixel") && line.contains("x the cost")));
        }
        let here = text.lines().find(|line| line.starts_with("  here ")).unwrap_or_else(|| panic!("{text}"));
        for backend in ["cpu", "opencl", "opengl"] {
            let arguments = [&["render", &scene, "--backend", backend, "--json", "-o", "x.exr"], &setting[..]].concat();
            let render = run(&arguments);
            let Some(class) = plan["gather"]["here"][backend].as_str() else {
                missing(backend, &plan["gather"]["here"]);
                assert_ne!(render.code, 0, "plan says that {backend} is not here");
                continue;
            };
            assert!(here.contains(&format!("{backend} is {class}")), "{here}");
            let (_, key) = CLASSES.iter().find(|(name, _)| *name == class).expect("a class");
            let gather = render.ends(0, &[]).json()["gather"].as_str().unwrap().to_string();
            assert_eq!(gather, cheapest(&plan, key), "{name}, {backend}");
            used.insert(gather);
        }
    }
    // Not the same one whatever the scene and the class.
    assert!(used.len() > 1, "{used:?}");
}

#[test]
fn plan_names_only_those_backends_whose_drivers_are_here() {
    let run = run_with(Path::new("/"), &HIDDEN, &[&["plan", GI_REF, "--json"], &SMALL[..]].concat()).ends(0, &[]);
    assert_eq!(run.json()["gather"]["here"], serde_json::json!({ "cpu": "cpu" }));
}

#[test]
fn plan_of_a_picture_without_photons_shows_no_methods() {
    let run = run(&["plan", GI_REF, "--light", "direct", "--json"]).ends(0, &[]);
    assert!(run.json()["gather"].is_null());
}

#[test]
fn gathers_of_a_backend_agree_on_the_reports_scenes() {
    for name in ["gi_ref", "sphere_and_plane"] {
        let scene = path(name);
        let arguments =
            [&["compare", &scene, "--gathers", "grid,tiles,brute", "--repeat", "1", "--json"], &SMALL[..]].concat();
        let json = run(&arguments).ends(0, &[]).json();
        let mut own = 0;
        for pair in json["pairs"].as_array().unwrap() {
            let [a, b] = ["a", "b"].map(|side| pair[side].as_str().unwrap().split_once('/').expect("backend/gather"));
            if a.0 == b.0 {
                assert_ne!(a.1, b.1);
                let off = pair["rmse_over_mean"].as_f64().unwrap();
                assert!(off <= 1e-4, "{name}: {pair}");
                own += 1;
            }
        }
        match own {
            9 => {}
            fewer => missing("OpenGL or OpenCL", &format!("{fewer} pairs of gathers in {json}")),
        }
    }
}

#[test]
fn gathers_of_different_things_differ() {
    let folder = tempfile::tempdir().unwrap();
    let scene = path("gi_ref");
    let render = |output: &str, more: &[&str]| {
        let arguments = [&["render", &scene, "--backend", "cpu", "-o", output], &SMALL[..], more].concat();
        run_with(folder.path(), &[], &arguments).ends(0, &[]);
    };
    render("grid.exr", &["--gather", "grid", "--radius", "0.8"]);
    render("same.exr", &["--gather", "brute", "--radius", "0.8"]);
    render("seed.exr", &["--gather", "brute", "--radius", "0.8", "--seed", "1"]);
    render("radius.exr", &["--gather", "brute", "--radius", "0.81"]);
    // The gathers' bound: 1e-4 of this picture's mean, which is 0.6.
    let compare = |other: &str| run_with(folder.path(), &[], &["compare", "grid.exr", other, "--max-rmse", "6e-5"]);
    compare("same.exr").ends(0, &[]);
    compare("seed.exr").ends(1, &["found RMSE"]);
    compare("radius.exr").ends(1, &["found RMSE"]);
}

#[test]
fn render_counts_what_it_uploads() {
    let uploads = |backend: &str, more: &[&str]| {
        let arguments = [&["render", GI_REF, "--backend", backend, "--json", "-o", "x.exr"], &SMALL[..], more].concat();
        let run = run(&arguments);
        if run.code != 0 {
            missing(backend, &run.stderr);
            return None;
        }
        Some(run.json()["uploads"].as_u64().expect("a number"))
    };
    if let Some(grid) = uploads("opengl", &["--gather", "grid"]) {
        // Positions, powers and the table of cells at least; hardly more tables than a map has.
        assert!((3..20).contains(&grid), "{grid}");
    }
    // Without photons there is no map, and without OpenGL no texture.
    assert!(uploads("opengl", &["--light", "direct"]).is_none_or(|direct| direct == 0));
    assert_eq!(uploads("cpu", &["--gather", "grid"]), Some(0));
}
