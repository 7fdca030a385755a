//! Scale-sensitive load balancing: units move from rank to rank of one scale, and the couplings to all other scales
//! follow.
//!
//! A balancing has three phases, each of which can be used alone: [`plan`] gathers the [`Loads`] of the scale and asks
//! a [`Planner`]; [`migrate`] sends serialized units point to point; [`Coupling::migrate`](super::Coupling::migrate)
//! and [`Coupling::reconcile_migrated`](super::Coupling::reconcile_migrated) update a coupling on its two sides.
//! Callers that move the data on their own pass the moves to [`Migration::announce`] instead of the second phase. A
//! [`Balancer`] decides during a run when to balance, by a [`Trigger`]; [`Weights`] are what units are expected to cost.
//!
//! # Example: three cells, one of which costs four times as much as the others
//!
//! ```
//! use biotissue::coupling::balance::{LongestFirst, migrate, plan};
//! use biotissue::coupling::{Channel, Comm, Coupling, EvenPartition, Message, Plan, Role, Scales, Share, thread};
//!
//! let shares = Plan::default().with("body", Share::Count(1)).with("cells", Share::Count(2));
//! thread::run(3, |comm| -> Result<(), Box<dyn std::error::Error>> {
//!     let scales = Scales::new(&comm, &shares)?;
//!     let units: &[u64] = if scales.own() == 0 { &[10, 11, 12] } else { &[] };
//!     let mut coupling = Coupling::new(&scales, "body", "cells", units, &[], &EvenPartition)?;
//!     let mut channel = Channel::<f64>::new(&coupling)?;
//!     match coupling.role() {
//!         Role::Producer => {
//!             coupling.reconcile_migrated()?;
//!             channel.send(&coupling, &[300.0, 301.0, 302.0])?; // still of 10, 11, 12
//!         }
//!         Role::Consumer => {
//!             let (cells, units) = (scales.comm(), coupling.units().to_vec()); // 10, 11 and 12
//!             let state: Vec<Vec<f64>> = units.iter().map(|&unit| vec![unit as f64; 1000]).collect();
//!             let weights: Vec<f64> = units.iter().map(|&unit| if unit == 10 { 4.0 } else { 1.0 }).collect();
//!
//!             let (_, plan) = plan(cells, &LongestFirst::default(), &weights, &[])?; // 0:{(1):1}
//!             let moves = plan.of(cells.rank());
//!             let (migration, arrived) = migrate(cells, moves, &units, |index| Message::of(&state[index]))?;
//!             let arrived = arrived.iter().map(|cell| cell.values().unwrap_or_default().to_vec()).collect();
//!             let state = migration.apply(state, arrived)?;
//!             coupling.migrate(&migration)?; // and the other couplings of the cells
//!
//!             let mut heat = vec![0.0; state.len()];
//!             channel.receive(&coupling, &mut heat)?;
//!             let expected: &[f64] = if cells.rank() == 0 { &[300.0] } else { &[302.0, 301.0] };
//!             assert_eq!(heat, expected);
//!             assert!(state.iter().zip(coupling.units()).all(|(cell, &unit)| cell[999] == unit as f64));
//!         }
//!     }
//!     Ok(())
//! })?;
//! # Ok::<(), thread::Failed>(())
//! ```
//!
//! After chapter 4 of W. R. Tobin, *The Adaptive Multiscale Simulation Infrastructure* (RPI 2018).

mod balancer;
mod error;
mod loads;
mod migrate;
mod plan;
mod planner;
mod predictor;
mod synchronize;
mod trigger;
mod weights;

pub use balancer::{Balancer, DueMigration};
pub use error::{BalanceError, MoveError};
pub use loads::{Loads, UnitLoads, max_over_mean};
pub use migrate::{Migration, Origin, migrate};
pub use plan::{MigrationPlan, Moves};
#[cfg(feature = "metis")]
pub use planner::{Affinity, Metis};
pub use planner::{Diffusive, Greedy, LongestFirst, Planner, plan, plan_units};
pub use predictor::{Predictor, Quantity};
pub use trigger::{Estimate, Trigger, TriggerParams};
pub use weights::{
    Cost, CostHistory, FEATURES, Iterations, SKILL_SAMPLE, Seconds, Unit, Weights, rank_correlation, record, skill,
};
