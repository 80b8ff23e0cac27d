//! What may go wrong around the program: said in a sentence, with the right exit code, and nothing half-written.

use std::path::Path;
use std::process::{Command, Output};

use photile::cl::{self, Buffer, Context};
use photile::error::Error;
use photile::source::{Options, assemble_text};

use super::one_at_a_time;
use crate::common::missing;

const GI_REF: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/gi_ref.toml");

struct Run {
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

impl Run {
    fn of(Output { status, stdout, stderr }: Output) -> Run {
        let text = |bytes| String::from_utf8(bytes).unwrap();
        Run { code: status.code(), stdout: text(stdout), stderr: text(stderr) }
    }

    #[track_caller]
    fn ends(&self, code: i32, said: &[&str]) {
        assert_eq!(self.code, Some(code), "{}{}", self.stdout, self.stderr);
        assert!(!self.stderr.contains("panicked"), "{}", self.stderr);
        for words in said {
            assert!(self.stderr.contains(words), "not said: {words}\n{}", self.stderr);
        }
    }
}

fn photile(folder: &Path, arguments: &[&str]) -> Run {
    let mut command = Command::new(env!("CARGO_BIN_EXE_photile"));
    Run::of(command.current_dir(folder).args(arguments).output().unwrap())
}

#[test]
fn numbers_out_of_range_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (option, value, said) in [
        ("--size", "0x0", "WIDTHxHEIGHT"),
        ("--size", "65536x65536", "WIDTHxHEIGHT"),
        ("--photons", "0", "number of photons"),
        ("--photons", "2147483648", "number of photons"),
        ("--stored", "0", "number of photons"),
        ("--radius", "0", "radius in metres, > 0"),
        ("--radius", "nan", "radius in metres, > 0"),
        ("--radius", "inf", "radius in metres, > 0"),
        ("--radius", "1e-30", "radius in metres, > 0"),
    ] {
        photile(folder.path(), &["render", GI_REF, option, value]).ends(2, &[said]);
    }
    photile(folder.path(), &["render", GI_REF, "--radius=-1"]).ends(2, &["radius in metres, > 0"]);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_device_in_place_of_a_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink("/dev/full", folder.path().join("full.png")).unwrap();
    photile(folder.path(), &["render", GI_REF, "-o", "full.png", "--backend", "cpu"]).ends(2, &["not a regular file"]);
}

#[test]
fn a_full_disk_leaves_the_old_image() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("out.exr"), "old").unwrap();
    // A limit on files' size stands for a full disk: writes fail in the middle, with an error of the same kind.
    let script = format!(
        "trap '' XFSZ; ulimit -f 1; exec '{}' render '{GI_REF}' -o out.exr --backend cpu --light direct --size 96x64",
        env!("CARGO_BIN_EXE_photile")
    );
    let run = Run::of(Command::new("bash").arg("-c").arg(script).current_dir(folder.path()).output().unwrap());
    run.ends(1, &["out.exr: cannot write"]);
    assert_eq!(std::fs::read(folder.path().join("out.exr")).unwrap(), b"old");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "something is left behind");
}

#[test]
fn a_kernel_that_does_not_build_names_our_file_and_line() {
    let _one = one_at_a_time();
    let device = cl::devices(None).and_then(|mut devices| Context::new(devices.remove(0)));
    let Ok(context) = device.map_err(|error| missing("OpenCL", &error)) else { return };
    let text = "#include \"shim.cl\"\n__kernel void broken(__global float *x) {\n    x[0] = nope;\n}\n";
    let options = Options { defines: vec!["HAS_NOTHING".into()], ..Options::default() };
    let source = assemble_text("broken.cl", text, &options);
    let Err(error) = context.kernel(&source, "broken") else { panic!("nope is defined") };
    assert!(matches!(error, Error::Build { .. }) && error.exit_code() == 1);
    let said = error.to_string();
    for words in ["broken.cl [HAS_NOTHING] does not build on", "broken.cl:3", "nope"] {
        assert!(said.contains(words), "not said: {words}\n{said}");
    }
}

#[test]
fn memory_that_is_not_there_is_an_error_with_its_size() {
    let _one = one_at_a_time();
    let device = cl::devices(None).and_then(|mut devices| Context::new(devices.remove(0)));
    let Ok(context) = device.map_err(|error| missing("OpenCL", &error)) else { return };
    let bytes = 1usize << 46;
    match Buffer::<u8>::new(&context, bytes) {
        Err(Error::Device(said)) => assert!(said.contains("MiB") || said.contains(&bytes.to_string()), "{said}"),
        Err(error) => panic!("{error}"),
        Ok(_) => panic!("64 TiB were given"),
    }
    // And the device goes on working.
    assert_eq!(Buffer::from_slice(&context, &[1u32, 2]).unwrap().to_vec(&context).unwrap(), [1, 2]);
}

#[test]
fn limits_of_float32_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let usual = ["--backend", "cpu", "--size", "16x12", "--photons", "500", "--json"];
    let render = |radius: &[&str]| photile(folder.path(), &[&["render", GI_REF], &usual[..], radius].concat());
    let quiet = render(&[]);
    quiet.ends(0, &[]);
    let warnings = |run: &Run| serde_json::from_str::<serde_json::Value>(&run.stdout).unwrap()["warnings"].clone();
    assert_eq!(warnings(&quiet), serde_json::json!([]));
    let loud = render(&["--radius", "1e-5"]);
    loud.ends(0, &["warning: gather radius"]);
    assert!(warnings(&loud)[0].as_str().unwrap().contains("photons' places"));
}

#[test]
fn stress_says_what_fails_and_writes_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let usual = ["stress", "--size", "tiny", "--suite", "intersection", "--backend", "cpu"];
    let run = photile(folder.path(), &[&usual[..], &["--out", "found", "--json"]].concat());
    run.ends(0, &["stress.csv"]);
    let json: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(json["failed"], 0);
    assert!(json["rows"].as_array().unwrap().iter().all(|row| row["holds"] == true));
    for file in ["stress.csv", "stress.json", "intersection.svg", "intersection.png"] {
        assert!(folder.path().join("found").join(file).metadata().unwrap().len() > 100, "{file}");
    }
    photile(folder.path(), &[&usual[..], &["--inject", "naive-sphere"]].concat())
        .ends(1, &["bounds fail", "root, ulp"]);
    photile(folder.path(), &["stress", "--suite", "nope"]).ends(2, &["intersection, leaks"]);
    photile(folder.path(), &["stress", "--inject", "nope"]).ends(2, &["naive-sphere"]);
}
