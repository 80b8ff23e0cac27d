//! The scene parser under cargo-fuzz. The same body runs on stable Rust in `tests/stress/fuzz.rs`.

#![no_main]

mod body;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    body::parse(bytes);
});
