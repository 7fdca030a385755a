//! Coupling of the two scales of a tissue, each on its own ranks.
//!
//! | module | holds |
//! |---|---|
//! | `protocol`, `piece_messages` | the messages between the scales; those about the pieces of a checkpoint |
//! | `macro_side` | the macro scale: a material that gets its stress from RVEs on other ranks |
//! | `micro_proxy` | the micro scale as seen by the macro scale: sends commands and tasks, receives responses |
//! | `divided` | a body of which each macro rank holds a part: its RVEs, and the responses of its ghosts |
//! | `shard` | the elements of one macro rank and the couplings of their RVEs |
//! | `channels` | the couplings of the RVEs of one rank, the same on both scales |
//! | `micro_side` | the micro scale: solves its RVEs and sends the responses |
//! | `balance` | moves RVEs between the ranks of the micro scale |
//! | `progress` | what the RVEs of all ranks do, for a report of progress |
//! | `partition` | assigns elements to macro ranks |
//!
//! The root of the macro scale broadcasts a command; the micro scale carries it out:
//!
//! ```text
//! macro scale                                      micro scale
//! -----------                                      -----------
//! until all steps are complete:                    while not complete:
//! a migration may be due: Command::Balance ----->   plan; if it pays, migrate RVEs, and both update their couplings
//!   Newton evaluates: Command::Step or Iterate       while not step_complete:
//!     send tasks ------------------------------>       receive tasks
//!     receive responses <-----------------------       solve all RVEs, send responses
//!   Newton converged: Iterate, Task::Verify --->       verify that responses continue the last step
//!   strain creates RVEs: Command::Units ------->       update units; Newton evaluates again
//!   converged: Command::Commit; else Revert --->     step_complete
//!     receive summaries for the fields <--------       after a commit: send summaries
//!   strain deletes RVEs: Command::Units ------->     update units
//! a checkpoint is due: Command::Save ---------->   each rank writes the states of its RVEs to a piece
//! Command::Complete --------------------------->   complete
//! ```
//!
//! # Example: planner and weights of a user
//!
//! A box of 48 elements with a network in each is strained in one half, where RVEs take more iterations. Three ranks solve
//! them; the planner deals out all RVEs by turns, the heaviest first.
//!
//! ```
//! use biotissue::backends::sparse::Sparse;
//! use biotissue::coupling::balance::{BalanceError, CostHistory, Loads, MigrationPlan, TriggerParams};
//! use biotissue::coupling::{Plan, Scales, Share, thread};
//! use biotissue::fem::mesh::shapes::cuboid;
//! use biotissue::fem::point_field::{PointField, PointResponses};
//! use biotissue::tissue::materials::{ElementSelection, Materials};
//! use biotissue::tissue::micro_scale::{Library, TissueField, TissueMaterial};
//! use biotissue::tissue::two_scale::{BalanceParams, BodySolve, MACRO, MICRO, MicroOutput, ScaleField, When, run_micro};
//! use nalgebra::Matrix3;
//!
//! # fn materials() -> Materials {
//! #     use biotissue::fiber::rve::StressScale;
//! #     use biotissue::tissue::materials::{FiberRve, NetworkAssignment, Region, RegionMaterial, RveLifecycle};
//! #     let rve = FiberRve {
//! #         networks: vec!["tests/networks/frozen.txt".into()],
//! #         assignment: NetworkAssignment::Cycle,
//! #         seed: 0,
//! #         scale: StressScale::Raw.into(),
//! #         law: None,
//! #         matrix: None,
//! #         lifecycle: RveLifecycle::default(),
//! #     };
//! #     let region = Region { name: "*".into(), material: RegionMaterial::FiberRve(rve) };
//! #     Materials { regions: vec![region], ..Materials::default() }
//! # }
//! # fn evaluate(field: &mut impl PointField) -> Result<PointResponses, Box<dyn std::error::Error>> {
//! #     let mut responses = PointResponses::zeros(48);
//! #     for iteration in 1..=3 {
//! #         let strained = Matrix3::identity() + Matrix3::from_element(0.02 * f64::from(iteration));
//! #         let gradients: Vec<_> = (0..48).map(|k| if k < 24 { strained } else { Matrix3::identity() }).collect();
//! #         field.update(&gradients, &mut responses).map_err(|error| error.to_string())?;
//! #     }
//! #     field.commit(true).map_err(|error| error.to_string())?;
//! #     Ok(responses)
//! # }
//! let by_turns = |loads: &Loads| -> Result<MigrationPlan, BalanceError> {
//!     let (mut order, ranks): (Vec<usize>, _) = ((0..loads.units()).collect(), loads.ranks() as u32);
//!     order.sort_by(|&a, &b| loads.weights()[b].total_cmp(&loads.weights()[a]));
//!     let mut targets = vec![0; loads.units()];
//!     (0..).zip(order).for_each(|(turn, unit)| targets[unit] = turn % ranks);
//!     MigrationPlan::to_targets(loads, &targets)
//! };
//! let last_iterations = |history: &CostHistory| 1.0 + history.iterations;
//! // Plans after every sweep, whatever a migration takes.
//! let trigger = TriggerParams { threshold: 1.0, always: true, ..TriggerParams::default() };
//!
//! let shares = Plan::default().with(MACRO, Share::Count(1)).with(MICRO, Share::Count(3));
//! thread::run(4, |comm| -> Result<(), Box<dyn std::error::Error>> {
//!     let scales = Scales::new(&comm, &shares)?;
//!     let when = When::Iteration;
//!     if scales.find(MICRO) == Some(scales.own()) {
//!         let (library, _) = Library::<Sparse>::read((), materials())?;
//!         let output = MicroOutput { networks: ElementSelection::None, costs: false };
//!         let balance = BalanceParams { planner: by_turns, weights: last_iterations, trigger, when };
//!         return Ok(run_micro(&scales, library, output, Some(balance), None)?);
//!     }
//!     let mesh = cuboid([2, 2, 2], [1.0; 3])?;
//!     let (mut field, _) =
//!         ScaleField::<_, Sparse>::new((&scales, BodySolve::Root, Some(when)), (), materials(), &mesh)?;
//!     field.couple()?;
//!     let responses = evaluate(&mut field)?; // updates the field three times
//!     let migrations = field.take_balance().migrations;
//!     assert!(migrations[0].units > 0 && migrations[0].max_over_mean[1] < 1.3, "{migrations:?}");
//!
//!     let (mut in_one_process, _) = TissueField::<Sparse>::new((), materials(), &mesh)?;
//!     assert_eq!(responses, evaluate(&mut in_one_process)?);
//!     Ok(())
//! })?;
//! # Ok::<(), thread::Failed>(())
//! ```

mod balance;
mod channels;
mod divided;
mod follower;
mod macro_side;
mod micro_proxy;
mod micro_side;
mod partition;
mod piece_messages;
mod progress;
mod protocol;
mod shard;

use thiserror::Error;

pub use balance::{BalanceParams, BalanceReport, MigrationReport, PlannerName, RveWeights, WeightsName, When};
pub use follower::follow;
pub use macro_side::ScaleField;
pub use micro_proxy::BodySolve;
pub use micro_side::{MicroOutput, run as run_micro};
pub use partition::partition;
pub use progress::ProgressChannel;
pub use protocol::{MACRO, MICRO, RankTimes};
#[cfg(feature = "app")]
pub(crate) use protocol::{pack, unpack};

use super::micro_scale::{MovingError, TissueFieldError};
use crate::coupling::balance::BalanceError;
use crate::coupling::{CouplingError, ScaleError};
use crate::fem::mesh::IntegrationPoint;
use crate::las::CommError;

/// Errors of the exchange between the scales.
#[derive(Debug, Error)]
pub enum TwoScaleError {
    /// Communication between ranks failed.
    #[error(transparent)]
    Comm(#[from] CommError),
    /// The coupling of the RVEs failed.
    #[error(transparent)]
    Coupling(#[from] CouplingError),
    /// The ranks cannot be divided among the scales, or a scale did not send or receive in time.
    #[error(transparent)]
    Scales(#[from] ScaleError),
    /// The load of the micro scale cannot be balanced.
    #[error("load balancing: {0}")]
    Balance(#[from] BalanceError),
    /// An RVE cannot move to another rank.
    #[error("an RVE cannot move to another rank: {0}")]
    Moving(#[from] MovingError),
    /// A rank does not have the material of the RVE at this point.
    #[error("{0}: the ranks have different materials")]
    Materials(IntegrationPoint),
    /// No scale has this name.
    #[error("there is no scale {0}")]
    Scale(&'static str),
    /// A message cannot be decoded.
    #[error("the scales are out of step: {0}")]
    Message(#[from] postcard::Error),
    /// A message holds another command or another number of values than the protocol expects at this point.
    #[error("the scales are out of step: a message of another kind was expected")]
    Protocol,
}

impl From<TwoScaleError> for TissueFieldError {
    fn from(error: TwoScaleError) -> Self {
        Self::Ranks(error.to_string())
    }
}
