//! The state of RVEs that passes from one load step to the next, to save and restore.

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize, Serializer};
use thiserror::Error;

use super::lifecycle::RveStatus;
use super::pieces::PieceError;
use super::raw::Raw;
use crate::fem::material::Response;
use crate::fem::mesh::IntegrationPoint;
use crate::fiber::network::Network;
use crate::fiber::rve::{Rve, RveStateError, Sensitivities};

/// The state of one RVE at the last converged load step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "UnitRecord", into = "UnitRecord")]
pub struct UnitState {
    /// The network; `None` for a matrix alone.
    pub rve: Option<Rve>,
    /// The last deformation gradient and the response there: the RVE returns this response at the same gradient without
    /// a solve.
    pub response: Option<(Matrix3<f64>, Response)>,
    /// Newton iterations of that load step.
    pub iterations: usize,
}

impl UnitState {
    /// Checks that the state matches the RVE of a point, which has this network or none.
    pub(super) fn check(&self, point: IntegrationPoint, network: Option<&Network>) -> Result<(), FieldRestoreError> {
        match (&self.rve, network) {
            (Some(rve), Some(network)) => rve.check(network).map_err(|reason| FieldRestoreError::Rve(point, reason)),
            (None, None) => Ok(()),
            (saved, _) => Err(FieldRestoreError::Fibers { point, saved: saved.is_some() }),
        }
    }
}

/// The state of the life cycles of all RVEs of a body.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SavedSites {
    /// The status of each point, [`RveStatus::Awake`] for one without an RVE.
    pub statuses: Vec<RveStatus>,
    /// The sleeping RVEs.
    pub asleep: Vec<SleepingRve>,
}

/// A sleeping RVE.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "(u64, ResponseRecord)", into = "(u64, ResponseRecord)")]
pub struct SleepingRve {
    /// Its point.
    pub point: usize,
    /// The deformation gradient at which it fell asleep, and its response there.
    pub extrapolation_point: (Matrix3<f64>, Response),
}

impl From<SleepingRve> for (u64, ResponseRecord) {
    fn from(rve: SleepingRve) -> Self {
        (rve.point as u64, rve.extrapolation_point.into())
    }
}

impl From<(u64, ResponseRecord)> for SleepingRve {
    fn from((point, response): (u64, ResponseRecord)) -> Self {
        Self { point: usize::try_from(point).unwrap_or(usize::MAX), extrapolation_point: response.into() }
    }
}

/// [`UnitState`] in the form that is stored and sent; matrices column by column.
#[derive(Serialize, Deserialize)]
struct UnitRecord {
    rve: Option<RveRecord>,
    response: Option<ResponseRecord>,
    iterations: u64,
}

#[derive(Serialize, Deserialize)]
struct RveRecord {
    gradient: [[f64; 3]; 3],
    interior: Raw<[f64; 3], 8>,
    sensitivities: Option<Raw<Sensitivities, 4>>,
}

#[derive(Serialize, Deserialize)]
struct ResponseRecord {
    gradient: [[f64; 3]; 3],
    energy: f64,
    pk1: [[f64; 3]; 3],
    tangent: [[f64; 9]; 9],
}

impl From<(Matrix3<f64>, Response)> for ResponseRecord {
    fn from((gradient, Response { energy, pk1, tangent }): (Matrix3<f64>, Response)) -> Self {
        Self { gradient: gradient.into(), energy, pk1: pk1.into(), tangent: tangent.into() }
    }
}

impl From<ResponseRecord> for (Matrix3<f64>, Response) {
    fn from(ResponseRecord { gradient, energy, pk1, tangent }: ResponseRecord) -> Self {
        (gradient.into(), Response { energy, pk1: pk1.into(), tangent: tangent.into() })
    }
}

impl From<UnitState> for UnitRecord {
    fn from(state: UnitState) -> Self {
        Self {
            rve: state.rve.map(|rve| {
                let (gradient, interior, sensitivities) = rve.into_parts();
                RveRecord { gradient: gradient.into(), interior: Raw(interior), sensitivities: sensitivities.map(Raw) }
            }),
            response: state.response.map(ResponseRecord::from),
            iterations: state.iterations as u64,
        }
    }
}

impl From<UnitRecord> for UnitState {
    fn from(record: UnitRecord) -> Self {
        Self {
            rve: record.rve.map(|rve| {
                let RveRecord { gradient, interior, sensitivities } = rve;
                Rve::restored(gradient.into(), interior.0, sensitivities.map(|sensitivities| sensitivities.0))
            }),
            response: record.response.map(Into::into),
            iterations: usize::try_from(record.iterations).unwrap_or(usize::MAX),
        }
    }
}

/// Serializes the items of an iterator one by one, because all of them together may need as much memory as the RVEs.
pub struct SerializeIter<F>(pub F);

impl<I: ExactSizeIterator<Item: Serialize>, F: Fn() -> I> Serialize for SerializeIter<F> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq((self.0)())
    }
}

/// The reason why saved RVEs do not match those of a field.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum FieldRestoreError {
    /// The numbers of points differ.
    #[error("the state has {found} integration points; this body has {expected}")]
    Points {
        /// Points of the state.
        found: usize,
        /// Points of the field.
        expected: usize,
    },
    /// The RVE of a point sleeps without a response, or has one although it does not sleep.
    #[error("{0}: only a sleeping RVE has a response to extrapolate from")]
    Asleep(IntegrationPoint),
    /// No piece holds the state of the RVE of a point.
    #[error("{0}: no piece of the state has its RVE")]
    NotInPieces(IntegrationPoint),
    /// A piece cannot be used.
    #[error(transparent)]
    Piece(#[from] PieceError),
    /// The numbers of RVEs differ.
    #[error("the state has {found} RVEs; this body has {expected}")]
    Units {
        /// RVEs of the state.
        found: usize,
        /// RVEs of the field.
        expected: usize,
    },
    /// Only one side has fibers.
    #[error("{point} has {} here", if *saved { "fibers in the saved state, but none" } else { "no fibers in the saved state, but has some" })]
    Fibers {
        /// The point.
        point: IntegrationPoint,
        /// Whether the saved state has fibers there.
        saved: bool,
    },
    /// Another rank failed to restore its RVEs, or communication failed.
    #[error("{0}")]
    Ranks(String),
    /// The saved state does not match the network of a point.
    #[error("{0}: {1}")]
    Rve(IntegrationPoint, RveStateError),
}
