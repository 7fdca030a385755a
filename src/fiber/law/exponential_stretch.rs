//! The exponential law with the extra factor `lambda`, and straight lines outside its range.

use super::FiberLaw;

/// `s = (E / B) lambda (exp(B g) - 1)` on `[1, lambda_t]`; outside, the tangent lines at the two ends (MuMFiM,
/// reaction 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExponentialStretch {
    youngs_modulus: f64,
    nonlinearity: f64,
    transition: f64,
    /// Stress and slope at the transition.
    at_transition: (f64, f64),
}

impl ExponentialStretch {
    /// The law with modulus `E` in Pa, nonlinearity `B` and transition stretch `lambda_t > 1`.
    #[must_use]
    pub fn new(youngs_modulus: f64, nonlinearity: f64, transition: f64) -> Self {
        let mut law = Self { youngs_modulus, nonlinearity, transition, at_transition: (0.0, 0.0) };
        law.at_transition = law.curve(transition);
        law
    }

    #[inline(always)]
    fn curve(&self, stretch: f64) -> (f64, f64) {
        let b = self.nonlinearity;
        let square = stretch * stretch;
        let growth = (b * 0.5 * (square - 1.0)).exp_m1();
        let modulus = self.youngs_modulus / b;
        (modulus * stretch * growth, modulus * (growth + b * square * (growth + 1.0)))
    }

    /// `integral_1^lambda s` on the curve: `E / B^2 (exp(B g) - 1 - B g)`, by its series where that would cancel.
    fn curve_energy(&self, stretch: f64) -> f64 {
        let b = self.nonlinearity;
        let x = b * 0.5 * (stretch - 1.0) * (stretch + 1.0);
        self.youngs_modulus / (b * b) * exp_minus_line(x)
    }
}

/// `exp(x) - 1 - x` to rounding.
fn exp_minus_line(x: f64) -> f64 {
    if x.abs() > 0.5 {
        return x.exp_m1() - x;
    }
    let (mut term, mut sum) = (0.5 * x * x, 0.0);
    let mut n = 3.0;
    while term.abs() > f64::EPSILON * 1e-2 * f64::abs(sum) {
        sum += term;
        term *= x / n;
        n += 1.0;
    }
    sum + term
}

impl FiberLaw for ExponentialStretch {
    #[inline(always)]
    fn stress(&self, stretch: f64) -> (f64, f64) {
        if stretch < 1.0 {
            (self.youngs_modulus * (stretch - 1.0), self.youngs_modulus)
        } else if stretch <= self.transition {
            self.curve(stretch)
        } else {
            let (stress, slope) = self.at_transition;
            (stress + slope * (stretch - self.transition), slope)
        }
    }

    fn energy(&self, stretch: f64) -> f64 {
        if stretch < 1.0 {
            return 0.5 * self.youngs_modulus * (stretch - 1.0).powi(2);
        }
        let on_curve = self.curve_energy(stretch.min(self.transition));
        let beyond = (stretch - self.transition).max(0.0);
        on_curve + beyond * (self.at_transition.0 + 0.5 * beyond * self.at_transition.1)
    }
}
