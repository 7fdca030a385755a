//! Whether a law keeps what every law must: a check for those who write one.

use std::ops::RangeInclusive;

use thiserror::Error;

use super::FiberLaw;
use super::quadrature::gauss;

/// What is wrong with a law; stresses and slopes in Pa.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LawFault {
    /// Force without stretch.
    #[error("the stress at stretch 1 is {stress:e}; an undeformed fiber carries nothing")]
    Rest {
        /// The stress.
        stress: f64,
    },
    /// The modulus is not the slope at rest, or not above 0.
    #[error("youngs_modulus() is {modulus:e} and the slope at stretch 1 {slope:e}; both must be one number above 0")]
    Modulus {
        /// What the law says.
        modulus: f64,
        /// The slope.
        slope: f64,
    },
    /// NaN or infinity.
    #[error("stress, slope or energy is not finite at the stretch {stretch}")]
    NotFinite {
        /// Where.
        stretch: f64,
    },
    /// The slope is not the derivative of the stress, or the stress jumps.
    #[error("next to the stretch {stretch} the stress rises by {rise:e} per stretch, but its slope is {slope:e}")]
    Slope {
        /// Where.
        stretch: f64,
        /// The difference quotient.
        rise: f64,
        /// The mean of the slope.
        slope: f64,
    },
    /// The slope jumps.
    #[error("the slope jumps at the stretch {stretch}, from {below:e} to {above:e}")]
    Kink {
        /// Where.
        stretch: f64,
        /// Slope before it.
        below: f64,
        /// Slope behind it.
        above: f64,
    },
    /// The stress is not the derivative of the energy, or the energy jumps.
    #[error("next to the stretch {stretch} the energy rises by {rise:e} per stretch, but the stress is {stress:e}")]
    Energy {
        /// Where.
        stretch: f64,
        /// The difference quotient.
        rise: f64,
        /// The mean of the stress.
        stress: f64,
    },
    /// A batch gives something else than the formula for one fiber.
    #[error("at the stretch {stretch} a batch gives {batch:e}, the formula {single:e}")]
    Batch {
        /// Where.
        stretch: f64,
        /// From `stresses` or `energies`.
        batch: f64,
        /// From `stress` or `energy`.
        single: f64,
    },
}

/// Checks a law over a range of stretches: no stress and a positive slope, [`FiberLaw::youngs_modulus`], at rest; stress
/// and slope continuous; the slope the derivative of the stress and the stress that of the energy; batches the same as
/// single fibers.
///
/// Differences are compared with integrals over a thousand intervals, and one that disagrees is halved until it agrees or
/// is as short as 1e-8: a mere bend fades away on the way, a jump or a wrong formula stays. What agrees does so within
/// some 1e-6. A slope that changes by 1e-6 of the modulus within 1e-10 counts as a jump.
///
/// # Errors
/// The first [`LawFault`] found.
pub fn check(law: &dyn FiberLaw, stretches: RangeInclusive<f64>) -> Result<(), LawFault> {
    let (stress, slope) = law.stress(1.0);
    if stress != 0.0 {
        return Err(LawFault::Rest { stress });
    }
    let modulus = law.youngs_modulus();
    if !(slope > 0.0 && (modulus - slope).abs() <= 1e-9 * slope) {
        return Err(LawFault::Modulus { modulus, slope });
    }
    let (first, last) = stretches.into_inner();
    let intervals = 1000;
    let at = |k: i32| first + (last - first) * f64::from(k) / f64::from(intervals);
    let samples: Vec<f64> = (0..=intervals).map(at).chain([1.0 - 1e-9, 1.0, 1.0 + 1e-9]).collect();
    for &stretch in &samples {
        let (stress, slope) = law.stress(stretch);
        if !(stress.is_finite() && slope.is_finite() && law.energy(stretch).is_finite()) {
            return Err(LawFault::NotFinite { stretch });
        }
    }
    batches(law, &samples)?;
    for k in 0..intervals {
        let (a, b) = (at(k), at(k + 1));
        kink(law, a, b, modulus)?;
        differences(a, b, modulus, |l| law.stress(l).0, |l| law.stress(l).1)
            .map_err(|(stretch, rise, slope)| LawFault::Slope { stretch, rise, slope })?;
        differences(a, b, modulus, |l| law.energy(l), |l| law.stress(l).0)
            .map_err(|(stretch, rise, stress)| LawFault::Energy { stretch, rise, stress })?;
    }
    Ok(())
}

fn batches(law: &dyn FiberLaw, samples: &[f64]) -> Result<(), LawFault> {
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
                return Err(LawFault::Batch { stretch, batch, single });
            }
        }
    }
    Ok(())
}

/// Whether a function rises by the integral of its derivative. Where not, the half that is further off is looked at, and
/// so on: at a bend the two come together. If they do not, the place, the difference quotient and the mean derivative.
fn differences(
    a: f64,
    b: f64,
    modulus: f64,
    function: impl Fn(f64) -> f64,
    derivative: impl Fn(f64) -> f64,
) -> Result<(), (f64, f64, f64)> {
    const AGREES: f64 = 1e-6;
    /// Below it, rounding of the function counts beside what is allowed.
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

/// Follows the larger half of the change of the slope: what is left of it in the end is a jump.
fn kink(law: &dyn FiberLaw, mut a: f64, mut b: f64, modulus: f64) -> Result<(), LawFault> {
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
    if is_small(below, above) { Ok(()) } else { Err(LawFault::Kink { stretch: 0.5 * (a + b), below, above }) }
}
