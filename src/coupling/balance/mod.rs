//! Scale-sensitive load balancing.

mod error;
mod loads;
mod migrate;
mod plan;
mod synchronize;

pub use error::{BalanceError, MoveError};
pub use loads::{Loads, max_over_mean};
pub use migrate::{Migration, Origin, migrate};
pub use plan::{MigrationPlan, Moves};
