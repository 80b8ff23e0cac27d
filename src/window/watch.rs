//! The scene file under watch: by its time and size, which also sees editors that write beside and rename.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use crate::scene::{self, Scene, SceneError};

/// How often the file is looked at.
const EVERY: Duration = Duration::from_millis(200);

/// What identifies a version of a file without reading it.
type Stamp = Option<(SystemTime, u64)>;

/// A watched scene file.
#[derive(Debug)]
pub struct Watch {
    path: PathBuf,
    /// Of the version that was read last.
    read: Stamp,
    /// Of the last look: a version is read once two looks agree, so that none is read half-written.
    seen: Stamp,
    looked: Instant,
}

impl Watch {
    /// Begins with the file as it is now.
    pub fn new(path: &Path) -> Watch {
        let stamp = stamp(path);
        Watch { path: path.to_owned(), read: stamp, seen: stamp, looked: Instant::now() }
    }

    /// The file's new content, when it is there.
    pub fn poll(&mut self, now: Instant) -> Option<Result<Scene, Box<SceneError>>> {
        if now.saturating_duration_since(self.looked) < EVERY {
            return None;
        }
        self.looked = now;
        let stamp = stamp(&self.path);
        let settled = stamp == self.seen;
        self.seen = stamp;
        // A file that is gone for a moment, between two steps of an editor, is no news.
        if !settled || stamp == self.read || stamp.is_none() {
            return None;
        }
        self.read = stamp;
        Some(scene::load(&self.path))
    }

    /// The file as it is now is known: the window wrote it itself.
    pub fn acknowledge(&mut self) {
        self.read = stamp(&self.path);
        self.seen = self.read;
    }
}

fn stamp(path: &Path) -> Stamp {
    let metadata = path.metadata().ok()?;
    Some((metadata.modified().ok()?, metadata.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "[camera]\nposition = [0, 0, 9]\nlook_at = [0, 0, 0]\n";

    #[test]
    fn changes_are_read_once_they_settle_and_errors_name_their_place() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("watched.toml");
        std::fs::write(&path, GOOD).unwrap();
        let mut watch = Watch::new(&path);
        let mut now = Instant::now();
        let mut look = |watch: &mut Watch| {
            now += EVERY;
            watch.poll(now)
        };
        assert!(look(&mut watch).is_none(), "nothing has changed");
        std::fs::write(&path, format!("{GOOD}fov_y = 60\n")).unwrap();
        assert!(look(&mut watch).is_none(), "it may still be written");
        assert_eq!(look(&mut watch).unwrap().unwrap().camera.fov_y, 60.0);
        assert!(look(&mut watch).is_none(), "read once");
        std::fs::write(&path, format!("{GOOD}fov_y = -60.0\n")).unwrap();
        look(&mut watch);
        let error = look(&mut watch).unwrap().unwrap_err();
        assert_eq!(error.position.map(|p| (p.line, p.column)), Some((4, 9)), "{error}");
        std::fs::remove_file(&path).unwrap();
        assert!(look(&mut watch).is_none() && look(&mut watch).is_none(), "gone is no news");
        std::fs::write(&path, GOOD).unwrap();
        watch.acknowledge();
        assert!(look(&mut watch).is_none(), "written by the window itself");
    }
}
