//! One run at a time writes into a result directory.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use super::{LOCK_FILE, ResultsError};

/// What a lock file begins with.
const BEGIN: &str = "process ";

/// A result directory that is this run's own until this is dropped.
///
/// The lock is one of the operating system's, which ends with the process however that ends: the file that a killed run
/// leaves behind stops no other. Readers need none. On a network file system it holds as far as that locks files: NFS
/// since version 4 and of Linux does, between machines too.
#[derive(Debug)]
pub struct DirectoryLock {
    path: PathBuf,
    file: Option<File>,
}

impl DirectoryLock {
    /// Takes a directory, which is made where there is none. Where its file system cannot lock files, there is a warning
    /// instead.
    ///
    /// # Errors
    /// [`ResultsError::Locked`] where another run has it; [`ResultsError::Foreign`] where the name of the lock file is taken;
    /// [`ResultsError::Write`].
    pub fn take(dir: &Path) -> Result<(Self, Option<String>), ResultsError> {
        fs::create_dir_all(dir).map_err(ResultsError::write(dir))?;
        let path = dir.join(LOCK_FILE);
        loop {
            match fs::symlink_metadata(&path) {
                Ok(there) if !there.is_file() => {
                    return Err(ResultsError::Foreign { path, what: "is no regular file, where a run keeps its lock" });
                }
                _ => {}
            }
            let open = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
            let mut file = open.map_err(ResultsError::write(&path))?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let mut holder = String::new();
                    // Some systems do not let another process read a locked file.
                    let _ = file.take(1000).read_to_string(&mut holder);
                    let holder = holder.trim().to_owned();
                    let is_known = holder.starts_with(BEGIN);
                    let holder = if is_known { holder } else { "a process that is starting or ending".into() };
                    return Err(ResultsError::Locked { path: dir.into(), holder });
                }
                Err(TryLockError::Error(error)) => {
                    let warning = format!(
                        "{}: cannot be locked: {error}; a second run there at the same time would not be noticed",
                        dir.display()
                    );
                    return Ok((Self { path, file: None }, Some(warning)));
                }
            }
            // The run before may have removed the file between its opening and its locking here.
            if is_at(&file, &path) {
                let mut old = String::new();
                let _ = (&mut file).take(1000).read_to_string(&mut old);
                if !old.is_empty() && !old.starts_with(BEGIN) {
                    return Err(ResultsError::Foreign { path, what: "is not the lock of a run" });
                }
                name_holder(&mut file).map_err(ResultsError::write(&path))?;
                return Ok((Self { path, file: Some(file) }, None));
            }
        }
    }
}

fn name_holder(file: &mut File) -> io::Result<()> {
    use std::io::Seek as _;

    // Linux; elsewhere the number of the process has to do.
    let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let on = if host.trim().is_empty() { String::new() } else { format!(" on {}", host.trim()) };
    file.set_len(0)?;
    file.rewind()?;
    file.write_all(format!("{BEGIN}{}{on}\n", std::process::id()).as_bytes())
}

/// Whether the file at `path` is this one.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;

    let place = |there: std::io::Result<fs::Metadata>| there.map(|there| (there.dev(), there.ino())).ok();
    place(file.metadata()) == place(fs::metadata(path))
}

/// A file that is open is not removed.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

impl Drop for DirectoryLock {
    fn drop(&mut self) {
        // While it is locked, so that no other run loses a file that it has locked. Left behind, it does no harm.
        // The folder may have another name by now, and another run a lock of this one.
        if cfg!(unix) && self.file.as_ref().is_some_and(|file| is_at(file, &self.path)) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_directory_has_one_owner_at_a_time() {
        let root = tempfile::tempdir().unwrap();
        let dir = root.path().join("results");
        let (own, warning) = DirectoryLock::take(&dir).unwrap();
        assert_eq!(warning, None);
        let said = DirectoryLock::take(&dir).unwrap_err().to_string();
        assert!(said.contains(&format!("in use by another run: process {}", std::process::id())), "{said}");
        drop(own);
        assert!(cfg!(not(unix)) || fs::read_dir(&dir).unwrap().count() == 0);
        // What a killed run leaves.
        fs::write(dir.join(LOCK_FILE), "process 1 on elsewhere\n").unwrap();
        let _own = DirectoryLock::take(&dir).unwrap();
        let holder = fs::read_to_string(dir.join(LOCK_FILE)).unwrap();
        assert!(holder.starts_with(&format!("process {}", std::process::id())) && holder.lines().count() == 1);
    }

    #[test]
    fn a_file_of_that_name_from_elsewhere_stays() {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join(LOCK_FILE), "mine").unwrap();
        assert!(matches!(DirectoryLock::take(dir.path()), Err(ResultsError::Foreign { .. })));
        assert_eq!(fs::read_to_string(dir.path().join(LOCK_FILE)).unwrap(), "mine");
    }
}
