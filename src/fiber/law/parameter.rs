//! The scalar parameters of fiber laws and materials, as named in files and on the command line.

use std::fmt;

use super::FiberMaterialError;

/// A scalar parameter of a fiber law or a fiber material.
///
/// The case file, the `.toml` file beside a network, the command line and the writers of these files all use the names,
/// ranges and defaults of these descriptions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// The key in files.
    pub name: &'static str,
    /// The name on the command line, without the leading hyphens.
    pub option: &'static str,
    /// The name in the errors of [`Law::check`](super::Law::check).
    pub label: &'static str,
    /// The short name in summaries and in the help of the command line.
    pub symbol: &'static str,
    /// The unit; empty for a number without dimension.
    pub unit: &'static str,
    /// The admissible values.
    pub range: ParameterRange,
    /// The value of an absent parameter; `None` if the parameter is required.
    pub default: Option<f64>,
    /// One line for the help of the command line.
    pub help: &'static str,
}

/// The admissible values of a parameter; infinity and NaN are never admissible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParameterRange {
    /// Greater than this number.
    Above(f64),
    /// Equal to this number or greater.
    AtLeast(f64),
    /// Between these numbers, both included.
    FromTo(f64, f64),
}

impl ParameterRange {
    /// Returns true if the value is in the range.
    pub fn contains(self, value: f64) -> bool {
        value.is_finite()
            && match self {
                Self::Above(low) => value > low,
                Self::AtLeast(low) => value >= low,
                Self::FromTo(low, high) => (low..=high).contains(&value),
            }
    }
}

/// Formats the range to follow "must be", such as `above 0` or `from 0 to 1`.
impl fmt::Display for ParameterRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Above(low) => write!(f, "above {low}"),
            Self::AtLeast(low) => write!(f, "at least {low}"),
            Self::FromTo(low, high) => write!(f, "from {low} to {high}"),
        }
    }
}

impl Parameter {
    /// Checks that the value is in the range.
    pub(super) fn check(&self, value: f64) -> Result<(), FiberMaterialError> {
        if self.range.contains(value) {
            return Ok(());
        }
        let expected = match self.range {
            ParameterRange::Above(0.0) => "positive and finite".into(),
            range @ (ParameterRange::Above(_) | ParameterRange::AtLeast(_)) => format!("{range} and finite"),
            range @ ParameterRange::FromTo(..) => range.to_string(),
        };
        Err(FiberMaterialError { parameter: self.label, value, expected })
    }

    /// Returns a valid value for tests.
    #[cfg(test)]
    pub(crate) fn example(&self) -> f64 {
        match self.range {
            ParameterRange::Above(low) if self.unit == "Pa" => low + 1.0e8,
            ParameterRange::Above(low) => low + 1.2,
            ParameterRange::AtLeast(low) => low + 0.1,
            ParameterRange::FromTo(low, high) => 0.5 * (low + high),
        }
    }
}

/// `E`, the slope of the nominal stress at rest.
pub const YOUNGS_MODULUS: Parameter = Parameter {
    name: "youngs_modulus",
    option: "youngs-modulus",
    label: "Young's modulus",
    symbol: "E",
    unit: "Pa",
    range: ParameterRange::Above(0.0),
    default: None,
    help: "Young's modulus E of the fibers, Pa",
};

/// `B`, the factor of the Green strain in the exponent of the exponential laws.
pub const NONLINEARITY: Parameter = Parameter {
    name: "nonlinearity",
    option: "nonlinearity",
    label: "nonlinearity",
    symbol: "B",
    unit: "",
    range: ParameterRange::Above(0.0),
    default: None,
    help: "B of the exponential laws",
};

/// `lambda_t`, the stretch above which [`ExponentialStretch`](super::ExponentialStretch) continues as a straight line.
pub const TRANSITION: Parameter = Parameter {
    name: "transition",
    option: "transition",
    label: "transition stretch",
    symbol: "lambda_t",
    unit: "",
    range: ParameterRange::AtLeast(1.0),
    default: None,
    help: "Stretch above which exponential-stretch continues along its tangent line",
};

/// `r`, the residual stiffness in compression over `E`, of [`Buckling`](super::Buckling).
pub const COMPRESSION: Parameter = Parameter {
    name: "compression",
    option: "compression",
    label: "stiffness in compression",
    symbol: "R",
    unit: "",
    range: ParameterRange::FromTo(0.0, 1.0),
    default: Some(1e-3),
    help: "Fibers buckle in compression: the fraction of stiffness that remains, 0.001 if only --buckling-strain is given",
};

/// `w`, the compressive strain over which the stiffness of [`Buckling`](super::Buckling) falls to its residual.
pub const BUCKLING_STRAIN: Parameter = Parameter {
    name: "buckling_strain",
    option: "buckling-strain",
    label: "buckling strain",
    symbol: "W",
    unit: "",
    range: ParameterRange::Above(0.0),
    default: Some(0.01),
    help: "Compressive strain over which the stiffness falls, 0.01 if only --compression is given",
};

/// The parameters of [`Buckling`](super::Buckling), which modify any law; one of them suffices.
pub const BUCKLING: [Parameter; 2] = [COMPRESSION, BUCKLING_STRAIN];

/// The radius of the circular cross-section, of every material.
pub const RADIUS: Parameter = Parameter {
    name: "radius",
    option: "radius",
    label: "radius",
    symbol: "R",
    unit: "m",
    range: ParameterRange::Above(0.0),
    default: None,
    help: "Radius of the fibers, m",
};
