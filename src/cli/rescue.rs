//! What cannot be written where it should be: somewhere else, rather than lost.

use std::path::{Path, PathBuf};

use super::notice;
use crate::error::{Error, Result};

/// Writes a file that took long to make. Where that fails, because the disk is full, or the directory was removed or
/// became read-only meanwhile, the system's temporary directory gets it, under a name of its own.
///
/// # Errors
/// What `write` met at the place that was asked for: the file is not where it is expected, rescued or not.
pub fn written_somewhere(path: &Path, write: impl Fn(&Path) -> Result<()>) -> Result<()> {
    let error = match write(path) {
        Err(error @ Error::File { .. }) => error,
        result => return result,
    };
    let elsewhere = free_name(&std::env::temp_dir(), path);
    match write(&elsewhere) {
        Ok(()) => Err(Error::Failed(format!("{error}; {} has it instead", elsewhere.display()))),
        Err(second) => {
            notice(&second.to_string());
            Err(error)
        }
    }
}

/// `photile-PROCESS-NAME` there, which no other run has.
fn free_name(directory: &Path, path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    directory.join(format!("photile-{}-{name}", std::process::id()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fails_for_other_reasons_is_not_tried_again() {
        let failed = |_: &Path| Err(Error::Failed("a pixel is NaN".into()));
        assert_eq!(written_somewhere(Path::new("x.png"), failed).unwrap_err().to_string(), "a pixel is NaN");
    }
}
