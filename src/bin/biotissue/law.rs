//! The fiber law that a command line names, the same for every command.

use biotissue::fiber::law::FiberMaterial;
use biotissue::fiber::network::file::sidecar::{NamedLaw, NamedLawError};
use clap::{Args, ValueEnum};

use crate::failure::Failure;
use crate::number::real;

/// A fiber law with its parameters; all of them together or none.
#[derive(Args)]
pub struct LawArguments {
    /// Law of all fibers
    #[arg(long, value_name = "NAME", value_enum, requires_all = ["youngs_modulus", "radius"])]
    law: Option<LawName>,
    /// Young's modulus E of the fibers, Pa
    #[arg(long, value_name = "E", value_parser = real, requires = "law", allow_hyphen_values = true)]
    youngs_modulus: Option<f64>,
    /// Radius of the fibers, m
    #[arg(long, value_name = "R", value_parser = real, requires = "law", allow_hyphen_values = true)]
    radius: Option<f64>,
    /// B of the exponential laws
    #[arg(long, value_name = "B", value_parser = real, requires = "law", allow_hyphen_values = true)]
    nonlinearity: Option<f64>,
    /// Stretch above which exponential-stretch goes on along its tangent line
    #[arg(long, value_name = "L", value_parser = real, requires = "law", allow_hyphen_values = true)]
    transition: Option<f64>,
}

#[derive(Clone, Copy, ValueEnum)]
enum LawName {
    Linear,
    Exponential,
    ExponentialStretch,
}

impl LawName {
    fn as_str(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Exponential => "exponential",
            Self::ExponentialStretch => "exponential-stretch",
        }
    }
}

impl LawArguments {
    /// The law with its parameters checked; `None` where no law is named.
    pub fn material(&self) -> Result<Option<FiberMaterial>, Failure> {
        let (Some(name), Some(youngs_modulus), Some(radius)) = (self.law, self.youngs_modulus, self.radius) else {
            return Ok(None); // The argument parser has seen to it that none of the others is there.
        };
        let law = NamedLaw {
            name: name.as_str().into(),
            youngs_modulus,
            radius,
            nonlinearity: self.nonlinearity,
            transition: self.transition,
            density: None,
        };
        let material = law.material().map_err(|error| refused(&error))?;
        material.check().map_err(|error| {
            Failure::arguments(error.to_string(), format!("a number {}", error.expected), "correct that parameter")
        })?;
        Ok(Some(material))
    }
}

fn refused(error: &NamedLawError) -> Failure {
    let flag = |parameter: &str| format!("--{}", parameter.replace('_', "-"));
    let (expected, cure) = match error {
        NamedLawError::Missing { parameter, .. } => {
            (format!("{} with its value", flag(parameter)), "add it, or choose another --law".into())
        }
        NamedLawError::Needless { parameter, .. } => {
            ("only parameters that the law has".into(), format!("leave out {}", flag(parameter)))
        }
        NamedLawError::Range { parameter, bound, .. } => {
            (format!("a finite number {bound}"), format!("correct {}", flag(parameter)))
        }
        NamedLawError::Name { .. } => ("a law that is known".into(), "choose one of them".into()),
    };
    Failure::arguments(error.to_string(), expected, cure)
}
