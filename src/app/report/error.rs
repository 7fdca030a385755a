//! Errors of reports and pictures.

use std::path::PathBuf;

use thiserror::Error;

use crate::app::results::ResultsError;

/// The error of a report or picture that cannot be made.
#[derive(Debug, Error)]
pub enum ReportError {
    /// A file of the directory cannot be read, or the page cannot be written.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// The directory has none of the files of a run.
    #[error("{0}: is not a result directory: it contains neither `log.jsonl` nor `loads.csv` nor `fields.pvd`")]
    NoResults(PathBuf),
    /// No fields were written yet.
    #[error("{0}: contains no fields (`fields.pvd` is missing or empty)")]
    NoFields(PathBuf),
    /// The mesh of a field file has no element.
    #[error("{0}: the mesh is empty")]
    EmptyMesh(PathBuf),
    /// There are no fields of the requested step: the step, and the steps that have fields.
    #[error("there are no fields of step {0}; steps with fields: {steps}", steps = list(.1))]
    NoStep(usize, Vec<usize>),
    /// There is no field with the requested name that gives the elements a color: the name, and the available fields.
    #[error("there is no field `{0}`; available fields: {fields}", fields = list(.1))]
    NoField(String, Vec<String>),
}

fn list<T: ToString>(items: &[T]) -> String {
    match items {
        [] => "none".into(),
        items => items.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "),
    }
}
