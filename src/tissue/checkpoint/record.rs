//! The content of a checkpoint in the form that is stored.

use serde::ser::SerializeStruct;
use serde::{Deserialize, Serialize, Serializer};

use super::identity::Identity;
use crate::fem::material::Response;
use crate::fem::stepping::SavedState;
use crate::fiber::rve::{Rates, Rve};
use crate::las::{Backend, Scalar};
use crate::tissue::micro_scale::{TissueField, UnitState};

/// What is read.
#[derive(Deserialize)]
pub(super) struct Record {
    pub identity: Identity,
    done: u64,
    halvings: u32,
    displacements: Vec<[f64; 3]>,
    units: Vec<UnitRecord>,
}

/// What is written: the fields of [`Record`] in the same order, RVE by RVE.
pub(super) struct RecordRef<'a, B: Backend> {
    pub identity: &'a Identity,
    pub state: &'a SavedState,
    pub field: &'a TissueField<B>,
}

#[derive(Serialize, Deserialize)]
struct UnitRecord {
    rve: Option<RveRecord>,
    answer: Option<AnswerRecord>,
    iterations: u64,
}

/// Matrices column by column.
#[derive(Serialize, Deserialize)]
struct RveRecord {
    gradient: [[f64; 3]; 3],
    interior: Vec<[f64; 3]>,
    rates: Option<Vec<Rates>>,
}

/// Matrices column by column.
#[derive(Serialize, Deserialize)]
struct AnswerRecord {
    gradient: [[f64; 3]; 3],
    energy: f64,
    pk1: [[f64; 3]; 3],
    tangent: [[f64; 9]; 9],
}

impl<B: Backend<Scalar = f64>> Serialize for RecordRef<'_, B>
where
    B::Reduced: Scalar,
{
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut record = serializer.serialize_struct("Record", 5)?;
        record.serialize_field("identity", self.identity)?;
        record.serialize_field("done", &(self.state.done as u64))?;
        record.serialize_field("halvings", &self.state.halvings)?;
        record.serialize_field("displacements", &self.state.displacements)?;
        record.serialize_field("units", &Units(self.field))?;
        record.end()
    }
}

/// Makes one unit at a time: all of them may take as much memory as the body itself.
struct Units<'a, B: Backend>(&'a TissueField<B>);

impl<B: Backend<Scalar = f64>> Serialize for Units<'_, B>
where
    B::Reduced: Scalar,
{
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.unit_states().map(UnitRecord::from))
    }
}

impl Record {
    /// The states in it; `None` where a count is none of this machine.
    pub fn into_states(self) -> Option<(SavedState, Vec<UnitState>)> {
        let Self { done, halvings, displacements, units, .. } = self;
        let state = SavedState { done: usize::try_from(done).ok()?, halvings, displacements };
        Some((state, units.into_iter().map(UnitState::from).collect()))
    }
}

impl From<UnitState> for UnitRecord {
    fn from(state: UnitState) -> Self {
        Self {
            rve: state.rve.map(|rve| RveRecord {
                gradient: (*rve.gradient()).into(),
                interior: rve.interior().to_vec(),
                rates: rve.rates().map(<[Rates]>::to_vec),
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
            rve: record.rve.map(|rve| Rve::restored(rve.gradient.into(), rve.interior, rve.rates)),
            answer: record.answer.map(|answer| {
                let AnswerRecord { gradient, energy, pk1, tangent } = answer;
                (gradient.into(), Response { energy, pk1: pk1.into(), tangent: tangent.into() })
            }),
            iterations: usize::try_from(record.iterations).unwrap_or(usize::MAX),
        }
    }
}
