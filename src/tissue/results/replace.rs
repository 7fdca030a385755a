//! Writing a file so that nobody ever sees half of it.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

use super::ResultsError;

/// Replaces the file at `path` by `bytes`: written beside it under another name, brought to the disk, then renamed.
pub(super) fn replace(path: &Path, bytes: &[u8]) -> Result<(), ResultsError> {
    replace_by(path, |file| file.write_all(bytes))
}

/// Replaces the file at `path` by what `write` writes, in the same way.
pub(in crate::tissue) fn replace_by(
    path: &Path,
    write: impl FnOnce(&mut File) -> io::Result<()>,
) -> Result<(), ResultsError> {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(name);
    let written = File::create(&part).and_then(|mut file| {
        write(&mut file)?;
        file.sync_data()?;
        fs::rename(&part, path)
    });
    written.map_err(|source| {
        // The error is reported either way; a leftover that cannot be removed changes nothing about it.
        let _ = fs::remove_file(&part);
        ResultsError::Write { path: path.into(), source }
    })
}

/// The name of a file that was being replaced when its writer was interrupted; any other name is its own.
pub(in crate::tissue) fn final_name(name: &str) -> &str {
    let parts = name.strip_prefix('.').and_then(|name| name.strip_suffix(".part"));
    parts.and_then(|name| name.rsplit_once('.')).map_or(name, |(name, _process)| name)
}

/// The text of a file up to its last newline: what follows was being written when the run was interrupted.
pub(super) fn whole_lines(path: &Path) -> Result<String, ResultsError> {
    let mut bytes = fs::read(path).map_err(ResultsError::read(path))?;
    bytes.truncate(bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |last| last + 1));
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        ResultsError::damaged(path, None, format!("no UTF-8 text from byte {at} on"), "text in UTF-8")
    })
}
