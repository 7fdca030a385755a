//! Why a report or a picture cannot be made.

use std::path::PathBuf;

use thiserror::Error;

use crate::tissue::results::ResultsError;

/// Why a report or a picture cannot be made.
#[derive(Debug, Error)]
pub enum ReportError {
    /// A file of the directory cannot be read, or the page cannot be written.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// The directory holds none of the files of a run.
    #[error("{}: is no result directory: it holds neither `log.jsonl` nor `loads.csv` nor `fields.pvd`", dir.display())]
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
    /// Fields of that step were not written.
    #[error("no fields of step {step}; there are those of {}", list(available))]
    NoStep {
        /// The step asked for.
        step: usize,
        /// The steps that can be had.
        available: Vec<usize>,
    },
    /// There is no field under that name that has one number an element.
    #[error("no field `{field}` to color by; there are {}", list(available))]
    NoField {
        /// The field asked for.
        field: String,
        /// The fields that can be had.
        available: Vec<String>,
    },
    /// A chart could not be drawn.
    #[error("the chart of {chart} cannot be drawn: {reason}")]
    Chart {
        /// What it shows.
        chart: &'static str,
        /// The answer of the drawing library.
        reason: String,
    },
}

fn list<T: ToString>(items: &[T]) -> String {
    match items {
        [] => "none".into(),
        items => items.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "),
    }
}
