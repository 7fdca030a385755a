//! Fibers of several types, drawn at random.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};

use super::Network;
use crate::fiber::law::FiberMaterial;

/// How far from 1 fractions may sum up: decimal fractions are not exact.
const TOLERANCE: f64 = 1e-9;
/// The stream of random numbers that draws types; a generator of the same seed draws its points from stream 0.
const STREAM: u64 = 1;

/// Why fibers cannot be divided into types.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FiberTypesError {
    /// No type at all, or more than material numbers can count.
    #[error("{count} types of fibers; there can be from 1 to 65535")]
    Count {
        /// How many.
        count: usize,
    },
    /// A fraction that is none.
    #[error("the fraction of type {number} is {fraction}")]
    Fraction {
        /// Which type, from 0.
        number: usize,
        /// Its fraction.
        fraction: f64,
    },
    /// Fractions that leave fibers out or count them twice.
    #[error("the fractions of the fiber types sum to {}", (sum * 1e12).round() / 1e12)]
    Sum {
        /// Their sum.
        sum: f64,
    },
}

impl Network {
    /// The same network with fibers of several types: each a fraction of all fibers, by number, and its material.
    ///
    /// How many fibers a type gets is exact, the fractions rounded such that none is off by a whole fiber (largest
    /// remainders); which ones is drawn by ChaCha from the seed, the same on every machine. Fibers keep their places.
    ///
    /// # Errors
    /// [`FiberTypesError`]: fractions must be above 0 and sum to 1 within 1e-9.
    pub fn with_random_types(self, types: Vec<(f64, FiberMaterial)>, seed: u64) -> Result<Self, FiberTypesError> {
        if !(1..=usize::from(u16::MAX)).contains(&types.len()) {
            return Err(FiberTypesError::Count { count: types.len() });
        }
        let (fractions, materials): (Vec<f64>, Vec<FiberMaterial>) = types.into_iter().unzip();
        for (number, &fraction) in fractions.iter().enumerate() {
            if fraction.is_nan() || fraction <= 0.0 {
                return Err(FiberTypesError::Fraction { number, fraction });
            }
        }
        let sum: f64 = fractions.iter().sum();
        if (sum - 1.0).abs() > TOLERANCE {
            return Err(FiberTypesError::Sum { sum });
        }
        let counts = counts(&fractions, self.fibers.len());
        let types = (0u16..).zip(counts);
        let mut type_of: Vec<u16> = types.flat_map(|(number, count)| std::iter::repeat_n(number, count)).collect();
        shuffle(&mut type_of, seed);
        Ok(Self { materials, reaction_of: type_of, ..self })
    }
}

/// Whole numbers in the proportion of the fractions that sum to `total`: those with the largest remainders are rounded up.
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
    // Fractions that sum to a trifle more than 1 could count a fiber too many.
    let mut excess = counts.iter().sum::<usize>().saturating_sub(total);
    for count in counts.iter_mut().rev() {
        let less = excess.min(*count);
        *count -= less;
        excess -= less;
    }
    counts
}

/// Every order with the same probability, but for a bias of `len / 2^64` (Fisher and Yates, as Durstenfeld wrote it).
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
    fn numbers_keep_the_proportion() {
        assert_eq!(counts(&[0.7, 0.3], 10), [7, 3]);
        assert_eq!(counts(&[0.5, 0.5], 3), [2, 1]);
        assert_eq!(counts(&[0.1, 0.1, 0.8], 4), [1, 0, 3]);
        assert_eq!(counts(&[1.0 / 3.0; 3], 38_376), [12_792; 3]);
        assert_eq!(counts(&[1.0 + 1e-9], 2_000_000_000), [2_000_000_000]);
        assert_eq!(counts(&[1.0 - 1e-9], 2_000_000_000), [2_000_000_000]);
    }

    #[test]
    fn the_seed_draws_the_types() {
        let network = delaunay(20, 1).unwrap();
        let fibers = network.fibers().len();
        let types = || vec![(0.7, material(1.0)), (0.3, material(2.0))];
        let one = network.clone().with_random_types(types(), 1).unwrap();
        let stiff = one.reaction_of().iter().filter(|&&of| of == 1).count();
        assert_eq!(stiff, (0.3 * fibers as f64).round() as usize);
        assert_eq!(one.fibers(), network.fibers());
        assert_eq!(network.clone().with_random_types(types(), 1).unwrap(), one);
        assert_ne!(network.with_random_types(types(), 2).unwrap().reaction_of(), one.reaction_of());
    }

    /// Numbers of ChaCha that no release of a library may change.
    #[test]
    fn the_order_stays_what_it_is() {
        let mut types: Vec<u16> = (0..12).collect();
        shuffle(&mut types, 1);
        assert_eq!(types, [10, 2, 11, 9, 4, 6, 5, 3, 8, 0, 1, 7]);
    }

    #[test]
    fn fractions_without_sense_are_told() {
        let network = delaunay(20, 1).unwrap();
        let error = |fractions: &[f64]| {
            let types = fractions.iter().map(|&fraction| (fraction, material(1.0))).collect();
            network.clone().with_random_types(types, 1).unwrap_err().to_string()
        };
        assert_eq!(error(&[]), "0 types of fibers; there can be from 1 to 65535");
        assert_eq!(error(&[0.5, 0.4]), "the fractions of the fiber types sum to 0.9");
        assert_eq!(error(&[1.5, -0.5]), "the fraction of type 1 is -0.5");
        assert!(error(&[f64::NAN]).contains("is NaN"));
    }
}
