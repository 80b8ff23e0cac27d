//! Stdout and stderr: closed ones end nothing, full ones are told of.

use std::fs::File;
use std::path::Path;
use std::process::{Command, Stdio};

use photile::film::Image;

use super::{ends, gi_ref, photile, quick, text};

/// A stream that nobody reads any more.
fn closed() -> Stdio {
    let mut reader = Command::new("true").stdin(Stdio::piped()).spawn().unwrap();
    let stream = reader.stdin.take().unwrap();
    reader.wait().unwrap();
    stream.into()
}

/// A stream that takes nothing, as a file on a full disk.
fn full() -> Stdio {
    File::options().write(true).open("/dev/full").unwrap().into()
}

#[test]
fn commands_whose_output_nobody_reads_end_with_their_own_code() {
    let (folder, scene) = (tempfile::tempdir().unwrap(), gi_ref());
    let source = ["plan", &scene, "--source", "trace.frag"];
    let json = ["render", &scene, "--backend", "cpu", "--size", "16x12", "--json"];
    let commands: [(&[&str], i32); 9] = [
        (&["doctor"], 0),
        (&["doctor", "--json"], 0),
        (&source, 0),
        (&["plan", &scene], 0),
        (&["--help"], 0),
        (&["--version"], 0),
        (&["render", "no/such/scene.toml"], 2),
        (&["render", "--no-such-option"], 2),
        (&json, 0),
    ];
    for (arguments, code) in commands {
        let whole = photile(folder.path(), arguments).output().unwrap();
        ends(&whole, code, &[]);
        let output = photile(folder.path(), arguments).stdout(closed()).stderr(Stdio::piped()).output().unwrap();
        ends(&output, code, &[]);
        assert!(!text(&output.stderr).contains("stdout"), "{arguments:?}: a closed stream is no error");
        let status = photile(folder.path(), arguments).stdout(closed()).stderr(closed()).status().unwrap();
        assert_eq!(status.code(), Some(code), "{arguments:?}, both closed");
    }
}

#[test]
fn a_full_stream_is_told_on_the_other_one() {
    let (folder, scene) = (tempfile::tempdir().unwrap(), gi_ref());
    let source = ["plan", &scene, "--source", "trace.frag"];
    for arguments in [&["doctor"][..], &source, &["--help"]] {
        let output = photile(folder.path(), arguments).stdout(full()).stderr(Stdio::piped()).output().unwrap();
        ends(&output, 1, &["stdout: cannot write: No space left"]);
    }
    // What was wrong before stays the worse.
    let status = photile(folder.path(), &["render", "none.toml"]).stderr(full()).status().unwrap();
    assert_eq!(status.code(), Some(2));
}

#[test]
fn the_picture_is_there_whatever_the_streams_are() {
    let scene = gi_ref();
    let picture = |folder: &Path| Image::load(&folder.join("out.png")).is_ok();
    let render = |folder: &Path| photile(folder, &quick(&scene, &["--passes", "3", "-o", "out.png", "--json"]));

    let folder = tempfile::tempdir().unwrap();
    let output = render(folder.path()).stdout(full()).stderr(Stdio::piped()).output().unwrap();
    ends(&output, 1, &["stdout: cannot write: No space left"]);
    assert!(picture(folder.path()));

    let folder = tempfile::tempdir().unwrap();
    let output = render(folder.path()).stdout(Stdio::piped()).stderr(full()).output().unwrap();
    ends(&output, 1, &[]);
    // Nothing is added to the object.
    assert!(serde_json::from_slice::<serde_json::Value>(&output.stdout).is_ok(), "{}", text(&output.stdout));
    assert!(picture(folder.path()));

    let folder = tempfile::tempdir().unwrap();
    let words = quick(&scene, &["-o", "out.png"]);
    let output = photile(folder.path(), &words).stdout(Stdio::piped()).stderr(full()).output().unwrap();
    ends(&output, 1, &[]);
    assert!(text(&output.stdout).contains("stderr: cannot write: No space left"), "{}", text(&output.stdout));
    assert!(picture(folder.path()));

    let folder = tempfile::tempdir().unwrap();
    let output = render(folder.path()).stdout(Stdio::piped()).stderr(closed()).output().unwrap();
    ends(&output, 0, &[]);
    assert!(picture(folder.path()) && !output.stdout.is_empty());

    // Closed before it began, `>&- 2>&- <&-`.
    let folder = tempfile::tempdir().unwrap();
    let closing = format!("exec \"$@\" {}", ">&- 2>&- <&-");
    let mut shell = Command::new("sh");
    shell.args(["-c", &closing, "sh", env!("CARGO_BIN_EXE_photile")]).current_dir(folder.path());
    let status = shell.args(quick(&scene, &["-o", "out.png", "--json"])).status().unwrap();
    assert!(status.success() && picture(folder.path()));
}

#[test]
fn tables_are_no_wider_than_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let stress = ["stress", "--suite", "special,random", "--size", "tiny", "--backend", "cpu"];
    for arguments in [&stress[..], &["bench", "gi_ref", "--suite", "speed", "--quick", "--backends", "cpu"]] {
        let output = photile(folder.path(), arguments).output().unwrap();
        ends(&output, 0, &[]);
        let stdout = text(&output.stdout);
        let widest = stdout.lines().map(|line| line.chars().count()).max().unwrap();
        assert!(widest <= 120 && stdout.lines().count() > 5, "{widest} columns:\n{stdout}");
    }
}
