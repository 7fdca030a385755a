//! The sidecar: the `.toml` file beside a network, with data that the text format cannot store.
//!
//! ```toml
//! [generated]                          # how the network was made
//! kind = "voronoi"                     # or "delaunay"
//! points = 60                          # number of points in the cube
//! seed = 1
//! merge = 0.05                         # nodes joined by a fiber shorter than 0.05 mean spacings were merged
//! align = [1.0, 0.0, 0.0]              # only if the fibers have a preferred direction, with
//! strength = 0.4                       # the requested order parameter P2
//! min_distance = 0.1                   # only if it is not 0.2: minimum distance of two points, in mean spacings
//! shorter_than = 0.01                  # only if fibers shorter than this fraction of the edge were removed
//! program = "biotissue 0.1.0"
//!
//! [units]
//! length = "edge of the cube"          # the unit of the coordinates
//!
//! [law]                                # the law of all fibers; a .params file takes precedence
//! name = "exponential"                 # or "linear", "exponential-stretch" with a `transition`
//! youngs_modulus = 1.0e8               # Pa
//! radius = 5.0e-8                      # m
//! nonlinearity = 1.2
//! compression = 1.0e-3                 # optional: residual stiffness in compression, and the
//! buckling_strain = 0.01               # compressive strain over which the stiffness falls
//! ```
//!
//! A law may be a table, `name = "table"` with `radius` and either `file = "curve.csv"` (relative to the folder of the
//! sidecar) or `points = [[0.9, -1.0e6], [1.0, 0.0], [1.1, 2.0e6]]`; see [`Table`](crate::fiber::law::Table).
//!
//! For fibers of several types, one `[[fiber_type]]` per type and the list of the types of all fibers replace `[law]`:
//!
//! ```toml
//! [[fiber_type]]                       # type 0: the same keys as [law]
//! name = "exponential"
//! youngs_modulus = 1.0e8
//! radius = 5.0e-8
//! nonlinearity = 1.2
//!
//! [[fiber_type]]                       # type 1
//! name = "linear"
//! youngs_modulus = 1.0e6
//! radius = 2.0e-7
//!
//! [fibers]
//! types = [0, 0, 1, 0]                 # one number per fiber, in the order of the network file
//! ```

use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::fiber_types::Fibers;
use super::{read_if_present, write};
use crate::checksum;
use crate::fiber::law::FiberMaterial;
use crate::input::{InputError, InputErrors, excerpt, without_byte_order_mark};
use crate::output;

pub use super::fiber_types::FiberTypes;
pub use super::named_law::{NamedLaw, NamedLawError};

pub use super::generated::Generated;

/// The contents of a sidecar.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sidecar {
    /// The generator and its parameters.
    pub generated: Option<Generated>,
    /// The unit of the coordinates, as text.
    pub length_unit: Option<String>,
    /// The material of all fibers.
    pub material: Option<FiberMaterial>,
    /// The material of each fiber, if there are several types.
    pub fiber_types: Option<FiberTypes>,
}

/// The raw contents of the file, key by key.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    generated: Option<Generated>,
    units: Option<Units>,
    law: Option<Spanned<NamedLaw>>,
    fiber_type: Option<Vec<Spanned<NamedLaw>>>,
    fibers: Option<Spanned<Fibers>>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Units {
    length: String,
}

/// The contents to write, with tables in the order of the fields.
#[derive(Serialize)]
struct Written<'a> {
    generated: Option<&'a Generated>,
    units: Option<Units>,
    law: Option<NamedLaw>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    fiber_type: Vec<NamedLaw>,
}

impl Sidecar {
    /// Writes `NAME.toml` beside the network file `NAME`, completely or not at all. If there are fiber types,
    /// `material` is not written.
    ///
    /// # Errors
    /// Returns [`io::ErrorKind::InvalidInput`] if the seed exceeds `2^63 - 1`, the largest integer of TOML, or a law
    /// could not be read back; otherwise the error of the operating system.
    pub fn write_beside(&self, network: &Path) -> io::Result<()> {
        output::write(&write::beside(network, ".toml"), checksum::with_checksum(&self.to_toml()?).as_bytes())
    }

    /// Formats the contents of the file, without the checksum.
    pub(super) fn to_toml(&self) -> io::Result<String> {
        let invalid = |what: String| io::Error::new(io::ErrorKind::InvalidInput, what);
        let types = self.fiber_types.as_ref();
        let material = self.material.as_ref().filter(|_| types.is_none());
        let materials = || types.into_iter().flat_map(|types| &types.materials);
        if let Some(custom) = material.into_iter().chain(materials()).find(|m| !NamedLaw::is_known(&m.law)) {
            return Err(invalid(format!("the law `{}` cannot be written to a file", custom.law.name())));
        }
        let written = Written {
            generated: self.generated.as_ref(),
            units: self.length_unit.clone().map(|length| Units { length }),
            law: material.map(NamedLaw::from),
            fiber_type: materials().map(NamedLaw::from).collect(),
        };
        let mut text = toml::to_string(&written).map_err(|error| invalid(error.to_string()))?;
        if let Some(types) = types {
            types.list(&mut text);
        }
        Ok(text)
    }
}

/// Reads the sidecar of a network file with this number of fibers; `None` if there is no sidecar.
///
/// # Errors
/// Returns the first error with its line: an unknown key, a value of the wrong type or out of range, or a list of types
/// whose length is not the number of fibers. If the file of a table is invalid, returns all errors in that file.
pub fn read_beside(network: &Path, fibers: usize) -> Result<Option<Sidecar>, InputErrors> {
    let file = write::beside(network, ".toml");
    read_if_present(&file)?.map(|bytes| parse(&file, &bytes, fibers)).transpose()
}

const EXPECTED: &str = "the contents that the generator writes beside a network";
const CURE: &str = "correct it; only [generated], [units], [law], [[fiber_type]] and [fibers] are allowed in this file";

/// Returns the line of a byte offset; lines are counted from 1, offsets from 0.
pub(super) fn line_of(bytes: &[u8], offset: usize) -> usize {
    1 + bytes.iter().take(offset).filter(|&&byte| byte == b'\n').count()
}

/// Returns the line of a key in the table of a law, or the first line of the law if the key is not found.
fn line_of_key(text: &str, law: std::ops::Range<usize>, key: Option<&str>) -> usize {
    let first = line_of(text.as_bytes(), law.start);
    // The lines of the law: its header, and all lines up to the next header.
    let mut own = text.lines().enumerate().skip(first - 1);
    let header = own.next();
    let has_key = |line: &str| {
        let (name, value) = line.split_once('=').unwrap_or((line, ""));
        !value.is_empty() && key.is_some_and(|key| name.trim().trim_matches(['"', '\'']) == key)
    };
    match header {
        Some((_, header)) if header.trim_start().starts_with('[') => own
            .take_while(|(_, line)| !line.trim_start().starts_with('['))
            .find(|(_, line)| has_key(line))
            .map_or(first, |(number, _)| number + 1),
        _ => first,
    }
}

/// Converts an error of the TOML reader, which uses names of Rust types, to the terms of TOML.
fn toml_error(file: &Path, text: &str, error: &toml::de::Error) -> InputError {
    let line = error.span().map(|span| line_of(text.as_bytes(), span.start));
    let message = error.message().replace('\n', ", ");
    let parts = ["invalid type: ", "invalid value: "].into_iter().find_map(|kind| message.strip_prefix(kind));
    let (what, expected) = match parts.and_then(|parts| parts.rsplit_once(", expected ")) {
        None => (message, EXPECTED),
        Some((found, expected)) => {
            let row = line.and_then(|line| text.lines().nth(line - 1)).unwrap_or_default();
            let key = row.split_once('=').map(|(key, _)| key.trim()).filter(|key| !key.is_empty());
            let place = key.map_or_else(|| "a value".into(), |key| format!("`{}`", excerpt(key)));
            (format!("{place} is {}", value_named(found)), type_named(expected))
        }
    };
    InputError { line, ..InputError::in_file(file, what, expected, CURE) }
}

/// Converts the description of a value, such as "integer `3` as i128", to terms of TOML.
fn value_named(found: &str) -> String {
    let quoted = found.split('`').nth(1).map(excerpt);
    match (found.split([' ', '`']).next().unwrap_or_default(), quoted) {
        ("integer", Some(number)) => format!("the whole number {number}"),
        ("floating", Some(number)) => format!("the number {number}"),
        ("boolean", Some(value)) => value,
        ("sequence", _) => "a list".into(),
        ("map", _) => "a table".into(),
        _ => format!("the {}", excerpt(found)),
    }
}

/// Converts the name of a Rust type to terms of TOML.
fn type_named(expected: &str) -> &str {
    match expected {
        "f64" => "a number",
        "u64" | "usize" => "a whole number from 0 to 9223372036854775807",
        "i64" => "a whole number from -9223372036854775808 to 9223372036854775807",
        "a string" | "path string" => "a string in quotes",
        "a sequence" => "a list in brackets",
        _ => EXPECTED,
    }
}

/// Parses and checks the contents of a sidecar for a network with this number of fibers.
pub(super) fn parse(file: &Path, bytes: &[u8], fibers: usize) -> Result<Sidecar, InputErrors> {
    let bytes = without_byte_order_mark(bytes);
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let line = line_of(bytes, error.valid_up_to());
        InputError::at_line(file, line, "bytes that are not text", "TOML in UTF-8", CURE)
    })?;
    let document: Document = toml::from_str(text).map_err(|error| toml_error(file, text, &error))?;
    let base = file.parent().unwrap_or(Path::new(""));
    let material = |law: Spanned<NamedLaw>| {
        law.get_ref().material(base).map_err(|error| match error {
            NamedLawError::File(errors) => errors,
            error => {
                let line = line_of_key(text, law.span(), error.key());
                let expected = match &error {
                    NamedLawError::Points(error) => error.advice()[0],
                    _ => "a law with its own parameters only",
                };
                InputError::at_line(file, line, error.to_string(), expected, CURE).into()
            }
        })
    };
    let both = document.law.as_ref().filter(|_| document.fiber_type.is_some());
    if let Some(law) = both {
        let (line, what) = (line_of(bytes, law.span().start), "the file has both [law] and [[fiber_type]]");
        let expected = "one law for all fibers, or several types";
        return Err(InputError::at_line(file, line, what, expected, "remove one of the two").into());
    }
    let materials: Option<Vec<FiberMaterial>> =
        document.fiber_type.map(|types| types.into_iter().map(material).collect()).transpose()?;
    let fiber_types = match (materials, document.fibers) {
        (None, None) => None,
        (Some(materials), Some(list)) => Some(FiberTypes::read(file, bytes, materials, list, fibers)?),
        (Some(_), None) => {
            let (what, expected) = ("[[fiber_type]] without [fibers]", "the type of every fiber: types = [0, 1, ...]");
            return Err(InputError::in_file(file, what, expected, "add [fibers] with `types`").into());
        }
        (None, Some(list)) => {
            let (line, what) = (line_of(bytes, list.span().start), "[fibers] without a [[fiber_type]]");
            return Err(
                InputError::at_line(file, line, what, "one [[fiber_type]] for each type in the list", CURE).into()
            );
        }
    };
    Ok(Sidecar {
        generated: document.generated,
        length_unit: document.units.map(|units| units.length),
        material: document.law.map(material).transpose()?,
        fiber_types,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fiber::law::{BUCKLING_STRAIN, COMPRESSION, FormulaLaw};

    fn table() -> NamedLaw {
        let points = vec![[0.9, -1e6 / 3.0], [1.0, 0.0], [1.0 + 1.0 / 3.0, 2e6]];
        let mut law = NamedLaw::new("table", 5e-8);
        law.points = Some(points);
        law
    }

    #[test]
    fn a_written_sidecar_is_read_back_unchanged() {
        let folder = tempfile::tempdir().unwrap();
        let network = folder.path().join("net.txt");
        let formulas = FormulaLaw::ALL.iter().map(|formula| {
            let law = NamedLaw::new(formula.name(), 5e-8);
            formula.parameters().iter().fold(law, |law, parameter| law.with(parameter, parameter.example()))
        });
        for law in formulas.chain([table()]).flat_map(|law| {
            let buckling = [
                law.clone().with(&COMPRESSION, 0.0),
                law.clone().with(&BUCKLING_STRAIN, 1e-3),
                law.clone().with(&COMPRESSION, 0.1).with(&BUCKLING_STRAIN, 0.3),
            ];
            [law].into_iter().chain(buckling)
        }) {
            let sidecar = Sidecar {
                generated: Some(Generated { seed: i64::MAX as u64, ..Generated::new("delaunay", 60, 1) }),
                length_unit: Some("edge of the cube".into()),
                material: Some(FiberMaterial { density: Some(1000.0), ..law.material(folder.path()).unwrap() }),
                fiber_types: None,
            };
            sidecar.write_beside(&network).unwrap();
            assert_eq!(read_beside(&network, 3).unwrap(), Some(sidecar));
        }
        assert_eq!(read_beside(&folder.path().join("other.txt"), 3).unwrap(), None);
    }

    #[test]
    fn the_file_of_a_table_is_relative_to_the_folder_of_the_sidecar() {
        let folder = tempfile::tempdir().unwrap();
        let network = folder.path().join("net.txt");
        let text = "[law]\nname = \"table\"\nfile = \"curve.csv\"\nradius = 1e-7\n";
        std::fs::write(folder.path().join("net.txt.toml"), text).unwrap();
        let error = read_beside(&network, 3).unwrap_err().to_string();
        assert!(error.contains("curve.csv: cannot be read"), "{error}");
        std::fs::write(folder.path().join("curve.csv"), "stretch,stress\n1,0\n1.1,0\n").unwrap();
        let error = read_beside(&network, 3).unwrap_err().to_string();
        assert!(error.contains("curve.csv:2: the curve has no slope at stretch 1"), "{error}");
        std::fs::write(folder.path().join("curve.csv"), "stretch,stress\n1,0\n1.1,1e6\n").unwrap();
        let law = read_beside(&network, 3).unwrap().unwrap().material.unwrap().law;
        assert!((law.youngs_modulus() - 1e7).abs() < 1e-6 * 1e7);
    }

    fn law(name: &str, rest: &str) -> String {
        format!("[law]\nname = \"{name}\"\n{rest}\n")
    }

    /// Checks the errors of files. Cases: a file => the line and description of its error.
    macro_rules! check {
        ($($text:expr => $expected:literal;)*) => {$(
            let text = $text;
            let error = parse(Path::new("n.toml"), text.as_bytes(), 3).unwrap_err().to_string();
            assert_eq!(error.lines().next(), Some(concat!("n.toml", $expected)), "{text}");
        )*};
    }

    #[test]
    fn errors_have_the_line_of_their_cause() {
        check! {
            "[generated]\nkind = \"delaunay\"\npoints = 3\nseed = 1\nprogram = \"p\"\nsede = 1\n" =>
                ":6: unknown field `sede`, expected one of `kind`, `points`, `seed`, `align`, `strength`, `merge`, `min_distance`, `shorter_than`, `program`";
            law("linear", "radius = 1") => ":1: the law `linear` needs a youngs_modulus";
            "\n[law]\nname = \"linear\"\nradius = \"1\"\nyoungs_modulus = 1\n" => ":4: `radius` is the string \"1\"";
            "[generated]\nkind = \"delaunay\"\npoints = 3\nseed = 99999999999999999999\nprogram = \"p\"\n" =>
                ":4: `seed` is the whole number 99999999999999999999";
            "[generated]\nkind = \"delaunay\"\npoints = -3\nseed = 1\nprogram = \"p\"\n" =>
                ":3: `points` is the whole number -3";
            "[generated]\nkind = \"delaunay\"\npoints = 3.5\nseed = 1\nprogram = \"p\"\n" =>
                ":3: `points` is the number 3.5";
            "\u{feff}[fibers]\ntypes = [0,\n 99999999999999999999999999, 0]\n" =>
                ":3: a value is the whole number 99999999999999999999999999";
            "[law]\nname = [1]\nradius = true\n" => ":2: `name` is a list";
            "\n[law]\nname = \"linnear\"\nradius = 1\nyoungs_modulus = 1\n" =>
                ":3: there is no law `linnear`; the known laws are linear, exponential, exponential-stretch and table";
            law("exponential", "radius = 1\nyoungs_modulus = 1") => ":1: the law `exponential` needs a nonlinearity";
            law("linear", "radius = -1\nyoungs_modulus = 1") => ":3: the radius is -1, but must be finite and above 0";
            law("linear", "radius = 1\nyoungs_modulus = nan") =>
                ":4: the youngs_modulus is NaN, but must be finite and above 0";
            law("linear", "radius = 1\nyoungs_modulus = 1\ntransition = 2") => ":5: the law `linear` has no transition";
            law("exponential-stretch", "radius = 1\nyoungs_modulus = 1\nnonlinearity = 1\ntransition = 0.5") =>
                ":6: the transition is 0.5, but must be finite and at least 1";
            law("linear", "radius = 1\nyoungs_modulus = 1\ncompression = -0.1") =>
                ":5: the compression is -0.1, but must be finite and from 0 to 1";
            law("linear", "radius = 1\nyoungs_modulus = 1\nbuckling_strain = 0") =>
                ":5: the buckling_strain is 0, but must be finite and above 0";
            law("table", "radius = 1") => ":1: the law `table` needs a file";
            "law = { name = \"linear\", youngs_modulus = 1,\n radius = -1 }\n" =>
                ":1: the radius is -1, but must be finite and above 0";
            law("table", "radius = 1\nyoungs_modulus = 1") => ":4: the law `table` has no youngs_modulus";
            law("table", "radius = 1\npoints = [[1, 0], [1.2, 1], [1.1, 2]]") =>
                ":4: point 3: the stretch 1.1 follows 1.2";
            law("table", "radius = 1\nfile = \"a\"\npoints = [[1, 0], [1.2, 1]]") =>
                ":5: the law `table` has both a file and points";
            "[[fiber_type]]\nname = \"linear\"\nradius = 1\nyoungs_modulus = 1\n" =>
                ": [[fiber_type]] without [fibers]";
            "\n[fibers]\ntypes = [0, 0, 0]\n" => ":2: [fibers] without a [[fiber_type]]";
            "[[fiber_type]]\nname = \"linear\"\nradius = 1\nyoungs_modulus = 1\n[fibers]\ntypes = [0,\n 0, 1]\n" =>
                ":7: there is no fiber type 1";
            "[[fiber_type]]\nname = \"linear\"\nradius = 1\nyoungs_modulus = 1\n[fibers]\ntypes = [0]\n" =>
                ":5: 1 fiber types in the list";
            "[[fiber_type]]\nname = \"linear\"\nradius = 1\n[fibers]\ntypes = [0, 0, 0]\n" =>
                ":1: the law `linear` needs a youngs_modulus";
            law("linear", "radius = 1\nyoungs_modulus = 1")
                + "[[fiber_type]]\nname = \"linear\"\nradius = 1\nyoungs_modulus = 1\n" =>
                ":1: the file has both [law] and [[fiber_type]]";
        }
        assert!(parse(Path::new("n.toml"), b"[law]\nname = \"\xff\"", 3).is_err());
    }
}
