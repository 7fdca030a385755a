//! The law that is exponential in the Green strain.

use super::FiberLaw;
use super::batch::{Formula, by_formula};
use super::exp::exp_m1_of;
use super::quadrature::{GAUSS, gauss};
use crate::fiber::simd::{Kernel, vectorized};

/// `s = (E / B) (exp(B g) - 1)` (Tobin 2018, eqs. B.1 and B.14).
///
/// The antiderivative is an imaginary error function. The energy is computed by Gauss quadrature of `s`, which keeps
/// full precision near rest, where a difference of antiderivatives would cancel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exponential {
    /// `E`, Pa.
    pub youngs_modulus: f64,
    /// `B`.
    pub nonlinearity: f64,
}

impl Exponential {
    /// Number of panels of eight Gauss points for a relative error below 1e-15: on each panel the exponent
    /// `B (t^2 - 1) / 2` grows by at most about 1, and its curvature is negligible. The maximum of 4001 panels is
    /// reached only far beyond the stretch at which the exponential overflows.
    #[inline(always)]
    fn panels(&self, stretch: f64) -> f64 {
        let strain = stretch - 1.0;
        let (growth, curvature) = (strain * (stretch + 1.0), strain * strain);
        1.0 + (0.4 * self.nonlinearity * (growth.abs() + curvature)).min(4000.0).floor()
    }

    /// `exp(B g) - 1` as a function of the strain `lambda - 1`, which has more significant digits near rest than the
    /// stretch.
    #[inline(always)]
    fn growth<const FUSED: bool>(&self, strain: f64) -> f64 {
        exp_m1_of::<FUSED>(0.5 * self.nonlinearity * strain * (strain + 2.0))
    }

    /// The energy for stretches that may need several panels.
    fn energy_by_panels(&self, stretch: f64) -> f64 {
        let panels = self.panels(stretch);
        let at = |panel: f64| (stretch - 1.0) * (panel / panels);
        let panel = |k: usize| gauss(at(k as f64), at(k as f64 + 1.0), |strain| self.growth::<false>(strain));
        // NaN gives the maximum number of panels and the result NaN.
        let sum: f64 = (0..panels as usize).map(panel).sum();
        self.youngs_modulus / self.nonlinearity * sum
    }
}

impl Formula for Exponential {
    #[inline(always)]
    fn stress_of<const FUSED: bool>(&self, stretch: f64) -> (f64, f64) {
        let (e, b) = (self.youngs_modulus, self.nonlinearity);
        let growth = exp_m1_of::<FUSED>(0.5 * b * (stretch - 1.0) * (stretch + 1.0));
        (e / b * growth, e * stretch * (growth + 1.0))
    }

    #[inline(always)]
    fn energy_of<const FUSED: bool>(&self, stretch: f64) -> f64 {
        self.energy_by_panels(stretch)
    }

    fn energies_of(&self, stretch: &[f64], energy: &mut [f64]) {
        vectorized(OnePanel { law: *self, stretch, energy });
        for (&stretch, energy) in stretch.iter().zip(energy) {
            if self.panels(stretch) > 1.0 {
                *energy = self.energy_by_panels(stretch);
            }
        }
    }
}

/// Energies by one panel. The Gauss points are the outer loop, so that the inner one is short enough to be vectorized.
struct OnePanel<'a> {
    law: Exponential,
    stretch: &'a [f64],
    energy: &'a mut [f64],
}

impl Kernel for OnePanel<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Self { law, stretch, energy } = self;
        energy.fill(0.0);
        for (x, w) in GAUSS {
            for (&stretch, energy) in stretch.iter().zip(&mut *energy) {
                let half = 0.5 * (stretch - 1.0);
                *energy += w * (law.growth::<FUSED>(half - half * x) + law.growth::<FUSED>(half + half * x));
            }
        }
        let scale = law.youngs_modulus / law.nonlinearity;
        for (&stretch, energy) in stretch.iter().zip(energy) {
            *energy *= scale * 0.5 * (stretch - 1.0);
        }
    }
}

impl FiberLaw for Exponential {
    by_formula!("exponential", youngs_modulus, nonlinearity);
}

#[cfg(test)]
mod tests {
    use super::super::quadrature::adaptive;
    use super::*;

    #[test]
    fn the_energy_by_panels_is_exact_to_rounding() {
        for nonlinearity in [1e-3, 0.05, 0.3, 1.2, 4.0, 9.0, 30.0, 200.0] {
            let law = Exponential { youngs_modulus: 1.0, nonlinearity };
            for k in 1..400 {
                let stretch = f64::from(k) * 0.0125;
                let exponent = |strain: f64| 0.5 * nonlinearity * strain * (strain + 2.0);
                if exponent(stretch - 1.0) > 600.0 {
                    continue;
                }
                let exact = adaptive(0.0, stretch - 1.0, &|strain| exponent(strain).exp_m1()) / nonlinearity;
                let mut found = [0.0; 2];
                law.energies(&[stretch; 2], &mut found);
                for found in [found[0], found[1], law.energy(stretch)] {
                    let error = (found - exact).abs();
                    // The rounding error of the exponent enters the exponential.
                    let tolerance = 1e-14 + f64::EPSILON * exponent(stretch - 1.0).abs();
                    assert!(error <= tolerance * exact, "B = {nonlinearity}, {stretch}: {found} {exact}");
                }
            }
        }
    }

    #[test]
    fn overflow_is_infinite_and_nan_is_nan() {
        let law = Exponential { youngs_modulus: 1.0, nonlinearity: 10.0 };
        assert_eq!(law.energy(100.0), f64::INFINITY);
        assert!(law.energy(f64::NAN).is_nan());
        assert_eq!(law.stress(100.0), (f64::INFINITY, f64::INFINITY));
    }
}
