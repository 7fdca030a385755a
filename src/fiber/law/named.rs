//! The laws by name, as files and commands call them.

use std::fmt;
use std::sync::Arc;

use super::{Exponential, ExponentialStretch, FiberLaw, FiberMaterialError, Linear, NoCompression, Table};

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
    /// Cubics through measured points, shared by all materials that use them.
    Table(Arc<Table>),
    /// Another law whose fibers give way below stretch 1; see [`NoCompression`].
    NoCompression {
        /// The law in tension; not itself of this kind.
        law: Box<Law>,
        /// Stiffness left in compression over `E`: `r`, from 0 to 1.
        compression: f64,
        /// The compressive strain within which the stiffness falls: `w`.
        buckling_strain: f64,
    },
    /// A law that this crate does not know.
    Custom(CustomLaw),
}

/// Any [`FiberLaw`], shared. Equal to another of the same name with the same parameters, bit for bit.
#[derive(Clone)]
pub struct CustomLaw(Arc<dyn FiberLaw>);

impl CustomLaw {
    /// The law.
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
    /// A law of the caller's own.
    #[must_use]
    pub fn custom(law: impl FiberLaw + 'static) -> Self {
        Self::Custom(CustomLaw(Arc::new(law)))
    }

    /// The law through measured points.
    #[must_use]
    pub fn table(table: Table) -> Self {
        Self::Table(Arc::new(table))
    }

    /// This law with fibers that give way in compression: `residual` is what is left of the stiffness at rest once a
    /// fiber is shortened by the `buckling_strain`.
    #[must_use]
    pub fn without_compression(self, residual: f64, buckling_strain: f64) -> Self {
        Self::NoCompression { law: Box::new(self), compression: residual, buckling_strain }
    }

    /// The name in files and on the command line; a modified law has that of the law itself.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Linear { .. } => "linear",
            Self::Exponential { .. } => "exponential",
            Self::ExponentialStretch { .. } => "exponential-stretch",
            Self::Table(_) => "table",
            Self::NoCompression { law, .. } => law.name(),
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
            Self::NoCompression { law, .. } => law.youngs_modulus(),
            Self::Custom(law) => law.law().youngs_modulus(),
        }
    }

    /// Hands the formula to `user`, once. All batches that `user` asks for go straight to it.
    pub fn with(&self, user: &mut dyn FnMut(&dyn FiberLaw)) {
        match self {
            &Self::Linear { youngs_modulus } => user(&Linear { youngs_modulus }),
            &Self::Exponential { youngs_modulus, nonlinearity } => user(&Exponential { youngs_modulus, nonlinearity }),
            &Self::ExponentialStretch { youngs_modulus, nonlinearity, transition } => {
                user(&ExponentialStretch { youngs_modulus, nonlinearity, transition });
            }
            Self::Table(table) => user(&**table),
            Self::NoCompression { law, compression, buckling_strain } => {
                law.with(&mut |law| user(&NoCompression::new(law, *compression, *buckling_strain)));
            }
            Self::Custom(law) => user(law.law()),
        }
    }

    /// Checks that every parameter has physical sense.
    ///
    /// # Errors
    /// The first that has none. Of a custom law stress and slope at rest are looked at.
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
            // A table is checked when it is made.
            Self::Table(_) => Ok(()),
            Self::NoCompression { law, compression, buckling_strain } => {
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

/// Refuses what is not above 0 and finite.
pub(super) fn positive(parameter: &'static str, value: f64) -> Result<(), FiberMaterialError> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(FiberMaterialError { parameter, value, expected: "positive and finite" })
    }
}

/// Whatever law it is; the methods for a batch choose once.
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
