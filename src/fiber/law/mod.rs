//! Fiber laws: the axial force of a fiber as a function of its stretch.
//!
//! A law gives the nominal stress `s(lambda)` of a fiber, in Pa: the force over the reference area, positive in tension.
//! From it follow the force `f = A s`, its slope over the current length `df/dl = A s'(lambda) / L` and the energy of the
//! fiber `A L integral_1^lambda s`. With `g = (lambda^2 - 1) / 2`, the Green strain:
//!
//! | law | `s` | source |
//! |---|---|---|
//! | [`Exponential`] | `(E / B) (exp(B g) - 1)` | Tobin 2018, eq. B.1 |
//! | [`Linear`] | `E lambda g` | MuMFiM, reaction 0 |
//! | [`ExponentialStretch`] | `(E / B) lambda (exp(B g) - 1)` on `[1, lambda_t]`, its tangent lines outside | MuMFiM, reaction 1 |

mod exponential;
mod exponential_stretch;
mod linear;

pub use exponential::Exponential;
pub use exponential_stretch::ExponentialStretch;
pub use linear::Linear;
use thiserror::Error;

/// The axial behaviour of a fiber; continuous with its first derivative for all `lambda > 0`.
pub trait FiberLaw {
    /// Nominal stress and its derivative with respect to the stretch, both in Pa.
    fn stress(&self, stretch: f64) -> (f64, f64);

    /// Energy per reference volume of the fiber, `integral_1^lambda s`, in J/m^3; exact to rounding.
    fn energy(&self, stretch: f64) -> f64;
}

/// A fiber law with its parameters; moduli in Pa.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// `s = E lambda g`.
    Linear {
        /// `E`.
        youngs_modulus: f64,
    },
    /// `s = (E / B) (exp(B g) - 1)`.
    Exponential {
        /// `E`.
        youngs_modulus: f64,
        /// `B`.
        nonlinearity: f64,
    },
    /// `s = (E / B) lambda (exp(B g) - 1)` on `[1, lambda_t]`, its tangent lines outside.
    ExponentialStretch {
        /// `E`.
        youngs_modulus: f64,
        /// `B`.
        nonlinearity: f64,
        /// `lambda_t`.
        transition: f64,
    },
}

/// What a fiber is made of: its law and its radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FiberMaterial {
    /// The law.
    pub law: Law,
    /// Radius of the round cross-section, in the units the modulus goes with (m for Pa).
    pub radius: f64,
    /// Mass density in kg/m^3, where a file gives one.
    pub density: Option<f64>,
}

/// A parameter without physical sense.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("the {parameter} of a fiber is {value}; it must be {expected}")]
pub struct FiberMaterialError {
    /// Which one.
    pub parameter: &'static str,
    /// Its value.
    pub value: f64,
    /// What it must be.
    pub expected: &'static str,
}

impl FiberMaterial {
    /// Area of the cross-section.
    #[must_use]
    pub fn area(&self) -> f64 {
        std::f64::consts::PI * self.radius * self.radius
    }

    /// Checks that every parameter has physical sense.
    ///
    /// # Errors
    /// The first that has none.
    pub fn check(&self) -> Result<(), FiberMaterialError> {
        let positive = |parameter, value: f64| {
            if value > 0.0 && value.is_finite() {
                Ok(())
            } else {
                Err(FiberMaterialError { parameter, value, expected: "positive and finite" })
            }
        };
        positive("radius", self.radius)?;
        if let Some(density) = self.density
            && (density.is_nan() || density < 0.0)
        {
            return Err(FiberMaterialError { parameter: "density", value: density, expected: "zero or positive" });
        }
        match self.law {
            Law::Linear { youngs_modulus } => positive("Young's modulus", youngs_modulus),
            Law::Exponential { youngs_modulus, nonlinearity } => {
                positive("Young's modulus", youngs_modulus)?;
                positive("nonlinearity", nonlinearity)
            }
            Law::ExponentialStretch { youngs_modulus, nonlinearity, transition } => {
                positive("Young's modulus", youngs_modulus)?;
                positive("nonlinearity", nonlinearity)?;
                if transition >= 1.0 && transition.is_finite() {
                    Ok(())
                } else {
                    let (parameter, expected) = ("transition stretch", "at least 1 and finite");
                    Err(FiberMaterialError { parameter, value: transition, expected })
                }
            }
        }
    }
}

impl Law {
    /// The name in files and on the command line.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Linear { .. } => "linear",
            Self::Exponential { .. } => "exponential",
            Self::ExponentialStretch { .. } => "exponential-stretch",
        }
    }

    /// `E`, the slope of the nominal stress at rest, in Pa.
    #[must_use]
    pub fn youngs_modulus(&self) -> f64 {
        match *self {
            Self::Linear { youngs_modulus }
            | Self::Exponential { youngs_modulus, .. }
            | Self::ExponentialStretch { youngs_modulus, .. } => youngs_modulus,
        }
    }

    /// Nominal stress and slope of a batch of fibers: the law is chosen once, the loop runs without branches on it.
    ///
    /// All slices have one length; stresses in Pa.
    pub fn stresses(&self, stretch: &[f64], stress: &mut [f64], slope: &mut [f64]) {
        match *self {
            Self::Linear { youngs_modulus } => batch(&Linear { youngs_modulus }, stretch, stress, slope),
            Self::Exponential { youngs_modulus, nonlinearity } => {
                batch(&Exponential { youngs_modulus, nonlinearity }, stretch, stress, slope);
            }
            Self::ExponentialStretch { youngs_modulus, nonlinearity, transition } => {
                batch(&ExponentialStretch::new(youngs_modulus, nonlinearity, transition), stretch, stress, slope);
            }
        }
    }

    /// `sum_f volume_f * integral_1^lambda_f s`, in J for volumes in m^3.
    #[must_use]
    pub fn energy(&self, stretch: &[f64], volume: &[f64]) -> f64 {
        match *self {
            Self::Linear { youngs_modulus } => total(&Linear { youngs_modulus }, stretch, volume),
            Self::Exponential { youngs_modulus, nonlinearity } => {
                total(&Exponential { youngs_modulus, nonlinearity }, stretch, volume)
            }
            Self::ExponentialStretch { youngs_modulus, nonlinearity, transition } => {
                total(&ExponentialStretch::new(youngs_modulus, nonlinearity, transition), stretch, volume)
            }
        }
    }
}

#[inline]
fn batch(law: &impl FiberLaw, stretch: &[f64], stress: &mut [f64], slope: &mut [f64]) {
    for ((&lambda, s), ds) in stretch.iter().zip(stress).zip(slope) {
        (*s, *ds) = law.stress(lambda);
    }
}

fn total(law: &impl FiberLaw, stretch: &[f64], volume: &[f64]) -> f64 {
    stretch.iter().zip(volume).map(|(&lambda, &v)| v * law.energy(lambda)).sum()
}

/// Integral of a smooth `integrand` from `a` to `b` by eight Gauss points on each of `panels` panels.
///
/// Eight points integrate polynomials of degree 15 exactly; over a panel on which an exponent changes by no more than 3
/// that leaves a relative error below 1e-15.
fn integrate(a: f64, b: f64, panels: usize, integrand: impl Fn(f64) -> f64) -> f64 {
    // Abramowitz and Stegun, table 25.4, n = 8.
    const NODES: [f64; 4] =
        [0.183_434_642_495_649_8, 0.525_532_409_916_329, 0.796_666_477_413_626_7, 0.960_289_856_497_536_2];
    const WEIGHTS: [f64; 4] =
        [0.362_683_783_378_362, 0.313_706_645_877_887_3, 0.222_381_034_453_374_5, 0.101_228_536_290_376_3];
    let width = (b - a) / panels as f64;
    (0..panels)
        .map(|panel| {
            let middle = a + (panel as f64 + 0.5) * width;
            let pairs = NODES.iter().zip(WEIGHTS);
            let sum: f64 = pairs
                .map(|(x, w)| w * (integrand(middle - 0.5 * width * x) + integrand(middle + 0.5 * width * x)))
                .sum();
            0.5 * width * sum
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const E: f64 = 1.0e8;

    fn laws() -> [Law; 5] {
        [
            Law::Linear { youngs_modulus: E },
            Law::Exponential { youngs_modulus: E, nonlinearity: 1.2 },
            Law::Exponential { youngs_modulus: E, nonlinearity: 9.0 },
            Law::ExponentialStretch { youngs_modulus: E, nonlinearity: 1.2, transition: 1.1 },
            Law::ExponentialStretch { youngs_modulus: E, nonlinearity: 9.0, transition: 1.4 },
        ]
    }

    fn stress(law: &Law, stretch: f64) -> (f64, f64) {
        let (mut s, mut ds) = ([0.0], [0.0]);
        law.stresses(&[stretch], &mut s, &mut ds);
        (s[0], ds[0])
    }

    #[test]
    fn the_slope_is_the_derivative_of_the_stress() {
        for law in laws() {
            for lambda in [0.4, 0.8, 0.999, 1.003, 1.05, 1.3, 1.8] {
                let h = 1e-5;
                let difference = (stress(&law, lambda + h).0 - stress(&law, lambda - h).0) / (2.0 * h);
                let slope = stress(&law, lambda).1;
                assert!(
                    (difference - slope).abs() < 1e-7 * slope.abs().max(E),
                    "{law:?} at {lambda}: {difference} {slope}"
                );
            }
        }
    }

    #[test]
    fn the_stress_is_the_derivative_of_the_energy() {
        for law in laws() {
            for lambda in [0.4, 0.8, 0.999, 1.003, 1.05, 1.3, 1.8] {
                let h = 1e-4;
                let w = |l: f64| law.energy(&[l], &[1.0]);
                // Fourth order, so that the truncation stays below the tolerance.
                let difference =
                    (8.0 * (w(lambda + h) - w(lambda - h)) - (w(lambda + 2.0 * h) - w(lambda - 2.0 * h))) / (12.0 * h);
                let s = stress(&law, lambda).0;
                assert!((difference - s).abs() < 1e-8 * s.abs().max(0.01 * E), "{law:?} at {lambda}: {difference} {s}");
            }
            assert_eq!(law.energy(&[1.0], &[1.0]), 0.0);
        }
    }

    #[test]
    fn every_law_is_at_rest_at_stretch_one_with_slope_e() {
        for law in laws() {
            assert_eq!(stress(&law, 1.0).0, 0.0, "{law:?}");
            assert!((stress(&law, 1.0).1 - E).abs() < 1e-8 * E, "{law:?}");
        }
    }

    #[test]
    fn value_and_slope_are_continuous_at_every_switch() {
        for law in laws() {
            let Law::ExponentialStretch { transition, .. } = law else { continue };
            for switch in [1.0, transition] {
                let (below, above) = (stress(&law, switch * (1.0 - 1e-12)), stress(&law, switch * (1.0 + 1e-12)));
                assert!((below.0 - above.0).abs() < 1e-9 * E, "{law:?} jumps at {switch}");
                assert!((below.1 - above.1).abs() < 1e-9 * above.1, "the slope of {law:?} jumps at {switch}");
            }
        }
    }

    #[test]
    fn small_strains_lose_no_digits() {
        // W = E h^2 / 2 + O(h^3), down to strains where a difference of antiderivatives would hold nothing but rounding.
        for law in laws() {
            let h = 1.0e-9;
            let w = law.energy(&[1.0 + h], &[1.0]);
            assert!((w / (0.5 * E * h * h) - 1.0).abs() < 1e-6, "{law:?}: {w}");
        }
    }

    #[test]
    fn parameters_without_sense_are_named() {
        let good = FiberMaterial { law: laws()[3], radius: 1e-7, density: None };
        assert_eq!(good.check(), Ok(()));
        let bad = FiberMaterial { radius: -1.0, ..good };
        assert_eq!(bad.check().unwrap_err().to_string(), "the radius of a fiber is -1; it must be positive and finite");
        let law = Law::ExponentialStretch { youngs_modulus: E, nonlinearity: 1.0, transition: 0.9 };
        assert_eq!(FiberMaterial { law, ..good }.check().unwrap_err().parameter, "transition stretch");
        let law = Law::Linear { youngs_modulus: f64::NAN };
        assert_eq!(FiberMaterial { law, ..good }.check().unwrap_err().parameter, "Young's modulus");
    }
}
