//! The fiber law on the command line, the same for every command.

use std::path::{Path, PathBuf};

use biotissue::fiber::law::FiberMaterial;
use biotissue::fiber::network::file::sidecar::{NamedLaw, NamedLawError};
use clap::{Args, ValueEnum};

use crate::failure::Failure;
use crate::number::real;

/// A fiber law with its parameters; all of them together or none.
#[derive(Args)]
pub struct LawArguments {
    /// Law of all fibers
    #[arg(long, value_name = "NAME", value_enum, requires = "radius")]
    law: Option<LawName>,
    /// Young's modulus E of the fibers, Pa
    #[arg(long, value_name = "E", value_parser = real, requires = "law", allow_hyphen_values = true)]
    #[arg(required_if_eq_any([("law", "linear"), ("law", "exponential"), ("law", "exponential-stretch")]))]
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
    /// CSV file of the law table: stretch and nominal stress in Pa, (1, 0) among them
    #[arg(long, value_name = "FILE", requires = "law", required_if_eq("law", "table"))]
    table: Option<PathBuf>,
    /// Fibers give way in compression: the part of the stiffness that is left, 0.001 where only --buckling-strain is given
    #[arg(long, value_name = "R", value_parser = real, requires = "law", allow_hyphen_values = true)]
    compression: Option<f64>,
    /// Compressive strain within which the stiffness falls, 0.01 where only --compression is given
    #[arg(long, value_name = "W", value_parser = real, requires = "law", allow_hyphen_values = true)]
    buckling_strain: Option<f64>,
}

#[derive(Clone, Copy, ValueEnum)]
enum LawName {
    Linear,
    Exponential,
    ExponentialStretch,
    Table,
}

impl LawName {
    fn as_str(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Exponential => "exponential",
            Self::ExponentialStretch => "exponential-stretch",
            Self::Table => "table",
        }
    }
}

impl LawArguments {
    /// Returns true if a law is named.
    pub fn is_given(&self) -> bool {
        self.law.is_some()
    }

    /// Returns the law with its parameters checked; `None` if no law is named.
    pub fn material(&self) -> Result<Option<FiberMaterial>, Failure> {
        let (Some(name), Some(radius)) = (self.law, self.radius) else {
            return Ok(None); // The argument parser ensures that no other law option is present.
        };
        let law = NamedLaw {
            name: name.as_str().into(),
            youngs_modulus: self.youngs_modulus,
            radius,
            nonlinearity: self.nonlinearity,
            transition: self.transition,
            file: self.table.clone(),
            points: None,
            compression: self.compression,
            buckling_strain: self.buckling_strain,
            density: None,
        };
        checked(&law, &|parameter| format!("--{parameter}"), "--law").map(Some)
    }
}

/// Checks the parameters of a law. `spelled` converts a parameter to the form the user typed; `name` is the option that
/// names the law. The path of a table file is relative to the working directory.
pub fn checked(law: &NamedLaw, spelled: &dyn Fn(&str) -> String, name: &str) -> Result<FiberMaterial, Failure> {
    let material = law.material(Path::new("")).map_err(|error| law_failure(error, spelled, name))?;
    material.check().map_err(|error| {
        Failure::arguments(error.to_string(), format!("a number {}", error.expected), "correct that parameter")
    })?;
    Ok(material)
}

fn law_failure(error: NamedLawError, spelled: &dyn Fn(&str) -> String, name: &str) -> Failure {
    let spelled = |parameter: &str| match parameter {
        "file" => spelled("table"),
        _ => spelled(&parameter.replace('_', "-")),
    };
    let (expected, cure) = match &error {
        NamedLawError::Missing { parameter, .. } => {
            (format!("{} with its value", spelled(parameter)), format!("add it, or choose another {name}"))
        }
        NamedLawError::Needless { parameter, .. } => {
            ("only parameters that the law has".into(), format!("leave out {}", spelled(parameter)))
        }
        NamedLawError::Range { parameter, bound, .. } => {
            (format!("a finite number {bound}"), format!("correct {}", spelled(parameter)))
        }
        NamedLawError::Name { .. } => ("a law that is known".into(), "choose one of them".into()),
        NamedLawError::TwoTables => ("a file or points".into(), "leave out one of the two".into()),
        NamedLawError::Points { error } => (error.expected().into(), error.cure().into()),
        NamedLawError::File(errors) => return Failure::Input(errors.clone()),
    };
    Failure::arguments(error.to_string(), expected, cure)
}
