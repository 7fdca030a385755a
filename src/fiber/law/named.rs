//! The laws by their names in files and commands.

use std::fmt;
use std::sync::Arc;

use super::{Buckling, Exponential, ExponentialStretch, FiberLaw, FiberMaterialError, Linear, Table};

/// A fiber law with its parameters; moduli in Pa.
#[derive(Clone, Debug, PartialEq)]
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
    /// Monotone cubics through measured points, shared by all materials that use them.
    Table(Arc<Table>),
    /// Another law with buckling in compression; see [`Buckling`].
    Buckling {
        /// The law in tension; it is not itself a `Buckling`.
        law: Box<Law>,
        /// `r`: residual stiffness in compression over `E`, from 0 to 1.
        compression: f64,
        /// `w`: the compressive strain over which the stiffness falls to its residual.
        buckling_strain: f64,
    },
    /// A law implemented outside this crate.
    Custom(CustomLaw),
}

/// Any [`FiberLaw`], shared. Two custom laws are equal if they have the same name and bitwise the same parameters.
#[derive(Clone)]
pub struct CustomLaw(Arc<dyn FiberLaw>);

impl CustomLaw {
    /// The shared law.
    #[must_use]
    pub fn law(&self) -> &dyn FiberLaw {
        &*self.0
    }
}

impl fmt::Debug for CustomLaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl PartialEq for CustomLaw {
    fn eq(&self, other: &Self) -> bool {
        let bits = |law: &Self| -> Vec<(&'static str, u64)> {
            law.0.parameters().into_iter().map(|(name, value)| (name, value.to_bits())).collect()
        };
        Arc::ptr_eq(&self.0, &other.0) || self.0.name() == other.0.name() && bits(self) == bits(other)
    }
}

impl Law {
    /// Wraps a custom law.
    #[must_use]
    pub fn custom(law: impl FiberLaw + 'static) -> Self {
        Self::Custom(CustomLaw(Arc::new(law)))
    }

    /// Makes the law through measured points.
    #[must_use]
    pub fn table(table: Table) -> Self {
        Self::Table(Arc::new(table))
    }

    /// Adds buckling in compression: `residual` is the fraction of the stiffness at rest that remains once a fiber is
    /// shortened by the `buckling_strain`.
    #[must_use]
    pub fn with_buckling(self, residual: f64, buckling_strain: f64) -> Self {
        Self::Buckling { law: Box::new(self), compression: residual, buckling_strain }
    }

    /// The name in files and on the command line; [`Law::Buckling`] has the name of the law in tension.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Linear { .. } => "linear",
            Self::Exponential { .. } => "exponential",
            Self::ExponentialStretch { .. } => "exponential-stretch",
            Self::Table(_) => "table",
            Self::Buckling { law, .. } => law.name(),
            Self::Custom(law) => law.law().name(),
        }
    }

    /// `E`, the slope of the nominal stress at rest, in Pa.
    #[must_use]
    pub fn youngs_modulus(&self) -> f64 {
        match self {
            Self::Linear { youngs_modulus }
            | Self::Exponential { youngs_modulus, .. }
            | Self::ExponentialStretch { youngs_modulus, .. } => *youngs_modulus,
            Self::Table(table) => table.youngs_modulus(),
            Self::Buckling { law, .. } => law.youngs_modulus(),
            Self::Custom(law) => law.law().youngs_modulus(),
        }
    }

    /// Calls `user` once with the formula, so that all batches that `user` evaluates bypass the dispatch.
    pub fn with(&self, user: &mut dyn FnMut(&dyn FiberLaw)) {
        match self {
            &Self::Linear { youngs_modulus } => user(&Linear { youngs_modulus }),
            &Self::Exponential { youngs_modulus, nonlinearity } => user(&Exponential { youngs_modulus, nonlinearity }),
            &Self::ExponentialStretch { youngs_modulus, nonlinearity, transition } => {
                user(&ExponentialStretch { youngs_modulus, nonlinearity, transition });
            }
            Self::Table(table) => user(&**table),
            Self::Buckling { law, compression, buckling_strain } => {
                law.with(&mut |law| user(&Buckling::new(law, *compression, *buckling_strain)));
            }
            Self::Custom(law) => user(law.law()),
        }
    }

    /// Checks that every parameter is physically valid.
    ///
    /// # Errors
    /// Returns the first invalid parameter. For a custom law the stress and the slope at rest are checked.
    pub fn check(&self) -> Result<(), FiberMaterialError> {
        let refuse = |parameter, value, expected| Err(FiberMaterialError { parameter, value, expected });
        match self {
            Self::Linear { youngs_modulus } => positive("Young's modulus", *youngs_modulus),
            Self::Exponential { youngs_modulus, nonlinearity } => {
                positive("Young's modulus", *youngs_modulus)?;
                positive("nonlinearity", *nonlinearity)
            }
            Self::ExponentialStretch { youngs_modulus, nonlinearity, transition } => {
                positive("Young's modulus", *youngs_modulus)?;
                positive("nonlinearity", *nonlinearity)?;
                if *transition >= 1.0 && transition.is_finite() {
                    return Ok(());
                }
                refuse("transition stretch", *transition, "at least 1 and finite")
            }
            // The constructor checks a table.
            Self::Table(_) => Ok(()),
            Self::Buckling { law, compression, buckling_strain } => {
                if !(0.0..=1.0).contains(compression) {
                    return refuse("stiffness in compression", *compression, "from 0 to 1, over the modulus");
                }
                positive("buckling strain", *buckling_strain)?;
                law.check()
            }
            Self::Custom(law) => {
                let (stress, slope) = law.law().stress(1.0);
                if stress != 0.0 {
                    return refuse("stress at stretch 1", stress, "0");
                }
                positive("slope at stretch 1", slope)?;
                let modulus = law.law().youngs_modulus();
                if (modulus - slope).abs() <= 1e-9 * slope {
                    return Ok(());
                }
                refuse("Young's modulus", modulus, "the slope of the stress at stretch 1")
            }
        }
    }
}

/// Returns an error unless `value` is positive and finite.
pub(super) fn positive(parameter: &'static str, value: f64) -> Result<(), FiberMaterialError> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(FiberMaterialError { parameter, value, expected: "positive and finite" })
    }
}

/// Dispatches to the variant; the batch methods dispatch once per batch.
impl FiberLaw for Law {
    fn name(&self) -> &str {
        self.name()
    }

    fn parameters(&self) -> Vec<(&'static str, f64)> {
        let mut parameters = Vec::new();
        self.with(&mut |law| parameters = law.parameters());
        parameters
    }

    fn stress(&self, stretch: f64) -> (f64, f64) {
        let mut stress = (0.0, 0.0);
        self.with(&mut |law| stress = law.stress(stretch));
        stress
    }

    fn energy(&self, stretch: f64) -> f64 {
        let mut energy = 0.0;
        self.with(&mut |law| energy = law.energy(stretch));
        energy
    }

    fn youngs_modulus(&self) -> f64 {
        self.youngs_modulus()
    }

    fn stresses(&self, stretch: &[f64], stress: &mut [f64], slope: &mut [f64]) {
        self.with(&mut |law| law.stresses(stretch, stress, slope));
    }

    fn energies(&self, stretch: &[f64], energy: &mut [f64]) {
        self.with(&mut |law| law.energies(stretch, energy));
    }

    fn total_energy(&self, stretch: &[f64], volume: &[f64]) -> f64 {
        let mut sum = 0.0;
        self.with(&mut |law| sum = law.total_energy(stretch, volume));
        sum
    }
}
