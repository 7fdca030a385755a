//! The law that is linear in the Green strain.

use super::FiberLaw;

/// `s = E lambda g` (MuMFiM, reaction 0).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear {
    /// `E`, Pa.
    pub youngs_modulus: f64,
}

impl FiberLaw for Linear {
    #[inline(always)]
    fn stress(&self, stretch: f64) -> (f64, f64) {
        let square = stretch * stretch;
        let green = 0.5 * (square - 1.0);
        (self.youngs_modulus * stretch * green, self.youngs_modulus * (green + square))
    }

    /// `E g^2 / 2`, since `d g = lambda d lambda`.
    #[inline(always)]
    fn energy(&self, stretch: f64) -> f64 {
        let green = 0.5 * (stretch - 1.0) * (stretch + 1.0);
        0.5 * self.youngs_modulus * green * green
    }
}
