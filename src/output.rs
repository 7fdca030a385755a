//! Writing files: a reader sees the old file or the new one, never a part of it, and nothing but a regular file is replaced.
//!
//! [`write()`] and [`write_by`] are for files that a user names: they follow symbolic links, and write straight to a device or
//! a pipe. `replace_by` is for the files of a result directory, which are regular files of known names.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// As many symbolic links as Linux follows.
const MAX_LINKS: usize = 40;

/// What is written to when a user names a file.
#[derive(Debug, PartialEq, Eq)]
enum Target {
    /// A file that is replaced as a whole, or made: the name at the end of all symbolic links.
    Regular(PathBuf),
    /// A device, a pipe, or an open file of this process such as `/dev/stdout`.
    Stream,
}

/// Writes `bytes` to the file that a user has named: see [`write_by`].
///
/// # Errors
/// What the operating system says.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    write_by(path, |file| file.write_all(bytes))
}

/// Lets `write` write the file that a user has named. A regular file keeps its old content until the new one is complete,
/// and if writing fails. Where `path` is a symbolic link, the link stays and the file it leads to is written. A device or a
/// pipe is written to as it is.
///
/// # Errors
/// What the operating system says.
pub fn write_by(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<()> {
    match target(path)? {
        Target::Regular(file) => replace_by(&file, write),
        Target::Stream => {
            // Behind what is there: standard output may lead to a regular file that others write to as well.
            let mut file = OpenOptions::new().append(true).open(path)?;
            write(&mut file)
        }
    }
}

/// Whether `path` leads to a device or a pipe: what is written there is gone, so that no file can go beside it.
#[must_use]
pub fn is_stream(path: &Path) -> bool {
    matches!(target(path), Ok(Target::Stream))
}

fn target(path: &Path) -> io::Result<Target> {
    match fs::metadata(path) {
        Ok(there) if there.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
        Ok(there) if !there.is_file() => return Ok(Target::Stream),
        _ => {}
    }
    let end = end_of_links(path)?;
    // The open files of a process have no other name than their links.
    if end.is_symlink() { Ok(Target::Stream) } else { Ok(Target::Regular(end)) }
}

/// Where the symbolic links at the end of `path` lead; the links of open files in `/proc` and `/dev` are not followed.
pub(crate) fn end_of_links(path: &Path) -> io::Result<PathBuf> {
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

/// Replaces the file at `path` by what `write` writes beside it under another name: brought to the disk, then renamed. A
/// symbolic link at `path` is itself replaced.
pub(crate) fn replace_by(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<()> {
    let name = path.file_name().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "this is no file name"))?;
    let part = path.with_file_name(part_name(name));
    let written = create(&part).and_then(|mut file| {
        write(&mut file)?;
        file.sync_data()?;
        if let Ok(there) = fs::metadata(path) {
            // What the owner allowed holds for the new content too; a file system without permissions has none to keep.
            let _ = file.set_permissions(there.permissions());
        }
        fs::rename(&part, path)
    });
    written.inspect_err(|_| {
        // The error is reported either way; a leftover that cannot be removed changes nothing about it.
        let _ = fs::remove_file(&part);
    })
}

fn part_name(name: &std::ffi::OsStr) -> OsString {
    let mut part = OsString::from(".");
    part.push(name);
    part.push(format!(".{}.part", std::process::id()));
    part
}

/// A new file. One of that name is a leftover of a process that had the number of this one.
fn create(part: &Path) -> io::Result<File> {
    let create = || OpenOptions::new().write(true).create_new(true).open(part);
    match create() {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            fs::remove_file(part)?;
            create()
        }
        outcome => outcome,
    }
}

/// Brings to the disk which files a folder has. Where folders cannot be opened, as on Windows, that is the system's affair.
#[cfg(feature = "app")]
pub(crate) fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}

/// The name of a file that was being replaced when its writer was interrupted; any other name is its own.
#[cfg(feature = "app")]
pub(crate) fn final_name(name: &str) -> &str {
    let parts = name.strip_prefix('.').and_then(|name| name.strip_suffix(".part"));
    parts.and_then(|name| name.rsplit_once('.')).map_or(name, |(name, _process)| name)
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
        // A process of the same number has left this.
        fs::write(folder.path().join(part_name("file".as_ref())), "half").unwrap();
        write(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["file"]);
        assert!(write(folder.path(), b"").is_err() && write(Path::new(".."), b"").is_err());
    }

    #[test]
    #[cfg(unix)]
    fn links_are_followed_wherever_they_lead() {
        use std::os::unix::fs::symlink;

        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("deep")).unwrap();
        // Relative to the folder of each link; the last leads to a file that is not there yet.
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
    #[cfg(unix)]
    fn what_the_owner_allowed_stays() {
        use std::os::unix::fs::PermissionsExt;

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("secret");
        fs::write(&path, "").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
        write(&path, b"new").unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
    }
}
