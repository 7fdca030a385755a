//! The law with second Piola-Kirchhoff stress linear in the Green strain.

use super::FiberLaw;
use super::batch::{Formula, by_formula};

/// `s = E lambda g` (MuMFiM, reaction 0); the energy is `E g^2 / 2`, since `d g = lambda d lambda`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear {
    /// `E`, Pa.
    pub youngs_modulus: f64,
}

impl Formula for Linear {
    #[inline(always)]
    fn stress_of<const FUSED: bool>(&self, stretch: f64) -> (f64, f64) {
        let green = 0.5 * (stretch - 1.0) * (stretch + 1.0);
        (self.youngs_modulus * stretch * green, self.youngs_modulus * (green + stretch * stretch))
    }

    #[inline(always)]
    fn energy_of<const FUSED: bool>(&self, stretch: f64) -> f64 {
        let green = 0.5 * (stretch - 1.0) * (stretch + 1.0);
        0.5 * self.youngs_modulus * green * green
    }
}

impl FiberLaw for Linear {
    by_formula!("linear", youngs_modulus);
}
