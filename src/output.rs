//! Atomic file output: a reader sees either the old file or the new one, never a part of it. Only regular files are
//! replaced.
//!
//! [`write()`] and [`write_by`] write files that a user names: they follow symbolic links and write directly to a
//! device or a pipe. `replace_by` writes the files of a result directory, which are regular files with known names.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tempfile::Builder;

/// The number of symbolic links that Linux follows.
const MAX_LINKS: usize = 40;

/// Writes `bytes` to the file named by the user; see [`write_by`].
///
/// # Errors
/// Returns the error of the operating system.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    write_by(path, |file| file.write_all(bytes))
}

/// Calls `write` to write the file named by the user. A regular file keeps its old content until the new content is
/// complete, also if writing fails. If `path` is a symbolic link, the link stays and its target is written. A device or
/// a pipe is opened and written directly.
///
/// # Errors
/// Returns the error of the operating system or of `write`.
pub fn write_by(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<()> {
    match regular_file(path)? {
        Some(file) => replace_by(&file, write),
        None => {
            // Appends: standard output may be redirected to a regular file that other processes also write to.
            let mut file = OpenOptions::new().append(true).open(path)?;
            write(&mut file)
        }
    }
}

/// Returns true if `path` is a device or a pipe; no file can be written beside it.
pub fn is_stream(path: &Path) -> bool {
    matches!(regular_file(path), Ok(None))
}

/// Returns the regular file, which is replaced as a whole or created, at the end of all symbolic links; `None` for a
/// device, a pipe, or an open file of this process such as `/dev/stdout`.
fn regular_file(path: &Path) -> io::Result<Option<PathBuf>> {
    match fs::metadata(path) {
        Ok(there) if there.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
        Ok(there) if !there.is_file() => return Ok(None),
        _ => {}
    }
    let end = resolve_links(path)?;
    // The open files of a process have no name other than these links.
    Ok((!end.is_symlink()).then_some(end))
}

/// Follows the symbolic links at the end of `path`, except those of open files in `/proc` and `/dev`.
pub(crate) fn resolve_links(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_path_buf();
    for _ in 0..MAX_LINKS {
        match fs::read_link(&path) {
            Ok(next) if !path.starts_with("/proc") && !path.starts_with("/dev") => {
                path = path.parent().map_or_else(|| next.clone(), |folder| folder.join(&next));
            }
            _ => return Ok(path),
        }
    }
    Err(io::Error::new(io::ErrorKind::InvalidInput, "too many levels of symbolic links"))
}

/// Replaces the file at `path`: `write` fills a temporary file in the same directory, which is then synced and renamed
/// (a caller that needs the name on disk too calls `sync_folder`). If an error or a panic ends `write`, the temporary
/// file is removed; if a signal ends the process, it stays, and `final_name` recognizes it. If `path` is a symbolic
/// link, the link itself is replaced.
pub(crate) fn replace_by(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<()> {
    let (Some(folder), Some(name)) = (path.parent(), path.file_name()) else {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "this is not a file name"));
    };
    let mut prefix = OsString::from(".");
    prefix.push(name);
    prefix.push(".");
    // `tempfile_in` would make a file for its owner only, and its errors would show the name of the temporary file.
    let mut part = Builder::new().prefix(&prefix).suffix(".part").make_in(folder, |part| File::create_new(part))?;
    write(part.as_file_mut())?;
    part.as_file().sync_data()?;
    if let Ok(old) = fs::metadata(path) {
        // The new file keeps the permissions of the old one; the error is ignored because some file systems have no
        // permissions.
        let _ = part.as_file().set_permissions(old.permissions());
    }
    part.persist(path)?;
    Ok(())
}

/// Syncs the directory entries of `folder` to the disk. Does nothing on systems such as Windows, which cannot open
/// folders.
#[cfg(feature = "app")]
pub(crate) fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}

/// Returns the final name of a temporary file that an interrupted process left; returns any other name unchanged.
#[cfg(feature = "app")]
pub(crate) fn final_name(name: &str) -> &str {
    let parts = name.strip_prefix('.').and_then(|name| name.strip_suffix(".part"));
    parts.and_then(|name| name.rsplit_once('.')).map_or(name, |(name, _random)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_replaced_whole_or_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        write(&path, b"old").unwrap();
        let failed = write_by(&path, |file| file.write_all(b"new").and(Err(io::Error::other("full"))));
        assert_eq!(failed.unwrap_err().to_string(), "full");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        write(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["file"]);
        assert!(write(folder.path(), b"").is_err() && write(Path::new(".."), b"").is_err());
    }

    #[test]
    #[cfg(unix)]
    fn links_are_followed_to_their_end() {
        use std::os::unix::fs::symlink;

        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("deep")).unwrap();
        // Each link is relative to its own folder; the last link points to a file that does not exist yet.
        symlink("deep/second", at("first")).unwrap();
        symlink("../file", at("deep/second")).unwrap();
        for content in ["made", "replaced"] {
            write(&at("first"), content.as_bytes()).unwrap();
            assert_eq!(fs::read_to_string(at("file")).unwrap(), content);
            assert!(at("first").is_symlink() && at("deep/second").is_symlink() && !at("file").is_symlink());
        }
        assert_eq!(
            (names(folder.path()), names(&at("deep"))),
            (["deep", "file", "first"].map(String::from).into(), vec!["second".to_owned()])
        );
        symlink("round", at("round")).unwrap();
        assert!(write(&at("round"), b"").is_err());
    }

    #[test]
    fn a_process_killed_while_it_writes_leaves_the_old_file() {
        const KILLED: &str = "BIOTISSUE_TEST_KILLED_WRITER";
        if let Some(path) = std::env::var_os(KILLED) {
            let _ = write_by(path.as_ref(), |file| {
                file.write_all(b"new")?;
                std::process::abort();
            });
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        write(&path, b"old").unwrap();
        let mut killed = std::process::Command::new(std::env::current_exe().unwrap());
        let test = "output::tests::a_process_killed_while_it_writes_leaves_the_old_file";
        let outcome = killed.args(["--exact", test]).env(KILLED, &path).output().unwrap();
        assert!(!outcome.status.success());
        assert_eq!(fs::read(&path).unwrap(), b"old");
        let names = names(folder.path());
        assert!(names.len() == 2 && names[1] == "file" && names[0].ends_with(".part"), "{names:?}");
        #[cfg(feature = "app")]
        assert_eq!(
            (final_name(&names[0]), final_name(".a.b.1234.part"), final_name(".part")),
            ("file", "a.b", ".part")
        );
    }

    #[test]
    #[cfg(unix)]
    fn permissions_are_kept() {
        use std::os::unix::fs::PermissionsExt;

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("secret");
        fs::write(&path, "").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
        write(&path, b"new").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        assert_eq!(mode(&path), 0o600);
        // A new file has the permissions that the user's mask leaves.
        let (plain, new) = (folder.path().join("plain"), folder.path().join("new"));
        fs::write(&plain, "").unwrap();
        write(&new, b"").unwrap();
        assert_eq!(mode(&new), mode(&plain));
    }
}
