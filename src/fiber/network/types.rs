//! Random assignment of fiber types.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};

use super::Network;
use crate::fiber::law::FiberMaterial;

/// Tolerance of the sum of the fractions, since decimal fractions are not exact in binary.
const TOLERANCE: f64 = 1e-9;
/// The stream of random numbers for the types; a generator with the same seed draws its points from stream 0.
const STREAM: u64 = 1;

/// The error of fiber types that cannot be assigned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FiberTypesError {
    /// There is no type, or there are more than 65535. The value is the number of types.
    #[error("{0} fiber types; the number must be from 1 to 65535")]
    Count(usize),
    /// A fraction is not positive.
    #[error("the fraction of fiber type {number} is {fraction}")]
    Fraction {
        /// The type, from 0.
        number: usize,
        /// Its fraction.
        fraction: f64,
    },
    /// The fractions do not sum to 1. The value is their sum.
    #[error("the fractions of the fiber types sum to {}", (.0 * 1e12).round() / 1e12)]
    Sum(f64),
}

impl Network {
    /// Assigns random types to the fibers; each type has a fraction of the number of all fibers, and a material.
    ///
    /// The fibers are apportioned to the types by the method of largest remainders, so that the number of fibers of
    /// each type differs from its share by less than one. The fibers of each type are drawn with ChaCha from the seed,
    /// the same on every machine. The order of the fibers does not change.
    ///
    /// # Errors
    /// Returns [`FiberTypesError`] unless there are 1 to 65535 types and all fractions are above 0 and sum to 1 within
    /// 1e-9.
    pub fn with_random_types(self, types: Vec<(f64, FiberMaterial)>, seed: u64) -> Result<Self, FiberTypesError> {
        if !(1..=usize::from(u16::MAX)).contains(&types.len()) {
            return Err(FiberTypesError::Count(types.len()));
        }
        let (fractions, materials): (Vec<f64>, Vec<FiberMaterial>) = types.into_iter().unzip();
        for (number, &fraction) in fractions.iter().enumerate() {
            if fraction.is_nan() || fraction <= 0.0 {
                return Err(FiberTypesError::Fraction { number, fraction });
            }
        }
        let sum: f64 = fractions.iter().sum();
        if (sum - 1.0).abs() > TOLERANCE {
            return Err(FiberTypesError::Sum(sum));
        }
        let counts = counts(&fractions, self.fibers.len());
        let types = (0u16..).zip(counts);
        let mut material_of: Vec<u16> = types.flat_map(|(number, count)| std::iter::repeat_n(number, count)).collect();
        shuffle(&mut material_of, seed);
        Ok(Self { materials, material_of, ..self })
    }
}

/// Apportions `total` to the fractions: rounds all shares down, and then those with the largest remainders up.
fn counts(fractions: &[f64], total: usize) -> Vec<usize> {
    let exact: Vec<f64> = fractions.iter().map(|fraction| fraction * total as f64).collect();
    let mut counts: Vec<usize> = exact.iter().map(|exact| exact.floor() as usize).collect();
    let mut by_remainder: Vec<usize> = (0..exact.len()).collect();
    by_remainder.sort_by(|&a, &b| (exact[b] - exact[b].floor()).total_cmp(&(exact[a] - exact[a].floor())));
    let mut missing = total.saturating_sub(counts.iter().sum());
    for &number in by_remainder.iter().cycle() {
        if missing == 0 {
            break;
        }
        counts[number] += 1;
        missing -= 1;
    }
    // Fractions that sum to slightly more than 1 may give too many fibers.
    let mut excess = counts.iter().sum::<usize>().saturating_sub(total);
    for count in counts.iter_mut().rev() {
        let less = excess.min(*count);
        *count -= less;
        excess -= less;
    }
    counts
}

/// Shuffles such that every order has the same probability, up to a bias of `len / 2^64` (the method of Fisher and
/// Yates, in Durstenfeld's form).
fn shuffle(types: &mut [u16], seed: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(STREAM);
    for last in (1..types.len()).rev() {
        let place = (random.next_u64() % (last as u64 + 1)) as usize;
        types.swap(last, place);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fiber::law::Law;
    use crate::fiber::network::generate::delaunay;

    fn material(youngs_modulus: f64) -> FiberMaterial {
        FiberMaterial { law: Law::Linear { youngs_modulus }, radius: 1.0, density: None }
    }

    #[test]
    fn counts_are_proportional_to_the_fractions() {
        assert_eq!(counts(&[0.7, 0.3], 10), [7, 3]);
        assert_eq!(counts(&[0.5, 0.5], 3), [2, 1]);
        assert_eq!(counts(&[0.1, 0.1, 0.8], 4), [1, 0, 3]);
        assert_eq!(counts(&[1.0 / 3.0; 3], 38_376), [12_792; 3]);
        assert_eq!(counts(&[1.0 + 1e-9], 2_000_000_000), [2_000_000_000]);
        assert_eq!(counts(&[1.0 - 1e-9], 2_000_000_000), [2_000_000_000]);
    }

    #[test]
    fn the_types_depend_on_the_seed() {
        let network = delaunay(20, 1).unwrap();
        let fibers = network.fibers().len();
        let types = || vec![(0.7, material(1.0)), (0.3, material(2.0))];
        let one = network.clone().with_random_types(types(), 1).unwrap();
        let stiff = one.material_of().iter().filter(|&&of| of == 1).count();
        assert_eq!(stiff, (0.3 * fibers as f64).round() as usize);
        assert_eq!(one.fibers(), network.fibers());
        assert_eq!(network.clone().with_random_types(types(), 1).unwrap(), one);
        assert_ne!(network.with_random_types(types(), 2).unwrap().material_of(), one.material_of());
    }

    /// Reference values of ChaCha, which no library release may change.
    #[test]
    fn the_shuffled_order_is_unchanged() {
        let mut types: Vec<u16> = (0..12).collect();
        shuffle(&mut types, 1);
        assert_eq!(types, [10, 2, 11, 9, 4, 6, 5, 3, 8, 0, 1, 7]);
    }

    #[test]
    fn invalid_fractions_are_errors() {
        let network = delaunay(20, 1).unwrap();
        let error = |fractions: &[f64]| {
            let types = fractions.iter().map(|&fraction| (fraction, material(1.0))).collect();
            network.clone().with_random_types(types, 1).unwrap_err().to_string()
        };
        assert_eq!(error(&[]), "0 fiber types; the number must be from 1 to 65535");
        assert_eq!(error(&[0.5, 0.4]), "the fractions of the fiber types sum to 0.9");
        assert_eq!(error(&[1.5, -0.5]), "the fraction of fiber type 1 is -0.5");
        assert!(error(&[f64::NAN]).contains("is NaN"));
    }
}
