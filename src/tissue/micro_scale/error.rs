//! Errors of points, with the reason as text so that they can be sent between ranks.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::unit::UnitError;
use crate::fem::material::MaterialError;
use crate::fem::mesh::IntegrationPoint;

/// The reason why a field has no response.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TissueFieldError {
    /// A point has no response.
    #[error(transparent)]
    Point(#[from] PointFailure),
    /// Communication between the ranks that share the points failed.
    #[error("{0}")]
    Ranks(String),
}

/// A point without a response.
#[derive(Clone, Debug, Error, PartialEq, Eq, Serialize, Deserialize)]
#[error("{point}{}: {reason}", network.as_ref().map(|n| format!(" (network {n})")).unwrap_or_default())]
pub struct PointFailure {
    /// The point.
    pub point: IntegrationPoint,
    /// The network of the RVE, if it has one.
    pub network: Option<String>,
    /// The reason as text.
    pub reason: String,
    /// The kind of failure.
    pub kind: PointFailureKind,
}

/// The part of a point that failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum PointFailureKind {
    /// A network found no equilibrium.
    Network,
    /// A linear system of a network could not be solved, whatever the step length.
    LinearSystem,
    /// A formula, or the matrix in parallel with a network, has no stress there.
    Formula,
    /// The backend could not create a workspace for the network.
    Backend,
    /// The device that solves most RVEs failed, which no smaller load step changes.
    Device,
}

impl TissueFieldError {
    /// Returns true if the error does not depend on the trial state.
    pub(in crate::tissue) fn is_final(&self) -> bool {
        matches!(self, Self::Ranks(_) | Self::Point(PointFailure { kind: PointFailureKind::Device, .. }))
    }
}

impl PointFailure {
    /// Reports the failure of a formula.
    pub(super) fn of_formula(point: IntegrationPoint, reason: &MaterialError) -> Self {
        Self { point, network: None, reason: reason.to_string(), kind: PointFailureKind::Formula }
    }

    /// Reports the failure of a unit.
    pub(super) fn of_unit<F: std::error::Error>(
        point: IntegrationPoint,
        network: Option<String>,
        reason: &UnitError<F>,
    ) -> Self {
        let kind = match reason {
            UnitError::Rve(error) if error.is_linear() => PointFailureKind::LinearSystem,
            UnitError::Rve(_) => PointFailureKind::Network,
            UnitError::Material(_) => PointFailureKind::Formula,
            UnitError::Workspace(_) => PointFailureKind::Backend,
        };
        Self { point, network, reason: reason.to_string(), kind }
    }
}
