//! Drivers that abort, crash, or cannot keep what they compile; sizes that they cannot hold; devices by number.

use std::path::Path;
use std::process::Output;

use photile::film::Image;

use super::{ends, gi_ref, photile, photile_after, text};
use crate::common;

/// `render` of a small picture with photons, wherever it can be made.
const ANYWHERE: [&str; 5] = ["--size", "48x36", "--photons", "2k", "-o"];

/// Whether the OpenCL driver is PoCL, whose ways to end a program are known.
fn is_pocl(folder: &Path) -> bool {
    let output = photile(folder, &["doctor", "--json"]).output().unwrap();
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let found = report["findings"].as_array().unwrap().iter().any(|finding| {
        let route = finding["route"].as_str().unwrap();
        finding["api"] == "OpenCL" && finding["works"] == true && route.contains("Portable Computing Language")
    });
    if !found {
        common::missing("PoCL", &text(&output.stdout));
    }
    found
}

fn render(folder: &Path, more: &[&str], script: &str, cache: &Path) -> Output {
    let scene = gi_ref();
    let arguments = [&["render", &scene][..], &ANYWHERE, &["out.exr"], more].concat();
    photile_after(script, folder, &arguments).env("POCL_CACHE_DIR", cache).output().unwrap()
}

/// Halves every file below a folder whose path has these words.
fn halve(folder: &Path, words: &str) -> usize {
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            count += halve(&entry, words);
        } else if entry.display().to_string().contains(words) {
            let file = std::fs::File::options().write(true).open(&entry).unwrap();
            file.set_len(entry.metadata().unwrap().len() / 2).unwrap();
            count += 1;
        }
    }
    count
}

#[test]
fn a_driver_that_aborts_or_crashes_is_passed_over_with_its_reason() {
    let folder = tempfile::tempdir().unwrap();
    if !is_pocl(folder.path()) {
        return;
    }
    let cache = folder.path().join("cache");
    let opencl = ["--backend", "opencl"];
    ends(&render(folder.path(), &opencl, ":", &cache), 0, &["rendering with opencl (asked for)"]);
    // One kernel's library, which is no longer what it says: the driver crashes when it is already in use.
    assert!(halve(&cache, "photons_record") > 0);
    let output = render(folder.path(), &opencl, ":", &cache);
    ends(&output, 1, &["OpenCL's driver was in use when the program crashed"]);
    let output = render(folder.path(), &[], ":", &cache);
    ends(&output, 0, &["OpenCL's driver was in use when the program crashed", "begun anew without it"]);
    assert!(Image::load(&folder.path().join("out.exr")).is_ok());
    // All that it has: it aborts when it is tried, in a child.
    assert!(halve(&cache, "") > 5);
    let output = render(folder.path(), &[], ":", &cache);
    ends(&output, 0, &["passed over", "its driver aborts (SIGABRT)", "Assertion"]);
    ends(&render(folder.path(), &opencl, ":", &cache), 1, &["its driver aborts (SIGABRT)", "Assertion"]);
    let doctor = photile(folder.path(), &["doctor"]).env("POCL_CACHE_DIR", &cache).output().unwrap();
    ends(&doctor, 0, &[]);
    assert!(text(&doctor.stdout).contains("OpenCL  FAILS  #1 of"), "{}", text(&doctor.stdout));
}

#[test]
fn without_a_linker_the_next_backend_renders() {
    let folder = tempfile::tempdir().unwrap();
    if !is_pocl(folder.path()) {
        return;
    }
    let cache = folder.path().join("cache");
    // Whether the tiny kernel that devices are tried with is in the cache or not.
    for _ in 0..2 {
        let output = render(folder.path(), &[], "PATH=/nonexistent", &cache);
        ends(&output, 0, &["passed over", "its driver aborts", "\"ld\" doesn't exist"]);
        assert!(!text(&output.stderr).contains("rendering with opencl"));
        ends(&render(folder.path(), &["--backend", "opencl"], "PATH=/nonexistent", &cache), 1, &["\"ld\" doesn't"]);
        let doctor = photile(folder.path(), &["doctor"]).env("POCL_CACHE_DIR", &cache).output().unwrap();
        ends(&doctor, 0, &[]);
    }
}

#[test]
fn little_address_space_is_no_end() {
    // From too little for any driver to enough for one of them; side by side, since a driver that hangs is waited for.
    std::thread::scope(|scope| {
        for megabytes in [200, 300, 400, 800] {
            scope.spawn(move || {
                let folder = tempfile::tempdir().unwrap();
                let limit = format!("ulimit -v {megabytes}000");
                let output = render(folder.path(), &[], &limit, &folder.path().join("cache"));
                ends(&output, 0, &["rendering with"]);
                assert!(Image::load(&folder.path().join("out.exr")).is_ok(), "{megabytes} MB");
            });
        }
    });
}

#[test]
fn a_cache_that_cannot_be_written_is_replaced() {
    let folder = tempfile::tempdir().unwrap();
    if !is_pocl(folder.path()) {
        return;
    }
    let scene = gi_ref();
    let arguments = [&["render", &scene, "--backend", "opencl"][..], &ANYWHERE, &["out.exr"]].concat();
    let temporary = folder.path().join("tmp");
    std::fs::create_dir(&temporary).unwrap();
    // /proc takes no directory from anybody, root included.
    for (name, value) in [("HOME", "/proc/nobody"), ("XDG_CACHE_HOME", "/proc/none"), ("POCL_CACHE_DIR", "/proc/none")]
    {
        let mut command = photile(folder.path(), &arguments);
        command.env_remove("POCL_CACHE_DIR").env_remove("XDG_CACHE_HOME").env(name, value).env("TMPDIR", &temporary);
        let output = command.output().unwrap();
        ends(&output, 0, &["cannot be written: drivers keep what they compile in", "rendering with opencl"]);
        let own = std::fs::read_dir(&temporary).unwrap().next().unwrap().unwrap().path();
        assert!(own.join("pocl_cache_dir").read_dir().unwrap().count() > 0, "{name}: nothing is kept there");
    }
}

#[test]
fn sizes_beyond_a_drivers_limit_go_on_to_the_next_backend() {
    let (folder, scene) = (tempfile::tempdir().unwrap(), gi_ref());
    let opengl = common::open(photile::settings::Backend::OpenGl);
    if opengl.is_none() {
        return;
    }
    drop(opengl);
    // Larger than any driver of OpenGL draws into is what the command line takes at most.
    let wide = ["render", &scene, "--size", "32768x2", "--light", "direct", "-o", "out.png"];
    let output = photile(folder.path(), &wide).output().unwrap();
    if text(&output.stderr).contains("rendering with opengl") {
        eprintln!("SKIPPED: this driver draws 32768 pixels a row");
        return;
    }
    ends(&output, 0, &["falling back from opengl to OpenCL", "the driver's limit is", "rendering with"]);
    assert_eq!(Image::load(&folder.path().join("out.png")).unwrap().width, 32768);
    let asked = photile(folder.path(), &[&wide[..], &["--backend", "opengl"]].concat()).output().unwrap();
    ends(&asked, 1, &["the driver's limit is"]);
}

#[test]
fn devices_of_one_name_are_told_apart_by_number() {
    let folder = tempfile::tempdir().unwrap();
    if !is_pocl(folder.path()) {
        return;
    }
    let scene = gi_ref();
    let run = |arguments: &[&str]| photile(folder.path(), arguments).env("POCL_DEVICES", "pthread pthread").output();
    let doctor = text(&run(&["doctor"]).unwrap().stdout);
    assert!(doctor.contains("#1 of") && doctor.contains("#2 of"), "{doctor}");
    let render = |device: &str| {
        run(&["render", &scene, "--backend", "opencl", "--size", "8x6", "--light", "direct", "--device", device])
            .unwrap()
    };
    for device in ["1", "2", "#1", "#2", "pthread", "PORTABLE"] {
        ends(&render(device), 0, &["rendering with opencl (asked for) on"]);
    }
    ends(&render("#3"), 2, &["no OpenCL device matches '#3'", "#1 '", "#2 '"]);
    ends(&render(""), 2, &["found nothing"]);
    // Photons' device is named wherever the picture is drawn.
    let output = run(&["render", &scene, "--size", "8x6", "--photons", "1k"]).unwrap();
    ends(&output, 0, &["photons by OpenCL on"]);
}

/// With a fault of the device on purpose; see `src/device/injected_faults.rs`.
fn faulty(fault: &str, folder: &Path, arguments: &[&str]) -> Output {
    photile(folder, arguments).env("PHOTILE_FAULT", fault).output().unwrap()
}

#[test]
fn passes_are_kept_when_the_device_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    if !is_pocl(folder.path()) {
        return;
    }
    let scene = gi_ref();
    let usual = [&["render", &scene, "--backend", "opencl", "--technique", "map"][..], &ANYWHERE].concat();
    let lost = faulty("opencl-lost=60", folder.path(), &[&usual[..], &["out.exr", "--passes", "64"]].concat());
    ends(&lost, 1, &["the device was lost", "passes: out.exr holds what was done"]);
    assert!(Image::load(&folder.path().join("out.exr")).is_ok());
    // With a checkpoint it goes on to the bytes of a render that nothing befell.
    let passes = [&usual[..], &["part.exr", "--checkpoint", "sums", "--passes", "12"]].concat();
    ends(
        &faulty("opencl-lost=60", folder.path(), &passes),
        1,
        &["the device was lost", "go on with --checkpoint sums"],
    );
    ends(&faulty("none=0", folder.path(), &passes), 0, &["going on from sums"]);
    ends(&faulty("none=0", folder.path(), &[&usual[..], &["whole.exr", "--passes", "12"]].concat()), 0, &[]);
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert!(bytes("part.exr") == bytes("whole.exr"));
}

#[test]
fn stress_keeps_its_rows_when_the_device_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    if !is_pocl(folder.path()) {
        return;
    }
    // Suites launch few kernels before the last one, which renders.
    let stress = ["stress", "--suite", "random,special", "--size", "tiny", "--backend", "opencl", "-o", "out"];
    let lost = faulty("opencl-lost=12", folder.path(), &stress);
    ends(&lost, 1, &["special: ", "the device was lost"]);
    let rows = std::fs::read_to_string(folder.path().join("out/stress.csv")).unwrap();
    assert!(rows.contains("random,") && !rows.contains("special,"), "{rows}");
    assert!(text(&lost.stdout).contains("counters at limits"));
}

#[test]
fn what_a_drivers_compiler_warns_of_is_not_the_users() {
    let folder = tempfile::tempdir().unwrap();
    if !is_pocl(folder.path()) {
        return;
    }
    let stress = ["stress", "--suite", "leaks", "--size", "tiny", "--backend", "opencl"];
    // Nothing is in the cache, so it compiles.
    let output = photile(folder.path(), &stress).env("POCL_CACHE_DIR", folder.path()).output().unwrap();
    ends(&output, 0, &[]);
    assert!(!text(&output.stderr).contains("warning"), "{}", text(&output.stderr));
}
