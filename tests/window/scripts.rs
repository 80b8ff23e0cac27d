//! Scripts, in a window and without.

use std::process::Command;

use serde_json::Value;

use super::display::{BINARY, Display};
use crate::common;

#[test]
fn scripts_run_in_a_window_and_without() {
    let Some(display) = Display::open() else { return };
    let script = display.directory.path().join("path.toml");
    let keys = "step = 0.1\n[[keys]]\ntime = 0\nposition = [0, 0, 1]\nlook_at = [0, 0, 0]\n\
                [[keys]]\ntime = 2.9\nposition = [0.5, 0, 0]\nlook_at = [0, 0, -5]\nlight = [1, 2, -7]\n";
    std::fs::write(&script, keys).unwrap();
    let scene = common::scene_path("gi_ref");
    for headless in [false, true] {
        let mut command = Command::new(BINARY);
        command.arg("view").arg(&scene).arg("--script").arg(&script);
        command.args(["--json", "--size", "160x120", "--photons", "5k", "--no-panel"]);
        if headless {
            command.arg("--headless").env_remove("DISPLAY");
        } else {
            command.env("DISPLAY", &display.name);
        }
        let out = command.env_remove("WAYLAND_DISPLAY").output().unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let summary: Value = serde_json::from_slice(&out.stdout).unwrap();
        let replayed = if headless { &summary } else { &summary["replayed"] };
        assert_eq!(replayed["frame_ms"]["frames"], 30, "{summary}");
        let [p50, p99] = ["p50", "p99"].map(|p| replayed["frame_ms"][p].as_f64().unwrap());
        assert!(p50 > 0.0 && p99 >= p50, "{summary}");
        for objects in ["gl_objects", "cl_objects"] {
            assert!(replayed[objects][0].as_i64() >= Some(1), "{summary}");
        }
        // The grid's capacity may grow with a photon more; textures and programs may not.
        assert_eq!(replayed["gl_objects"][0], replayed["gl_objects"][1], "{summary}");
    }
}

#[test]
fn two_thousand_pictures_with_photons_of_their_own_leave_nothing_behind() {
    let directory = tempfile::tempdir().unwrap();
    let script = directory.path().join("path.toml");
    let shipped = common::scene_path("paths/gi_ref_light");
    let text = std::fs::read_to_string(shipped).unwrap().replace("step = 0.05", "step = 0.05\nrepeat = 7");
    std::fs::write(&script, text).unwrap();
    let table = directory.path().join("frames.csv");
    let out = Command::new(BINARY)
        .arg("view")
        .arg(common::scene_path("gi_ref"))
        .args(["--json", "--headless", "--size", "40x30", "--photons", "1k", "--script"])
        .arg(&script)
        .arg("--frames")
        .arg(&table)
        // Else the allocator keeps a megabyte more or less of what was freed, as it pleases.
        .envs([("MALLOC_MMAP_THRESHOLD_", "65536"), ("MALLOC_TRIM_THRESHOLD_", "131072")])
        .output()
        .unwrap();
    let err = String::from_utf8_lossy(&out.stderr);
    if !out.status.success() {
        return common::missing("OpenGL", &err);
    }
    let replayed: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(replayed["frame_ms"]["frames"], 2100, "{replayed}");
    for objects in ["gl_objects", "cl_objects"] {
        assert_eq!(replayed[objects][0], replayed[objects][1], "{objects}: {replayed}");
    }
    // From a quarter on: half a kilobyte a picture, where the smallest table of a map has four.
    let [then, now] = [0, 1].map(|i| replayed["memory_bytes"][i].as_i64().unwrap());
    assert!(now - then < 1575 * 512, "memory grew by {} bytes: {}", now - then, replayed["memory_curve_bytes"]);
    let lines = std::fs::read_to_string(&table).unwrap().lines().count();
    assert_eq!(lines, 2101, "a head, and a line a picture");
}
