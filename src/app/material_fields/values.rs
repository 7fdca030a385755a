//! The values of one parameter or axis, read from its source.

mod columns;
mod files;
mod grid;

use std::path::{Path, PathBuf};
use std::rc::Rc;

use nalgebra::Vector3;

pub(super) use files::Files;
use grid::Grid;

use super::{Body, Place, unit};
use crate::app::case::{AxisCase, FieldCase, FieldFormula, FieldSource, ParameterCase, Range};
use crate::input::{InputError, InputErrors, excerpt};

/// The values of a parameter.
pub(super) struct ParameterValues<'a> {
    pub key: &'static str,
    range: Range,
    values: Values<'a, 1>,
}

/// The values of an axis.
pub(super) enum AxisValues<'a> {
    Constant(Vector3<f64>),
    Components([Values<'a, 1>; 3]),
    Field(Values<'a, 3>),
}

/// Values with `N` components.
pub(super) enum Values<'a, const N: usize> {
    Constant([f64; N]),
    Expression(&'a FieldCase, &'a Path),
    Elements(ElementValues<N>),
    /// A grid, whose lengths are in mesh units of this many meters.
    Grid(Rc<Grid>, f64),
}

/// One value per element of the mesh.
pub(super) struct ElementValues<const N: usize> {
    file: PathBuf,
    /// The name of the array or of the columns.
    name: String,
    /// Elements outside of the region may have no value, which is NaN.
    values: Vec<[f64; N]>,
    /// The lines of all values, or of each.
    lines: Vec<usize>,
}

impl<'a> ParameterValues<'a> {
    pub fn read(
        body: &Body<'a>,
        field: &'a FieldFormula,
        key: &'static str,
        parameter: &'a ParameterCase,
        elements: &[usize],
    ) -> Result<Self, InputErrors> {
        let values = Values::of_parameter(body, parameter, elements)?;
        Ok(Self { key, range: field.model.range(key), values })
    }

    pub fn varies(&self) -> bool {
        self.values.varies()
    }

    /// Returns the value at a point, in the range of the parameter.
    pub fn at(&self, place: Place) -> Result<f64, InputError> {
        let [value] = self.values.at(place);
        if self.range.contains(value) {
            return Ok(value);
        }
        let expected = format!("a number{}", self.range.describe());
        Err(self.values.error(place, &format!("{value}"), &expected, |key| key))
    }
}

impl<'a> AxisValues<'a> {
    pub fn read(body: &Body<'a>, axis: &'a AxisCase, elements: &[usize]) -> Result<Self, InputErrors> {
        Ok(match axis {
            AxisCase::Constant(axis) => Self::Constant(*axis),
            AxisCase::Components([x, y, z]) => {
                let of = |parameter| Values::of_parameter(body, parameter, elements);
                Self::Components([of(x)?, of(y)?, of(z)?])
            }
            AxisCase::Field(field) => Self::Field(Values::of_field(body, field, elements)?),
        })
    }

    pub fn varies(&self) -> bool {
        !matches!(self, Self::Constant(_))
    }

    /// Returns the unit vector at a point.
    pub fn at(&self, place: Place) -> Result<Vector3<f64>, InputError> {
        let components = match self {
            Self::Constant(axis) => return Ok(*axis),
            Self::Components(components) => components.each_ref().map(|component| component.at(place)[0]),
            Self::Field(values) => values.at(place),
        };
        unit(components).ok_or_else(|| {
            let (shown, expected) = (format!("{components:?}"), "a direction: three finite numbers, not all zero");
            match self {
                Self::Components(all) => {
                    let varying = all.iter().find(|component| component.varies()).unwrap_or(&all[0]);
                    varying.error(place, &shown, expected, |key| key.rsplit_once('[').map_or(key, |(axis, _)| axis))
                }
                Self::Field(values) => values.error(place, &shown, expected, |key| key),
                Self::Constant(_) => Values::Constant([0.0]).error(place, &shown, expected, |key| key),
            }
        })
    }
}

impl<'a> Values<'a, 1> {
    pub(super) fn of_parameter(
        body: &Body<'a>,
        parameter: &'a ParameterCase,
        elements: &[usize],
    ) -> Result<Self, InputErrors> {
        match parameter {
            ParameterCase::Number(number) => Ok(Self::Constant([*number])),
            ParameterCase::Field(field) => Self::of_field(body, field, elements),
        }
    }
}

impl<'a, const N: usize> Values<'a, N> {
    pub(super) fn of_field(body: &Body<'a>, field: &'a FieldCase, elements: &[usize]) -> Result<Self, InputErrors> {
        Ok(match &field.source {
            FieldSource::Expression(_) => Self::Expression(field, &body.case.file),
            FieldSource::Cells { file, array } => {
                let file = file.as_deref().or(body.mesh_file()).ok_or_else(|| {
                    let problem = format!("`{}` names an array of the mesh, which is not a .vtu file", field.key);
                    let cure = "add `file = \"NAME.vtu\"`, or a CSV file with `column`";
                    InputError::at_line(&body.case.file, field.line, problem, "a mesh with arrays of cells", cure)
                })?;
                Self::Elements(cells(body, file, array)?)
            }
            FieldSource::Grid { file } => Self::Grid(body.files.grid(file)?, body.case.mesh_scale),
            FieldSource::Columns { file, columns } => {
                let rows = body.files.rows(file)?;
                Self::Elements(columns::parse(file, &rows, columns, (body.mesh.elements().len(), elements))?)
            }
        })
    }

    /// Returns the values at a point; NaN where there are none.
    pub(super) fn at(&self, place: Place) -> [f64; N] {
        match self {
            Self::Constant(values) => *values,
            Self::Expression(field, _) => match &field.source {
                FieldSource::Expression(expression) => [expression.at(0.0, place.position); N],
                _ => [f64::NAN; N],
            },
            Self::Elements(elements) => elements.values[place.point.element as usize],
            Self::Grid(grid, unit) => [grid.at(place.position.map(|x| x / unit)).unwrap_or(f64::NAN); N],
        }
    }

    /// Returns the least and the greatest value of all that a file has; `None` of others, or without any.
    pub(super) fn extent(&self) -> Option<[f64; 2]> {
        let of = |values: &mut dyn Iterator<Item = f64>| {
            let finite = values.filter(|value| value.is_finite());
            finite.fold(None, |extent: Option<[f64; 2]>, value| {
                Some(extent.map_or([value; 2], |[low, high]| [low.min(value), high.max(value)]))
            })
        };
        match self {
            Self::Constant(_) | Self::Expression(..) => None,
            Self::Elements(elements) => of(&mut elements.values.iter().flatten().copied()),
            Self::Grid(grid, _) => of(&mut grid.values().iter().copied()),
        }
    }

    pub(super) fn varies(&self) -> bool {
        !matches!(self, Self::Constant(_))
    }

    /// Reports an invalid value; `of` returns what is invalid, given the key of an expression.
    pub(super) fn error(&self, place: Place, value: &str, expected: &str, of: impl Fn(&str) -> &str) -> InputError {
        let [x, y, z] = place.position;
        match self {
            Self::Constant(_) => InputError::in_file(Path::new(""), value, expected, "correct the number"),
            Self::Expression(field, file) => {
                let at = format!("x = {x:.6e}, y = {y:.6e}, z = {z:.6e} m ({})", place.point);
                let problem = format!("`{}` is {value} at {at}", of(&field.key));
                InputError::at_line(file, field.line, problem, expected, "correct the expression")
            }
            Self::Elements(elements) => elements.error(place.point.element as usize, value, expected),
            Self::Grid(grid, unit) => grid.error(place.position.map(|x| x / unit), place.point, value, expected),
        }
    }
}

impl<const N: usize> ElementValues<N> {
    fn error(&self, element: usize, value: &str, expected: &str) -> InputError {
        let line = self.lines.get(element).or(self.lines.first()).copied();
        let problem = format!("{} of element {element} is {value}", self.name);
        InputError { line, ..InputError::in_file(&self.file, problem, expected, "correct the value") }
    }
}

/// Reads an array of the cells of a `.vtu` file, which are those of the mesh.
fn cells<const N: usize>(body: &Body<'_>, file: &Path, array: &str) -> Result<ElementValues<N>, InputError> {
    let (data, elements) = (body.files.cells(file)?, body.mesh.elements().len());
    let read = data.array(array)?;
    let name = format!("`{}`", excerpt(array));
    let invalid = |problem, expected: String, cure: &str| InputError::at_line(file, read.line, problem, expected, cure);
    if read.components != N {
        let s = if N == 1 { "" } else { "s" };
        let plural = if read.components == 1 { "" } else { "s" };
        let problem = format!("the array {name} has {} component{plural}", read.components);
        return Err(invalid(problem, format!("{N} component{s} per cell"), "name another array"));
    }
    let values = read.values.as_chunks::<N>().0.to_vec();
    if values.len() != elements {
        let problem = format!("the array {name} has values of {} elements; the mesh has {elements}", values.len());
        let expected = "one cell for each element of the mesh, in the same order".to_owned();
        return Err(invalid(problem, expected, "write the array on the mesh of this case"));
    }
    if body.mesh_file() != Some(file) {
        files::check_cells(body, file, &data)?;
    }
    Ok(ElementValues { file: file.into(), name, values, lines: vec![read.line] })
}
