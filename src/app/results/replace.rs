//! Writing and listing the files of a result directory, and reading files that grow during a run.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

use super::ResultsError;
use crate::output;

/// Replaces the file at `path` by `bytes`; see [`output::replace_by`].
pub(in crate::app) fn replace(path: &Path, bytes: &[u8]) -> Result<(), ResultsError> {
    replace_by(path, |file| file.write_all(bytes))
}

/// Replaces the file at `path` by what `write` writes; see [`output::replace_by`].
pub(super) fn replace_by(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> Result<(), ResultsError> {
    output::replace_by(path, write).map_err(ResultsError::write(path))
}

/// Returns the names of the files in a folder that are text in UTF-8; none if the folder does not exist.
pub(in crate::app) fn names_in(folder: &Path) -> io::Result<Vec<String>> {
    match fs::read_dir(folder) {
        Ok(entries) => {
            entries.map(|entry| Ok(entry?.file_name().into_string().ok())).filter_map(Result::transpose).collect()
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(error) => Err(error),
    }
}

/// Returns the text of a file up to its last newline; an interrupted run may leave an unfinished line after it.
pub(super) fn whole_lines(path: &Path) -> Result<String, ResultsError> {
    let mut bytes = fs::read(path).map_err(ResultsError::read(path))?;
    bytes.truncate(bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |last| last + 1));
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        ResultsError::damaged(path, None, format!("not UTF-8 text from byte {at} on"), "text in UTF-8")
    })
}
