//! Batch evaluation of the formula for one fiber.

use crate::fiber::simd::{Kernel, vectorized};

/// The formula of a law without branches, so that the compiler can vectorize its loops.
///
/// Implementations of `stress_of` and `energy_of` must be `#[inline(always)]`.
pub(super) trait Formula: Sized {
    /// Nominal stress and slope.
    fn stress_of<const FUSED: bool>(&self, stretch: f64) -> (f64, f64);

    /// Energy per reference volume.
    fn energy_of<const FUSED: bool>(&self, stretch: f64) -> f64;

    /// Computes the energy for all stretches.
    #[inline]
    fn energies_of(&self, stretch: &[f64], energy: &mut [f64]) {
        vectorized(Energies { law: self, stretch, energy });
    }
}

/// Computes stress and slope for all stretches.
#[inline]
pub(super) fn stresses(law: &impl Formula, stretch: &[f64], stress: &mut [f64], slope: &mut [f64]) {
    vectorized(Stresses { law, stretch, stress, slope });
}

struct Stresses<'a, L> {
    law: &'a L,
    stretch: &'a [f64],
    stress: &'a mut [f64],
    slope: &'a mut [f64],
}

impl<L: Formula> Kernel for Stresses<'_, L> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        for ((&stretch, stress), slope) in self.stretch.iter().zip(self.stress).zip(self.slope) {
            (*stress, *slope) = self.law.stress_of::<FUSED>(stretch);
        }
    }
}

struct Energies<'a, L> {
    law: &'a L,
    stretch: &'a [f64],
    energy: &'a mut [f64],
}

impl<L: Formula> Kernel for Energies<'_, L> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        for (&stretch, energy) in self.stretch.iter().zip(self.energy) {
            *energy = self.law.energy_of::<FUSED>(stretch);
        }
    }
}

/// Implements the methods of [`super::FiberLaw`] for a law with this name and these fields by its [`Formula`].
macro_rules! by_formula {
    ($name:literal, $($field:ident),+) => {
        fn name(&self) -> &str {
            $name
        }

        fn parameters(&self) -> Vec<(&'static str, f64)> {
            vec![$((stringify!($field), self.$field)),+]
        }

        fn youngs_modulus(&self) -> f64 {
            self.youngs_modulus
        }

        #[inline]
        fn stress(&self, stretch: f64) -> (f64, f64) {
            $crate::fiber::law::batch::Formula::stress_of::<false>(self, stretch)
        }

        #[inline]
        fn energy(&self, stretch: f64) -> f64 {
            $crate::fiber::law::batch::Formula::energy_of::<false>(self, stretch)
        }

        fn stresses(&self, stretch: &[f64], stress: &mut [f64], slope: &mut [f64]) {
            $crate::fiber::law::batch::stresses(self, stretch, stress, slope);
        }

        fn energies(&self, stretch: &[f64], energy: &mut [f64]) {
            $crate::fiber::law::batch::Formula::energies_of(self, stretch, energy);
        }
    };
}
pub(super) use by_formula;
