//! The fiber law on the command line, the same for every command.

use std::path::{Path, PathBuf};

use biotissue::fiber::law::{
    BUCKLING, FiberMaterial, FormulaLaw, LawName, Parameter, RADIUS, YOUNGS_MODULUS, formula_parameters,
};
use biotissue::fiber::network::file::sidecar::{NamedLaw, NamedLawError};
use clap::builder::PossibleValuesParser;
use clap::{Arg, ArgMatches, Args, Command, FromArgMatches, value_parser};

use crate::failure::Failure;
use crate::number::real;

/// A fiber law with its parameters; all of them together or none. The library's table of laws gives the options.
pub struct LawArguments {
    law: Option<NamedLaw>,
}

impl Args for LawArguments {
    fn augment_args(command: Command) -> Command {
        let names: Vec<_> = LawName::all().map(LawName::as_str).collect();
        let law = Arg::new("law")
            .long("law")
            .value_name("NAME")
            .help("Law of all fibers")
            .value_parser(PossibleValuesParser::new(names));
        let mut parameters: Vec<Arg> = formula_parameters().into_iter().map(number).collect();
        parameters.insert(1, number(&RADIUS));
        let table = "CSV file of the law table: stretch and nominal stress in Pa, (1, 0) among them";
        let table = Arg::new("table")
            .long("table")
            .value_name("FILE")
            .help(table)
            .value_parser(value_parser!(PathBuf))
            .requires("law");
        command
            .arg(law.requires(RADIUS.name))
            .args(parameters)
            .arg(table.required_if_eq("law", LawName::Table.as_str()))
            .args(BUCKLING.iter().map(number))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

fn number(parameter: &'static Parameter) -> Arg {
    let option = Arg::new(parameter.name).long(parameter.option).value_name(parameter.symbol).help(parameter.help);
    let option = option.value_parser(real).requires("law").allow_hyphen_values(true);
    if parameter != &YOUNGS_MODULUS {
        return option;
    }
    let laws = FormulaLaw::ALL.iter().filter(|law| law.parameters().contains(parameter));
    option.required_if_eq_any(laws.map(|law| ("law", law.name())))
}

impl FromArgMatches for LawArguments {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let number = |parameter: &Parameter| matches.get_one::<f64>(parameter.name).copied();
        // The argument parser ensures that a law has a radius, and that no parameter is given without a law.
        let (Some(name), Some(radius)) = (matches.get_one::<String>("law"), number(&RADIUS)) else {
            return Ok(Self { law: None });
        };
        let mut law = NamedLaw::new(name, radius);
        law.file = matches.get_one("table").cloned();
        for parameter in formula_parameters().into_iter().chain(&BUCKLING) {
            if let Some(value) = number(parameter) {
                law.set(parameter, value);
            }
        }
        Ok(Self { law: Some(law) })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl LawArguments {
    /// Returns true if a law is named.
    pub fn is_given(&self) -> bool {
        self.law.is_some()
    }

    /// Returns the law with its parameters checked; `None` if no law is named.
    pub fn material(&self) -> Result<Option<FiberMaterial>, Failure> {
        let law = self.law.as_ref();
        law.map(|law| checked(law, &|parameter| format!("--{parameter}"), "--law")).transpose()
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
        NamedLawError::UnexpectedParameter { parameter, .. } => {
            ("only parameters that the law has".into(), format!("leave out {}", spelled(parameter)))
        }
        NamedLawError::Range { parameter, range, .. } => {
            (format!("a finite number {range}"), format!("correct {}", spelled(parameter)))
        }
        NamedLawError::Name(_) => ("a known law".into(), "choose one of them".into()),
        NamedLawError::TwoTables => ("a file or points".into(), "leave out one of the two".into()),
        NamedLawError::Points(error) => error.advice().map(String::from).into(),
        NamedLawError::File(errors) => return Failure::Input(errors.clone()),
    };
    Failure::arguments(error.to_string(), expected, cure)
}
