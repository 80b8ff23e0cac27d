//! Every way a run ends, and what becomes of what it holds: the rows of `docs/endings.md`.

#![cfg(unix)] // signals, limits and links are

mod devices;
mod disks;
mod screens;
mod signals;
mod streams;

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::common;

/// A room that takes a hundredth of a second.
const QUICK: [&str; 6] = ["--backend", "cpu", "--size", "64x48", "--photons", "2k"];

fn gi_ref() -> String {
    common::scene_path("gi_ref").display().to_string()
}

/// The program with some arguments, in a folder of its own.
fn photile(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_photile"));
    command.current_dir(folder).args(arguments).stdin(Stdio::null());
    command
}

/// The program after some lines of a shell, such as limits.
fn photile_after(script: &str, folder: &Path, arguments: &[&str]) -> Command {
    let mut shell = Command::new("bash");
    shell.args(["-c", &format!("{script}; exec \"$@\""), "bash", env!("CARGO_BIN_EXE_photile")]);
    shell.current_dir(folder).args(arguments).stdin(Stdio::null());
    shell
}

/// `render` of the room, with more arguments.
fn quick<'a>(scene: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["render", scene][..], &QUICK, more].concat()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// How it ended, and all these words stand on stderr; never a panic's.
#[track_caller]
fn ends(output: &Output, code: i32, said: &[&str]) {
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{}{stderr}", text(&output.stdout));
    assert!(!stderr.contains("panicked"), "{stderr}");
    for words in said {
        assert!(stderr.contains(words), "not said: {words}\n{stderr}");
    }
}

/// Names in a folder, sorted.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into()).collect();
    names.sort();
    names
}

/// Sends a signal by its name.
fn send(signal: &str, program: &Child) {
    // The shell's own kill: the program of that name is no part of a minimal system.
    let kill = Command::new("sh").args(["-c", &format!("kill -{signal} {}", program.id())]).status().unwrap();
    assert!(kill.success());
}

/// Waits until something holds.
#[track_caller]
fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < Duration::from_secs(60), "no {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// The page names a test for each row, and all of them are there.
#[test]
fn every_row_of_the_page_has_a_test() {
    let page = include_str!("../../docs/endings.md");
    let mut sources = String::new();
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("tests")];
    while let Some(folder) = folders.pop() {
        for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            match path.extension() {
                _ if path.is_dir() => folders.push(path),
                Some(extension) if extension == "rs" => sources += &std::fs::read_to_string(path).unwrap(),
                _ => {}
            }
        }
    }
    let rows = page.lines().filter(|line| line.starts_with("| ") && !line.ends_with("| tests |"));
    let mut count = 0;
    for row in rows {
        let tests = row.trim_end_matches('|').rsplit('|').next().unwrap();
        let names: Vec<&str> = tests.split('`').skip(1).step_by(2).collect();
        assert!(!names.is_empty() || row.contains("can be had again"), "no test: {row}");
        for name in names {
            assert!(sources.contains(&format!("fn {name}(")), "{name} is no test: {row}");
        }
        count += 1;
    }
    assert!(count > 25, "{count} rows");
}
