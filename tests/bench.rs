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
    let of = |method: &str, key: &str| -> Vec<f64> {
        rows.iter().filter(|row| row["method"] == method).map(|row| row[key].as_f64().unwrap()).collect()
    };
    let ratios = of("grid", "candidates_per_accepted");
    // Rows are by radius, then by cells along it: 1, 2, 3, 4; then 2 across rows, with finer ones along them, and what
    // fragments take: the same where photons are as few as here.
    for by_cells in ratios.chunks(6) {
        assert!(by_cells[..4].windows(2).all(|pair| pair[0] > pair[1]), "{by_cells:?}");
        assert!(by_cells[1] > by_cells[4] && by_cells[4] == by_cells[5], "finer along rows: {by_cells:?}");
        assert!(by_cells.iter().all(|ratio| *ratio >= 1.0), "a photon is accepted that was no candidate");
    }
    let accepted: Vec<f64> = rows.iter().map(|row| row["accepted"].as_f64().unwrap()).collect();
    // 6 sizes of cells, then 3 of tiles and of tiled grids: the same photons by all of them.
    assert!(accepted.chunks(12).all(|same| same.iter().all(|a| *a == same[0])), "cells change what is found");
    let [tiles, tiled] = ["tiles", "tiled-grid"].map(|method| of(method, "candidates_per_accepted"));
    assert!(tiles.iter().zip(&tiled).all(|(tiles, tiled)| (1.0..=*tiles).contains(tiled)), "{tiles:?}, {tiled:?}");
    assert!(tiles.chunks(3).all(|by_size| by_size.windows(2).all(|pair| pair[0] >= pair[1])), "{tiles:?}");
}

#[test]
fn the_report_goes_on_where_it_was_left() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("out");
    let command = format!("bench gi_ref --suite report --quick --backends cpu --json -o {}", out.display());
    let report = json(&command);
    let ways: Vec<&str> = rows(&report).iter().map(|row| row["way"].as_str().unwrap()).collect();
    assert_eq!(ways, ["direct", "grid", "tiles", "auto"]);
    let [direct, grid, tiles, auto] = [0, 1, 2, 3].map(|i| &rows(&report)[i]);
    // The report's own figures, its table's first row.
    assert_eq!((&direct["report_ms"], &grid["report_ms"]), (&13.0.into(), &Value::Null), "2000 photons are not there");
    assert_eq!((&grid["grid"], &tiles["tile"]), (&"60x40x40".into(), &"80x80".into()));
    assert!(tiles["build_ms"].as_f64() > Some(0.0) && grid["build_ms"].as_f64() == Some(0.0));
    assert!(auto["rel_mse"].as_f64() <= grid["rel_mse"].as_f64() && auto["radius_m"].as_f64() > Some(0.0));
    for name in ["report.csv", "report.json", "report-gi_ref-2k.svg", "report-gi_ref-2k.png"] {
        assert!(out.join(name).metadata().unwrap().len() > 100, "{name}");
    }

    // An earlier run's rows stay, what is missing is measured.
    let saved = out.join("report.json");
    let mut left: Value = serde_json::from_slice(&std::fs::read(&saved).unwrap()).unwrap();
    left["rows"].as_array_mut().unwrap().truncate(2);
    left["rows"][1]["frame_ms"] = 123.5.into();
    std::fs::write(&saved, left.to_string()).unwrap();
    let again = json(&command);
    assert_eq!((rows(&again).len(), &rows(&again)[1]["frame_ms"]), (4, &123.5.into()));

    // Another run's, or no run's, are not mixed with these.
    for (text, expected) in [
        (left.to_string().replace("\"rounds\":1,\"samples\"", "\"rounds\":9,\"samples\""), "other settings"),
        (left.to_string().replace("\"version\":\"", "\"version\":\"9."), "another machine's"),
        ("{}".to_string(), "no rows of this suite"),
    ] {
        std::fs::write(&saved, text).unwrap();
        let output = photile(&command);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{errors}");
        assert!(errors.contains(expected) && errors.contains("report.json"), "{errors}");
    }
}

#[test]
fn the_choice_is_judged_by_what_was_measured_and_judged_again_from_kept_rows() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("out");
    let command = format!("bench gi_ref --suite choice --quick --backends cpu --json -o {}", out.display());
    let report = json(&command);
    // The grid, and tiles and tiled grids of three sizes.
    assert_eq!(rows(&report).len(), 7);
    let times = |report: &Value| rows(report).iter().map(|row| row["ms"].as_f64().unwrap()).collect::<Vec<_>>();
    let least = times(&report).into_iter().fold(f64::INFINITY, f64::min);
    for row in rows(&report) {
        let expected = row["ms"].as_f64().unwrap() / least;
        assert!((row["over_best"].as_f64().unwrap() / expected - 1.0).abs() < 1e-9, "{row}");
    }
    // What is chosen is told from what is best: the kept rows say that another one was.
    let chosen = report["summaries"][0][0]["chosen"].clone();
    let saved = out.join("choice.json");
    let mut kept: Value = serde_json::from_slice(&std::fs::read(&saved).unwrap()).unwrap();
    for row in kept["rows"].as_array_mut().unwrap() {
        row["over_best"] = if row["gather"] == chosen { 3.25 } else { 1.0 }.into();
    }
    std::fs::write(&saved, kept.to_string()).unwrap();
    let again = json(&command);
    assert_eq!(times(&again), times(&report), "kept, not measured anew");
    assert_eq!(
        (&again["summaries"][0][0]["chosen"], &again["summaries"][0][0]["chosen/best"]),
        (&chosen, &3.25.into())
    );
    assert_eq!(again["summaries"][2][0]["within 15%"], 0);
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
        ("bench --suite report --radii 0.5", "has the report's"),
        ("bench --suite report --size 64x64", "expected one of the report's"),
    ] {
        let output = photile(arguments);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {errors}");
        assert!(errors.contains(expected), "{arguments}: {errors}");
        assert!(output.stdout.is_empty());
    }
}
