//! Writing a file so that nobody ever sees half of it.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

use super::ResultsError;

/// Replaces the file at `path` by `bytes`: written beside it under another name, brought to the disk, then renamed.
pub(super) fn replace(path: &Path, bytes: &[u8]) -> Result<(), ResultsError> {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(name);
    let written = File::create(&part).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_data()?;
        fs::rename(&part, path)
    });
    written.map_err(|source| {
        // The error is reported either way; a leftover that cannot be removed changes nothing about it.
        let _ = fs::remove_file(&part);
        ResultsError::Write { path: path.into(), source }
    })
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
