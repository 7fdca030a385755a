//! Ranks that set up a case together: the first rank of the body reads the mesh, and sends the others what they need.

use serde::{Deserialize, Serialize};

use crate::app::case::Case;
use crate::app::material_fields::MaterialFields;
use crate::coupling::Scales;
use crate::fem::stepping::BodyPiece;
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
    /// Returns the error of the connection.
    fn send(&self, rank: usize, message: Message) -> Result<(), CommError>;

    /// Receives a message of the first rank of the body.
    ///
    /// # Errors
    /// Returns the error of the connection.
    fn receive(&self) -> Result<Message, CommError>;

    /// Sends a message to all ranks of the RVEs.
    ///
    /// # Errors
    /// Returns the error of the connection.
    fn send_to_rves(&self, message: &Message) -> Result<(), CommError>;
}

/// A single process.
impl SetupRanks for () {
    fn rank(&self) -> usize {
        0
    }

    fn count(&self) -> usize {
        1
    }

    fn send(&self, _: usize, _: Message) -> Result<(), CommError> {
        Ok(())
    }

    fn receive(&self) -> Result<Message, CommError> {
        Ok(Message::new())
    }

    fn send_to_rves(&self, _: &Message) -> Result<(), CommError> {
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
}

impl<C: Comm> ScaleRanks<'_, C> {
    fn ranks_of(&self, scale: &str) -> &[usize] {
        self.scales.find(scale).map_or(&[], |scale| self.scales.ranks(scale))
    }

    fn root(&self) -> usize {
        self.ranks_of(MACRO).first().copied().unwrap_or_default()
    }

    /// Returns the materials of a case on a rank of the micro scale. Those that depend on the mesh come from the macro
    /// scale.
    ///
    /// # Errors
    /// Returns the reason as text if the macro scale failed, or the connection to it.
    pub fn materials(&self, case: &Case) -> Result<Materials, String> {
        if let Some(materials) = case.materials() {
            return Ok(materials);
        }
        let message = self.world.receive(self.root(), SETUP).map_err(|error| error.to_string())?;
        let fields: Option<MaterialFields> = unpack(&message).map_err(|error| error.to_string())?;
        let fields = fields.ok_or("the macro scale could not be set up")?;
        fields.materials(case).ok_or_else(|| "the ranks have different cases".into())
    }
}

impl<C: Comm> SetupRanks for ScaleRanks<'_, C> {
    fn rank(&self) -> usize {
        if self.divides { self.scales.comm().rank() } else { 0 }
    }

    fn count(&self) -> usize {
        if self.divides { self.scales.comm().size() } else { 1 }
    }

    fn send(&self, rank: usize, message: Message) -> Result<(), CommError> {
        self.world.send(self.ranks_of(MACRO)[rank], SETUP, message)
    }

    fn receive(&self) -> Result<Message, CommError> {
        self.world.receive(self.root(), SETUP)
    }

    fn send_to_rves(&self, message: &Message) -> Result<(), CommError> {
        self.ranks_of(MICRO).iter().try_for_each(|&rank| self.world.send(rank, SETUP, message.clone()))
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
    /// The points whose networks are written.
    pub networks: Vec<usize>,
    /// The number of unknowns of the whole body.
    pub unknowns: usize,
    /// The hashes of the whole mesh and of its material fields.
    pub hashes: (u64, Option<u64>),
}

/// Sends a rank its part; `None` if the body cannot be divided.
pub(super) fn send_setup(ranks: &dyn SetupRanks, rank: usize, part: Option<PartSetup>) -> Result<(), String> {
    let setup = part.map_or(RankSetup::Undivided, |part| RankSetup::Part(Box::new(part)));
    ranks.send(rank, packed(&setup)?).map_err(|error| error.to_string())
}

/// Receives what the first rank sends.
pub(super) fn receive_setup(ranks: &dyn SetupRanks) -> Result<RankSetup, String> {
    let message = ranks.receive().map_err(|error| error.to_string())?;
    unpack(&message).map_err(|error| error.to_string())
}

/// Sends the ranks of the RVEs the materials, if these depend on the mesh, without the values at points: these come with
/// the RVEs.
pub(super) fn send_fields(ranks: &dyn SetupRanks, fields: Option<&MaterialFields>) -> Result<(), String> {
    let Some(fields) = fields else { return Ok(()) };
    ranks.send_to_rves(&packed(&Some(fields.on_points(&[])))?).map_err(|error| error.to_string())
}

/// Tells all ranks that wait that the case could not be set up.
pub(super) fn send_failure(ranks: &dyn SetupRanks, rves_wait: bool) {
    let (Ok(of_part), Ok(of_rves)) = (packed(&RankSetup::Failed), packed(&None::<MaterialFields>)) else { return };
    // A rank that does not get the message has failed itself, which ends all ranks.
    for rank in 1..ranks.count() {
        let _ = ranks.send(rank, of_part.clone());
    }
    if rves_wait {
        let _ = ranks.send_to_rves(&of_rves);
    }
}

fn packed<T: Serialize>(value: &T) -> Result<Message, String> {
    pack(value).map_err(|error| format!("the setup of the body cannot be sent to other ranks: {error}"))
}
