//! All integration tests, in one program: ten of them took longer to link than most of their tests take to run.
//!
//! `cargo test --release --test all direct::` runs one of its modules. `scripts/test` gives every test a process of its
//! own, so that two that need the drivers run side by side; in one process they wait for each other, see
//! [`common::one_at_a_time`].

mod bench;
mod common;
mod direct;
mod endings;
mod golden;
mod house;
mod photon_map;
mod photons;
mod progressive;
mod quads;
mod reference;
mod scene;
mod stress;
mod window;

/// Cargo finds no test by itself here, so a file that nobody names above would be left out silently.
#[test]
fn every_file_is_a_module() {
    let named = include_str!("main.rs");
    let mut modules = 0;
    for entry in std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/tests")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        if name != "main" && (path.join("mod.rs").exists() || path.extension().is_some_and(|e| e == "rs")) {
            assert!(named.contains(&format!("\nmod {name};\n")), "tests/main.rs does not name {}", path.display());
            modules += 1;
        }
    }
    assert!(modules >= 12, "{modules}");
}
