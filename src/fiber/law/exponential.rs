//! The law that is exponential in the Green strain.

use super::{FiberLaw, integrate};

/// `s = (E / B) (exp(B g) - 1)` (Tobin 2018, eqs. B.1 and B.14).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exponential {
    /// `E`, Pa.
    pub youngs_modulus: f64,
    /// `B`.
    pub nonlinearity: f64,
}

impl FiberLaw for Exponential {
    #[inline(always)]
    fn stress(&self, stretch: f64) -> (f64, f64) {
        let (e, b) = (self.youngs_modulus, self.nonlinearity);
        let growth = (b * 0.5 * (stretch * stretch - 1.0)).exp_m1();
        (e / b * growth, e * stretch * (growth + 1.0))
    }

    /// The antiderivative is an imaginary error function; quadrature of `s` itself keeps every digit near rest, where
    /// a difference of antiderivatives would cancel.
    fn energy(&self, stretch: f64) -> f64 {
        let exponent = self.nonlinearity * 0.5 * (stretch * stretch - 1.0);
        let panels = 1 + (exponent.abs() / 3.0).min(1000.0) as usize;
        integrate(1.0, stretch, panels, |s| self.stress(s).0)
    }
}
