//! Files: full disks, links, files that may only be read, directories that go.

use std::fs::Permissions;
use std::os::unix::fs::{PermissionsExt as _, symlink};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use photile::film::{Accumulator, Image};

use super::{ends, gi_ref, names, photile, photile_after, quick, text, until};

fn bytes(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap()
}

#[test]
fn a_finished_checkpoint_gives_the_picture_and_stays_as_it_is() {
    let (folder, scene) = (tempfile::tempdir().unwrap(), gi_ref());
    for limit in [&["--passes", "8"][..], &["--until-error", "0.5"], &[]] {
        let render = |output| {
            let arguments = quick(&scene, &["--checkpoint", "sums", "--json", "-o", output]);
            let output = photile(folder.path(), &[&arguments[..], limit].concat()).output().unwrap();
            ends(&output, 0, &[]);
            serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()["passes"].as_u64().unwrap()
        };
        let passes = render("first.exr");
        let sums = bytes(folder.path(), "sums");
        for _ in 0..2 {
            assert_eq!(render("again.exr"), passes, "{limit:?}");
            assert!(bytes(folder.path(), "again.exr") == bytes(folder.path(), "first.exr"), "{limit:?}");
            assert!(bytes(folder.path(), "sums") == sums, "{limit:?}");
        }
        std::fs::remove_file(folder.path().join("sums")).unwrap();
    }
    // More than is asked for is not less than it.
    let render = |passes| {
        let output = photile(folder.path(), &quick(&scene, &["--checkpoint", "sums", "--passes", passes])).output();
        ends(&output.unwrap(), 0, &[]);
        Accumulator::load(&folder.path().join("sums")).unwrap().passes()
    };
    assert_eq!((render("4"), render("2"), render("5")), (4, 4, 5));
}

#[test]
fn a_full_disk_under_the_checkpoint_takes_neither_the_picture_nor_the_sums() {
    let (folder, scene) = (tempfile::tempdir().unwrap(), gi_ref());
    std::fs::create_dir(folder.path().join("tmp")).unwrap();
    // A limit on files' size stands for a full disk: the sums have 600 kB, the picture a few. Nothing ignores the signal
    // that comes with it but the program.
    let arguments = quick(&scene, &["--passes", "3", "--checkpoint", "sums", "-o", "out.png"]);
    let output = photile_after("ulimit -f 100", folder.path(), &arguments).env("TMPDIR", "tmp").output().unwrap();
    ends(&output, 1, &["sums: cannot write"]);
    assert!(Image::load(&folder.path().join("out.png")).is_ok());
    assert_eq!(names(folder.path()), ["out.png", "tmp"]);
    // Where there is another disk, the sums are there.
    let Some(disk) = small_disk(folder.path()) else { return };
    let arguments = quick(&scene, &["--passes", "3", "--checkpoint", "disk/sums", "-o", "out.png"]);
    let output = photile(folder.path(), &arguments).env("TMPDIR", folder.path().join("tmp")).output().unwrap();
    drop(disk);
    ends(&output, 1, &["disk/sums: cannot write", "has it instead"]);
    let rescued = names(&folder.path().join("tmp"));
    let sums = Accumulator::load(&folder.path().join("tmp").join(&rescued[0])).unwrap();
    assert_eq!((sums.passes(), rescued.len()), (3, 1));
}

#[test]
fn a_picture_that_cannot_be_written_where_it_should_is_somewhere_else() {
    let (folder, scene) = (tempfile::tempdir().unwrap(), gi_ref());
    let temporary = folder.path().join("tmp");
    std::fs::create_dir(&temporary).unwrap();
    let rescued = || -> Vec<String> {
        let found = names(&temporary);
        found.iter().for_each(|name| std::fs::remove_file(temporary.join(name)).unwrap());
        found
    };
    // The directory goes while it renders; a file there becomes one that may only be read.
    for what in ["removed", "read-only"] {
        let directory = folder.path().join("pictures");
        std::fs::create_dir_all(&directory).unwrap();
        std::fs::write(directory.join("out.png"), "old").unwrap();
        let arguments = quick(&scene, &["--time", "1.5", "-o", "pictures/out.png"]);
        let mut command = photile(folder.path(), &arguments);
        let running = command.env("TMPDIR", &temporary).stderr(Stdio::piped()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(700));
        if what == "removed" {
            std::fs::remove_dir_all(&directory).unwrap();
        } else {
            std::fs::set_permissions(directory.join("out.png"), Permissions::from_mode(0o444)).unwrap();
        }
        let output = running.wait_with_output().unwrap();
        ends(&output, 1, &["pictures/out.png: cannot write", "has it instead"]);
        let found = rescued();
        assert!(found.len() == 1 && found[0].ends_with("-out.png"), "{found:?}");
        assert!(what == "removed" || bytes(&directory, "out.png") == b"old");
    }
    let Some(disk) = small_disk(folder.path()) else { return };
    let reference = ["reference", &scene, "--size", "64x48", "--spp", "8", "-o", "disk/out.exr"];
    let output = photile(folder.path(), &reference).env("TMPDIR", &temporary).output().unwrap();
    let left = names(&folder.path().join("disk"));
    drop(disk);
    ends(&output, 1, &["disk/out.exr: cannot write", "No space left", "has it instead"]);
    assert!(left.is_empty() && rescued().len() == 1);
}

#[test]
fn a_full_disk_leaves_no_table_unprinted() {
    let folder = tempfile::tempdir().unwrap();
    let Some(disk) = small_disk(folder.path()) else { return };
    std::fs::write(folder.path().join("disk/filler"), vec![0; 1 << 16]).unwrap_or(()); // as much as there is room for
    let temporary = folder.path().join("tmp");
    std::fs::create_dir(&temporary).unwrap();
    let bench = ["bench", "gi_ref", "--suite", "gather", "--quick", "--photons", "2k", "--csv", "disk/rows.csv"];
    let output = photile(folder.path(), &bench).env("TMPDIR", &temporary).output().unwrap();
    let stress = ["stress", "--suite", "random", "--size", "tiny", "--backend", "cpu", "-o", "disk"];
    let tables = photile(folder.path(), &stress).env("TMPDIR", &temporary).output().unwrap();
    drop(disk);
    ends(&output, 1, &["rows.csv: cannot write", "has it instead"]);
    assert!(text(&output.stdout).contains("gi_ref"));
    assert_eq!(names(&temporary).len(), 1);
    ends(&tables, 1, &["stress.csv: cannot write"]);
    assert!(text(&tables.stdout).contains("counters at limits"));
}

/// A disk of 64 kB at `disk`, if this user may have one; gone when dropped.
struct Disk(std::path::PathBuf);

fn small_disk(folder: &Path) -> Option<Disk> {
    let place = folder.join("disk");
    std::fs::create_dir_all(&place).unwrap();
    let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", "size=64k", "photile-test"]).arg(&place).output();
    if !mounted.is_ok_and(|output| output.status.success()) {
        eprintln!("SKIPPED in part: no right to mount a small disk");
        return None;
    }
    Some(Disk(place))
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status(); // lazily by the system, else
    }
}

#[test]
fn two_files_of_one_name_are_refused() {
    let (folder, scene) = (tempfile::tempdir().unwrap(), gi_ref());
    let place = folder.path();
    symlink("sums.exr", place.join("link.exr")).unwrap(); // to nothing yet
    std::fs::create_dir(place.join("sub")).unwrap();
    symlink(place, place.join("sub/here")).unwrap();
    for output in ["sums.exr", "./sums.exr", "sub/../sums.exr", "link.exr", "sub/here/sums.exr"] {
        let arguments = quick(&scene, &["--passes", "2", "--checkpoint", "sums.exr", "-o", output]);
        ends(&photile(place, &arguments).output().unwrap(), 2, &["is the file of -o, too"]);
        let reference = ["reference", &scene, "--spp", "8", "--checkpoint", "sums.exr", "-o", output];
        ends(&photile(place, &reference).output().unwrap(), 2, &["is the file of -o, too"]);
    }
    assert_eq!(names(place), ["link.exr", "sub"], "nothing was rendered");
    std::fs::write(place.join("one.exr"), "").unwrap();
    std::fs::hard_link(place.join("one.exr"), place.join("two.exr")).unwrap();
    let arguments = quick(&scene, &["--passes", "2", "--checkpoint", "one.exr", "-o", "two.exr"]);
    ends(&photile(place, &arguments).output().unwrap(), 2, &["is the file of -o, too"]);
    // A window would write a path over its own scene.
    std::fs::copy(&scene, place.join("room.toml")).unwrap();
    let view = photile(place, &["view", "room.toml", "--record", "./room.toml"]).output().unwrap();
    ends(&view, 2, &["--record ./room.toml", "is the file of the scene, too"]);
    // Files of their own are not.
    let arguments = quick(&scene, &["--passes", "2", "--checkpoint", "sums", "-o", "sums.exr"]);
    ends(&photile(place, &arguments).output().unwrap(), 0, &[]);
}

#[test]
fn links_are_written_through_and_files_keep_their_permissions() {
    let (folder, scene) = (tempfile::tempdir().unwrap(), gi_ref());
    let place = folder.path();
    std::fs::create_dir(place.join("sub")).unwrap();
    symlink("sub/link.png", place.join("out.png")).unwrap();
    symlink("target.png", place.join("sub/link.png")).unwrap();
    // To nothing at first, then to what the first run made.
    for _ in 0..2 {
        ends(&photile(place, &quick(&scene, &["-o", "out.png"])).output().unwrap(), 0, &[]);
        assert!(place.join("out.png").is_symlink() && place.join("sub/link.png").is_symlink());
        assert!(Image::load(&place.join("sub/target.png")).is_ok());
    }
    symlink("no/such/directory/x.png", place.join("lost.png")).unwrap();
    ends(&photile(place, &quick(&scene, &["-o", "lost.png"])).output().unwrap(), 2, &["lost.png", "no/such/directory"]);
    symlink("round.png", place.join("round.png")).unwrap();
    ends(&photile(place, &quick(&scene, &["-o", "round.png"])).output().unwrap(), 2, &["round.png", "symbolic links"]);

    std::fs::write(place.join("own.png"), "old").unwrap();
    std::fs::set_permissions(place.join("own.png"), Permissions::from_mode(0o600)).unwrap();
    ends(&photile(place, &quick(&scene, &["-o", "own.png"])).output().unwrap(), 0, &[]);
    assert_eq!(place.join("own.png").metadata().unwrap().permissions().mode() & 0o777, 0o600);
}

#[test]
fn files_that_may_only_be_read_are_refused_before_anything_is_rendered() {
    let (folder, scene) = (tempfile::tempdir().unwrap(), gi_ref());
    for name in ["out.png", "sums"] {
        std::fs::write(folder.path().join(name), "precious").unwrap();
        std::fs::set_permissions(folder.path().join(name), Permissions::from_mode(0o444)).unwrap();
    }
    let picture = photile(folder.path(), &quick(&scene, &["-o", "out.png"])).output().unwrap();
    ends(&picture, 2, &["out.png: may only be read"]);
    assert!(!text(&picture.stderr).contains("rendering"));
    let sums = quick(&scene, &["-o", "x.png", "--passes", "1", "--checkpoint", "sums"]);
    ends(&photile(folder.path(), &sums).output().unwrap(), 2, &["sums: may only be read"]);
    assert_eq!(names(folder.path()), ["out.png", "sums"]);
    assert!(names(folder.path()).iter().all(|name| bytes(folder.path(), name) == b"precious"));
}

#[test]
fn what_is_killed_leaves_the_last_checkpoint_whole() {
    let (folder, scene) = (tempfile::tempdir().unwrap(), gi_ref());
    let first = quick(&scene, &["--passes", "4", "--checkpoint", "sums", "-o", "out.exr"]);
    ends(&photile(folder.path(), &first).output().unwrap(), 0, &[]);
    let picture = bytes(folder.path(), "out.exr");
    let long = quick(&scene, &["--time", "600", "--checkpoint", "sums", "-o", "out.exr"]);
    let mut running = photile(folder.path(), &long).stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(500));
    running.kill().unwrap();
    let mut status = None;
    until("end", || {
        status = running.try_wait().unwrap();
        status.is_some()
    });
    assert!(Accumulator::load(&folder.path().join("sums")).unwrap().passes() >= 4);
    assert!(bytes(folder.path(), "out.exr") == picture);
}
