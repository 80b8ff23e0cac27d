//! The `photile` program: see `photile --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    photile::cli::run()
}
