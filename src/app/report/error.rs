//! Errors of reports and pictures.

use std::path::PathBuf;

use thiserror::Error;

use crate::app::results::ResultsError;

/// The reason why a report or a picture cannot be made.
#[derive(Debug, Error)]
pub enum ReportError {
    /// A file of the directory cannot be read, or the page cannot be written.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// The directory has none of the files of a run.
    #[error("{0}: is not a result directory: it contains neither `log.jsonl` nor `loads.csv` nor `fields.pvd`")]
    NoResults(PathBuf),
    /// No fields were written yet.
    #[error("{0}: holds no fields (`fields.pvd` is missing or empty)")]
    NoFields(PathBuf),
    /// The mesh of a field file has no element.
    #[error("{0}: the mesh is empty")]
    EmptyMesh(PathBuf),
    /// There are no fields of the requested step; the steps that have fields.
    #[error("no fields of step {0}; there are those of {steps}", steps = list(.1))]
    NoStep(usize, Vec<usize>),
    /// There is no field with the requested name and one value per element; the available fields.
    #[error("no field `{0}` to color by; there are {fields}", fields = list(.1))]
    NoField(String, Vec<String>),
}

fn list<T: ToString>(items: &[T]) -> String {
    match items {
        [] => "none".into(),
        items => items.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "),
    }
}
