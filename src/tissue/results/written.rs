//! What a checkpoint knows of the results that were written before it: a run that goes on from there finds them as they
//! were, or says which file is not.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::clear::is_collection;
use super::collection::Entry;
use super::fields_read::sources;
use super::loads::LineMark;
use super::{Collection, FIELDS_FILE, LOADS_FILE, Loads, NETWORKS_FOLDER, ResultsError};

/// The results of a run up to a converged step.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Written {
    /// The header of the loads, then the row of every step.
    pub loads: Vec<LineMark>,
    /// The field files, in ascending time.
    pub fields: Vec<FieldFile>,
}

/// A field file of the collection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FieldFile {
    /// Pseudo-time.
    pub time: f64,
    /// Its name, relative to the result directory.
    pub file: String,
    /// How long it is.
    pub bytes: u64,
}

impl FieldFile {
    /// A file of the result directory `dir` that was just written.
    ///
    /// # Errors
    /// [`ResultsError::Read`].
    pub fn new(dir: &Path, time: f64, file: &str) -> Result<Self, ResultsError> {
        let path = dir.join(file);
        let bytes = fs::metadata(&path).map_err(ResultsError::read(&path))?.len();
        Ok(Self { time, file: file.into(), bytes })
    }

    /// What the collection says of it.
    #[must_use]
    pub fn entry(&self) -> Entry {
        Entry { time: self.time, file: self.file.clone() }
    }
}

impl Written {
    /// Compares the files in `dir` with what was written until pseudo-time `t`; returns what will be restored. Nothing is
    /// touched.
    ///
    /// # Errors
    /// [`ResultsError::Damaged`] for the first file that is missing or not as it was; [`ResultsError::Read`].
    pub fn check(&self, dir: &Path, t: f64) -> Result<Vec<String>, ResultsError> {
        Loads::check(&dir.join(LOADS_FILE), &self.loads)?;
        let listed = match Collection::read(dir) {
            Ok(read) => read.entries().to_vec(),
            Err(error) if error.is_not_found() || matches!(error, ResultsError::Damaged { .. }) => Vec::new(),
            Err(error) => return Err(error),
        };
        let lost = self.fields.iter().filter(|field| !listed.contains(&field.entry())).count();
        let restored = (lost > 0).then(|| {
            let files = if lost == 1 { "a field file".into() } else { format!("{lost} field files") };
            format!("{}: does not list {files} of the run: they are entered again", dir.join(FIELDS_FILE).display())
        });
        for field in &self.fields {
            let path = dir.join(&field.file);
            let bytes = whole(&path)?;
            if bytes != field.bytes {
                let what = format!("has {bytes} bytes where {} were written", field.bytes);
                return Err(ResultsError::damaged(&path, None, what, EXPECTED));
            }
        }
        // Those of a state after the checkpoint are written anew.
        for entry in listed.iter().filter(|entry| entry.time <= t) {
            let path = dir.join(&entry.file);
            whole(&path)?;
            if path.extension().is_some_and(|extension| extension == "pvtu") {
                let text = fs::read_to_string(&path).map_err(ResultsError::read(&path))?;
                for piece in sources(&path, &text)? {
                    whole(&path.with_file_name(piece))?;
                }
            }
        }
        networks(&dir.join(NETWORKS_FOLDER), t)?;
        Ok(restored.into_iter().collect())
    }
}

const EXPECTED: &str = "every file of fields and networks that the run has written, as it was";

/// How long a regular file is.
fn whole(path: &Path) -> Result<u64, ResultsError> {
    match fs::symlink_metadata(path) {
        Ok(there) if there.is_file() => Ok(there.len()),
        _ => Err(ResultsError::damaged(path, None, "is missing", EXPECTED)),
    }
}

/// That the files of networks are there which the collections in `folder` list.
fn networks(folder: &Path, t: f64) -> Result<(), ResultsError> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        entries => entries.map_err(ResultsError::read(folder))?,
    };
    let paths: Result<Vec<PathBuf>, _> = entries.map(|entry| entry.map(|entry| entry.path())).collect();
    let mut paths = paths.map_err(ResultsError::read(folder))?;
    paths.sort_unstable();
    let is_ours = |path: &Path| path.file_name().and_then(|name| name.to_str()).is_some_and(is_collection);
    for path in paths.into_iter().filter(|path| is_ours(path)) {
        let read = Collection::read_at(path)?;
        for entry in read.entries().iter().filter(|entry| entry.time <= t) {
            whole(&folder.join(&entry.file))?;
        }
    }
    Ok(())
}
