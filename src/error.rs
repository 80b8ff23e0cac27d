//! One error type for the whole program; each variant knows its exit code.

use std::path::PathBuf;

use crate::reading::SceneError;

/// What can go wrong, in words that name file, permutation or device.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The scene file is wrong: file, line, column, what was found, what was expected.
    #[error(transparent)]
    Scene(#[from] Box<SceneError>),
    /// Options that cannot be honoured together, or values out of range.
    #[error("{0}")]
    Usage(String),
    /// A file could not be read or written.
    #[error("{path}: {what}", path = .path.display())]
    File {
        /// The file in question.
        path: PathBuf,
        /// What was attempted and what the system answered.
        what: String,
    },
    /// A driver, device or library is missing; the text says which package brings it.
    #[error("{0}")]
    Driver(String),
    /// A kernel or shader did not build; the log's lines are the source files' own.
    #[error("{unit} [{permutation}] does not build on {device}:\n{log}")]
    Build {
        /// `trace.frag`, `trace.cl` …
        unit: String,
        /// The `#define`s of this permutation.
        permutation: String,
        /// The device or GL renderer that refused.
        device: String,
        /// The driver's log, its lines mapped back to our files.
        log: String,
    },
    /// A device call failed while it ran.
    #[error("{0}")]
    Device(String),
    /// A device has no room for something; the text says how much.
    #[error("{0}: the device's memory is full; fewer --photons, a smaller --size or another --backend take less")]
    Memory(String),
    /// Something the user asked to be checked does not hold (validate, compare).
    #[error("{0}")]
    Failed(String),
}

impl Error {
    /// The process's exit code: 2 for wrong usage or bad input, 1 for all else.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Scene(_) | Error::Usage(_) => 2,
            _ => 1,
        }
    }
}

/// Shorthand for results with [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
