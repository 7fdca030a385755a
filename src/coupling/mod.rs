//! AMSI: couplings between separate single-scale codes, each on its own ranks.
//!
//! A *scale* is a code that runs on some of the ranks, on a communicator of its own; it needs no knowledge of the other
//! scales. A *coupling* is directed: it records which *units* of the producer scale's data go to which ranks of the
//! consumer scale. A *channel* transfers values of the units point to point, between neighbors only. Units have numbers
//! of their own, so that results need not depend on their distribution; they can be added and removed at run time, and
//! [move from rank to rank](balance) so that all ranks have the same load.
//!
//! # Example: two scales on threads, with units that are added and removed
//!
//! ```
//! use biotissue::coupling::{Channel, Coupling, EvenPartition, Plan, Role, Scales, Share, thread};
//!
//! // One rank owns the units and sends them to two others.
//! let plan = Plan::default().with("body", Share::Count(1)).with("cells", Share::Ratio(1.0));
//! thread::run(3, |comm| -> Result<(), Box<dyn std::error::Error>> {
//!     let scales = Scales::new(&comm, &plan)?;
//!     let units: &[u64] = if scales.own() == 0 { &[10, 11, 12] } else { &[] };
//!     let mut coupling = Coupling::new(&scales, "body", "cells", units, &[], &EvenPartition)?;
//!     let mut channel = Channel::<f64>::new(&coupling)?;
//!     match coupling.role() {
//!         Role::Producer => {
//!             coupling.remove(&[11])?;
//!             let new = coupling.add(&[20], &[], &EvenPartition)?;
//!             channel.send(&new, &[293.0])?; // of the new unit alone
//!             let pending = channel.start(&coupling, &[300.0, 301.0, 302.0])?; // of 10, 12, 20
//!             // Work goes on here.
//!             channel.finish(&coupling, pending)?;
//!             let mut back = [0.0; 3];
//!             channel.receive(&coupling.inverse(), &mut back)?;
//!             assert_eq!(back, [600.0, 602.0, 604.0]);
//!         }
//!         Role::Consumer => {
//!             let mut state = vec![273.0; coupling.units().len()];
//!             // Keeps the state of the remaining units and appends the initial values of the new ones.
//!             state = coupling.reconcile_removed()?.iter().map(|&index| state[index as usize]).collect();
//!             let new = coupling.reconcile_added()?;
//!             let mut first = vec![0.0; new.units().len()];
//!             channel.receive(&new, &mut first)?;
//!             state.extend(first);
//!             let pending = channel.start_receive(&coupling)?;
//!             // Work goes on here too.
//!             channel.finish_receive(&coupling, pending, &mut state)?;
//!             let answers: Vec<f64> = state.iter().map(|value| 2.0 * value).collect();
//!             channel.send(&coupling.inverse(), &answers)?;
//!         }
//!     }
//!     Ok(())
//! })?;
//! # Ok::<(), thread::Failed>(())
//! ```
//!
//! # The same on processes
//!
//! A function of a rank that is generic over [`Comm`] runs on threads ([`thread::run`]) and, with the feature `mpi`, on the
//! processes that `mpirun` started (`mpi::run`). There, a rank that fails ends all processes; the second argument returns
//! the exit code for its error.
//!
//! ```no_run
//! use std::error::Error;
//! use biotissue::coupling::{Comm, Plan, Scales, Share};
//!
//! fn on_rank<C: Comm>(comm: &C) -> Result<(), Box<dyn Error>> {
//!     let plan = Plan::default().with("body", Share::Count(1)).with("cells", Share::Ratio(1.0));
//!     let scales = Scales::new(comm, &plan)?;
//!     println!("rank {} belongs to {}", comm.rank(), scales.name(scales.own()));
//!     Ok(())
//! }
//!
//! # #[cfg(feature = "mpi")]
//! biotissue::coupling::mpi::run(|comm| on_rank(&comm), |_error| 1);
//! ```
//!
//! After chapter 2 of W. R. Tobin, *The Adaptive Multiscale Simulation Infrastructure* (RPI 2018).

pub mod balance;
mod config;
mod couple;
mod data;
mod exchange;
mod partition;
mod plan;
mod scale;
pub mod topology;
mod unit_map;

pub use config::{Config, Relation};
pub use couple::{Coupling, CouplingError, Delta, Role};
pub use data::{Distribution, UnitId};
pub use exchange::{Channel, PendingReceive, PendingSend};
pub use partition::{EvenPartition, Partitioner, WeightedPartition};
pub use plan::{Plan, PlanError, Share};
pub use scale::{Main, ScaleError, Scales};

// Re-exports ranks and messages, so that users of couplings need no other module.
#[cfg(feature = "mpi")]
pub use crate::backends::comm::mpi;
pub use crate::backends::comm::thread;
pub use crate::las::{Comm, CommError, Layout, Message, Payload, bytemuck};
