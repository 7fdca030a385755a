//! Statistics and errors of dynamic relaxation.

use thiserror::Error;

/// Statistics of dynamic relaxation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RelaxationReport {
    /// Number of steps, including those of repeated integrations.
    pub steps: usize,
    /// Number of integrations repeated with half the step.
    pub repeats: u32,
    /// `|r|` of the interior at the end, N.
    pub residual: f64,
    /// `residual` over the norm of all nodal forces; 0 if that is 0.
    pub relative: f64,
    /// Energies at the end, in J for a cube with an edge of 1 m.
    pub energies: Energies,
}

/// Terms of the energy balance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energies {
    /// Work done at the boundary.
    pub work: f64,
    /// Increase of the strain energy of the fibers.
    pub strain: f64,
    /// Kinetic energy of the nodes.
    pub kinetic: f64,
    /// Energy dissipated by the damping, and by the growth of masses at constant momentum.
    pub damped: f64,
}

impl Energies {
    /// The error of the energy balance over the largest of the energies.
    pub fn error(&self) -> f64 {
        let largest = self.work.abs().max(self.strain.abs()).max(self.kinetic).max(self.damped);
        let missing = (self.strain + self.kinetic + self.damped - self.work).abs();
        // An overflow violates the balance.
        if !missing.is_finite() {
            f64::INFINITY
        } else if largest > 0.0 {
            missing / largest
        } else {
            0.0
        }
    }
}

/// The reason why a relaxation did not come to rest.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RelaxationError {
    /// The maximum number of steps was reached.
    #[error("not at rest after {steps} steps: |r| = {residual:.3e}, limit {limit:.3e}")]
    TooManySteps {
        /// Steps taken.
        steps: usize,
        /// `|r|` at the end.
        residual: f64,
        /// The limit of `|r|`.
        limit: f64,
    },
    /// The energy balance was violated at every step size tried.
    #[error("{part:.1e} of the energy is missing after {steps} steps, with the step halved {repeats} times")]
    EnergyBalance {
        /// The error of the balance over the largest energy.
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
    fn the_error_of_the_balance_is_relative_to_the_largest_energy() {
        let balanced = Energies { work: 3.0, strain: 1.0, kinetic: 0.5, damped: 1.5 };
        assert_eq!(balanced.error(), 0.0);
        assert_eq!(Energies { damped: 0.0, ..balanced }.error(), 0.5);
        assert_eq!(Energies::default().error(), 0.0);
        assert_eq!(Energies { strain: f64::NAN, ..balanced }.error(), f64::INFINITY);
    }
}
