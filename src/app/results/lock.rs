//! The lock that lets only one run at a time write to a result directory.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use super::{LOCK_FILE, ResultsError};

/// The first word of a lock file.
const BEGIN: &str = "process ";

/// Exclusive use of a result directory by this run until the lock is dropped.
///
/// The operating system releases the lock when the process ends, for whatever reason: a file left by a killed run does
/// not block other runs. Readers need no lock. On a network file system the lock works as far as the file system
/// supports it: NFS since version 4, and NFS of Linux, also between machines.
#[derive(Debug)]
pub struct DirectoryLock {
    path: PathBuf,
    file: Option<File>,
}

impl DirectoryLock {
    /// Locks a directory and creates it if necessary. If its file system cannot lock files, returns a warning instead.
    ///
    /// # Errors
    /// Returns [`ResultsError::Locked`] if another run holds the lock, [`ResultsError::UnknownOrigin`] if another file
    /// has the name of the lock file, or [`ResultsError::Write`] if the directory or the lock file cannot be written.
    pub fn acquire(dir: &Path) -> Result<(Self, Option<String>), ResultsError> {
        fs::create_dir_all(dir).map_err(ResultsError::write(dir))?;
        let path = dir.join(LOCK_FILE);
        loop {
            match fs::symlink_metadata(&path) {
                Ok(there) if !there.is_file() => {
                    return Err(ResultsError::UnknownOrigin(path, "is not a regular file, as the lock of a run is"));
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
                    return Err(ResultsError::Locked(dir.into(), holder));
                }
                Err(TryLockError::Error(error)) => {
                    let warning = format!(
                        "{}: cannot be locked: {error}; a second run there at the same time would not be noticed",
                        dir.display()
                    );
                    return Ok((Self { path, file: None }, Some(warning)));
                }
            }
            // The previous run may have removed the file after this process opened it and before it was locked.
            if is_at(&file, &path) {
                let mut old = String::new();
                let _ = (&mut file).take(1000).read_to_string(&mut old);
                if !old.is_empty() && !old.starts_with(BEGIN) {
                    return Err(ResultsError::UnknownOrigin(path, "is not the lock of a run"));
                }
                name_holder(&mut file).map_err(ResultsError::write(&path))?;
                return Ok((Self { path, file: Some(file) }, None));
            }
        }
    }
}

fn name_holder(file: &mut File) -> io::Result<()> {
    use std::io::Seek as _;

    // Only Linux has this file; elsewhere the process id has to suffice.
    let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let on = if host.trim().is_empty() { String::new() } else { format!(" on {}", host.trim()) };
    file.set_len(0)?;
    file.rewind()?;
    file.write_all(format!("{BEGIN}{}{on}\n", std::process::id()).as_bytes())
}

/// Returns true if `path` still refers to the open file `file`.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;

    let place = |there: std::io::Result<fs::Metadata>| there.map(|there| (there.dev(), there.ino())).ok();
    place(file.metadata()) == place(fs::metadata(path))
}

/// Always returns true: these systems do not remove an open file.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

impl Drop for DirectoryLock {
    fn drop(&mut self) {
        // The file is removed while still locked, so that no other run loses a file that it has just locked. Leaving it
        // behind would do no harm. If the folder was renamed meanwhile, another run may hold a new lock file at this
        // path.
        if cfg!(unix) && self.file.as_ref().is_some_and(|file| is_at(file, &self.path)) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_one_run_at_a_time_locks_a_directory() {
        let root = tempfile::tempdir().unwrap();
        let dir = root.path().join("results");
        let (own, warning) = DirectoryLock::acquire(&dir).unwrap();
        assert_eq!(warning, None);
        let said = DirectoryLock::acquire(&dir).unwrap_err().to_string();
        assert!(said.contains(&format!("in use by another run: process {}", std::process::id())), "{said}");
        drop(own);
        assert!(cfg!(not(unix)) || fs::read_dir(&dir).unwrap().count() == 0);
        // The file that a killed run leaves.
        fs::write(dir.join(LOCK_FILE), "process 1 on elsewhere\n").unwrap();
        let _own = DirectoryLock::acquire(&dir).unwrap();
        let holder = fs::read_to_string(dir.join(LOCK_FILE)).unwrap();
        assert!(holder.starts_with(&format!("process {}", std::process::id())) && holder.lines().count() == 1);
    }

    #[test]
    fn another_file_with_the_name_of_the_lock_stays() {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join(LOCK_FILE), "mine").unwrap();
        assert!(matches!(DirectoryLock::acquire(dir.path()), Err(ResultsError::UnknownOrigin { .. })));
        assert_eq!(fs::read_to_string(dir.path().join(LOCK_FILE)).unwrap(), "mine");
    }
}
