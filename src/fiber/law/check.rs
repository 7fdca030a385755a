//! A consistency check for implementations of [`FiberLaw`].

use std::ops::RangeInclusive;

use thiserror::Error;

use super::FiberLaw;
use super::quadrature::gauss;

/// A violated requirement of a law; stresses and slopes in Pa.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LawError {
    /// The stress at rest is not 0. Holds the stress.
    #[error("the stress at stretch 1 is {0:e}; an undeformed fiber carries no force")]
    Rest(f64),
    /// The modulus differs from the slope at rest, or the slope is not positive.
    #[error("youngs_modulus() is {modulus:e} and the slope at stretch 1 {slope:e}; both must be equal and above 0")]
    Modulus {
        /// [`FiberLaw::youngs_modulus`].
        modulus: f64,
        /// The slope at stretch 1.
        slope: f64,
    },
    /// Stress, slope or energy is NaN or infinite. Holds the stretch.
    #[error("stress, slope or energy is not finite at the stretch {0}")]
    NotFinite(f64),
    /// The slope is not the derivative of the stress, or the stress is discontinuous.
    #[error("next to the stretch {stretch} the stress rises by {rise:e} per stretch, but its slope is {slope:e}")]
    Slope {
        /// The stretch.
        stretch: f64,
        /// The difference quotient of the stress.
        rise: f64,
        /// The mean of the slope.
        slope: f64,
    },
    /// The slope is discontinuous.
    #[error("the slope jumps at the stretch {stretch}, from {below:e} to {above:e}")]
    SlopeJump {
        /// The stretch.
        stretch: f64,
        /// The slope below it.
        below: f64,
        /// The slope above it.
        above: f64,
    },
    /// The stress is not the derivative of the energy, or the energy is discontinuous.
    #[error("next to the stretch {stretch} the energy rises by {rise:e} per stretch, but the stress is {stress:e}")]
    Energy {
        /// The stretch.
        stretch: f64,
        /// The difference quotient of the energy.
        rise: f64,
        /// The mean of the stress.
        stress: f64,
    },
    /// A batch method and the method for one fiber give different values.
    #[error("at the stretch {stretch} a batch gives {batch:e}, the formula {single:e}")]
    Batch {
        /// The stretch.
        stretch: f64,
        /// The value from `stresses` or `energies`.
        batch: f64,
        /// The value from `stress` or `energy`.
        single: f64,
    },
}

/// Checks a law over a range of stretches: at rest the stress is 0 and the slope is positive and equal to
/// [`FiberLaw::youngs_modulus`]; stress and slope are continuous; the slope is the derivative of the stress, and the
/// stress that of the energy; batches give the same values as single fibers.
///
/// On a thousand intervals, differences of a function are compared with integrals of its derivative. An interval that
/// disagrees is halved until it agrees or is as short as 1e-8: at a kink the two converge, at a jump or with a
/// wrong formula they do not. The tolerance is about 1e-6. A slope that changes within 1e-10 by more than 1e-6 of the
/// modulus (or of the slope, if that is larger) counts as a jump.
///
/// # Errors
/// Returns the first [`LawError`] found.
pub fn check(law: &dyn FiberLaw, stretches: RangeInclusive<f64>) -> Result<(), LawError> {
    let (stress, slope) = law.stress(1.0);
    if stress != 0.0 {
        return Err(LawError::Rest(stress));
    }
    let modulus = law.youngs_modulus();
    if !(slope > 0.0 && (modulus - slope).abs() <= 1e-9 * slope) {
        return Err(LawError::Modulus { modulus, slope });
    }
    let (first, last) = stretches.into_inner();
    let intervals = 1000;
    let at = |k: i32| first + (last - first) * f64::from(k) / f64::from(intervals);
    let samples: Vec<f64> = (0..=intervals).map(at).chain([1.0 - 1e-9, 1.0, 1.0 + 1e-9]).collect();
    for &stretch in &samples {
        let (stress, slope) = law.stress(stretch);
        if !(stress.is_finite() && slope.is_finite() && law.energy(stretch).is_finite()) {
            return Err(LawError::NotFinite(stretch));
        }
    }
    batches(law, &samples)?;
    for k in 0..intervals {
        let (a, b) = (at(k), at(k + 1));
        kink(law, a, b, modulus)?;
        differences(a, b, modulus, |l| law.stress(l).0, |l| law.stress(l).1)
            .map_err(|(stretch, rise, slope)| LawError::Slope { stretch, rise, slope })?;
        differences(a, b, modulus, |l| law.energy(l), |l| law.stress(l).0)
            .map_err(|(stretch, rise, stress)| LawError::Energy { stretch, rise, stress })?;
    }
    Ok(())
}

fn batches(law: &dyn FiberLaw, samples: &[f64]) -> Result<(), LawError> {
    let (mut stress, mut slope, mut energy) =
        (vec![0.0; samples.len()], vec![0.0; samples.len()], vec![0.0; samples.len()]);
    law.stresses(samples, &mut stress, &mut slope);
    law.energies(samples, &mut energy);
    for (k, &stretch) in samples.iter().enumerate() {
        let (single_stress, single_slope) = law.stress(stretch);
        for (batch, single) in [(stress[k], single_stress), (slope[k], single_slope), (energy[k], law.energy(stretch))]
        {
            let same = (batch - single).abs() <= 1e-12 * single.abs();
            if !same {
                return Err(LawError::Batch { stretch, batch, single });
            }
        }
    }
    Ok(())
}

/// Tests that the increase of a function equals the integral of its derivative. Otherwise bisects toward the half with
/// the larger difference: at a kink the two values converge. If they do not, the error holds the stretch, the
/// difference quotient and the mean derivative.
fn differences(
    a: f64,
    b: f64,
    modulus: f64,
    function: impl Fn(f64) -> f64,
    derivative: impl Fn(f64) -> f64,
) -> Result<(), (f64, f64, f64)> {
    const AGREES: f64 = 1e-6;
    /// Shortest interval; below it, the rounding error of the function is not small against the tolerance.
    const SHORTEST: f64 = 1e-8;
    let compare = |a: f64, b: f64| {
        let (before, behind) = (function(a), function(b));
        let (rise, integral) = (behind - before, gauss(a, b, &derivative));
        let rounding = 8.0 * f64::EPSILON * (before.abs() + behind.abs());
        (rise, integral, AGREES * (integral.abs() + 1e-3 * modulus * (b - a)) + rounding)
    };
    let (mut a, mut b) = (a, b);
    loop {
        let (rise, integral, allowed) = compare(a, b);
        let agrees = (rise - integral).abs() <= allowed;
        if agrees {
            return Ok(());
        }
        let middle = 0.5 * (a + b);
        if b - a <= SHORTEST {
            return Err((middle, rise / (b - a), integral / (b - a)));
        }
        let (left, right) = (compare(a, middle), compare(middle, b));
        if (left.0 - left.1).abs() > (right.0 - right.1).abs() { b = middle } else { a = middle }
    }
}

/// Bisects toward the half with the larger change of the slope: a change that remains at the end is a jump.
fn kink(law: &dyn FiberLaw, mut a: f64, mut b: f64, modulus: f64) -> Result<(), LawError> {
    const JUMP: f64 = 1e-6;
    const SHORTEST: f64 = 1e-10;
    let slope = |stretch: f64| law.stress(stretch).1;
    let (mut below, mut above) = (slope(a), slope(b));
    let is_small = |below: f64, above: f64| (above - below).abs() <= JUMP * modulus.max(below.abs()).max(above.abs());
    while b - a > SHORTEST {
        if is_small(below, above) {
            return Ok(());
        }
        let middle = 0.5 * (a + b);
        let between = slope(middle);
        if (between - below).abs() > (above - between).abs() {
            (b, above) = (middle, between);
        } else {
            (a, below) = (middle, between);
        }
    }
    if is_small(below, above) { Ok(()) } else { Err(LawError::SlopeJump { stretch: 0.5 * (a + b), below, above }) }
}
