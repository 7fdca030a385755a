//! What a relaxation took, and why it did not come to rest.

use thiserror::Error;

/// What a relaxation took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RelaxationReport {
    /// Steps, those of repeated integrations included.
    pub steps: usize,
    /// Integrations repeated with half the step.
    pub repeats: u32,
    /// `|r|` of the interior at the end, N.
    pub residual: f64,
    /// The same over the norm of all nodal forces; 0 where there are none.
    pub relative: f64,
    /// Energies at the end, J in unit-cube lengths.
    pub energies: Energies,
}

/// Where the work of the boundary went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energies {
    /// Done at the boundary.
    pub work: f64,
    /// Gained by the fibers.
    pub strain: f64,
    /// Of the moving nodes.
    pub kinetic: f64,
    /// Taken by the damping.
    pub damped: f64,
}

impl Energies {
    /// What is missing from the balance, over the largest of the energies.
    #[must_use]
    pub fn error(&self) -> f64 {
        let largest = self.work.abs().max(self.strain.abs()).max(self.kinetic).max(self.damped);
        let missing = (self.strain + self.kinetic + self.damped - self.work).abs();
        // An overflow is no balance either.
        if !missing.is_finite() {
            f64::INFINITY
        } else if largest > 0.0 {
            missing / largest
        } else {
            0.0
        }
    }
}

/// Why a relaxation did not come to rest.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RelaxationError {
    /// Out of steps.
    #[error("not at rest after {steps} steps: |r| = {residual:.3e}, limit {limit:.3e}")]
    TooManySteps {
        /// How many were taken.
        steps: usize,
        /// `|r|` at the end.
        residual: f64,
        /// What it should have fallen to.
        limit: f64,
    },
    /// Energy appeared or vanished, whatever the step.
    #[error("{part:.1e} of the energy is missing after {steps} steps, with the step halved {repeats} times")]
    EnergyBalance {
        /// How much, over the largest energy.
        part: f64,
        /// Steps taken.
        steps: usize,
        /// Halvings of the step.
        repeats: u32,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_balance_counts_what_is_missing() {
        let balanced = Energies { work: 3.0, strain: 1.0, kinetic: 0.5, damped: 1.5 };
        assert_eq!(balanced.error(), 0.0);
        assert_eq!(Energies { damped: 0.0, ..balanced }.error(), 0.5);
        assert_eq!(Energies::default().error(), 0.0);
        assert_eq!(Energies { strain: f64::NAN, ..balanced }.error(), f64::INFINITY);
    }
}
