//! The exponential law with an additional factor `lambda`, and tangent lines outside its range.

use super::FiberLaw;
use super::batch::{Formula, by_formula};
use super::exp::exp_m1_of;
use crate::fiber::simd::fma;

/// `s = (E / B) lambda (exp(B g) - 1)` on `[1, lambda_t]`; outside, the tangent lines at the two ends (MuMFiM,
/// reaction 1).
///
/// The energy on the curve is `E / B^2 (exp(B g) - 1 - B g)`; outside, the energy of the tangent line is added.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExponentialStretch {
    /// `E`, Pa.
    pub youngs_modulus: f64,
    /// `B`.
    pub nonlinearity: f64,
    /// `lambda_t`, at least 1.
    pub transition: f64,
}

impl ExponentialStretch {
    /// Makes the law with modulus `E` in Pa, nonlinearity `B` and transition stretch `lambda_t >= 1`.
    pub fn new(youngs_modulus: f64, nonlinearity: f64, transition: f64) -> Self {
        Self { youngs_modulus, nonlinearity, transition }
    }

    /// The point of the curve closest to a stretch: its stretch, `B g` and `exp(B g) - 1`.
    #[inline(always)]
    fn on_curve<const FUSED: bool>(&self, stretch: f64) -> (f64, f64, f64) {
        // These comparisons propagate NaN.
        let nearest = if stretch < 1.0 { 1.0 } else { stretch };
        let nearest = if nearest > self.transition { self.transition } else { nearest };
        let exponent = 0.5 * self.nonlinearity * (nearest - 1.0) * (nearest + 1.0);
        (nearest, exponent, exp_m1_of::<FUSED>(exponent))
    }

    #[inline(always)]
    fn curve(&self, stretch: f64, growth: f64) -> (f64, f64) {
        let (e, b) = (self.youngs_modulus, self.nonlinearity);
        (e / b * stretch * growth, e * (growth / b + stretch * stretch * (growth + 1.0)))
    }
}

/// `1/3` to `1/16`.
const INVERSES: [f64; 14] = {
    let (mut table, mut k) = ([0.0; 14], 0);
    while k < table.len() {
        table[k] = 1.0 / (k + 3) as f64;
        k += 1;
    }
    table
};

/// `exp(x) - 1 - x` to rounding, from `x` and `exp(x) - 1`: their difference for `|x| > 1/2`, where it does not cancel,
/// and otherwise the Taylor series with a remainder below `2^-56`.
#[inline(always)]
fn exp_minus_line<const FUSED: bool>(x: f64, growth: f64) -> f64 {
    let mut series = 1.0;
    for inverse in INVERSES.iter().rev() {
        series = fma::<FUSED>(series, x * inverse, 1.0);
    }
    if x.abs() > 0.5 { growth - x } else { 0.5 * x * x * series }
}

impl Formula for ExponentialStretch {
    #[inline(always)]
    fn stress_of<const FUSED: bool>(&self, stretch: f64) -> (f64, f64) {
        let (nearest, _, growth) = self.on_curve::<FUSED>(stretch);
        let (stress, slope) = self.curve(nearest, growth);
        (stress + slope * (stretch - nearest), slope)
    }

    #[inline(always)]
    fn energy_of<const FUSED: bool>(&self, stretch: f64) -> f64 {
        let (nearest, exponent, growth) = self.on_curve::<FUSED>(stretch);
        let (stress, slope) = self.curve(nearest, growth);
        let beyond = stretch - nearest;
        let curve = self.youngs_modulus / (self.nonlinearity * self.nonlinearity);
        curve * exp_minus_line::<FUSED>(exponent, growth) + beyond * (stress + 0.5 * beyond * slope)
    }
}

impl FiberLaw for ExponentialStretch {
    by_formula!("exponential-stretch", youngs_modulus, nonlinearity, transition);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_truncated_series_is_exact_to_rounding() {
        for k in 1..=1000 {
            let x = 1e-3 * f64::from(k);
            // The leading terms of the series, which do not cancel.
            let (mut term, mut exact) = (0.5 * x * x, 0.0);
            for n in 3..40 {
                exact += term;
                term *= x / f64::from(n);
            }
            let found = exp_minus_line::<false>(x, x.exp_m1());
            assert!((found / exact - 1.0).abs() < 2e-15, "{x}");
        }
    }
}
