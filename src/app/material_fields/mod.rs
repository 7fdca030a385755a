//! Material parameters, fiber axes, networks and fiber volume fractions that vary over the body: their values at the
//! integration points of a mesh.
//!
//! An expression is evaluated at the reference position of each point, and a grid has one value in each of its cells;
//! values of cells of the mesh and rows of a CSV file belong to all points of an element. Points with bitwise equal
//! parameters share one formula. The values depend only on the case, the mesh and the files, so that all ranks find the
//! same.
//!
//! # Grids
//!
//! A grid is a text file of numbers between blanks, commas or line breaks, with comments from `#` to the end of a line:
//!
//! ```text
//! # lowest corner, edges of a cell (mesh units), numbers of cells
//! 0 0 0   0.5 1 1   4 1 1
//! 3.1 3.3 2.9 2.7                          # the values, those along x first, then along y, then along z
//! ```

mod networks;
mod on_ranks;
mod values;

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::Vector3;
use serde::Serialize;

use super::case::{Case, FieldFormula, FormulaCase, MeshSource, RegionCase, Unstable, direction};
use super::vtu;
use crate::fem::mesh::{IntegrationPoint, Mesh};
use crate::input::{InputError, InputErrors};
use crate::tissue::materials::{Formula, Formulas, Materials, PointFormulas, Region, RegionMaterial};
pub use on_ranks::MaterialFields;
use values::{AxisValues, Files, ParameterValues};

/// The materials of a body with the ranges of the fields in them.
#[derive(Clone, Debug, PartialEq)]
pub struct ResolvedMaterials {
    /// The materials.
    pub materials: Materials,
    /// The ranges of all parameters and axes that vary.
    pub ranges: Vec<FieldRange>,
}

/// The range of a field over the points of a region.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FieldRange {
    /// The region of the case.
    pub region: String,
    /// The parameter; of an axis, the component of its unit vector, such as `axis.x`.
    pub parameter: String,
    /// The least value, in SI units.
    pub min: f64,
    /// The greatest value.
    pub max: f64,
}

/// Returns the materials of a case on its mesh.
///
/// # Errors
/// Returns [`InputErrors`] if a file cannot be read or does not fit the mesh, or if a value is out of its range; of each
/// parameter, only the first such value.
pub fn resolve(case: &Case, mesh: &Mesh) -> Result<ResolvedMaterials, InputErrors> {
    let (mut regions, mut ranges, mut errors) = (Vec::new(), Vec::new(), Vec::new());
    let files = Files::default();
    for (number, region) in case.regions.iter().enumerate() {
        let body = Body { case, mesh, region, number, files: &files };
        match material_of(&body) {
            Ok((material, of_region)) => {
                ranges.extend(of_region);
                regions.push(Region { name: region.name.clone(), material });
            }
            Err(InputErrors(new)) => errors.extend(new),
        }
    }
    if errors.is_empty() {
        Ok(ResolvedMaterials { materials: Materials { regions, rve: case.micro }, ranges })
    } else {
        // Several parameters may have the same error, for example if their file cannot be read.
        errors.dedup();
        Err(InputErrors(errors))
    }
}

/// A region of a case with its mesh.
struct Body<'a> {
    case: &'a Case,
    mesh: &'a Mesh,
    region: &'a RegionCase,
    /// Index of the region in the case.
    number: usize,
    files: &'a Files,
}

impl Body<'_> {
    /// The elements of the region.
    fn elements(&self) -> Vec<usize> {
        let of_mesh: Vec<bool> =
            self.mesh.regions().iter().map(|name| self.case.region_of(name) == Some(self.number)).collect();
        let is_own = |(_, region): &(usize, &u32)| of_mesh[**region as usize];
        self.mesh.region_of().iter().enumerate().filter(is_own).map(|(element, _)| element).collect()
    }

    /// The mesh file, if it has arrays of cells.
    fn mesh_file(&self) -> Option<&std::path::Path> {
        match &self.case.mesh {
            MeshSource::File(file) if vtu::is_vtu(file) => Some(file),
            _ => None,
        }
    }
}

/// An integration point with its reference position, m.
#[derive(Clone, Copy)]
struct Place {
    point: IntegrationPoint,
    position: [f64; 3],
}

/// The least and the greatest value so far.
#[derive(Clone, Copy)]
struct Extent([f64; 2]);

impl Extent {
    const EMPTY: Self = Self([f64::INFINITY, f64::NEG_INFINITY]);

    fn add(&mut self, value: f64) {
        self.0 = [self.0[0].min(value), self.0[1].max(value)];
    }
}

/// Evaluates the fields of a region; also returns their ranges.
fn material_of(body: &Body<'_>) -> Result<(RegionMaterial, Vec<FieldRange>), InputErrors> {
    let formulas = |formula: &FormulaCase| match formula {
        FormulaCase::Constant(formula) => Ok((Formulas::from(formula.clone()), Vec::new())),
        FormulaCase::Field(field) => formulas_of(body, field),
    };
    match &body.region.material {
        RegionMaterial::Formula(formula) => {
            formulas(formula).map(|(formulas, ranges)| (RegionMaterial::Formula(formulas), ranges))
        }
        RegionMaterial::FiberRve(rve) => {
            let (matrix, mut ranges) = rve.matrix.as_ref().map(formulas).transpose()?.unzip();
            let (rve, of_networks) = networks::resolve(body, rve, matrix)?;
            let ranges = ranges.get_or_insert_default();
            ranges.extend(of_networks);
            Ok((RegionMaterial::FiberRve(rve), std::mem::take(ranges)))
        }
    }
}

/// Evaluates a formula at all points of a region.
fn formulas_of(body: &Body<'_>, field: &FieldFormula) -> Result<(Formulas, Vec<FieldRange>), InputErrors> {
    let elements = body.elements();
    let read = |(key, parameter)| ParameterValues::read(body, field, key, parameter, &elements);
    let parameters = all(field.parameters.iter().map(|(key, parameter)| (*key, parameter)).map(read));
    let axes = all(field.axes.iter().map(|axis| AxisValues::read(body, axis, &elements)));
    let (parameters, axes) = match (parameters, axes) {
        (Ok(parameters), Ok(axes)) => (parameters, axes),
        (Err(mut one), Err(other)) => {
            one.0.extend(other.0);
            return Err(one);
        }
        (Err(errors), _) | (_, Err(errors)) => return Err(errors),
    };
    let positions = body.mesh.at_points(body.mesh.nodes());
    let mut extents = vec![Extent::EMPTY; parameters.len() + 3 * axes.len()];
    let mut distinct = Distinct::default();
    let mut of_point = vec![PointFormulas::NONE; body.mesh.points().len()];
    let (mut values, mut directions) = (Vec::<(&str, f64)>::new(), Vec::<Vector3<f64>>::new());
    let mut errors = FirstErrors::new(parameters.len() + axes.len() + 1);
    for &element in &elements {
        for point in body.mesh.points().of_element(element) {
            let place = Place { point: body.mesh.points().locate(point), position: positions[point] };
            let at = |(k, parameter): (usize, &ParameterValues<'_>)| {
                errors.first(k, || parameter.at(place).map(|value| (parameter.key, value)))
            };
            values.clear();
            values.extend(parameters.iter().enumerate().filter_map(at));
            let along = |(k, axis): (usize, &AxisValues<'_>)| errors.first(parameters.len() + k, || axis.at(place));
            directions.clear();
            directions.extend(axes.iter().enumerate().filter_map(along));
            if !errors.is_empty() {
                continue;
            }
            let components = values.iter().map(|(_, value)| *value).chain(directions.iter().flatten().copied());
            extents.iter_mut().zip(components).for_each(|(extent, value)| extent.add(value));
            let formula = errors.first(parameters.len() + axes.len(), || {
                distinct.index(field, &values, &directions).map_err(|error| {
                    let (what, cure) = (format!("`{}` {} at {}", field.key, error.what, place.point), error.cure);
                    InputError::at_line(&body.case.file, field.line, what, error.expected, cure)
                })
            });
            of_point[point] = formula.unwrap_or(PointFormulas::NONE);
        }
    }
    errors.into_result()?;
    let formulas = PointFormulas::new(distinct.formulas, of_point).map_err(|error| {
        InputError::in_file(&body.case.file, error.to_string(), "at most 4294967294 formulas", "use fewer elements")
    })?;
    let ranges = ranges(&body.region.name, (&parameters, &axes), &extents);
    Ok((Formulas::Points(Arc::new(formulas)), ranges))
}

/// Collects values, or all errors.
fn all<T>(read: impl Iterator<Item = Result<T, InputErrors>>) -> Result<Vec<T>, InputErrors> {
    let (mut values, mut errors) = (Vec::new(), Vec::new());
    for each in read {
        match each {
            Ok(value) => values.push(value),
            Err(InputErrors(new)) => errors.extend(new),
        }
    }
    if errors.is_empty() { Ok(values) } else { Err(InputErrors(errors)) }
}

/// The first error of each parameter and axis, and of the formulas.
struct FirstErrors(Vec<Option<InputError>>);

impl FirstErrors {
    fn new(count: usize) -> Self {
        Self(vec![None; count])
    }

    fn is_empty(&self) -> bool {
        self.0.iter().all(Option::is_none)
    }

    /// Returns a value of one of them unless it is, or was, an error.
    fn first<T>(&mut self, number: usize, value: impl FnOnce() -> Result<T, InputError>) -> Option<T> {
        let known = &mut self.0[number];
        if known.is_some() {
            return None;
        }
        value().map_err(|error| *known = Some(error)).ok()
    }

    fn into_result(self) -> Result<(), InputErrors> {
        let errors: Vec<InputError> = self.0.into_iter().flatten().collect();
        if errors.is_empty() { Ok(()) } else { Err(InputErrors(errors)) }
    }
}

/// The formulas made so far, found by the bits of their values.
#[derive(Default)]
struct Distinct {
    formulas: Vec<Formula>,
    known: HashMap<Vec<u64>, u32>,
}

impl Distinct {
    /// Returns the index of the formula with these values.
    fn index(&mut self, field: &FieldFormula, values: &[(&str, f64)], axes: &[Vector3<f64>]) -> Result<u32, Unstable> {
        let all = values.iter().map(|(_, value)| value).chain(axes.iter().flatten());
        let bits: Vec<u64> = all.map(|value| value.to_bits()).collect();
        if let Some(&known) = self.known.get(&bits) {
            return Ok(known);
        }
        let value = |key: &str| values.iter().find(|(name, _)| *name == key).map(|(_, value)| *value);
        let formula = field.model.formula(&value, axes)?;
        let index = u32::try_from(self.formulas.len()).unwrap_or(PointFormulas::NONE);
        self.formulas.push(formula);
        self.known.insert(bits, index);
        Ok(index)
    }
}

/// Returns the ranges of the parameters that vary; `extents` has those of all parameters, then of all axes.
fn ranges(
    region: &str,
    (parameters, axes): (&[ParameterValues<'_>], &[AxisValues<'_>]),
    extents: &[Extent],
) -> Vec<FieldRange> {
    let names = parameters.iter().map(|parameter| parameter.varies().then(|| parameter.key.to_owned()));
    let axes = axes.iter().enumerate().flat_map(|(number, axis)| {
        let key = if axes.len() == 1 { "axis".to_owned() } else { format!("axes[{number}]") };
        ["x", "y", "z"].map(|component| axis.varies().then(|| format!("{key}.{component}")))
    });
    let named = names.chain(axes).zip(extents);
    let range = |(name, Extent([min, max])): (Option<String>, &Extent)| {
        Some(FieldRange { region: region.to_owned(), parameter: name?, min: *min, max: *max })
    };
    // A region without elements has no values.
    named.filter(|(_, Extent([min, max]))| min <= max).filter_map(range).collect()
}

fn unit(components: [f64; 3]) -> Option<Vector3<f64>> {
    direction(Vector3::from(components))
}
