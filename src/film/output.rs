//! Output files: their format by extension, a check before the work starts, and writing beside then renaming.

use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Error, Result};

/// An image file format, chosen by the output's extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// 8 bits a channel, tone-mapped to sRGB.
    Png,
    /// float32, linear radiance, ZIP compression.
    Exr,
}

impl Format {
    /// By extension, in any case of letters.
    ///
    /// # Errors
    /// [`Error::Usage`] for another extension, or none.
    pub fn of(path: &Path) -> Result<Format> {
        let extension = path.extension().and_then(OsStr::to_str).map(str::to_ascii_lowercase);
        match extension.as_deref() {
            Some("png") => Ok(Format::Png),
            Some("exr") => Ok(Format::Exr),
            Some(other) => Err(usage(path, format!("unknown image format .{other}, expected .png or .exr"))),
            None => Err(usage(path, "no extension that names an image format, expected .png or .exr")),
        }
    }
}

/// Finds out before hours of rendering whether [`super::Image::save`] will be able to write `path`: its extension is
/// known and [`check_directory`] holds.
///
/// # Errors
/// [`Error::Usage`], naming the path and the reason.
pub fn check_output(path: &Path) -> Result<Format> {
    let format = Format::of(path)?;
    check_directory(path)?;
    Ok(format)
}

/// Finds out whether [`write_beside`] will be able to write `path`, whatever its format: its directory exists and a
/// file can be made there (which is tried: permission bits say too little), and `path` is not a directory.
///
/// # Errors
/// [`Error::Usage`], naming the path and the reason.
pub fn check_directory(path: &Path) -> Result<()> {
    // The link's target counts, not the link; a name too long for the file system shows here, not at the rename.
    match path.metadata() {
        Ok(found) if found.is_dir() => {
            return Err(usage(path, "is a directory, expected a file's name"));
        }
        Ok(found) if !found.is_file() => return Err(usage(path, "is not a regular file")),
        Ok(_) => {}
        Err(error) if error.kind() == ErrorKind::NotFound => {}
        Err(error) => return Err(usage(path, error)),
    }
    let directory = directory_of(path);
    match directory.metadata() {
        Ok(found) if found.is_dir() => {}
        Ok(_) => {
            return Err(usage(path, format!("{} is not a directory", directory.display())));
        }
        Err(error) => {
            return Err(usage(path, format!("directory {}: {error}", directory.display())));
        }
    }
    let probe = temporary(&directory);
    probe.map_err(|error| usage(path, format!("cannot write to directory {}: {error}", directory.display())))?;
    Ok(())
}

/// Lets `write` fill a temporary file in the directory of `path`, then renames it to `path`. On any error the
/// temporary is removed and `path` is as it was; a symbolic link stays one and its target is replaced.
///
/// # Errors
/// [`Error::File`] with what the system or `write` answered.
pub fn write_beside(path: &Path, write: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>) -> Result<()> {
    let failed = |error: io::Error| Error::File { path: path.to_owned(), what: format!("cannot write: {error}") };
    let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let mut file = temporary(&directory_of(&target)).map_err(failed)?;
    fill(file.as_file_mut(), write).map_err(failed)?;
    file.persist(&target).map_err(|error| failed(error.error))?;
    Ok(())
}

fn fill(file: &mut File, write: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>) -> io::Result<()> {
    let mut buffered = BufWriter::new(&mut *file);
    write(&mut buffered)?;
    buffered.flush()?;
    drop(buffered);
    // A rename may reach the disk before the data does; a power cut would then leave an empty file under a good name.
    file.sync_all()
}

/// A file of its own name that removes itself unless it is persisted.
fn temporary(directory: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".photile-").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // As any new file, less the umask: the default of 0o600 would give an image that others cannot read.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(directory)
}

fn directory_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if parent.as_os_str().is_empty() => PathBuf::from("."),
        Some(parent) => parent.to_owned(),
        None => PathBuf::from("/"),
    }
}

fn usage(path: &Path, what: impl std::fmt::Display) -> Error {
    Error::Usage(format!("output {}: {what}", path.display()))
}
