//! Scripts, in a window and without.

use std::process::Command;

use serde_json::Value;

use crate::common;
use crate::display::{BINARY, Display};

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
