//! `photile bench` through the program itself, at sizes that take seconds.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn photile(arguments: &str) -> Output {
    let root = env!("CARGO_MANIFEST_DIR");
    Command::new(env!("CARGO_BIN_EXE_photile")).args(arguments.split(' ')).current_dir(root).output().unwrap()
}

/// What `--json` printed: one object and nothing else.
fn json(arguments: &str) -> Value {
    let output = photile(arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments}: {errors}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    for key in ["suite", "machine", "settings", "rows", "summaries"] {
        assert!(report.get(key).is_some(), "{key} in {report}");
    }
    assert!(report["machine"]["threads"].as_u64().unwrap() > 0);
    report
}

fn rows(report: &Value) -> &Vec<Value> {
    report["rows"].as_array().unwrap()
}

#[test]
fn speed_gives_every_stage_and_ratios_to_plain_kernels() {
    let directory = tempfile::tempdir().unwrap();
    let csv = directory.path().join("s.csv");
    // Without OpenGL: compiling its shaders in software takes longer than all the rest.
    let report = json(&format!(
        "bench box --quick --backends opencl,cpu --radii 0.3 --photons 2k --json --csv {}",
        csv.display()
    ));
    let rows = rows(&report);
    let of = |stage: &str, backend: &str| {
        rows.iter().filter(|row| row["stage"] == stage && row["backend"] == backend).collect::<Vec<_>>()
    };
    for (stage, times) in [("direct", 1), ("gather", 1), ("emission", 1), ("grid", 2)] {
        let of_cpu = of(stage, "cpu");
        assert_eq!(of_cpu.len(), times, "{stage}");
        for row in of_cpu {
            assert!(row["ms"].as_f64().unwrap() > 0.0 && row["rounds"].as_u64().unwrap() == 3, "{row}");
            assert!(row["least_ms"].as_f64() <= row["ms"].as_f64(), "{row}");
        }
    }
    let emission = of("emission", "cpu")[0];
    let rate = emission["count"].as_f64().unwrap() / emission["ms"].as_f64().unwrap() * 1e3;
    assert!((emission["per_second"].as_f64().unwrap() / rate - 1.0).abs() < 1e-9);
    // One lane or many: something in OpenCL is measured by itself.
    if report["settings"]["lanes"].is_u64() {
        assert!(rows.iter().any(|row| row["stage"] == "gather" && row["ratio_to_plain"] == 1.0));
        assert!(of("direct", "cpu")[0]["ratio_to_plain"].as_f64().unwrap() > 0.0);
    }
    let csv = std::fs::read_to_string(csv).unwrap();
    assert!(csv.starts_with("scene,stage,count,radius_m,backend,ms,"));
    assert_eq!(csv.lines().count(), rows.len() + 1);
}

#[test]
fn radius_marks_the_chosen_and_the_best_and_writes_files() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name).display().to_string();
    let reference = path("reference.exr");
    let made = photile(&format!("reference scenes/gi_ref.toml --size 32x24 --spp 64 -o {reference}"));
    assert!(made.status.success());
    let report = json(&format!(
        "bench gi_ref --suite radius --quick --backends cpu --reference {reference} --json -o {}",
        path("out")
    ));
    let rows = rows(&report);
    let marked = |key: &str| rows.iter().filter(|row| row[key] == true).collect::<Vec<_>>();
    let (auto, best) = (marked("is_auto"), marked("is_best"));
    assert_eq!((rows.len(), auto.len(), best.len()), (3, 1, 1));
    assert_eq!(auto[0]["factor"], 1.0);
    assert!(rows.iter().all(|row| row["rmse"].as_f64() >= best[0]["rmse"].as_f64()));
    // The picture is the reference's: a wrong one (mean radiance is about 1) would be off by its own size.
    assert!(best[0]["rmse"].as_f64().unwrap() < 0.5, "{}", best[0]);
    for name in ["radius.csv", "radius.json", "radius.svg", "radius.png"] {
        assert!(Path::new(&path("out")).join(name).metadata().unwrap().len() > 100, "{name}");
    }
}

#[test]
fn gather_tests_more_candidates_in_larger_cells() {
    let report = json("bench box --suite gather --quick --json");
    let rows = rows(&report);
    let ratios: Vec<f64> = rows.iter().map(|row| row["candidates_per_accepted"].as_f64().unwrap()).collect();
    // Rows are by radius, then by cells along it: 1, 2, 3, 4.
    for by_cells in ratios.chunks(4) {
        assert!(by_cells.windows(2).all(|pair| pair[0] > pair[1]), "{by_cells:?}");
        assert!(by_cells.iter().all(|ratio| *ratio >= 1.0), "a photon is accepted that was no candidate");
    }
    let accepted: Vec<f64> = rows.iter().map(|row| row["accepted"].as_f64().unwrap()).collect();
    assert!(accepted.chunks(4).all(|same| same.iter().all(|a| *a == same[0])), "cells change what is found");
}

#[test]
fn wrong_usage_is_told_and_ends_with_2() {
    for (arguments, expected) in [
        ("bench nowhere", "neither a file nor one of gi_ref"),
        ("bench nowhere.toml", "nowhere.toml"),
        ("bench box --suite radius", "no reference image"),
        ("bench gi_ref box --suite radius --reference a.exr", "--reference is one scene's"),
        ("bench gi_ref --suite radius --size 8x8", "--size asks for 8x8"),
        ("bench --suite speediest", "speediest"),
        ("bench --photons 0", "expected a number of photons"),
    ] {
        let output = photile(arguments);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {errors}");
        assert!(errors.contains(expected), "{arguments}: {errors}");
        assert!(output.stdout.is_empty());
    }
}
