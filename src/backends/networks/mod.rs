//! Equilibria of many fiber networks with the same connectivity at once: what the solvers have in common.
//!
//! | solver | a network is |
//! |---|---|
//! | [`lanes`] | a lane of the vector registers of the processor |
//! | `cuda::networks` | a thread of a graphics processor |
//!
//! Both find equilibria by Newton's method with a line search, factor the stiffness in 3x3 blocks, prove with the factor
//! that an equilibrium is stable, and compute stress, energy and the sensitivities for the tangent. The order of
//! elimination and the operations of the factorization are computed once for all networks and are data (`schedule.rs`). A
//! network that needs more than Newton's method (its stiffness is not positive definite, the line search fails, the
//! iterations do not suffice) keeps its state and gets a [`Status`] that says so.

mod data;
pub mod lanes;
mod plan;
mod result;
mod schedule;

pub use data::{BatchParams, LawData, LawFormula, NetworkData, NetworkStates};
pub(super) use plan::Plan;
pub(super) use result::{MODES, RESULT_LEN};
pub use result::{NetworkResult, NetworkResults, Status};
pub(super) use schedule::{NONE, PanelShape, Schedule, TileShape};

/// Most Newton steps of the test whether an equilibrium continues another.
pub(super) const STEPS_OF_CONTINUATION: u32 = 3;
