//! Where drivers keep what they have compiled. A driver whose cache cannot be written may find no device (PoCL), or
//! compile everything at every start: such a one gets a directory of this program's own.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// A driver's cache: the variable that says where it is, and where it is without that.
struct Cache {
    variable: &'static str,
    /// Below the user's cache directory, or his home (`~`).
    usual: &'static str,
    /// The driver looks at `XDG_CACHE_HOME` too.
    xdg: bool,
}

/// As PoCL, Mesa, Intel's and NVIDIA's drivers document them.
const CACHES: [Cache; 4] = [
    Cache { variable: "POCL_CACHE_DIR", usual: "pocl", xdg: true },
    Cache { variable: "MESA_SHADER_CACHE_DIR", usual: "mesa_shader_cache", xdg: true },
    Cache { variable: "NEO_CACHE_DIR", usual: "neo_compiler_cache", xdg: true },
    Cache { variable: "CUDA_CACHE_PATH", usual: ".nv/ComputeCache", xdg: false },
];

/// Gives each driver whose cache cannot be written one that can. What was done, for the user; none where all is well.
///
/// To be called while the program has one thread, and before a driver is loaded.
pub fn prepare() -> Option<String> {
    let unwritable: Vec<&Cache> = CACHES.iter().filter(|cache| !is_writable(&cache.place())).collect();
    let first = unwritable.first()?.place();
    let Some(private) = private_directory() else {
        return Some(format!("drivers cannot keep what they compile: {} cannot be written", first.display()));
    };
    for cache in &unwritable {
        let own = private.join(cache.variable.to_lowercase());
        // The driver says more, should even this fail.
        let _ = fs::create_dir_all(&own);
        // SAFETY: there is no other thread yet that could read the environment meanwhile.
        unsafe { std::env::set_var(cache.variable, &own) };
    }
    Some(format!("{} cannot be written: drivers keep what they compile in {}", first.display(), private.display()))
}

impl Cache {
    fn place(&self) -> PathBuf {
        let named = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
        let home = || named("HOME").unwrap_or_else(|| PathBuf::from("/nonexistent"));
        match (named(self.variable), named("XDG_CACHE_HOME")) {
            (Some(own), _) => own,
            (None, Some(xdg)) if self.xdg => xdg.join(self.usual),
            (None, _) if self.xdg => home().join(".cache").join(self.usual),
            (None, _) => home().join(self.usual),
        }
    }
}

/// Whether files can be made in a directory, or in the nearest one above it that is there. A page is really written: an
/// empty file finds room on a full disk.
fn is_writable(directory: &Path) -> bool {
    let Some(there) = directory.ancestors().find(|above| above.exists()) else { return false };
    // A home that is not there was not meant to be made.
    let missing = directory.strip_prefix(there).map_or(0, |rest| rest.components().count());
    if missing > 3 || !there.is_dir() {
        return false;
    }
    let probe = tempfile::Builder::new().prefix(".photile-").tempfile_in(there);
    probe.and_then(|mut file| file.write_all(&[0; 4096])).is_ok()
}

/// A directory of this user's alone, below the system's temporary one, and the same at every start. Where somebody else
/// has taken its name, another: what drivers find in a cache, they run.
fn private_directory() -> Option<PathBuf> {
    let temporary = std::env::temp_dir();
    #[cfg(unix)]
    {
        use std::os::unix::fs::{DirBuilderExt as _, MetadataExt as _};
        let user = fs::metadata("/proc/self").map(|own| own.uid()).ok()?;
        let shared = temporary.join(format!("photile-cache-{user}"));
        // There already, as a rule.
        let _ = fs::DirBuilder::new().mode(0o700).create(&shared);
        if let Ok(found) = fs::symlink_metadata(&shared) {
            if found.is_dir() && found.uid() == user && found.mode() & 0o077 == 0 && is_writable(&shared) {
                return Some(shared);
            }
        }
    }
    tempfile::Builder::new().prefix("photile-cache-").tempdir_in(temporary).ok().map(tempfile::TempDir::keep)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directories_that_can_be_written_are_told_from_others() {
        let folder = tempfile::tempdir().unwrap();
        assert!(is_writable(folder.path()) && is_writable(&folder.path().join("cache/pocl")));
        assert!(!is_writable(Path::new("/proc/no/pocl")));
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        assert!(!is_writable(&file.join("pocl")), "a file is no directory");
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1, "nothing is left behind");
    }

    #[cfg(unix)]
    #[test]
    fn the_private_directory_is_the_users_own() {
        use std::os::unix::fs::MetadataExt as _;
        let own = private_directory().unwrap();
        assert_eq!(fs::metadata(own).unwrap().mode() & 0o077, 0);
    }
}
