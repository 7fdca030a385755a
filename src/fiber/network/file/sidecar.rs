//! The `.toml` file beside a network: what the text format has no place for.
//!
//! ```toml
//! [generated]                          # how the network was made
//! kind = "voronoi"                     # or "delaunay"
//! points = 60
//! seed = 1
//! merge = 0.05                         # nodes nearer than this part of the mean spacing were merged
//! align = [1.0, 0.0, 0.0]              # where the fibers have a preferred direction, with
//! strength = 0.4                       # the order parameter P2 asked for
//! shorter_than = 0.01                  # where fibers shorter than this part of the edge were taken out
//! program = "biotissue 0.1.0"
//!
//! [units]
//! length = "edge of the cube"          # of the coordinates
//!
//! [law]                                # of all fibers; a .params file counts before it
//! name = "exponential"
//! youngs_modulus = 1.0e8               # Pa
//! radius = 5.0e-8                      # m
//! nonlinearity = 1.2
//! ```

use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::{read_if_present, write};
use crate::fiber::law::{FiberMaterial, Law};
use crate::input::InputError;

pub use super::generated::Generated;

/// What a sidecar says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sidecar {
    /// How the network was made.
    pub generated: Option<Generated>,
    /// The unit of the coordinates, in words.
    pub length_unit: Option<String>,
    /// What all fibers are made of.
    pub material: Option<FiberMaterial>,
}

/// A fiber law by name, with the parameters that people give: in a sidecar, on a command line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedLaw {
    /// `linear`, `exponential` or `exponential-stretch`.
    pub name: String,
    /// `E` in Pa.
    pub youngs_modulus: f64,
    /// Radius of the round cross-section in m.
    pub radius: f64,
    /// `B`, of the exponential laws.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nonlinearity: Option<f64>,
    /// `lambda_t`, of `exponential-stretch`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transition: Option<f64>,
    /// kg/m^3.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
}

/// Why named parameters are no fiber law.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NamedLawError {
    /// No law is called that.
    #[error("there is no law `{name}`; known are linear, exponential and exponential-stretch")]
    Name {
        /// The name given.
        name: String,
    },
    /// The law needs a parameter that was not given.
    #[error("the law `{law}` needs a {parameter}")]
    Missing {
        /// The law.
        law: &'static str,
        /// The parameter.
        parameter: &'static str,
    },
    /// The law does not have a parameter that was given.
    #[error("the law `{law}` has no {parameter}")]
    Needless {
        /// The law.
        law: &'static str,
        /// The parameter.
        parameter: &'static str,
    },
    /// A parameter that no fiber can have.
    #[error("the {parameter} is {value}, but must be finite and {bound}")]
    Range {
        /// The parameter.
        parameter: &'static str,
        /// Its value.
        value: f64,
        /// `above 0`, `at least 1`.
        bound: &'static str,
    },
}

impl NamedLaw {
    /// The law with its parameters checked.
    ///
    /// # Errors
    /// See [`NamedLawError`].
    pub fn material(&self) -> Result<FiberMaterial, NamedLawError> {
        let youngs_modulus = above_zero("youngs_modulus", self.youngs_modulus)?;
        let radius = above_zero("radius", self.radius)?;
        let law = match self.name.as_str() {
            "linear" => {
                absent("linear", "nonlinearity", self.nonlinearity)?;
                absent("linear", "transition", self.transition)?;
                Law::Linear { youngs_modulus }
            }
            "exponential" => {
                absent("exponential", "transition", self.transition)?;
                let nonlinearity = present("exponential", "nonlinearity", self.nonlinearity)?;
                Law::Exponential { youngs_modulus, nonlinearity: above_zero("nonlinearity", nonlinearity)? }
            }
            "exponential-stretch" => {
                let nonlinearity = present("exponential-stretch", "nonlinearity", self.nonlinearity)?;
                let nonlinearity = above_zero("nonlinearity", nonlinearity)?;
                let transition = present("exponential-stretch", "transition", self.transition)?;
                let transition = in_range("transition", transition, transition >= 1.0, "at least 1")?;
                Law::ExponentialStretch { youngs_modulus, nonlinearity, transition }
            }
            name => return Err(NamedLawError::Name { name: name.into() }),
        };
        if let Some(density) = self.density {
            in_range("density", density, density >= 0.0, "at least 0")?;
        }
        Ok(FiberMaterial { law, radius, density: self.density })
    }
}

impl From<&FiberMaterial> for NamedLaw {
    fn from(material: &FiberMaterial) -> Self {
        let (name, youngs_modulus, nonlinearity, transition) = match material.law {
            Law::Linear { youngs_modulus } => ("linear", youngs_modulus, None, None),
            Law::Exponential { youngs_modulus, nonlinearity } => {
                ("exponential", youngs_modulus, Some(nonlinearity), None)
            }
            Law::ExponentialStretch { youngs_modulus, nonlinearity, transition } => {
                ("exponential-stretch", youngs_modulus, Some(nonlinearity), Some(transition))
            }
        };
        let (radius, density) = (material.radius, material.density);
        Self { name: name.into(), youngs_modulus, radius, nonlinearity, transition, density }
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

fn absent(law: &'static str, parameter: &'static str, value: Option<f64>) -> Result<(), NamedLawError> {
    value.map_or(Ok(()), |_| Err(NamedLawError::Needless { law, parameter }))
}

/// The file as it stands, key by key.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    generated: Option<Generated>,
    units: Option<Units>,
    law: Option<Spanned<NamedLaw>>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Units {
    length: String,
}

/// What is written: tables in the order of the fields.
#[derive(Serialize)]
struct Written<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    generated: Option<&'a Generated>,
    #[serde(skip_serializing_if = "Option::is_none")]
    units: Option<Units>,
    #[serde(skip_serializing_if = "Option::is_none")]
    law: Option<NamedLaw>,
}

impl Sidecar {
    /// Writes `NAME.toml` beside the network file `NAME`, whole or not at all.
    ///
    /// # Errors
    /// [`io::ErrorKind::InvalidInput`] for a seed above `2^63 - 1`, which TOML cannot hold; otherwise what the
    /// operating system says.
    pub fn write_beside(&self, network: &Path) -> io::Result<()> {
        let written = Written {
            generated: self.generated.as_ref(),
            units: self.length_unit.clone().map(|length| Units { length }),
            law: self.material.as_ref().map(NamedLaw::from),
        };
        let text = toml::to_string(&written)
            .map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error.to_string()))?;
        write::replace(&write::beside(network, ".toml"), text.as_bytes())
    }
}

/// The sidecar of a network file; `None` where there is none.
///
/// # Errors
/// A key that is not known, a value of the wrong type or out of range, with its line.
pub fn read_beside(network: &Path) -> Result<Option<Sidecar>, InputError> {
    let file = write::beside(network, ".toml");
    read_if_present(&file)?.map(|bytes| parse(&file, &bytes)).transpose()
}

fn parse(file: &Path, bytes: &[u8]) -> Result<Sidecar, InputError> {
    const CURE: &str = "correct it; only [generated], [units] and [law] stand in this file";
    let line_of = |offset: usize| 1 + bytes.iter().take(offset).filter(|&&byte| byte == b'\n').count();
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let line = line_of(error.valid_up_to());
        InputError::at_line(file, line, "bytes that are no text", "TOML in UTF-8", CURE)
    })?;
    let document: Document = toml::from_str(text).map_err(|error| {
        let line = error.span().map(|span| line_of(span.start));
        let what = error.message().replace('\n', " ");
        InputError { line, ..InputError::in_file(file, what, "what the generator writes beside a network", CURE) }
    })?;
    let material = document.law.map(|law| {
        law.get_ref().material().map_err(|error| {
            let line = line_of(law.span().start);
            InputError::at_line(file, line, error.to_string(), "a law with the parameters it has", CURE)
        })
    });
    Ok(Sidecar {
        generated: document.generated,
        length_unit: document.units.map(|units| units.length),
        material: material.transpose()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law(name: &str, nonlinearity: Option<f64>, transition: Option<f64>) -> NamedLaw {
        NamedLaw { name: name.into(), youngs_modulus: 1e8, radius: 5e-8, nonlinearity, transition, density: None }
    }

    #[test]
    fn what_is_written_reads_back_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let network = folder.path().join("net.txt");
        for law in [
            law("linear", None, None),
            law("exponential", Some(1.2), None),
            law("exponential-stretch", Some(0.1), Some(1.4)),
        ] {
            let sidecar = Sidecar {
                generated: Some(Generated { seed: i64::MAX as u64, ..Generated::new("delaunay", 60, 1) }),
                length_unit: Some("edge of the cube".into()),
                material: Some(FiberMaterial { density: Some(1000.0), ..law.material().unwrap() }),
            };
            sidecar.write_beside(&network).unwrap();
            assert_eq!(read_beside(&network).unwrap(), Some(sidecar));
        }
        assert_eq!(read_beside(&folder.path().join("other.txt")).unwrap(), None);
    }

    #[test]
    fn every_mistake_is_told_with_its_line() {
        let cases = [
            (
                "[generated]\nkind = \"delaunay\"\npoints = 3\nseed = 1\nprogram = \"p\"\nsede = 1\n",
                "n.toml:6: unknown field `sede`, expected one of `kind`, `points`, `seed`, `align`, `strength`, `merge`, `shorter_than`, `program`",
            ),
            ("[law]\nname = \"linear\"\nradius = 1\n", "n.toml:1: missing field `youngs_modulus`"),
            (
                "\n[law]\nname = \"linear\"\nradius = \"1\"\nyoungs_modulus = 1\n",
                "n.toml:4: invalid type: string \"1\", expected f64",
            ),
            (
                "\n[law]\nname = \"linnear\"\nradius = 1\nyoungs_modulus = 1\n",
                "n.toml:2: there is no law `linnear`; known are linear, exponential and exponential-stretch",
            ),
            (
                "[law]\nname = \"exponential\"\nradius = 1\nyoungs_modulus = 1\n",
                "n.toml:1: the law `exponential` needs a nonlinearity",
            ),
            (
                "[law]\nname = \"linear\"\nradius = -1\nyoungs_modulus = 1\n",
                "n.toml:1: the radius is -1, but must be finite and above 0",
            ),
            (
                "[law]\nname = \"linear\"\nradius = 1\nyoungs_modulus = nan\n",
                "n.toml:1: the youngs_modulus is NaN, but must be finite and above 0",
            ),
            (
                "[law]\nname = \"linear\"\nradius = 1\nyoungs_modulus = 1\ntransition = 2\n",
                "n.toml:1: the law `linear` has no transition",
            ),
            (
                "[law]\nname = \"exponential-stretch\"\nradius = 1\nyoungs_modulus = 1\nnonlinearity = 1\ntransition = 0.5\n",
                "n.toml:1: the transition is 0.5, but must be finite and at least 1",
            ),
        ];
        for (text, expected) in cases {
            let error = parse(Path::new("n.toml"), text.as_bytes()).unwrap_err().to_string();
            assert_eq!(error.lines().next(), Some(expected), "{text}");
        }
        assert!(parse(Path::new("n.toml"), b"[law]\nname = \"\xff\"").is_err());
    }
}
