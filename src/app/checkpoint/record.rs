//! The content of a checkpoint in the form that is stored.

use serde::{Deserialize, Serialize};

use super::identity::Identity;
use crate::app::results::ResultsRecord;
use crate::fem::stepping::SavedState;
use crate::tissue::micro_scale::{RveStatus, SerializeIter, TissueMaterial, UnitState};

/// The content as read.
#[derive(Deserialize)]
pub(super) struct Record {
    pub identity: Identity,
    completed_steps: u64,
    halvings: u32,
    displacements: Vec<[f64; 3]>,
    /// The results that must exist.
    pub written: ResultsRecord,
    statuses: Vec<RveStatus>,
    units: Vec<UnitState>,
}

/// The content as written: the fields of [`Record`] in the same order, one RVE at a time.
#[derive(Serialize)]
struct RecordRef<'a, U> {
    identity: &'a Identity,
    completed_steps: u64,
    halvings: u32,
    displacements: &'a [[f64; 3]],
    written: &'a ResultsRecord,
    statuses: Vec<RveStatus>,
    units: U,
}

/// Returns the content of a checkpoint.
pub(super) fn record<'a>(
    identity: &'a Identity,
    state: &'a SavedState,
    written: &'a ResultsRecord,
    field: &'a impl TissueMaterial,
) -> impl Serialize {
    RecordRef {
        identity,
        completed_steps: state.completed_steps as u64,
        halvings: state.halvings,
        displacements: &state.displacements,
        written,
        statuses: field.sites().statuses(),
        units: SerializeIter(|| field.unit_states()),
    }
}

impl Record {
    /// Returns the states; `None` if a count does not fit into `usize`.
    pub fn into_states(self) -> Option<(SavedState, Vec<RveStatus>, Vec<UnitState>)> {
        let Self { completed_steps, halvings, displacements, statuses, units, .. } = self;
        let state = SavedState { completed_steps: usize::try_from(completed_steps).ok()?, halvings, displacements };
        Some((state, statuses, units))
    }
}
