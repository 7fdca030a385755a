//! The record in a checkpoint of the results written before it: a resumed run finds these files unchanged, or reports
//! the file that is not.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::collection::Entry;
use super::fields_read::sources;
use super::loads::LineChecksum;
use super::names::FileName;
use super::networks::{NetworkPoint, network_collection};
use super::replace::names_in;
use super::{Collection, FIELDS_FILE, LOADS_FILE, Loads, NETWORKS_FOLDER, POINTS_FILE, ResultsError};

/// The progress of a run.
#[derive(Clone, Copy, Debug)]
pub struct RunProgress {
    /// Number of converged load steps.
    pub steps: usize,
    /// Number of all load steps.
    pub of: usize,
}

impl RunProgress {
    /// Returns the pseudo-time after the last converged step.
    pub fn t(self) -> f64 {
        self.t_of(self.steps)
    }

    fn t_of(self, step: usize) -> f64 {
        step as f64 / self.of as f64
    }
}

/// The results of a run up to a converged step.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ResultsRecord {
    /// The checksum of the header of the loads, then of the row of every step.
    pub loads: Vec<LineChecksum>,
    /// The field files, in ascending time.
    pub fields: Vec<FieldFile>,
}

/// A field file of the collection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FieldFile {
    /// Pseudo-time.
    pub time: f64,
    /// Name of the file, relative to the result directory.
    pub file: String,
    /// Length of the file in bytes.
    pub bytes: u64,
}

impl FieldFile {
    /// Records a file of the result directory `dir` that was just written.
    ///
    /// # Errors
    /// Returns [`ResultsError::Read`] if the length of the file cannot be read.
    pub fn new(dir: &Path, time: f64, file: &str) -> Result<Self, ResultsError> {
        let path = dir.join(file);
        let bytes = fs::metadata(&path).map_err(ResultsError::read(&path))?.len();
        Ok(Self { time, file: file.into(), bytes })
    }

    /// Returns the entry of this file in the collection.
    pub fn entry(&self) -> Entry {
        Entry { time: self.time, file: self.file.clone() }
    }
}

impl ResultsRecord {
    /// Compares the files in `dir` with this record; returns messages about the entries that will be restored. Nothing
    /// is changed.
    ///
    /// # Errors
    /// Returns [`ResultsError::Damaged`] for the first file that is missing or changed; [`ResultsError::Read`] if a
    /// file cannot be read.
    pub fn check(&self, dir: &Path, progress: RunProgress) -> Result<Vec<String>, ResultsError> {
        Loads::check(&dir.join(LOADS_FILE), &self.loads)?;
        let t = progress.t();
        let collection = dir.join(FIELDS_FILE);
        let listed = Collection::listed(&collection)?.unwrap_or_default();
        let lost = self.fields.iter().filter(|field| !listed.contains(&field.entry())).count();
        let mut restored: Vec<String> =
            restored_message(&collection, lost, "a field file", "field files").into_iter().collect();
        for field in &self.fields {
            let path = dir.join(&field.file);
            let bytes = file_length(&path)?;
            if bytes != field.bytes {
                let what = format!("has {bytes} bytes where {} were written", field.bytes);
                return Err(ResultsError::damaged(&path, None, what, EXPECTED));
            }
        }
        // Files of states after the checkpoint will be written again.
        let collection = dir.join(POINTS_FILE);
        let points = Collection::listed(&collection)?.unwrap_or_default();
        let lost = unlisted_points(dir, progress)?.len();
        restored.extend(restored_message(&collection, lost, "a file of points", "files of points"));
        for entry in listed.iter().chain(&points).filter(|entry| entry.time <= t) {
            let path = dir.join(&entry.file);
            file_length(&path)?;
            if path.extension().is_some_and(|extension| extension == "pvtu") {
                let text = fs::read_to_string(&path).map_err(ResultsError::read(&path))?;
                for piece in sources(&path, &text)? {
                    file_length(&path.with_file_name(piece))?;
                }
            }
        }
        let folder = dir.join(NETWORKS_FOLDER);
        for networks in &network_series(&folder, progress)? {
            let collection = folder.join(network_collection(networks.point));
            let listed = Collection::listed(&collection)?.unwrap_or_default();
            for entry in listed.iter().filter(|entry| entry.time <= t) {
                file_length(&folder.join(&entry.file))?;
            }
            let lost = networks.files.iter().filter(|entry| !listed.contains(entry)).count();
            restored.extend(restored_message(&collection, lost, "a network", "networks"));
        }
        Ok(restored)
    }
}

/// Returns the message about a collection from which `count` files are missing.
fn restored_message(collection: &Path, count: usize, one: &str, several: &str) -> Option<String> {
    let files = if count == 1 { one.to_owned() } else { format!("{count} {several}") };
    let collection = collection.display();
    (count > 0).then(|| format!("{collection}: does not list {files} of the run, which will be listed again"))
}

/// The network files of an RVE.
pub struct NetworkSeries {
    /// The RVE.
    pub point: NetworkPoint,
    /// The files in the folder up to the last converged step, in ascending time.
    pub files: Vec<Entry>,
}

const EXPECTED: &str = "every file of fields and networks that the run has written, as it was";

/// Returns the length of a regular file.
fn file_length(path: &Path) -> Result<u64, ResultsError> {
    match fs::symlink_metadata(path) {
        Ok(there) if there.is_file() => Ok(there.len()),
        _ => Err(ResultsError::damaged(path, None, "is missing", EXPECTED)),
    }
}

/// Returns the files of integration points in `dir` up to the last converged step, in ascending time, if their
/// collection is missing or damaged, and none otherwise.
///
/// # Errors
/// Returns [`ResultsError::Read`] if the folder or the collection cannot be read.
pub fn unlisted_points(dir: &Path, progress: RunProgress) -> Result<Vec<Entry>, ResultsError> {
    if Collection::listed(&dir.join(POINTS_FILE))?.is_some_and(|listed| !listed.is_empty()) {
        return Ok(Vec::new());
    }
    let mut files = BTreeMap::new();
    for name in names_in(dir).map_err(ResultsError::read(dir))? {
        match FileName::parse(&name) {
            Some(FileName::Fields { step } | FileName::Index { step })
                if name.starts_with("points-") && step <= progress.steps =>
            {
                files.insert(step, name);
            }
            _ => {}
        }
    }
    Ok(files.into_iter().map(|(step, file)| Entry { time: progress.t_of(step), file }).collect())
}

/// Returns all RVEs that have a collection of networks in `folder`, or networks of converged steps, ascending.
///
/// # Errors
/// Returns [`ResultsError::Read`] if the folder cannot be read.
pub fn network_series(folder: &Path, progress: RunProgress) -> Result<Vec<NetworkSeries>, ResultsError> {
    let mut steps = BTreeMap::<NetworkPoint, BTreeMap<usize, String>>::new();
    for name in names_in(folder).map_err(ResultsError::read(folder))? {
        match FileName::parse(&name) {
            Some(FileName::Collection { point }) => {
                steps.entry(point).or_default();
            }
            Some(FileName::Network { point, step }) if step <= progress.steps => {
                steps.entry(point).or_default().insert(step, name);
            }
            _ => {}
        }
    }
    let series = steps.into_iter().map(|(point, files)| {
        let files = files.into_iter().map(|(step, file)| Entry { time: progress.t_of(step), file }).collect();
        NetworkSeries { point, files }
    });
    Ok(series.collect())
}
