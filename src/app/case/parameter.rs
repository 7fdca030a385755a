//! Material parameters: numbers, or fields over the body.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;

use super::range::Range;
use super::table::Table;
use super::value::Value;
use super::write::{Entry, entry, quoted, table};
use crate::app::expression::{Expression, VARIABLES};
use crate::app::vtu;

/// The variables of parameters, which do not change in time.
const POSITION: &[&str] = VARIABLES.split_at(1).1;

/// A scalar parameter of a material.
#[derive(Clone, Debug, PartialEq)]
pub enum ParameterCase {
    /// The same at all points.
    Number(f64),
    /// A field.
    Field(FieldCase),
}

/// The axis of a family of fibers.
#[derive(Clone, Debug, PartialEq)]
pub enum AxisCase {
    /// The same unit vector at all points.
    Constant(Vector3<f64>),
    /// Components of any common length, at least one of which is an expression.
    Components([ParameterCase; 3]),
    /// Three columns or components.
    Field(FieldCase),
}

/// The values of a parameter over the body, with its place in the case file.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldCase {
    /// The source of the values.
    pub source: FieldSource,
    /// The key in the case file, such as `region.material.shear_modulus`.
    pub key: String,
    /// Line of the case file.
    pub line: usize,
}

/// The source of a field. Paths are absolute.
#[derive(Clone, Debug, PartialEq)]
pub enum FieldSource {
    /// An expression of the position in the reference state.
    Expression(Expression),
    /// An array of the cells of a `.vtu` file; of the mesh if there is no other file.
    Cells {
        /// The file.
        file: Option<PathBuf>,
        /// The name of the array.
        array: String,
    },
    /// The values on a regular grid ([`crate::app::material_fields`] describes the file); those of its cells.
    Grid {
        /// The file.
        file: PathBuf,
    },
    /// Columns of a CSV file.
    Columns {
        /// The file.
        file: PathBuf,
        /// The names of the columns.
        columns: Vec<String>,
    },
}

impl ParameterCase {
    /// Reads a number in a range, or a field.
    pub(super) fn read(value: &Value<'_>, range: Range, base: &Path) -> Option<Self> {
        let expected = format!("a number{}, or an expression of x, y and z in quotes", range.describe());
        let source = if value.inner.is_str() {
            let expression = value.expression(&expected, POSITION)?;
            match expression.constant() {
                None => FieldSource::Expression(expression),
                Some(number) if range.contains(number) => return Some(Self::Number(number)),
                Some(number) => {
                    value.report_error(&format!("has the value {number}"), expected, "correct the expression");
                    return None;
                }
            }
        } else if value.inner.is_table() {
            FieldSource::read(value, 1, base)?
        } else {
            return value.number_or(range, expected).map(Self::Number);
        };
        Some(Self::Field(FieldCase::new(source, value)))
    }

    /// Formats the parameter.
    pub(super) fn toml(&self) -> String {
        match self {
            Self::Number(number) => entry("", number).1,
            Self::Field(field) => field.source.toml(),
        }
    }

    pub(super) fn number(&self) -> Option<f64> {
        if let Self::Number(number) = self { Some(*number) } else { None }
    }
}

impl AxisCase {
    pub(super) const EXPECTED: &str = "the direction of the fibers: three numbers x, y, z, not all zero";

    /// Reads a vector, whose components may be expressions, or a field with three components.
    pub(super) fn read(value: &Value<'_>, base: &Path) -> Option<Self> {
        if value.inner.is_table() {
            return Some(Self::Field(FieldCase::new(FieldSource::read(value, 3, base)?, value)));
        }
        let [x, y, z] = value.components(Range::any(""))?.map(|component| match component.inner.is_table() {
            false => ParameterCase::read(&component, Range::any(""), base),
            true => {
                let expected = "a number, or an expression of x, y and z in quotes".to_owned();
                component.number_or(Range::any(""), expected).map(ParameterCase::Number)
            }
        });
        let components = [x?, y?, z?];
        let [Some(x), Some(y), Some(z)] = components.each_ref().map(ParameterCase::number) else {
            return Some(Self::Components(components));
        };
        let direction = direction(Vector3::new(x, y, z));
        if direction.is_none() {
            let cure = "give a vector that is not zero; its length does not matter";
            value.report_error("has no direction", Self::EXPECTED, cure);
        }
        direction.map(Self::Constant)
    }

    /// Formats the axis.
    pub(super) fn toml(&self) -> String {
        match self {
            Self::Constant(axis) => entry("", <[f64; 3]>::from(*axis)).1,
            Self::Components(components) => format!("[{}]", components.each_ref().map(ParameterCase::toml).join(", ")),
            Self::Field(field) => field.source.toml(),
        }
    }

    pub(super) fn constant(&self) -> Option<Vector3<f64>> {
        if let Self::Constant(axis) = self { Some(*axis) } else { None }
    }
}

/// Divides a vector by its length; `None` if it has none, or an infinite one. A vector whose length is one up to rounding
/// stays as it is, so that a case that is written and read again does not change.
pub(crate) fn direction(vector: Vector3<f64>) -> Option<Vector3<f64>> {
    // Scaled first, so that neither large nor small components overflow.
    let largest = vector.amax();
    if !(largest > 0.0 && vector.iter().all(|component| component.is_finite())) {
        return None;
    }
    let is_unit = (vector.norm_squared() - 1.0).abs() <= 8.0 * f64::EPSILON;
    Some(if is_unit { vector } else { (vector / largest).normalize() })
}

impl FieldCase {
    pub(super) fn new(source: FieldSource, value: &Value<'_>) -> Self {
        Self { source, key: value.path.clone(), line: value.line }
    }
}

impl FieldSource {
    /// Returns the file that the values are read from, unless it is the mesh.
    pub fn file_mut(&mut self) -> Option<&mut PathBuf> {
        match self {
            Self::Expression(_) => None,
            Self::Cells { file, .. } => file.as_mut(),
            Self::Grid { file } | Self::Columns { file, .. } => Some(file),
        }
    }

    /// Reads `{ cells = "NAME" }`, `{ file = "F.vtu", cells = "NAME" }`, `{ file = "F.csv", column = "NAME" }`,
    /// `{ grid = "FILE" }` or, for several components, `{ file = "F.csv", columns = ["NAME", ...] }`.
    fn read(value: &Value<'_>, components: usize, base: &Path) -> Option<Self> {
        let mut table = value.table()?;
        let source = Self::read_from(value, &mut table, components, base);
        table.report_unknown_keys();
        source
    }

    /// Reads a source from a table that may have other keys too.
    pub(super) fn read_from(value: &Value<'_>, table: &mut Table<'_>, components: usize, base: &Path) -> Option<Self> {
        let expected = "a file that exists; a path is relative to the case file";
        if components == 1
            && let Some(grid) = table.get("grid")
        {
            for key in ["file", "cells", "column"] {
                if table.get(key).is_some() {
                    let complaint = format!("has `{key}` in addition to `grid`, which names the file");
                    value.report_error(&complaint, "one source of values", "remove one of them");
                }
            }
            return Some(Self::Grid { file: grid.existing_file(base, expected)? });
        }
        let file = table.get("file");
        let path = file.as_ref().map(|file| file.existing_file(base, expected));
        let column = if components == 1 { "column" } else { "columns" };
        let (key, given) = table.one_of(&["cells", column])?;
        if key == "cells" {
            let array = given.text("the name of an array of the cells of a .vtu file")?.to_owned();
            let path = path.map_or(Some(None), |path| path.map(Some))?;
            if let (Some(file), Some(path)) = (&file, &path)
                && !vtu::is_vtu(path)
            {
                let cure = format!("name a .vtu file, or write `{column}` for a CSV file");
                file.report_invalid("a .vtu file with the values of its cells", cure);
                return None;
            }
            return Some(Self::Cells { file: path, array });
        }
        let columns = match components {
            1 => vec![given.text("the name of a column")?.to_owned()],
            _ => column_names(&given, components)?,
        };
        if file.is_none() {
            value.report_error(
                &format!("has `{column}` but no `file`"),
                "a CSV file, relative to the case file",
                "add `file = \"NAME.csv\"`",
            );
        }
        let path = path??;
        if let Some(file) = file.filter(|_| vtu::is_vtu(&path)) {
            let cure = "name a CSV file, or write `cells` for a .vtu file";
            file.report_invalid("a CSV file with the columns", cure);
            return None;
        }
        Some(Self::Columns { file: path, columns })
    }

    pub(super) fn toml(&self) -> String {
        match self {
            Self::Expression(expression) => quoted(expression.text()),
            source => table("", source.entries()).1,
        }
    }

    /// Formats the keys of the table of a source; none of an expression.
    pub(super) fn entries(&self) -> Vec<Entry<'static>> {
        let path = |file: &PathBuf| ("file", quoted(&file.to_string_lossy()));
        match self {
            Self::Expression(_) => Vec::new(),
            Self::Grid { file } => vec![("grid", quoted(&file.to_string_lossy()))],
            Self::Cells { file, array } => file.iter().map(path).chain([("cells", quoted(array))]).collect(),
            Self::Columns { file, columns } => {
                let names: Vec<String> = columns.iter().map(|column| quoted(column)).collect();
                let columns = match &names[..] {
                    [name] => ("column", name.clone()),
                    names => ("columns", format!("[{}]", names.join(", "))),
                };
                vec![path(file), columns]
            }
        }
    }
}

fn column_names(value: &Value<'_>, count: usize) -> Option<Vec<String>> {
    let expected = format!("the names of {count} columns");
    let names = value.list(&expected, "a list of names, such as [\"ax\", \"ay\", \"az\"]")?;
    let read: Vec<Option<&str>> = names.iter().map(|name| name.text(&expected)).collect();
    let read: Vec<String> = read.into_iter().map(|name| name.map(str::to_owned)).collect::<Option<_>>()?;
    if read.len() != count {
        value.report_error(&format!("has {} names", read.len()), expected, "name one column for each of x, y and z");
        return None;
    }
    Some(read)
}

/// Reads a required parameter.
pub(super) fn required(table: &mut Table<'_>, key: &'static str, range: Range, base: &Path) -> Option<ParameterCase> {
    let value = table.require(key, &format!("a number{}", range.describe()))?;
    ParameterCase::read(&value, range, base)
}
