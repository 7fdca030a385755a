//! Fiber laws: the axial force of a fiber as a function of its stretch.
//!
//! A law gives the nominal stress `s(lambda)` of a fiber, in Pa: the force over the reference area, positive in
//! tension. The force is `f = A s`, its slope with respect to the current length `df/dl = A s'(lambda) / L`, and the
//! energy of the fiber `A L integral_1^lambda s`. With the Green strain `g = (lambda^2 - 1) / 2`, the laws are:
//!
//! | law | `s` | source |
//! |---|---|---|
//! | [`Exponential`] | `(E / B) (exp(B g) - 1)` | Tobin 2018, eq. B.1 |
//! | [`Linear`] | `E lambda g` | MuMFiM, reaction 0 |
//! | [`ExponentialStretch`] | `(E / B) lambda (exp(B g) - 1)` on `[1, lambda_t]`, tangent lines outside | MuMFiM, reaction 1 |
//! | [`Table`] | monotone cubics through measured points, tangent lines beyond them | Fritsch and Butland 1984 |
//! | [`Buckling`] of any law | below stretch 1 the slope falls from `E` to `r E` over the strain `w` | smoothstep |
//!
//! [`Law`] is an enum of these laws. For the laws with scalar parameters, the table `laws!` below gives the names and
//! parameters in files and on the command line; [`FormulaLaw`] is its run-time form. A new law of this crate is a file
//! like `linear.rs` and an entry of that table. [`Law::custom`] adds any other type that implements [`FiberLaw`];
//! networks, trusses and RVE models treat it like a built-in law.
//!
//! # A custom law
//!
//! Implement the formula for one fiber. Batches and the energy have default implementations, which you can override if
//! a custom loop or a closed form is faster. [`check()`] tests that stress, slope, energy and batches are consistent.
//!
//! ```
//! use biotissue::fiber::law::{FiberLaw, FiberMaterial, Law, check};
//!
//! /// `s = E ln(lambda)`.
//! #[derive(Clone, Debug)]
//! struct Hencky {
//!     youngs_modulus: f64,
//! }
//!
//! impl FiberLaw for Hencky {
//!     fn name(&self) -> &str {
//!         "hencky"
//!     }
//!
//!     fn parameters(&self) -> Vec<(&'static str, f64)> {
//!         vec![("youngs_modulus", self.youngs_modulus)]
//!     }
//!
//!     fn stress(&self, stretch: f64) -> (f64, f64) {
//!         (self.youngs_modulus * stretch.ln(), self.youngs_modulus / stretch)
//!     }
//! }
//!
//! let law = Hencky { youngs_modulus: 1.0e8 };
//! check(&law, 0.5..=2.0)?;
//! let fiber = FiberMaterial { law: Law::custom(law), radius: 5.0e-8, density: None };
//! assert_eq!(fiber.check(), Ok(()));
//! # Ok::<(), biotissue::fiber::law::LawError>(())
//! ```

mod batch;
mod buckling;
mod check;
mod exp;
mod exponential;
mod exponential_stretch;
mod linear;
mod material;
mod named;
mod parameter;
mod quadrature;
mod table;
#[cfg(feature = "app")]
mod table_file;
#[cfg(test)]
mod tests;

use std::fmt::Debug;
use std::sync::Arc;

pub use buckling::Buckling;
pub use check::{LawError, check};
pub use exp::exp_m1;
pub use exponential::Exponential;
pub use exponential_stretch::ExponentialStretch;
pub use linear::Linear;
pub use material::{FiberMaterial, FiberMaterialError};
pub use named::{CustomLaw, LawName, formula_parameters};
pub use parameter::{
    BUCKLING, BUCKLING_STRAIN, COMPRESSION, NONLINEARITY, Parameter, ParameterRange, RADIUS, TRANSITION, YOUNGS_MODULUS,
};
pub use table::{Table, TableError};

// The table of all laws with scalar parameters: type, name in files and on the command line, parameters.
named::laws! {
    /// `s = E lambda g`.
    Linear, "linear", { youngs_modulus: YOUNGS_MODULUS };
    /// `s = (E / B) (exp(B g) - 1)`.
    Exponential, "exponential", { youngs_modulus: YOUNGS_MODULUS, nonlinearity: NONLINEARITY };
    /// `s = (E / B) lambda (exp(B g) - 1)` on `[1, lambda_t]`, its tangent lines outside.
    ExponentialStretch, "exponential-stretch",
        { youngs_modulus: YOUNGS_MODULUS, nonlinearity: NONLINEARITY, transition: TRANSITION };
}

/// The axial behavior of a fiber: nominal stress, slope and energy as functions of the stretch. The stress is C1 for
/// all `lambda > 0`, vanishes at stretch 1 and has a positive slope there.
///
/// A truss evaluates batches of about a hundred fibers per call; only laws that override the batch methods use vector
/// instructions. Stresses, slopes and energies per volume are in Pa. Threads share a law, and its results must depend
/// on the arguments only.
pub trait FiberLaw: Debug + Send + Sync {
    /// The name of the law. Two laws with the same name and the same [`FiberLaw::parameters`] are the same law.
    fn name(&self) -> &str;

    /// All parameters of the law, with their names; they identify the law in comparisons, reports and checkpoints.
    fn parameters(&self) -> Vec<(&'static str, f64)>;

    /// Nominal stress and its derivative with respect to the stretch, both in Pa.
    fn stress(&self, stretch: f64) -> (f64, f64);

    /// Energy per reference volume of the fiber, `integral_1^lambda s`, in J/m^3.
    ///
    /// The default implementation integrates the stress by adaptive quadrature, to about 14 digits, in some
    /// microseconds.
    fn energy(&self, stretch: f64) -> f64 {
        quadrature::adaptive(1.0, stretch, &|stretch| self.stress(stretch).0)
    }

    /// `E`, the slope of the nominal stress at rest, in Pa.
    fn youngs_modulus(&self) -> f64 {
        self.stress(1.0).1
    }

    /// Computes nominal stress and slope of a batch of fibers; all slices have the same length.
    fn stresses(&self, stretch: &[f64], stress: &mut [f64], slope: &mut [f64]) {
        for ((&stretch, stress), slope) in stretch.iter().zip(stress).zip(slope) {
            (*stress, *slope) = self.stress(stretch);
        }
    }

    /// Computes the energy per reference volume of a batch of fibers; the slices have the same length.
    fn energies(&self, stretch: &[f64], energy: &mut [f64]) {
        for (&stretch, energy) in stretch.iter().zip(energy) {
            *energy = self.energy(stretch);
        }
    }

    /// `sum_f volume_f * integral_1^lambda_f s` in J for volumes in m^3, summed in the order of the fibers.
    fn total_energy(&self, stretch: &[f64], volume: &[f64]) -> f64 {
        const BATCH: usize = 64;
        let (mut energy, mut sum) = ([0.0; BATCH], 0.0);
        for (stretch, volume) in stretch.chunks(BATCH).zip(volume.chunks(BATCH)) {
            let energy = &mut energy[..stretch.len()];
            self.energies(stretch, energy);
            for (energy, volume) in energy.iter().zip(volume) {
                sum += energy * volume;
            }
        }
        sum
    }
}
