//! Signals: the first one saves what is done.

use std::io::{BufRead as _, BufReader, Read as _};
use std::os::unix::process::ExitStatusExt as _;
use std::process::{Child, Output, Stdio};
use std::time::Duration;

use photile::film::{Accumulator, Image};

use super::{ends, gi_ref, names, photile, photile_after, quick, send, text};

/// Starts it, and waits until it says so.
fn started(mut command: std::process::Command, said: &str) -> (Child, BufReader<std::process::ChildStderr>, String) {
    let mut running = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut stderr = BufReader::new(running.stderr.take().unwrap());
    let mut lines = String::new();
    while !lines.contains(said) {
        assert!(stderr.read_line(&mut lines).unwrap() > 0, "ended before it said {said}: {lines}");
    }
    (running, stderr, lines)
}

fn ended((running, mut stderr, mut lines): (Child, BufReader<std::process::ChildStderr>, String)) -> Output {
    stderr.read_to_string(&mut lines).unwrap();
    let output = running.wait_with_output().unwrap();
    Output { stderr: lines.into_bytes(), ..output }
}

#[test]
fn passes_are_saved_whatever_the_signal_and_go_on_to_the_same_bytes() {
    let scene = gi_ref();
    for signal in ["INT", "TERM", "HUP", "XCPU"] {
        let folder = tempfile::tempdir().unwrap();
        let passes = quick(&scene, &["--time", "600", "--checkpoint", "sums", "-o", "part.exr"]);
        let running = started(photile(folder.path(), &passes), "rendering in passes");
        send(signal, &running.0);
        let output = ended(running);
        ends(&output, 1, &[&format!("SIG{signal}: stopping after this pass"), "go on with --checkpoint sums"]);
        assert!(Image::load(&folder.path().join("part.exr")).is_ok());
        assert_eq!(names(folder.path()), ["part.exr", "sums"], "something is left behind");
        let wanted = (Accumulator::load(&folder.path().join("sums")).unwrap().passes() + 2).to_string();
        let on = quick(&scene, &["--passes", &wanted, "--checkpoint", "sums", "-o", "part.exr"]);
        ends(&photile(folder.path(), &on).output().unwrap(), 0, &["going on from sums"]);
        let whole = quick(&scene, &["--passes", &wanted, "-o", "whole.exr"]);
        ends(&photile(folder.path(), &whole).output().unwrap(), 0, &[]);
        let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
        assert!(bytes("part.exr") == bytes("whole.exr"), "{signal}");
    }
}

#[test]
fn what_is_ignored_from_the_start_stays_ignored() {
    let (folder, scene) = (tempfile::tempdir().unwrap(), gi_ref());
    let passes = quick(&scene, &["--time", "1", "-o", "out.png"]);
    let running = started(photile_after("trap '' HUP", folder.path(), &passes), "rendering in passes");
    send("HUP", &running.0);
    ends(&ended(running), 0, &["passes in"]);
}

#[test]
fn the_second_signal_ends_at_once() {
    let (folder, scene) = (tempfile::tempdir().unwrap(), gi_ref());
    // Passes that take minutes.
    let long = ["render", &scene, "--backend", "cpu", "--size", "4096x4096", "--spp", "64", "--light", "direct"];
    let passes = [&long[..], &["--passes", "2", "--checkpoint", "sums", "-o", "out.exr"]].concat();
    let mut running = started(photile(folder.path(), &passes), "rendering in passes");
    send("TERM", &running.0);
    while !running.2.contains("stopping") {
        assert!(running.1.read_line(&mut running.2).unwrap() > 0);
    }
    send("TERM", &running.0);
    ends(&ended(running), 143, &["SIGTERM"]);
    assert!(names(folder.path()).is_empty(), "something is left behind");
}

#[test]
fn a_single_picture_ends_by_the_signal_and_leaves_nothing() {
    let (folder, scene) = (tempfile::tempdir().unwrap(), gi_ref());
    std::fs::write(folder.path().join("out.exr"), "old").unwrap();
    let long = ["render", &scene, "--backend", "cpu", "--size", "4096x4096", "--spp", "64", "-o", "out.exr"];
    for (signal, number) in [("TERM", 15), ("HUP", 1), ("INT", 2)] {
        let running = started(photile(folder.path(), &long), "rendering with");
        send(signal, &running.0);
        // As the shell would report it if nobody had listened.
        assert_eq!(ended(running).status.signal(), Some(number));
        assert_eq!(std::fs::read(folder.path().join("out.exr")).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["out.exr"], "something is left behind");
    }
}

#[test]
fn a_reference_is_saved_and_goes_on() {
    let (folder, scene) = (tempfile::tempdir().unwrap(), gi_ref());
    let usual = ["reference", &scene, "--size", "32x24", "--threads", "1", "-o", "out.exr", "--spp"];
    let running = started(photile(folder.path(), &[&usual[..], &["1000000"]].concat()), "rendering 32x24");
    std::thread::sleep(Duration::from_millis(500));
    send("TERM", &running.0);
    ends(&ended(running), 1, &["interrupted after", "go on with --checkpoint out.checkpoint"]);
    let sums = Accumulator::load(&folder.path().join("out.checkpoint")).unwrap();
    assert!(sums.passes() > 0 && (sums.passes() < 8 || folder.path().join("out.exr").exists()));
    let wanted = sums.passes().next_multiple_of(8).to_string();
    let on = [&usual[..], &[&wanted, "--checkpoint", "out.checkpoint"]].concat();
    ends(&photile(folder.path(), &on).output().unwrap(), 0, &["going on from out.checkpoint"]);
}

/// Stops a command of many rows once it has some of them, which only time tells: later, where it had none.
fn stopped_with_rows(arguments: &[&str], table: &str) -> (Output, usize) {
    for milliseconds in [300, 600, 1200, 2400, 4800, 9600, 19_200] {
        let folder = tempfile::tempdir().unwrap();
        let running = photile(folder.path(), arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(milliseconds));
        send("TERM", &running);
        let output = running.wait_with_output().unwrap();
        let rows = std::fs::read_to_string(folder.path().join(table)).map_or(0, |csv| csv.lines().count());
        if rows > 1 {
            return (output, rows - 1);
        }
        ends(&output, 1, &["interrupted"]);
    }
    panic!("no row in all this time");
}

#[test]
fn a_bench_leaves_the_rows_that_it_has() {
    let radii = (1..=400).map(|i| format!("0.{i:03}")).collect::<Vec<_>>().join(",");
    let gather = ["bench", "gi_ref", "--suite", "gather", "--quick", "--photons", "5k", "--radii", &radii];
    let (output, rows) = stopped_with_rows(&[&gather[..], &["--csv", "rows.csv"]].concat(), "rows.csv");
    ends(&output, 1, &["SIGTERM: stopping after this row", "interrupted"]);
    assert!(text(&output.stdout).contains("gi_ref"), "the table is printed, too");
    assert!(rows < 400);
}

#[test]
fn stress_leaves_the_suites_that_it_has() {
    let suites = ["stress", "--suite", "random,intersection,leaks,offset", "--backend", "cpu", "--threads", "1"];
    let (output, _) = stopped_with_rows(&[&suites[..], &["--quick", "-o", "out"]].concat(), "out/stress.csv");
    ends(&output, 1, &["SIGTERM: stopping after this step", "interrupted before"]);
    assert!(text(&output.stdout).contains("rows, "), "the table is printed, too");
}
