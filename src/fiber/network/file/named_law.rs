//! A fiber law by name with its parameters, as given in a sidecar or on a command line.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use serde::de::{Error as _, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::fiber::law::{
    BUCKLING, BUCKLING_STRAIN, COMPRESSION, FiberMaterial, Law, LawName, Parameter, ParameterRange, RADIUS, Table,
    TableError, YOUNGS_MODULUS, formula_parameters,
};
use crate::input::InputErrors;

/// A fiber law by name with its parameters, as given in a sidecar or on a command line; not yet checked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NamedLaw {
    /// One of the names of [`LawName`].
    pub name: String,
    /// Radius of the circular cross-section in m.
    pub radius: f64,
    /// The values of the parameters of the law and of [`BUCKLING`], by their names.
    values: BTreeMap<&'static str, f64>,
    /// The CSV file of a `table`.
    pub file: Option<PathBuf>,
    /// The points of a `table`, as an alternative to a file: stretch and nominal stress in Pa.
    pub points: Option<Vec<[f64; 2]>>,
    /// Mass density in kg/m^3.
    pub density: Option<f64>,
}

/// The keys of the table of a law, in the order in which they are written.
static KEYS: LazyLock<Vec<&'static str>> = LazyLock::new(|| {
    let mut keys: Vec<_> = formula_parameters().iter().map(|parameter| parameter.name).collect();
    keys.insert(1, RADIUS.name);
    keys.insert(0, "name");
    keys.extend(["file", "points"]);
    keys.extend(BUCKLING.iter().map(|parameter| parameter.name));
    keys.push("density");
    keys
});

/// A key of the table of a law.
struct Key(&'static str);

impl<'de> Deserialize<'de> for Key {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let key = KEYS.iter().find(|&&key| key == text);
        key.copied().map(Self).ok_or_else(|| D::Error::unknown_field(&text, &KEYS))
    }
}

impl<'de> Deserialize<'de> for NamedLaw {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(LawVisitor)
    }
}

struct LawVisitor;

impl<'de> Visitor<'de> for LawVisitor {
    type Value = NamedLaw;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a fiber law")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<NamedLaw, A::Error> {
        let (mut name, mut radius, mut law) = (None, None, NamedLaw::default());
        while let Some(Key(key)) = map.next_key()? {
            match key {
                "name" => name = Some(map.next_value()?),
                "radius" => radius = Some(map.next_value()?),
                "file" => law.file = map.next_value()?,
                "points" => law.points = map.next_value()?,
                "density" => law.density = map.next_value()?,
                key => law.values.extend(map.next_value::<Option<f64>>()?.map(|value| (key, value))),
            }
        }
        law.name = name.ok_or_else(|| A::Error::missing_field("name"))?;
        law.radius = radius.ok_or_else(|| A::Error::missing_field("radius"))?;
        Ok(law)
    }
}

impl Serialize for NamedLaw {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for &key in &*KEYS {
            match (key, &self.file, &self.points, self.density, self.values.get(key)) {
                ("name", ..) => map.serialize_entry(key, &self.name)?,
                ("radius", ..) => map.serialize_entry(key, &self.radius)?,
                ("file", Some(file), ..) => map.serialize_entry(key, file)?,
                ("points", _, Some(points), ..) => map.serialize_entry(key, points)?,
                ("density", .., Some(density), _) => map.serialize_entry(key, &density)?,
                (.., Some(value)) => map.serialize_entry(key, value)?,
                _ => {}
            }
        }
        map.end()
    }
}

/// The error of named parameters that do not define a fiber law.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NamedLawError {
    /// There is no law with this name.
    #[error("there is no law `{}`; the known laws are {}", .0, known_laws())]
    Name(String),
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
    UnexpectedParameter {
        /// The law.
        law: &'static str,
        /// The parameter.
        parameter: &'static str,
    },
    /// A parameter is out of range.
    #[error("the {parameter} is {value}, but must be finite and {range}")]
    Range {
        /// The parameter.
        parameter: &'static str,
        /// Its value.
        value: f64,
        /// The admissible values.
        range: ParameterRange,
    },
    /// A table has both a file and points.
    #[error("the law `table` has both a file and points")]
    TwoTables,
    /// The points of a table do not define a law. The message counts the points from 1.
    #[error("{}{}", .0.point().map(|point| format!("point {}: ", point + 1)).unwrap_or_default(), .0)]
    Points(TableError),
    /// The file of a table cannot be read or does not define a law.
    #[error(transparent)]
    File(#[from] InputErrors),
}

impl NamedLawError {
    /// The invalid key, if there is one.
    pub(super) fn key(&self) -> Option<&'static str> {
        match self {
            Self::Name(_) => Some("name"),
            Self::UnexpectedParameter { parameter, .. } | Self::Range { parameter, .. } => Some(parameter),
            Self::TwoTables | Self::Points(_) => Some("points"),
            Self::Missing { .. } | Self::File(_) => None,
        }
    }
}

/// Formats the names of the laws: `a, b and c`.
fn known_laws() -> String {
    let names: Vec<_> = LawName::all().map(LawName::as_str).collect();
    names.split_last().map_or_else(String::new, |(last, others)| format!("{} and {last}", others.join(", ")))
}

impl NamedLaw {
    /// Creates a law without parameters; `radius` is in m.
    pub fn new(name: &str, radius: f64) -> Self {
        Self { name: name.into(), radius, ..Self::default() }
    }

    /// Sets the value of a parameter.
    pub fn set(&mut self, parameter: &Parameter, value: f64) {
        self.values.insert(parameter.name, value);
    }

    /// Returns this law with the given value of a parameter.
    #[must_use]
    pub fn with(mut self, parameter: &Parameter, value: f64) -> Self {
        self.set(parameter, value);
        self
    }

    /// Returns the value of a parameter, if it is given.
    pub fn get(&self, parameter: &Parameter) -> Option<f64> {
        self.values.get(parameter.name).copied()
    }

    /// Returns the material with checked parameters; the file of a table is relative to the folder `base`.
    ///
    /// # Errors
    /// Returns [`NamedLawError`] if the name is unknown, a parameter is missing, unexpected or out of range, or the table
    /// is invalid.
    pub fn material(&self, base: &Path) -> Result<FiberMaterial, NamedLawError> {
        let name = LawName::find(&self.name).ok_or_else(|| NamedLawError::Name(self.name.clone()))?;
        let mut law = self.law(name, base)?;
        if BUCKLING.iter().any(|parameter| self.get(parameter).is_some()) {
            law = law.with_buckling(self.value(name, &COMPRESSION)?, self.value(name, &BUCKLING_STRAIN)?);
        }
        let radius = in_range("radius", self.radius, RADIUS.range)?;
        if let Some(density) = self.density {
            in_range("density", density, ParameterRange::AtLeast(0.0))?;
        }
        Ok(FiberMaterial { law, radius, density: self.density })
    }

    fn law(&self, name: LawName, base: &Path) -> Result<Law, NamedLawError> {
        let unexpected = |parameter| Err(NamedLawError::UnexpectedParameter { law: name.as_str(), parameter });
        for parameter in formula_parameters() {
            if self.get(parameter).is_some() && !name.parameters().contains(parameter) {
                return unexpected(parameter.name);
            }
        }
        match name {
            LawName::Formula(_) if self.file.is_some() => unexpected("file"),
            LawName::Formula(_) if self.points.is_some() => unexpected("points"),
            LawName::Formula(formula) => formula.law(|parameter| self.value(name, parameter)),
            LawName::Table => self.table(base).map(Law::table),
        }
    }

    fn table(&self, base: &Path) -> Result<Table, NamedLawError> {
        match (&self.file, &self.points) {
            (Some(file), None) => Ok(Table::read(&base.join(file))?),
            (None, Some(points)) => Table::new(points.clone()).map_err(NamedLawError::Points),
            (Some(_), Some(_)) => Err(NamedLawError::TwoTables),
            (None, None) => Err(NamedLawError::Missing { law: "table", parameter: "file" }),
        }
    }

    /// Returns the checked value of a parameter, or its default.
    fn value(&self, law: LawName, parameter: &'static Parameter) -> Result<f64, NamedLawError> {
        let missing = || NamedLawError::Missing { law: law.as_str(), parameter: parameter.name };
        in_range(parameter.name, self.get(parameter).or(parameter.default).ok_or_else(missing)?, parameter.range)
    }

    /// Returns true if a sidecar can store the law; the name of a custom law can be displayed but not read.
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
    /// Converts a law. The radius is 0, since it is not part of the law.
    fn from(law: &Law) -> Self {
        let named = Self::new(law.name(), 0.0);
        if let Some((formula, values)) = law.formula() {
            return formula.parameters().iter().zip(values).fold(named, |named, (p, value)| named.with(p, value));
        }
        match law {
            Law::Table(table) => Self { points: Some(table.points().to_vec()), ..named },
            Law::Buckling { law, compression, buckling_strain } => {
                Self::from(&**law).with(&COMPRESSION, *compression).with(&BUCKLING_STRAIN, *buckling_strain)
            }
            law => named.with(&YOUNGS_MODULUS, law.youngs_modulus()),
        }
    }
}

/// Returns the value if it is in the range of its parameter.
fn in_range(parameter: &'static str, value: f64, range: ParameterRange) -> Result<f64, NamedLawError> {
    if range.contains(value) { Ok(value) } else { Err(NamedLawError::Range { parameter, value, range }) }
}
