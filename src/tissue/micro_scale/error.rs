//! A point without an answer, in words that can travel from rank to rank.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::unit::UnitError;
use crate::fem::material::MaterialError;

/// Why there is no answer.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TissueFieldError {
    /// A point has none.
    #[error(transparent)]
    Point(#[from] PointFailure),
    /// The ranks that share the points could not exchange something.
    #[error("{0}")]
    Ranks(String),
}

/// A point without an answer.
#[derive(Clone, Debug, Error, PartialEq, Eq, Serialize, Deserialize)]
#[error("element {element}{}: {reason}", network.as_ref().map(|n| format!(" (network {n})")).unwrap_or_default())]
pub struct PointFailure {
    /// The element, from 0.
    pub element: usize,
    /// The network there, if there is one.
    pub network: Option<String>,
    /// Why, in words.
    pub reason: String,
    /// What failed.
    pub kind: PointFailureKind,
}

/// What failed at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum PointFailureKind {
    /// A network found no equilibrium.
    Network,
    /// A linear system of a network was not solved, whatever the step.
    LinearSystem,
    /// A formula, or the matrix beside a network, has no stress there.
    Formula,
    /// The backend could not make what the network needs.
    Backend,
}

impl PointFailure {
    /// Of a formula.
    pub(super) fn of_formula(element: usize, reason: &MaterialError) -> Self {
        Self { element, network: None, reason: reason.to_string(), kind: PointFailureKind::Formula }
    }

    /// Of a unit.
    pub(super) fn of_unit<F: std::error::Error>(
        element: usize,
        network: Option<String>,
        reason: &UnitError<F>,
    ) -> Self {
        let kind = match reason {
            UnitError::Rve(error) if error.is_linear() => PointFailureKind::LinearSystem,
            UnitError::Rve(_) => PointFailureKind::Network,
            UnitError::Material(_) => PointFailureKind::Formula,
            UnitError::Workspace(_) => PointFailureKind::Backend,
        };
        Self { element, network, reason: reason.to_string(), kind }
    }
}
