//! Ranks that set up a case together: the first rank of the body reads the mesh, and sends the others what they need.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::body_files::BodyFiles;
use crate::app::case::Case;
use crate::app::material_fields::MaterialFields;
use crate::app::results::log::SurfacePlace;
use crate::coupling::Scales;
use crate::fem::stepping::{BodyDivision, BodyPiece};
use crate::input::InputErrors;
use crate::las::{Comm, CommError, Message, Tag};
use crate::tissue::materials::Materials;
use crate::tissue::two_scale::{MACRO, MICRO, pack, unpack};

/// What the setup of a case sends from rank to rank.
const SETUP: Tag = Tag::of(4);

/// The ranks among which a body is divided, and those of its RVEs.
pub trait SetupRanks {
    /// Returns the rank of the caller among those of the body, from 0.
    fn rank(&self) -> usize;

    /// Returns the number of ranks of the body; 1 if it is not divided.
    fn count(&self) -> usize;

    /// Sends a message to a rank of the body.
    ///
    /// # Errors
    /// Returns the error of the connection, or of the file.
    fn send(&self, rank: usize, message: Message) -> Result<(), ExchangeError>;

    /// Receives the part of this rank.
    ///
    /// # Errors
    /// Returns the error of the connection, or of the file.
    fn receive(&self) -> Result<Message, ExchangeError>;

    /// Sends a message to all ranks of the RVEs.
    ///
    /// # Errors
    /// Returns the error of the connection, or of the file.
    fn send_to_rves(&self, message: &Message) -> Result<(), ExchangeError>;

    /// Returns the files from which every rank reads its part, if the body was divided before.
    fn files(&self) -> Option<&BodyFiles> {
        None
    }

    /// Returns true if these are files from which the ranks of later runs read: then the first rank needs its part too, and
    /// the body must be one that can be divided.
    fn are_files(&self) -> bool {
        false
    }
}

/// The reason why the ranks do not get what they set up from.
#[derive(Debug, Error)]
pub enum ExchangeError {
    /// The connection failed, or another rank.
    #[error("{0}")]
    Ranks(String),
    /// A file of a body that was divided before cannot be read or written.
    #[error(transparent)]
    File(#[from] InputErrors),
}

impl From<CommError> for ExchangeError {
    fn from(error: CommError) -> Self {
        Self::Ranks(error.to_string())
    }
}

impl From<postcard::Error> for ExchangeError {
    fn from(error: postcard::Error) -> Self {
        Self::Ranks(format!("the setup of the body cannot be exchanged between the ranks: {error}"))
    }
}

/// A single process.
impl SetupRanks for () {
    fn rank(&self) -> usize {
        0
    }

    fn count(&self) -> usize {
        1
    }

    fn send(&self, _: usize, _: Message) -> Result<(), ExchangeError> {
        Ok(())
    }

    fn receive(&self) -> Result<Message, ExchangeError> {
        Ok(Message::new())
    }

    fn send_to_rves(&self, _: &Message) -> Result<(), ExchangeError> {
        Ok(())
    }
}

/// The ranks of both scales. Each waits without limit for the one that reads the mesh.
pub struct ScaleRanks<'a, C: Comm> {
    /// All ranks of the program.
    pub world: &'a C,
    /// The scales.
    pub scales: &'a Scales<C>,
    /// Whether the body is divided among the ranks of the macro scale.
    pub divides: bool,
    /// The files of the body, if it was divided before.
    pub files: Option<&'a BodyFiles>,
}

impl<C: Comm> ScaleRanks<'_, C> {
    fn ranks_of(&self, scale: &str) -> &[usize] {
        self.scales.find(scale).map_or(&[], |scale| self.scales.ranks(scale))
    }

    fn root(&self) -> usize {
        self.ranks_of(MACRO).first().copied().unwrap_or_default()
    }

    /// Returns the materials of a case on a rank of the micro scale. Those that depend on the mesh come from the macro
    /// scale, or from the files of the body.
    ///
    /// # Errors
    /// Returns [`ExchangeError`] if the macro scale failed, or the connection to it, or if the file cannot be read.
    pub fn materials(&self, case: &Case) -> Result<Materials, ExchangeError> {
        if let Some(materials) = case.materials() {
            return Ok(materials);
        }
        let message = match self.files {
            Some(files) => files.fields()?,
            None => self.world.receive(self.root(), SETUP)?,
        };
        let failed = |reason: &str| ExchangeError::Ranks(reason.into());
        let fields: Option<MaterialFields> = unpack(&message)?;
        let fields = fields.ok_or_else(|| failed("the macro scale could not be set up"))?;
        fields.materials(case).ok_or_else(|| failed("the ranks have different cases"))
    }
}

impl<C: Comm> SetupRanks for ScaleRanks<'_, C> {
    fn rank(&self) -> usize {
        if self.divides { self.scales.comm().rank() } else { 0 }
    }

    fn count(&self) -> usize {
        if self.divides { self.scales.comm().size() } else { 1 }
    }

    fn send(&self, rank: usize, message: Message) -> Result<(), ExchangeError> {
        Ok(self.world.send(self.ranks_of(MACRO)[rank], SETUP, message)?)
    }

    fn receive(&self) -> Result<Message, ExchangeError> {
        Ok(match self.files {
            Some(files) => files.part(self.rank())?,
            None => self.world.receive(self.root(), SETUP)?,
        })
    }

    fn send_to_rves(&self, message: &Message) -> Result<(), ExchangeError> {
        self.ranks_of(MICRO).iter().try_for_each(|&rank| Ok(self.world.send(rank, SETUP, message.clone())?))
    }

    fn files(&self) -> Option<&BodyFiles> {
        self.files
    }
}

/// What the first rank of a body sends to another.
#[derive(Deserialize, Serialize)]
pub(super) enum RankSetup {
    /// It could not set up the case.
    Failed,
    /// The body cannot be divided: every rank reads it.
    Undivided,
    /// The part of the rank.
    Part(Box<PartSetup>),
}

/// The part of a rank, and what it needs to know of the whole body.
#[derive(Deserialize, Serialize)]
pub(super) struct PartSetup {
    pub piece: BodyPiece,
    /// The fields of the materials at the points of the part, if these depend on the mesh.
    pub fields: Option<MaterialFields>,
    pub common: CommonSetup,
    /// What else the first rank needs, if it reads a file.
    pub of_whole: Option<OfWhole>,
}

/// What all ranks need to know of the whole body.
#[derive(Clone, Deserialize, Serialize)]
pub(super) struct CommonSetup {
    /// The points whose networks are written.
    pub networks: Vec<usize>,
    /// The number of unknowns.
    pub unknowns: usize,
    /// The hashes of the mesh and of its material fields.
    pub hashes: (u64, Option<u64>),
}

/// What the first rank needs to know of the whole body, besides what all ranks do.
#[derive(Debug, Default, Deserialize, Serialize)]
pub(super) struct OfWhole {
    /// The surfaces with boundary conditions.
    pub surfaces: Vec<SurfacePlace>,
    /// The number of integration points that may have an RVE.
    pub rve_points: usize,
    /// The warnings of the body; if its materials vary, also of floppy networks, whose matrix a part does not know everywhere.
    pub warnings: Vec<String>,
}

/// Sends every rank that waits its part; if `divided` is `None`, the body cannot be divided. `of_whole` is for ranks that are
/// files.
pub(super) fn send_parts(
    ranks: &dyn SetupRanks,
    divided: Option<&BodyDivision<'_>>,
    fields: Option<&MaterialFields>,
    common: &CommonSetup,
    mut of_whole: Option<OfWhole>,
) -> Result<(), ExchangeError> {
    let first = if ranks.are_files() { 0 } else { 1 };
    for rank in first..ranks.count() {
        let setup = divided.map_or(RankSetup::Undivided, |divided| {
            let fields = fields.map(|fields| fields.on_points(&divided.points(rank)));
            let (piece, common, of_whole) = (divided.piece(rank), common.clone(), of_whole.take());
            RankSetup::Part(Box::new(PartSetup { piece, fields, common, of_whole }))
        });
        ranks.send(rank, pack(&setup)?)?;
    }
    Ok(())
}

/// Receives what the first rank sends.
pub(super) fn receive_setup(ranks: &dyn SetupRanks) -> Result<RankSetup, ExchangeError> {
    let message = ranks.receive()?;
    unpack(&message).map_err(|error| match ranks.files() {
        Some(files) => files.undecodable(&error).into(),
        None => error.into(),
    })
}

/// Sends the ranks of the RVEs the materials, if these depend on the mesh, without the values at points: these come with
/// the RVEs.
pub(super) fn send_fields(ranks: &dyn SetupRanks, fields: Option<&MaterialFields>) -> Result<(), ExchangeError> {
    let Some(fields) = fields else { return Ok(()) };
    ranks.send_to_rves(&pack(&Some(fields.on_points(&[])))?)
}

/// Tells all ranks that wait that the case could not be set up.
pub(super) fn send_failure(ranks: &dyn SetupRanks, rves_wait: bool) {
    let (Ok(of_part), Ok(of_rves)) = (pack(&RankSetup::Failed), pack(&None::<MaterialFields>)) else { return };
    // A rank that does not get the message has failed itself, which ends all ranks.
    for rank in 1..ranks.count() {
        let _ = ranks.send(rank, of_part.clone());
    }
    if rves_wait {
        let _ = ranks.send_to_rves(&of_rves);
    }
}
