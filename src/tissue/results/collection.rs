//! `fields.pvd`: which field file belongs to which time, in the form that ParaView opens; and the same for the networks
//! of one element.

use std::fs;
use std::path::{Path, PathBuf};

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, Event as XmlEvent};

use super::replace::replace;
use super::{FIELDS_FILE, ResultsError};

/// One field file and its time.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Pseudo-time.
    pub time: f64,
    /// The file, relative to the folder of the collection.
    pub file: String,
}

impl Entry {
    /// The step of a file named by [`field_file`] or [`index_file`]: the digits at the end of its name.
    #[must_use]
    pub fn step(&self) -> Option<usize> {
        let stem = Path::new(&self.file).file_stem()?.to_str()?;
        stem[stem.trim_end_matches(|letter: char| letter.is_ascii_digit()).len()..].parse().ok()
    }
}

/// The name of the field file of a step.
#[must_use]
pub fn field_file(step: usize) -> String {
    format!("fields-{step:05}.vtu")
}

/// The name of the file of a step that names the pieces of a body in several parts.
#[must_use]
pub fn index_file(step: usize) -> String {
    format!("fields-{step:05}.pvtu")
}

/// The name of a file of a step for a state within the step after it: what a run that failed there has left.
#[must_use]
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
    /// An empty collection in this directory. Nothing is written before the first [`add`](Self::add).
    #[must_use]
    pub fn new(dir: &Path) -> Self {
        Self::at(dir.join(FIELDS_FILE))
    }

    /// An empty collection in a file of another name, which should end in `.pvd`.
    #[must_use]
    pub fn at(path: PathBuf) -> Self {
        Self { path, entries: Vec::new() }
    }

    /// The collection in `path` of a run that is resumed: what is there up to and including `time`, and all of `known`, which
    /// the run had written until then. One that is missing or damaged is restored from what is known.
    ///
    /// # Errors
    /// [`ResultsError::Read`] where the system refuses, [`ResultsError::Write`].
    pub fn resume(path: PathBuf, time: f64, known: &[Entry]) -> Result<Self, ResultsError> {
        let listed = Self::listed(&path)?;
        let mut collection = Self::at(path);
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

    /// What a collection lists, nothing if it is damaged; `None` where there is none.
    pub(super) fn listed(path: &Path) -> Result<Option<Vec<Entry>>, ResultsError> {
        match Self::read_at(path.to_owned()) {
            Ok(read) => Ok(Some(read.entries)),
            Err(error) if error.is_not_found() => Ok(None),
            Err(ResultsError::Damaged { .. }) => Ok(Some(Vec::new())),
            Err(error) => Err(error),
        }
    }

    /// Reads `fields.pvd` of a directory.
    ///
    /// # Errors
    /// [`ResultsError::Read`] where there is none, [`ResultsError::Damaged`] where it is no collection.
    pub fn read(dir: &Path) -> Result<Self, ResultsError> {
        Self::read_at(dir.join(FIELDS_FILE))
    }

    /// [`read`](Self::read) of a file of another name.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn read_at(path: PathBuf) -> Result<Self, ResultsError> {
        let text = fs::read_to_string(&path).map_err(ResultsError::read(&path))?;
        Self::parse(path, &text)
    }

    /// The collection that this text is, of a file at `path`.
    pub(super) fn parse(path: PathBuf, text: &str) -> Result<Self, ResultsError> {
        let damaged =
            |what: String| ResultsError::damaged(&path, None, what, "a ParaView collection of files and times");
        let mut reader = quick_xml::Reader::from_str(text);
        let (mut entries, mut ended) = (Vec::new(), false);
        loop {
            match reader.read_event().map_err(|error| damaged(error.to_string()))? {
                XmlEvent::Empty(tag) | XmlEvent::Start(tag) if tag.name().as_ref() == "DataSet" => {
                    entries.push(entry(&tag).map_err(damaged)?);
                }
                XmlEvent::End(tag) => ended |= tag.name().as_ref() == "VTKFile",
                XmlEvent::Eof => break,
                _ => {}
            }
        }
        if ended { Ok(Self { path, entries }) } else { Err(damaged("does not end with `</VTKFile>`".into())) }
    }

    /// The files and their times.
    #[must_use]
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Adds a file (relative to the folder of the collection) and rewrites the collection, which is whole at any moment.
    ///
    /// # Errors
    /// [`ResultsError::Write`].
    pub fn add(&mut self, time: f64, file: &str) -> Result<(), ResultsError> {
        self.entries.push(Entry { time, file: file.into() });
        self.write()
    }

    fn write(&self) -> Result<(), ResultsError> {
        let bytes = self.encode().map_err(ResultsError::write(&self.path))?;
        replace(&self.path, &bytes)
    }

    fn encode(&self) -> std::io::Result<Vec<u8>> {
        let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
        writer.write_event(XmlEvent::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
        let file = [("type", "Collection"), ("version", "0.1"), ("byte_order", "LittleEndian")];
        writer.write_event(XmlEvent::Start(BytesStart::new("VTKFile").with_attributes(file)))?;
        writer.write_event(XmlEvent::Start(BytesStart::new("Collection")))?;
        for Entry { time, file } in &self.entries {
            let time = time.to_string();
            let set = [("timestep", time.as_str()), ("group", ""), ("part", "0"), ("file", file.as_str())];
            writer.write_event(XmlEvent::Empty(BytesStart::new("DataSet").with_attributes(set)))?;
        }
        writer.write_event(XmlEvent::End(BytesEnd::new("Collection")))?;
        writer.write_event(XmlEvent::End(BytesEnd::new("VTKFile")))?;
        let mut bytes = writer.into_inner();
        bytes.push(b'\n');
        Ok(bytes)
    }
}

fn entry(tag: &BytesStart) -> Result<Entry, String> {
    let value = |name: &str| -> Result<String, String> {
        let attribute = tag.try_get_attribute(name).map_err(|error| error.to_string())?;
        let attribute = attribute.ok_or_else(|| format!("a `DataSet` has no `{name}`"))?;
        let value = attribute.normalized_value(quick_xml::XmlVersion::Implicit1_0);
        value.map(std::borrow::Cow::into_owned).map_err(|error| error.to_string())
    };
    let time = value("timestep")?;
    let time = time.parse().map_err(|_| format!("`timestep` is `{time}`, which is no number"))?;
    Ok(Entry { time, file: value("file")? })
}
