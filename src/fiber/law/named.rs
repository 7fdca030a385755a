//! The enum of all laws, generated from the table in [`super`].

use std::fmt;
use std::sync::Arc;

use super::{
    BUCKLING_STRAIN, COMPRESSION, FiberLaw, FiberMaterialError, FormulaLaw, Law, Parameter, Table, YOUNGS_MODULUS,
};

/// Generates [`Law`] and [`FormulaLaw`] from the table of the laws. An entry is the type that implements the law, its
/// name in files and on the command line, and its fields with the parameters that they hold.
macro_rules! laws {
    ($($(#[$doc:meta])* $law:ident, $name:literal, { $($field:ident: $parameter:ident),+ };)+) => {
        /// A fiber law with its parameters.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Law {
            $(
                $(#[$doc])*
                $law {
                    $(
                        #[doc = concat!("See [`", stringify!($parameter), "`].")]
                        $field: f64,
                    )+
                },
            )+
            /// Monotone cubics through measured points, shared by all materials that use them.
            Table(Arc<Table>),
            /// Another law with buckling in compression; see [`Buckling`].
            Buckling {
                /// The law in tension; files cannot hold one that is itself a `Buckling`.
                law: Box<Law>,
                /// See [`COMPRESSION`].
                compression: f64,
                /// See [`BUCKLING_STRAIN`].
                buckling_strain: f64,
            },
            /// A law implemented outside this crate.
            Custom(CustomLaw),
        }

        impl Law {
            /// The name in files and on the command line; [`Law::Buckling`] has the name of the law in tension.
            pub fn name(&self) -> &str {
                match self {
                    $(Self::$law { .. } => $name,)+
                    Self::Table(_) => LawName::Table.as_str(),
                    Self::Buckling { law, .. } => law.name(),
                    Self::Custom(law) => law.law().name(),
                }
            }

            /// Calls `user` once with the formula, so that all batches that `user` evaluates bypass the dispatch.
            pub fn dispatch(&self, user: &mut dyn FnMut(&dyn FiberLaw)) {
                match self {
                    $(&Self::$law { $($field),+ } => user(&$law { $($field),+ }),)+
                    Self::Table(table) => user(&**table),
                    Self::Buckling { law, compression, buckling_strain } => {
                        law.dispatch(&mut |law| user(&Buckling::new(law, *compression, *buckling_strain)));
                    }
                    Self::Custom(law) => user(law.law()),
                }
            }

            /// Returns the law with scalar parameters and their values; `None` for the other variants.
            pub fn formula(&self) -> Option<(FormulaLaw, Vec<f64>)> {
                match self {
                    $(&Self::$law { $($field),+ } => Some((FormulaLaw::$law, vec![$($field),+])),)+
                    Self::Table(_) | Self::Buckling { .. } | Self::Custom(_) => None,
                }
            }
        }

        /// A law that a formula with scalar parameters defines.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum FormulaLaw {
            $($(#[$doc])* $law,)+
        }

        impl FormulaLaw {
            /// All these laws.
            pub const ALL: &'static [Self] = &[$(Self::$law),+];

            /// The name in files and on the command line.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$law => $name,)+
                }
            }

            /// The parameters, in the order in which files list them.
            pub const fn parameters(self) -> &'static [Parameter] {
                match self {
                    $(Self::$law => &[$($parameter),+],)+
                }
            }

            /// Makes the law from the values that `value` returns for its parameters.
            ///
            /// # Errors
            /// Returns the first error of `value`. The values are not checked; see [`Law::check`].
            pub fn law<E>(self, mut value: impl FnMut(&'static Parameter) -> Result<f64, E>) -> Result<Law, E> {
                Ok(match self {
                    $(Self::$law => Law::$law { $($field: value(&$parameter)?),+ },)+
                })
            }
        }
    };
}
pub(super) use laws;

/// Any [`FiberLaw`], shared. Two custom laws are equal if they have the same name and bitwise the same parameters.
#[derive(Clone)]
pub struct CustomLaw(Arc<dyn FiberLaw>);

impl CustomLaw {
    /// The shared law.
    pub fn law(&self) -> &dyn FiberLaw {
        &*self.0
    }

    /// Checks stress and slope at rest.
    fn check(&self) -> Result<(), FiberMaterialError> {
        let (stress, slope) = self.0.stress(1.0);
        let refuse =
            |parameter, value, expected: &str| Err(FiberMaterialError { parameter, value, expected: expected.into() });
        if stress != 0.0 {
            return refuse("stress at stretch 1", stress, "0");
        }
        Parameter { label: "slope at stretch 1", ..YOUNGS_MODULUS }.check(slope)?;
        let modulus = self.0.youngs_modulus();
        if (modulus - slope).abs() <= 1e-9 * slope {
            return Ok(());
        }
        refuse("Young's modulus", modulus, "the slope of the stress at stretch 1")
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
    pub fn custom(law: impl FiberLaw + 'static) -> Self {
        Self::Custom(CustomLaw(Arc::new(law)))
    }

    /// Makes the law through measured points.
    pub fn table(table: Table) -> Self {
        Self::Table(Arc::new(table))
    }

    /// Adds buckling in compression: `residual` is the fraction of the stiffness at rest that remains once a fiber is
    /// shortened by the `buckling_strain`.
    #[must_use]
    pub fn with_buckling(self, residual: f64, buckling_strain: f64) -> Self {
        Self::Buckling { law: Box::new(self), compression: residual, buckling_strain }
    }

    /// Returns what `user` returns for the formula.
    fn with<T: Default>(&self, user: impl Fn(&dyn FiberLaw) -> T) -> T {
        let mut value = T::default();
        self.dispatch(&mut |law| value = user(law));
        value
    }

    /// `E`, the slope of the nominal stress at rest, in Pa.
    pub fn youngs_modulus(&self) -> f64 {
        self.with(|law| law.youngs_modulus())
    }

    /// Checks that every parameter is physically valid.
    ///
    /// # Errors
    /// Returns the first invalid parameter. For a custom law the stress and the slope at rest are checked.
    pub fn check(&self) -> Result<(), FiberMaterialError> {
        if let Some((formula, values)) = self.formula() {
            return formula.parameters().iter().zip(values).try_for_each(|(parameter, value)| parameter.check(value));
        }
        match self {
            Self::Buckling { law, compression, buckling_strain } => {
                COMPRESSION.check(*compression)?;
                BUCKLING_STRAIN.check(*buckling_strain)?;
                law.check()
            }
            Self::Custom(law) => law.check(),
            // The constructor of a table checks it.
            _ => Ok(()),
        }
    }
}

/// Dispatches to the variant; the batch methods dispatch once per batch.
impl FiberLaw for Law {
    fn name(&self) -> &str {
        self.name()
    }

    fn parameters(&self) -> Vec<(&'static str, f64)> {
        self.with(|law| law.parameters())
    }

    fn stress(&self, stretch: f64) -> (f64, f64) {
        self.with(|law| law.stress(stretch))
    }

    fn energy(&self, stretch: f64) -> f64 {
        self.with(|law| law.energy(stretch))
    }

    fn youngs_modulus(&self) -> f64 {
        self.youngs_modulus()
    }

    fn stresses(&self, stretch: &[f64], stress: &mut [f64], slope: &mut [f64]) {
        self.dispatch(&mut |law| law.stresses(stretch, stress, slope));
    }

    fn energies(&self, stretch: &[f64], energy: &mut [f64]) {
        self.dispatch(&mut |law| law.energies(stretch, energy));
    }

    fn total_energy(&self, stretch: &[f64], volume: &[f64]) -> f64 {
        self.with(|law| law.total_energy(stretch, volume))
    }
}

/// A law that files and the command line can name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LawName {
    /// A law with scalar parameters.
    Formula(FormulaLaw),
    /// A curve through points; see [`Table`].
    Table,
}

impl LawName {
    /// All names.
    pub fn all() -> impl Iterator<Item = Self> {
        FormulaLaw::ALL.iter().copied().map(Self::Formula).chain([Self::Table])
    }

    /// Returns the law with this [`LawName::as_str`].
    pub fn find(name: &str) -> Option<Self> {
        Self::all().find(|law| law.as_str() == name)
    }

    /// The name in files and on the command line.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Formula(law) => law.name(),
            Self::Table => "table",
        }
    }

    /// The scalar parameters, in the order in which files list them.
    pub const fn parameters(self) -> &'static [Parameter] {
        match self {
            Self::Formula(law) => law.parameters(),
            Self::Table => &[],
        }
    }
}

/// The parameters of all laws, each once.
pub fn formula_parameters() -> Vec<&'static Parameter> {
    let mut parameters: Vec<&Parameter> = Vec::new();
    for parameter in FormulaLaw::ALL.iter().flat_map(|law| law.parameters()) {
        if !parameters.contains(&parameter) {
            parameters.push(parameter);
        }
    }
    parameters
}
