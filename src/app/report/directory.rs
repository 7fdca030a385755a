//! The content of a result directory, read once for all figures.

use std::path::{Path, PathBuf};

use super::ReportError;
use super::extension::{Extension, Kind, box_extension, row_at};
use super::ranks::history::RankRun;
use crate::app::results::collection::Entry;
use crate::app::results::loads::LoadRow;
use crate::app::results::log::{self, Cut, End, Start, Step};
use crate::app::results::{Collection, Event, FIELDS_FILE, Fields, LOADS_FILE, LOG_FILE, Loads, read_fields};

/// A result directory. Parts that a run did not write are absent or empty.
#[derive(Clone, Debug)]
pub struct Directory {
    /// Path of the directory.
    pub path: PathBuf,
    /// The last start event of the log.
    pub start: Option<Start>,
    /// The converged increments of the log, in the order of the file.
    pub steps: Vec<Step>,
    /// The attempts that failed and were cut.
    pub cuts: Vec<Cut>,
    /// The runs on several ranks.
    pub rank_runs: Vec<RankRun>,
    /// The end event of the log; `None` during the run.
    pub end: Option<End>,
    /// The table of loads.
    pub loads: Option<Loads>,
    /// The field files.
    pub fields: Vec<Entry>,
}

/// One converged load step, with its data from the log and from the table of loads.
#[derive(Clone, Copy, Debug)]
pub struct Increment<'a> {
    /// The load step.
    pub step: usize,
    /// Pseudo-time at the end of the increment.
    pub t: f64,
    /// The event in the log.
    pub log: Option<&'a Step>,
    /// The row in the table of loads.
    pub row: Option<&'a LoadRow>,
}

impl Directory {
    /// Reads the files that exist.
    ///
    /// # Errors
    /// Returns [`ReportError::NoResults`] if there is no result file, or [`ReportError::Results`] if a file cannot be
    /// read or is damaged.
    pub fn open(path: &Path) -> Result<Self, ReportError> {
        let file = |name: &str| Some(path.join(name)).filter(|file| file.is_file());
        let (log, loads, fields) = (file(LOG_FILE), file(LOADS_FILE), file(FIELDS_FILE));
        if log.is_none() && loads.is_none() && fields.is_none() {
            return Err(ReportError::NoResults(path.into()));
        }
        let fields = match fields {
            Some(file) => Collection::read(file)?.entries().to_vec(),
            None => Vec::new(),
        };
        let loads = loads.map(|file| Loads::read(&file)).transpose()?;
        let events = log.map(|file| log::read(&file)).transpose()?.unwrap_or_default();
        let mut directory = Self {
            path: path.into(),
            start: None,
            steps: Vec::new(),
            cuts: Vec::new(),
            rank_runs: super::ranks::history::runs(&events),
            end: None,
            loads,
            fields,
        };
        events.into_iter().for_each(|event| directory.add_event(event));
        Ok(directory)
    }

    fn add_event(&mut self, event: Event) {
        match event {
            // A resumed run writes another start event; an earlier end event does not apply to it.
            Event::Start(start) => (self.start, self.end) = (Some(start), None),
            Event::Step(step) => self.steps.push(step),
            Event::Cut(cut) => self.cuts.push(cut),
            Event::End(end) => self.end = Some(end),
            Event::Ranks(_) | Event::Migration(_) | Event::Unknown => {}
        }
    }

    /// Returns the title of the run from the log, or else the name of the directory.
    pub fn title(&self) -> String {
        let named = self.start.as_ref().map(|start| start.title.trim()).filter(|title| !title.is_empty());
        named.map(str::to_owned).unwrap_or_else(|| {
            let whole = self.path.canonicalize().unwrap_or_else(|_| self.path.clone());
            whole.file_name().map_or_else(|| "Results".into(), |name| name.to_string_lossy().into_owned())
        })
    }

    /// Returns the converged increments in the order of pseudo-time. If a resumed run computed an increment again, the
    /// last result is used.
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

    /// Returns the last field file of a step, or the last one of all if `step` is `None`.
    ///
    /// # Errors
    /// Returns [`ReportError::NoFields`] if there are no fields, or [`ReportError::NoStep`] if the step has none.
    pub fn field_file(&self, step: Option<usize>) -> Result<&Entry, ReportError> {
        let last = self.fields.last().ok_or_else(|| ReportError::NoFields(self.path.clone()))?;
        let Some(step) = step else { return Ok(last) };
        let wanted = self.fields.iter().rev().find(|entry| entry.step() == Some(step));
        wanted.ok_or_else(|| {
            let mut available: Vec<usize> = self.fields.iter().filter_map(Entry::step).collect();
            available.dedup();
            ReportError::NoStep(step, available)
        })
    }

    /// Reads a field file.
    ///
    /// # Errors
    /// Returns [`ReportError::Results`] if it is missing or damaged, or [`ReportError::EmptyMesh`] if it has no
    /// element.
    pub fn read_fields(&self, entry: &Entry) -> Result<Fields, ReportError> {
        let file = self.path.join(&entry.file);
        let fields = read_fields(&file)?;
        if fields.elements.is_empty() { Err(ReportError::EmptyMesh(file)) } else { Ok(fields) }
    }

    /// Determines how the body is pulled or sheared ([`Extension::find`]).
    pub fn extension(&self, fields: Option<(&Fields, f64)>) -> Option<Extension> {
        let places = self.start.as_ref().map_or(&[][..], |start| &start.surfaces);
        Extension::find(self.loads.as_ref()?, places, fields)
    }

    /// Returns the extension or shear of the body in these fields, as a fraction of its reference length: from the table of
    /// loads at the time of the fields, or, if no surface is pulled, from the bounding box of the body, if its longest edge
    /// changes. `None` for a state without a row in the table.
    pub fn extension_at(&self, entry: &Entry, fields: &Fields) -> Option<(Kind, f64)> {
        /// The change of an edge that is due to rounding.
        const ROUNDING: f64 = 1e-9;
        match self.loads.as_ref().zip(self.extension(Some((fields, entry.time)))) {
            // A state within a step that failed has no row, and another measure would not compare with that of the steps.
            Some((loads, extension)) => {
                row_at(loads, entry.time).and_then(|row| Some((extension.kind, extension.fraction(row)?)))
            }
            None => {
                let of_box = box_extension(fields).filter(|extension| extension.abs() > ROUNDING);
                of_box.map(|extension| (Kind::Pull, extension))
            }
        }
    }
}
