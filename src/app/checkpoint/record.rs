//! The content of a checkpoint in the form that is stored.

use serde::ser::SerializeStruct;
use serde::{Deserialize, Serialize, Serializer};

use super::identity::Identity;
use super::raw::Raw;
use crate::app::results::ResultsRecord;
use crate::fem::material::Response;
use crate::fem::stepping::SavedState;
use crate::fiber::rve::{Rve, Sensitivities};
use crate::tissue::micro_scale::{Life, TissueMaterial, UnitState};

/// The content as read.
#[derive(Deserialize)]
pub(super) struct Record {
    pub identity: Identity,
    done: u64,
    halvings: u32,
    displacements: Vec<[f64; 3]>,
    /// The results that must exist.
    pub written: ResultsRecord,
    lives: Vec<Life>,
    units: Vec<UnitRecord>,
}

/// The content as written: the fields of [`Record`] in the same order, one RVE at a time.
pub(super) struct RecordRef<'a, M> {
    pub identity: &'a Identity,
    pub state: &'a SavedState,
    pub written: &'a ResultsRecord,
    pub field: &'a M,
}

#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct UnitRecord {
    rve: Option<RveRecord>,
    answer: Option<AnswerRecord>,
    iterations: u64,
}

/// Matrices column by column.
#[derive(Clone, Serialize, Deserialize)]
struct RveRecord {
    gradient: [[f64; 3]; 3],
    interior: Raw<[f64; 3], 8>,
    sensitivities: Option<Raw<Sensitivities, 4>>,
}

/// Matrices column by column.
#[derive(Clone, Serialize, Deserialize)]
struct AnswerRecord {
    gradient: [[f64; 3]; 3],
    energy: f64,
    pk1: [[f64; 3]; 3],
    tangent: [[f64; 9]; 9],
}

impl<M: TissueMaterial> Serialize for RecordRef<'_, M> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut record = serializer.serialize_struct("Record", 7)?;
        record.serialize_field("identity", self.identity)?;
        record.serialize_field("done", &(self.state.completed_steps as u64))?;
        record.serialize_field("halvings", &self.state.halvings)?;
        record.serialize_field("displacements", &self.state.displacements)?;
        record.serialize_field("written", self.written)?;
        record.serialize_field("lives", &self.field.sites().lives())?;
        record.serialize_field("units", &Units(self.field))?;
        record.end()
    }
}

/// Serializes one unit at a time, because all of them together may need as much memory as the body itself.
struct Units<'a, M>(&'a M);

impl<M: TissueMaterial> Serialize for Units<'_, M> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.unit_states().map(UnitRecord::from))
    }
}

impl Record {
    /// Returns the states; `None` if a count does not fit into `usize`.
    pub fn into_states(self) -> Option<(SavedState, Vec<Life>, Vec<UnitState>)> {
        let Self { done, halvings, displacements, lives, units, .. } = self;
        let state = SavedState { completed_steps: usize::try_from(done).ok()?, halvings, displacements };
        Some((state, lives, units.into_iter().map(UnitState::from).collect()))
    }
}

impl From<UnitState> for UnitRecord {
    fn from(state: UnitState) -> Self {
        Self {
            rve: state.rve.map(|rve| {
                let (gradient, interior, sensitivities) = rve.into_parts();
                RveRecord { gradient: gradient.into(), interior: Raw(interior), sensitivities: sensitivities.map(Raw) }
            }),
            answer: state.answer.map(|(gradient, Response { energy, pk1, tangent })| AnswerRecord {
                gradient: gradient.into(),
                energy,
                pk1: pk1.into(),
                tangent: tangent.into(),
            }),
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
            answer: record.answer.map(|answer| {
                let AnswerRecord { gradient, energy, pk1, tangent } = answer;
                (gradient.into(), Response { energy, pk1: pk1.into(), tangent: tangent.into() })
            }),
            iterations: usize::try_from(record.iterations).unwrap_or(usize::MAX),
        }
    }
}
