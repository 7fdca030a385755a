//! A fiber law by name with its parameters, as given in a sidecar or on a command line.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::fiber::law::{BUCKLING_STRAIN, COMPRESSION, FiberMaterial, Law, Table, TableError};
use crate::input::InputErrors;

/// A fiber law by name with its parameters, as given in a sidecar or on a command line.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedLaw {
    /// `linear`, `exponential`, `exponential-stretch` or `table`.
    pub name: String,
    /// `E` in Pa, for all laws except `table`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub youngs_modulus: Option<f64>,
    /// Radius of the circular cross-section in m.
    pub radius: f64,
    /// `B`, for the exponential laws.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nonlinearity: Option<f64>,
    /// `lambda_t`, for `exponential-stretch`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transition: Option<f64>,
    /// The CSV file of a `table`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// The points of a `table`, as an alternative to a file: stretch and nominal stress in Pa.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points: Option<Vec<[f64; 2]>>,
    /// Residual stiffness in compression over `E`, for any law.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compression: Option<f64>,
    /// The compressive strain over which the stiffness falls to its residual, for any law.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub buckling_strain: Option<f64>,
    /// Mass density in kg/m^3.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
}

/// The reason why named parameters do not define a fiber law.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NamedLawError {
    /// There is no law with this name.
    #[error("there is no law `{name}`; known are linear, exponential, exponential-stretch and table")]
    Name {
        /// The name given.
        name: String,
    },
    /// A required parameter is missing.
    #[error("the law `{law}` needs a {parameter}")]
    Missing {
        /// The law.
        law: &'static str,
        /// The parameter.
        parameter: &'static str,
    },
    /// A parameter does not belong to the law.
    #[error("the law `{law}` has no {parameter}")]
    Needless {
        /// The law.
        law: &'static str,
        /// The parameter.
        parameter: &'static str,
    },
    /// A parameter is out of range.
    #[error("the {parameter} is {value}, but must be finite and {bound}")]
    Range {
        /// The parameter.
        parameter: &'static str,
        /// Its value.
        value: f64,
        /// The valid range, such as `above 0` or `at least 1`.
        bound: &'static str,
    },
    /// A table has both a file and points.
    #[error("the law `table` has both a file and points")]
    TwoTables,
    /// The points of a table do not define a law; they are counted from 1.
    #[error("{}{error}", error.point().map(|point| format!("point {}: ", point + 1)).unwrap_or_default())]
    Points {
        /// The reason.
        error: TableError,
    },
    /// The file of a table cannot be read or does not define a law.
    #[error(transparent)]
    File(#[from] InputErrors),
}

impl NamedLawError {
    /// The invalid key, if there is one.
    pub(super) fn key(&self) -> Option<&'static str> {
        match self {
            Self::Name { .. } => Some("name"),
            Self::Needless { parameter, .. } | Self::Range { parameter, .. } => Some(parameter),
            Self::TwoTables | Self::Points { .. } => Some("points"),
            Self::Missing { .. } | Self::File(_) => None,
        }
    }
}

impl NamedLaw {
    /// Returns the material with checked parameters; the file of a table is relative to the folder `base`.
    ///
    /// # Errors
    /// Returns [`NamedLawError`] if the name is unknown, a parameter is missing, needless or out of range, or the table
    /// is invalid.
    pub fn material(&self, base: &Path) -> Result<FiberMaterial, NamedLawError> {
        let law = self.law(base)?;
        let law = match (self.compression, self.buckling_strain) {
            (None, None) => law,
            (compression, strain) => {
                let compression = compression.unwrap_or(COMPRESSION);
                let fits = (0.0..=1.0).contains(&compression);
                in_range("compression", compression, fits, "from 0 to 1")?;
                law.with_buckling(compression, above_zero("buckling_strain", strain.unwrap_or(BUCKLING_STRAIN))?)
            }
        };
        let radius = above_zero("radius", self.radius)?;
        if let Some(density) = self.density {
            in_range("density", density, density >= 0.0, "at least 0")?;
        }
        Ok(FiberMaterial { law, radius, density: self.density })
    }

    fn law(&self, base: &Path) -> Result<Law, NamedLawError> {
        let modulus = |law| {
            absent(law, "file", self.file.is_some())?;
            absent(law, "points", self.points.is_some())?;
            above_zero("youngs_modulus", present(law, "youngs_modulus", self.youngs_modulus)?)
        };
        let nonlinearity = |law| above_zero("nonlinearity", present(law, "nonlinearity", self.nonlinearity)?);
        match self.name.as_str() {
            "linear" => {
                absent("linear", "nonlinearity", self.nonlinearity.is_some())?;
                absent("linear", "transition", self.transition.is_some())?;
                Ok(Law::Linear { youngs_modulus: modulus("linear")? })
            }
            "exponential" => {
                absent("exponential", "transition", self.transition.is_some())?;
                let youngs_modulus = modulus("exponential")?;
                Ok(Law::Exponential { youngs_modulus, nonlinearity: nonlinearity("exponential")? })
            }
            "exponential-stretch" => {
                let youngs_modulus = modulus("exponential-stretch")?;
                let nonlinearity = nonlinearity("exponential-stretch")?;
                let transition = present("exponential-stretch", "transition", self.transition)?;
                let transition = in_range("transition", transition, transition >= 1.0, "at least 1")?;
                Ok(Law::ExponentialStretch { youngs_modulus, nonlinearity, transition })
            }
            "table" => {
                absent("table", "youngs_modulus", self.youngs_modulus.is_some())?;
                absent("table", "nonlinearity", self.nonlinearity.is_some())?;
                absent("table", "transition", self.transition.is_some())?;
                self.table(base).map(Law::table)
            }
            name => Err(NamedLawError::Name { name: name.into() }),
        }
    }

    fn table(&self, base: &Path) -> Result<Table, NamedLawError> {
        match (&self.file, &self.points) {
            (Some(file), None) => Ok(Table::read(&base.join(file))?),
            (None, Some(points)) => Table::new(points.clone()).map_err(|error| NamedLawError::Points { error }),
            (Some(_), Some(_)) => Err(NamedLawError::TwoTables),
            (None, None) => Err(NamedLawError::Missing { law: "table", parameter: "file" }),
        }
    }

    /// Returns true if the law can be read back; a custom law can be displayed but not read.
    pub(super) fn is_known(law: &Law) -> bool {
        match law {
            Law::Buckling { law, .. } => !matches!(**law, Law::Buckling { .. }) && Self::is_known(law),
            Law::Custom(_) => false,
            _ => true,
        }
    }
}

impl From<&FiberMaterial> for NamedLaw {
    fn from(material: &FiberMaterial) -> Self {
        let (radius, density) = (material.radius, material.density);
        Self { radius, density, ..Self::from(&material.law) }
    }
}

impl From<&Law> for NamedLaw {
    /// Leaves the radius at 0, since it is not part of the law.
    fn from(law: &Law) -> Self {
        let mut named = Self { name: law.name().into(), ..Self::default() };
        match law {
            Law::Linear { youngs_modulus } => named.youngs_modulus = Some(*youngs_modulus),
            Law::Exponential { youngs_modulus, nonlinearity } => {
                named.youngs_modulus = Some(*youngs_modulus);
                named.nonlinearity = Some(*nonlinearity);
            }
            Law::ExponentialStretch { youngs_modulus, nonlinearity, transition } => {
                named.youngs_modulus = Some(*youngs_modulus);
                named.nonlinearity = Some(*nonlinearity);
                named.transition = Some(*transition);
            }
            Law::Table(table) => named.points = Some(table.points().to_vec()),
            Law::Buckling { law, compression, buckling_strain } => {
                named = Self::from(&**law);
                named.compression = Some(*compression);
                named.buckling_strain = Some(*buckling_strain);
            }
            Law::Custom(law) => named.youngs_modulus = Some(law.law().youngs_modulus()),
        }
        named
    }
}

fn in_range(parameter: &'static str, value: f64, holds: bool, bound: &'static str) -> Result<f64, NamedLawError> {
    if holds && value.is_finite() { Ok(value) } else { Err(NamedLawError::Range { parameter, value, bound }) }
}

fn above_zero(parameter: &'static str, value: f64) -> Result<f64, NamedLawError> {
    in_range(parameter, value, value > 0.0, "above 0")
}

fn present(law: &'static str, parameter: &'static str, value: Option<f64>) -> Result<f64, NamedLawError> {
    value.ok_or(NamedLawError::Missing { law, parameter })
}

fn absent(law: &'static str, parameter: &'static str, given: bool) -> Result<(), NamedLawError> {
    if given { Err(NamedLawError::Needless { law, parameter }) } else { Ok(()) }
}
