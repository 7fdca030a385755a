//! The ParaView collection `fields.pvd`, which maps times to field files, and the collections of the networks of single
//! elements.

use std::fs;
use std::path::{Path, PathBuf};

use quick_xml::events::BytesStart;

use super::ResultsError;
use super::replace::replace;
use super::vtk::{attribute, visit_elements, write_text};

/// One field file and its time.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Pseudo-time.
    pub time: f64,
    /// Path of the file, relative to the folder of the collection.
    pub file: String,
}

impl Entry {
    /// Returns the step of a file named by [`field_file`] or [`index_file`]: the digits at the end of its name.
    pub fn step(&self) -> Option<usize> {
        let stem = Path::new(&self.file).file_stem()?.to_str()?;
        stem[stem.trim_end_matches(|letter: char| letter.is_ascii_digit()).len()..].parse().ok()
    }
}

/// Returns the name of the field file of a step.
pub fn field_file(step: usize) -> String {
    format!("fields-{step:05}.vtu")
}

/// Returns the name of the index file of a step, which names the pieces of a divided body.
pub fn index_file(step: usize) -> String {
    format!("fields-{step:05}.pvtu")
}

/// Returns the name of the file of integration points of a step.
pub fn point_file(step: usize) -> String {
    format!("points-{step:05}.vtu")
}

/// Returns the name of the index file of a step, which names the pieces of the integration points of a divided body.
pub fn point_index_file(step: usize) -> String {
    format!("points-{step:05}.pvtu")
}

/// Returns the file name of a state within the step after the step of `file`, as left by a failed run.
pub fn partial(file: &str) -> String {
    match file.rsplit_once('.') {
        Some((stem, extension)) => format!("{stem}-partial.{extension}"),
        None => format!("{file}-partial"),
    }
}

/// The field files of a run (or the network files of an element), in ascending time.
#[derive(Clone, Debug, PartialEq)]
pub struct Collection {
    path: PathBuf,
    entries: Vec<Entry>,
}

impl Collection {
    /// Creates an empty collection for a file, whose name should end in `.pvd`. Nothing is written before the first
    /// [`add`](Self::add).
    pub fn new(path: PathBuf) -> Self {
        Self { path, entries: Vec::new() }
    }

    /// Restores the collection in `path` for a resumed run: all entries of `known`, which the run had written before,
    /// and the other entries listed there up to and including `time`. A missing or damaged collection is restored from
    /// `known`.
    ///
    /// # Errors
    /// Returns [`ResultsError::Read`] if the file exists but cannot be read, or [`ResultsError::Write`] if it cannot be
    /// written.
    pub fn resume(path: PathBuf, time: f64, known: &[Entry]) -> Result<Self, ResultsError> {
        let listed = Self::listed(&path)?;
        let mut collection = Self::new(path);
        if listed.is_none() && known.is_empty() {
            return Ok(collection);
        }
        collection.entries = known.to_vec();
        let others = listed.into_iter().flatten().filter(|entry| entry.time <= time && !known.contains(entry));
        collection.entries.extend(others);
        collection.entries.sort_by(|a, b| a.time.total_cmp(&b.time));
        collection.write()?;
        Ok(collection)
    }

    /// Returns the entries of a collection; empty if the file is damaged, `None` if it does not exist.
    pub(super) fn listed(path: &Path) -> Result<Option<Vec<Entry>>, ResultsError> {
        match Self::read(path.to_owned()) {
            Ok(read) => Ok(Some(read.entries)),
            Err(error) if error.is_not_found() => Ok(None),
            Err(ResultsError::Damaged { .. }) => Ok(Some(Vec::new())),
            Err(error) => Err(error),
        }
    }

    /// Reads a collection.
    ///
    /// # Errors
    /// Returns [`ResultsError::Read`] if it cannot be read, or [`ResultsError::Damaged`] if it is not a collection.
    pub fn read(path: PathBuf) -> Result<Self, ResultsError> {
        let text = fs::read_to_string(&path).map_err(ResultsError::read(&path))?;
        Self::parse(path, &text)
    }

    /// Parses the text of the collection at `path`.
    pub(super) fn parse(path: PathBuf, text: &str) -> Result<Self, ResultsError> {
        let mut entries = Vec::new();
        let visited = visit_elements(text, "DataSet", |tag| {
            entries.push(entry(tag)?);
            Ok(())
        });
        let ended = visited.and_then(|ended| ended.then_some(()).ok_or("does not end with `</VTKFile>`".into()));
        let expected = "a ParaView collection of files and times";
        ended.map_err(|what| ResultsError::damaged(&path, None, what, expected))?;
        Ok(Self { path, entries })
    }

    /// Returns the files with their times.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Adds a file (relative to the folder of the collection) and replaces the collection on disk atomically.
    ///
    /// # Errors
    /// Returns [`ResultsError::Write`] if the collection cannot be written.
    pub fn add(&mut self, time: f64, file: &str) -> Result<(), ResultsError> {
        self.entries.push(Entry { time, file: file.into() });
        self.write()
    }

    fn write(&self) -> Result<(), ResultsError> {
        let file = [("type", "Collection"), ("version", "0.1"), ("byte_order", "LittleEndian")];
        let text = write_text(&file, |writer| {
            writer.create_element("Collection").write_inner_content(|writer| {
                for Entry { time, file } in &self.entries {
                    let time = time.to_string();
                    let set = [("timestep", time.as_str()), ("group", ""), ("part", "0"), ("file", file.as_str())];
                    writer.create_element("DataSet").with_attributes(set).write_empty()?;
                }
                Ok(())
            })?;
            Ok(())
        });
        replace(&self.path, &text.map_err(ResultsError::write(&self.path))?)
    }
}

fn entry(tag: &BytesStart) -> Result<Entry, String> {
    let value = |name: &str| attribute(tag, name)?.ok_or_else(|| format!("a `DataSet` has no `{name}`"));
    let time = value("timestep")?;
    let time = time.parse().map_err(|_| format!("`timestep` is `{time}`, which is not a number"))?;
    Ok(Entry { time, file: value("file")? })
}
