//! Scales: codes that run concurrently, each on its own ranks.

use std::cell::RefCell;
use std::collections::HashMap;
use std::fmt::Display;
use std::time::Duration;

use thiserror::Error;

use super::plan::{Plan, PlanError};
use crate::las::{Comm, CommError, Message, Tag};

/// The tag of broadcasts between scales.
const BROADCAST: Tag = Tag(1);

/// The scales of a program, as seen by one rank.
#[derive(Debug)]
pub struct Scales<C: Comm> {
    world: C,
    /// The communicator of this rank's scale.
    comm: C,
    names: Vec<String>,
    ranks: Vec<Vec<usize>>,
    own: usize,
    /// Number of couplings created so far for each pair of scales.
    couplings: RefCell<HashMap<[usize; 2], u32>>,
}

/// The main function of a scale; its communicator is [`Scales::comm`].
pub type Main<'a, C, R, E> = &'a dyn Fn(&Scales<C>) -> Result<R, E>;

/// The reason why scales cannot be created or cannot communicate.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ScaleError {
    /// The plan does not fit the ranks.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The communication failed.
    #[error(transparent)]
    Comm(#[from] CommError),
    /// No message from a scale arrived before the time-out.
    #[error("scale {scale} sent no message to scale {own} within {} s", .waited.as_secs_f64())]
    ReceiveTimeout {
        /// The scale that did not send.
        scale: String,
        /// The scale that waited.
        own: String,
        /// The waiting time.
        waited: Duration,
    },
    /// A scale did not receive a message before the time-out.
    #[error("scale {scale} received no message from scale {own} within {} s", .waited.as_secs_f64())]
    SendTimeout {
        /// The scale that did not receive.
        scale: String,
        /// The scale that waited.
        own: String,
        /// The waiting time.
        waited: Duration,
    },
    /// No scale has this number.
    #[error("there is no scale {number} among {scales}")]
    Number {
        /// The number, from 0.
        number: usize,
        /// Number of scales.
        scales: usize,
    },
    /// A scale has no main function.
    #[error("scale {0} has no main function")]
    NoMain(String),
}

impl<C: Comm> Scales<C> {
    /// Assigns the ranks to the scales. Collective over `world`; all ranks pass the same plan.
    ///
    /// # Errors
    /// Returns [`ScaleError`] if the plan does not fit or the communication fails.
    pub fn new(world: &C, plan: &Plan) -> Result<Self, ScaleError> {
        Self::with_time_out(world, plan, None)
    }

    /// Assigns the ranks to the scales as [`new`](Self::new) does, with a time-out for communication between scales;
    /// the error names the scale that did not respond. `None` waits indefinitely.
    ///
    /// # Errors
    /// Returns [`ScaleError`] if the plan does not fit or the communication fails.
    pub fn with_time_out(world: &C, plan: &Plan, time_out: Option<Duration>) -> Result<Self, ScaleError> {
        let local = format!("{:?}", plan.scales);
        let root = world.broadcast(0, Message::text(&local))?.to_text();
        if local != root {
            return Err(PlanError::Mismatch { local, root }.into());
        }
        let ranks = plan.assign(world.size())?;
        let names = plan.scales.iter().map(|(name, _)| name.clone()).collect();
        let own = ranks.iter().position(|ranks| ranks.contains(&world.rank())).ok_or(PlanError::NoScales)?;
        // Every rank belongs to a scale, its color; the ranks of a scale are ordered as in the plan.
        let key = ranks[own].iter().position(|&rank| rank == world.rank()).ok_or(PlanError::NoScales)?;
        // No time-out inside a scale: a stall there is always caused by another scale, which is the one reported.
        let comm = world.split(Some(own), key)?.ok_or(PlanError::NoScales)?;
        let world = world.duplicate(time_out)?;
        Ok(Self { world, comm, names, ranks, own, couplings: RefCell::default() })
    }

    /// Returns the communicator of all ranks of the program.
    pub fn world(&self) -> &C {
        &self.world
    }

    /// Returns the communicator of this rank's scale.
    pub fn comm(&self) -> &C {
        &self.comm
    }

    /// Returns the number of this rank's scale.
    pub fn own(&self) -> usize {
        self.own
    }

    /// Returns the number of the scale with this name.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|other| other == name)
    }

    /// Returns the name of a scale.
    ///
    /// # Panics
    /// Panics if there is no scale of this number.
    pub fn name(&self, scale: usize) -> &str {
        &self.names[scale]
    }

    /// Returns the world ranks of a scale, ordered by their rank in the scale.
    ///
    /// # Panics
    /// Panics if there is no scale of this number.
    pub fn ranks(&self, scale: usize) -> &[usize] {
        &self.ranks[scale]
    }

    /// Returns the rank in a scale of a world rank, or `None` if it belongs to another scale.
    ///
    /// # Panics
    /// Panics if there is no scale of this number.
    pub fn rank_in(&self, scale: usize, rank: usize) -> Option<usize> {
        self.ranks[scale].iter().position(|&other| other == rank)
    }

    /// Returns the number of a new coupling of two scales; both sides count equally.
    pub(super) fn next_coupling(&self, a: usize, b: usize) -> u32 {
        let mut couplings = self.couplings.borrow_mut();
        let count = couplings.entry([a.min(b), a.max(b)]).or_default();
        *count += 1;
        *count - 1
    }

    /// Sends the message of the root (rank 0) of this scale to all ranks of scale `to`, which call
    /// [`receive`](Self::receive). Collective over this scale.
    ///
    /// # Errors
    /// Returns [`ScaleError`] if the send fails or times out.
    pub fn broadcast(&self, to: usize, message: Message) -> Result<(), ScaleError> {
        let first = self.first_of(to)?;
        if self.comm.rank() > 0 {
            return Ok(());
        }
        self.world.send(first, BROADCAST, message).map_err(|error| self.timeout_of(to, error))
    }

    /// Receives what scale `from` [`broadcast`](Self::broadcast)s, on all ranks of this scale. Collective over this
    /// scale.
    ///
    /// # Errors
    /// Returns [`ScaleError`] if the receive fails or times out.
    pub fn receive(&self, from: usize) -> Result<Message, ScaleError> {
        let first = self.first_of(from)?;
        let receive = || {
            let received = if self.comm.rank() == 0 { self.world.receive(first, BROADCAST)? } else { Message::new() };
            self.comm.broadcast(0, received)
        };
        receive().map_err(|error| self.timeout_of(from, error))
    }

    /// Receives, on the root of this scale only, what scale `from` broadcasts; the other ranks do not wait.
    ///
    /// # Errors
    /// Returns [`ScaleError`] if the receive fails or times out.
    pub fn receive_on_root(&self, from: usize) -> Result<Message, ScaleError> {
        self.world.receive(self.first_of(from)?, BROADCAST).map_err(|error| self.timeout_of(from, error))
    }

    /// Waits on the root of this scale until a message of scale `from` has arrived; [`receive`](Self::receive) or
    /// [`receive_on_root`](Self::receive_on_root) then takes it.
    ///
    /// # Errors
    /// Returns [`ScaleError`] if the receive fails or times out.
    pub fn wait_for(&self, from: usize) -> Result<(), ScaleError> {
        self.world.wait_for(self.first_of(from)?, BROADCAST).map_err(|error| self.timeout_of(from, error))
    }

    /// Returns the world rank of the root of a scale.
    fn first_of(&self, scale: usize) -> Result<usize, ScaleError> {
        let ranks = self.ranks.get(scale).ok_or(ScaleError::Number { number: scale, scales: self.ranks.len() })?;
        ranks.first().copied().ok_or(ScaleError::Plan(PlanError::NoScales))
    }

    /// Attributes a time-out to the other scale.
    fn timeout_of(&self, other: usize, error: CommError) -> ScaleError {
        let (scale, own) = (self.names[other].clone(), self.names[self.own].clone());
        match error {
            CommError::TimeOut { waited, .. } => ScaleError::ReceiveTimeout { scale, own, waited },
            CommError::SendTimeOut { waited, .. } => ScaleError::SendTimeout { scale, own, waited },
            error => error.into(),
        }
    }

    /// Runs the main function of this rank's scale.
    ///
    /// # Errors
    /// Returns [`ScaleError::NoMain`] if the scale has no main function, or the error of that function.
    pub fn run<R, E: From<ScaleError>>(&self, mains: &[(&str, Main<'_, C, R, E>)]) -> Result<R, E> {
        let own = self.name(self.own);
        let main = mains.iter().find(|(name, _)| *name == own);
        let (_, main) = main.ok_or_else(|| E::from(ScaleError::NoMain(own.to_owned())))?;
        main(self)
    }
}

impl<C: Comm> Display for Scales<C> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let scale = |(name, ranks): (&String, &Vec<usize>)| format!("{name} on {} ranks", ranks.len());
        f.write_str(&self.names.iter().zip(&self.ranks).map(scale).collect::<Vec<_>>().join(", "))
    }
}
