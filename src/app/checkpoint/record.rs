//! The content of the main file of a checkpoint.

use serde::{Deserialize, Serialize};

use super::body_pieces::BodyStatePiece;
use super::identity::Identity;
use crate::app::results::ResultsRecord;
use crate::fem::stepping::SavedState;
use crate::tissue::micro_scale::Piece;

/// The content of the main file of a checkpoint.
#[derive(Serialize, Deserialize)]
pub(super) struct Record {
    pub identity: Identity,
    pub state: SavedState,
    /// The results that must exist.
    pub written: ResultsRecord,
    pub body: Vec<BodyStatePiece>,
    pub pieces: Vec<Piece>,
}
