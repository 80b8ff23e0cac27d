//! Output files: their format by extension, a check before the work starts, and writing beside then renaming.

use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

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
/// file can be made there (which is tried: permission bits say too little), and what is there already is a file that may
/// be written. Of a symbolic link its target counts, whether that exists or not.
///
/// # Errors
/// [`Error::Usage`], naming the path and the reason.
pub fn check_directory(path: &Path) -> Result<()> {
    let target = check_target(path).map_err(|what| usage(path, what))?;
    let directory = directory_of(&target);
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

/// Finds out whether files that are written have a name each: links, `./` and hard links looked through. Each comes with
/// the option that names it.
///
/// # Errors
/// [`Error::Usage`] with both options.
pub fn check_distinct(files: &[(&str, Option<&Path>)]) -> Result<()> {
    let named: Vec<(&str, &Path)> = files.iter().filter_map(|(option, path)| Some((*option, (*path)?))).collect();
    for (i, (option, path)) in named.iter().enumerate() {
        for (other, taken) in &named[..i] {
            if is_same_file(path, taken) {
                let both = format!("is the file of {other}, too; expected one for each");
                return Err(Error::Usage(format!("{option} {}: {both}", path.display())));
            }
        }
    }
    Ok(())
}

fn is_same_file(a: &Path, b: &Path) -> bool {
    let place = |path: &Path| {
        let target = target_of(path).ok()?;
        Some(directory_of(&target).canonicalize().ok()?.join(target.file_name()?))
    };
    #[cfg(unix)]
    if let (Ok(a), Ok(b)) = (a.metadata(), b.metadata()) {
        use std::os::unix::fs::MetadataExt;
        return (a.dev(), a.ino()) == (b.dev(), b.ino());
    }
    place(a).is_some_and(|a| Some(a) == place(b))
}

/// Where a path leads by way of symbolic links, whether there is anything at their end or not.
fn target_of(path: &Path) -> io::Result<PathBuf> {
    let mut target = path.to_owned();
    // As many as Linux follows.
    for _ in 0..40 {
        match target.read_link() {
            Ok(next) => target = directory_of(&target).join(next),
            Err(_) => return Ok(target), // no link, or nothing there
        }
    }
    Err(io::Error::other("too many symbolic links"))
}

/// The file that is written in the end, which may be replaced if it is there.
fn check_target(path: &Path) -> std::result::Result<PathBuf, String> {
    let target = target_of(path).map_err(|error| error.to_string())?;
    // A name too long for the file system shows here, not at the rename.
    match target.metadata() {
        Ok(found) if found.is_dir() => Err("is a directory, expected a file's name".into()),
        Ok(found) if !found.is_file() => Err("is not a regular file".into()),
        // A rename asks the directory alone; who made the file read-only meant the file. Whoever may write everywhere
        // finds the bits in the way nevertheless.
        Ok(found) if found.permissions().readonly() => Err("may only be read".into()),
        Ok(_) => match File::options().append(true).open(&target) {
            Ok(_) => Ok(target),
            Err(error) => Err(format!("may not be written: {error}")),
        },
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(target),
        Err(error) => Err(error.to_string()),
    }
}

/// Files in the making, which a program that ends on a signal must not leave behind.
static WRITING: Mutex<()> = Mutex::new(());

/// Waits until no file is in the making, and lets none be begun any more: for a program about to end. A disk that does not
/// answer is not waited for longer than two seconds.
pub fn finish_writing() {
    let since = Instant::now();
    while since.elapsed() < Duration::from_secs(2) {
        if let Ok(alone) = WRITING.try_lock() {
            std::mem::forget(alone);
            return;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Lets `write` fill a temporary file in the directory of `path`, then renames it to `path`. On any error the
/// temporary is removed and `path` is as it was; a symbolic link stays one and its target is replaced, or made. A file
/// that is replaced keeps its permissions.
///
/// # Errors
/// [`Error::File`] with what the system or `write` answered.
pub fn write_beside(path: &Path, write: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>) -> Result<()> {
    let failed = |what: String| Error::File { path: path.to_owned(), what: format!("cannot write: {what}") };
    let target = check_target(path).map_err(failed)?;
    let failed = |error: io::Error| failed(error.to_string());
    let _alone = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
    let mut file = temporary(&directory_of(&target)).map_err(failed)?;
    fill(file.as_file_mut(), write).map_err(failed)?;
    if let Ok(replaced) = target.metadata() {
        // Some file systems have none to set.
        let _ = file.as_file().set_permissions(replaced.permissions());
    }
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
