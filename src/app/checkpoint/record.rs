//! The content of a checkpoint in the form that is stored.

use serde::{Deserialize, Serialize};

use super::identity::Identity;
use crate::app::results::ResultsRecord;
use crate::fem::stepping::SavedState;
use crate::tissue::micro_scale::{RveStatus, UnitState};

/// The content of a checkpoint. `U` is the list of the states of all RVEs, which is written one RVE at a time.
#[derive(Serialize, Deserialize)]
pub(super) struct Record<U = Vec<UnitState>> {
    pub identity: Identity,
    pub state: SavedState,
    /// The results that must exist.
    pub written: ResultsRecord,
    pub statuses: Vec<RveStatus>,
    pub units: U,
}
