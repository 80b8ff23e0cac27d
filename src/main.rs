//! The `photile` program: see `photile --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    match photile::cli::run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("photile: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
