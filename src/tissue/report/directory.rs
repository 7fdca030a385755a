//! What a result directory holds, read once for everything that is drawn from it.

use std::path::{Path, PathBuf};

use super::ReportError;
use super::extension::{Extension, box_extension, row_at};
use crate::tissue::results::collection::Entry;
use crate::tissue::results::loads::LoadRow;
use crate::tissue::results::log::{self, Cut, End, Start, Step};
use crate::tissue::results::{Collection, Event, FIELDS_FILE, Fields, LOADS_FILE, LOG_FILE, Loads, read_fields};

/// A result directory. Parts that a run did not write are absent or empty.
#[derive(Clone, Debug)]
pub struct Directory {
    /// Where it is.
    pub path: PathBuf,
    /// The head of the log.
    pub start: Option<Start>,
    /// The converged increments of the log, as they came.
    pub steps: Vec<Step>,
    /// The attempts that failed.
    pub cuts: Vec<Cut>,
    /// The end of the log; absent while the run goes on.
    pub end: Option<End>,
    /// The table of loads.
    pub loads: Option<Loads>,
    /// The field files.
    pub fields: Vec<Entry>,
}

/// One converged load increment: what the log and the table of loads say about it.
#[derive(Clone, Copy, Debug)]
pub struct Increment<'a> {
    /// The load step.
    pub step: usize,
    /// Pseudo-time at its end.
    pub t: f64,
    /// From the log.
    pub log: Option<&'a Step>,
    /// From the table of loads.
    pub row: Option<&'a LoadRow>,
}

impl Directory {
    /// Reads what is there.
    ///
    /// # Errors
    /// [`ReportError::NoResults`] where nothing is; [`ReportError::Results`] where a file is damaged.
    pub fn open(path: &Path) -> Result<Self, ReportError> {
        let file = |name: &str| Some(path.join(name)).filter(|file| file.is_file());
        let (log, loads, fields) = (file(LOG_FILE), file(LOADS_FILE), file(FIELDS_FILE));
        if log.is_none() && loads.is_none() && fields.is_none() {
            return Err(ReportError::NoResults { dir: path.into() });
        }
        let fields = match fields {
            Some(_) => Collection::read(path)?.entries().to_vec(),
            None => Vec::new(),
        };
        let loads = loads.map(|file| Loads::read(&file)).transpose()?;
        let mut directory =
            Self { path: path.into(), start: None, steps: Vec::new(), cuts: Vec::new(), end: None, loads, fields };
        for event in log.map(|file| log::read(&file)).transpose()?.unwrap_or_default() {
            directory.take(event);
        }
        Ok(directory)
    }

    fn take(&mut self, event: Event) {
        match event {
            // A run that was resumed starts again: its end is still to come.
            Event::Start(start) => (self.start, self.end) = (Some(start), None),
            Event::Step(step) => self.steps.push(step),
            Event::Cut(cut) => self.cuts.push(cut),
            Event::End(end) => self.end = Some(end),
            Event::Ranks(_) | Event::Unknown => {}
        }
    }

    /// What the run is called: from the log, or else the name of the directory.
    #[must_use]
    pub fn title(&self) -> String {
        let named = self.start.as_ref().map(|start| start.title.trim()).filter(|title| !title.is_empty());
        named.map(str::to_owned).unwrap_or_else(|| {
            let whole = self.path.canonicalize().unwrap_or_else(|_| self.path.clone());
            whole.file_name().map_or_else(|| "Results".into(), |name| name.to_string_lossy().into_owned())
        })
    }

    /// The converged increments in the order of time. Of an increment that a resumed run computed again, the last
    /// counts.
    #[must_use]
    pub fn increments(&self) -> Vec<Increment<'_>> {
        let mut increments: Vec<Increment> = Vec::new();
        let place = |increments: &mut Vec<Increment>, step: usize, t: f64| {
            increments.iter().position(|other| other.step == step && other.t == t).unwrap_or_else(|| {
                increments.push(Increment { step, t, log: None, row: None });
                increments.len() - 1
            })
        };
        for step in &self.steps {
            let k = place(&mut increments, step.step, step.t);
            increments[k].log = Some(step);
        }
        for row in self.loads.iter().flat_map(|loads| &loads.rows) {
            let k = place(&mut increments, row.step, row.t);
            increments[k].row = Some(row);
        }
        increments.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.step.cmp(&b.step)));
        increments
    }

    /// The field file of a step, or the last one.
    ///
    /// # Errors
    /// [`ReportError::NoFields`], [`ReportError::NoStep`].
    pub fn field_file(&self, step: Option<usize>) -> Result<&Entry, ReportError> {
        let last = self.fields.last().ok_or_else(|| ReportError::NoFields { dir: self.path.clone() })?;
        let Some(step) = step else { return Ok(last) };
        let wanted = self.fields.iter().rev().find(|entry| entry.step() == Some(step));
        wanted.ok_or_else(|| {
            let mut available: Vec<usize> = self.fields.iter().filter_map(Entry::step).collect();
            available.dedup();
            ReportError::NoStep { step, available }
        })
    }

    /// Reads a field file.
    ///
    /// # Errors
    /// [`ReportError::Results`] where it is missing or damaged, [`ReportError::EmptyMesh`].
    pub fn read_fields(&self, entry: &Entry) -> Result<Fields, ReportError> {
        let file = self.path.join(&entry.file);
        let fields = read_fields(&file)?;
        if fields.elements.is_empty() { Err(ReportError::EmptyMesh { file }) } else { Ok(fields) }
    }

    /// How far the body is extended in these fields, as a fraction: from the loads of that time, or else from the
    /// bounding box of the body.
    #[must_use]
    pub fn extension_at(&self, entry: &Entry, fields: &Fields) -> Option<f64> {
        let row = self
            .loads
            .as_ref()
            .and_then(|loads| Extension::find(loads, Some((fields, entry.time)))?.fraction(row_at(loads, entry.time)?));
        row.or_else(|| box_extension(fields))
    }
}
