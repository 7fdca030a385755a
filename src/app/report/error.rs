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
    #[error("{}: is not a result directory: it contains neither `log.jsonl` nor `loads.csv` nor `fields.pvd`", dir.display())]
    NoResults {
        /// The directory.
        dir: PathBuf,
    },
    /// No fields were written yet.
    #[error("{}: holds no fields (`fields.pvd` is missing or empty)", dir.display())]
    NoFields {
        /// The directory.
        dir: PathBuf,
    },
    /// The mesh has no element.
    #[error("{}: the mesh is empty", file.display())]
    EmptyMesh {
        /// The field file.
        file: PathBuf,
    },
    /// There are no fields of the requested step.
    #[error("no fields of step {step}; there are those of {}", list(available))]
    NoStep {
        /// The requested step.
        step: usize,
        /// The steps that have fields.
        available: Vec<usize>,
    },
    /// There is no field with the requested name and one value per element.
    #[error("no field `{field}` to color by; there are {}", list(available))]
    NoField {
        /// The requested field.
        field: String,
        /// The available fields.
        available: Vec<String>,
    },
}

fn list<T: ToString>(items: &[T]) -> String {
    match items {
        [] => "none".into(),
        items => items.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "),
    }
}
