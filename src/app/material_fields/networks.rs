//! Networks that are chosen by fields, and fiber volume fractions that vary over the body.

use std::collections::HashMap;
use std::ops::Range;
use std::path::PathBuf;

use super::values::Values;
use super::{Body, Extent, FieldRange, Place, all};
use crate::app::case::{ChoiceField, FRACTIONS, FieldCase, FormulaCase, NetworkAssignment, NetworkChoice, RveScale};
use crate::input::{InputError, InputErrors};
use crate::tissue::materials::{FiberRve, Formulas, PointFractions, PointNetworks, random_network};

/// The largest number of a network or of a part of its name.
const LARGEST: f64 = 4e9;

/// Resolves the networks and the fractions of a material, whose matrix is resolved already; also returns their ranges.
pub(super) fn resolve(
    body: &Body<'_>,
    rve: &FiberRve<FormulaCase, NetworkChoice, FieldCase>,
    matrix: Option<Formulas>,
) -> Result<(FiberRve, Vec<FieldRange>), InputErrors> {
    let mut ranges = Vec::new();
    let (networks, assignment) = match &rve.assignment {
        NetworkAssignment::Random => (rve.networks.clone(), NetworkAssignment::Random),
        NetworkAssignment::Cycle => (rve.networks.clone(), NetworkAssignment::Cycle),
        NetworkAssignment::Field(choice) => {
            let Chosen { networks, of_point, ranges: of_fields } = chosen(body, choice, rve)?;
            ranges.extend(of_fields);
            (networks, NetworkAssignment::Field(of_point))
        }
    };
    let scale = match &rve.scale {
        RveScale::Uniform(scale) => RveScale::Uniform(*scale),
        RveScale::Fractions(field) => {
            let (of_point, extent) = fractions(body, field)?;
            ranges.extend(range(body, "fiber_volume_fraction".into(), extent));
            RveScale::Fractions(PointFractions::new(of_point))
        }
    };
    Ok((rve.with_fields((networks, assignment), scale, matrix), ranges))
}

fn range(body: &Body<'_>, parameter: String, Extent([min, max]): Extent) -> Option<FieldRange> {
    (min <= max).then(|| FieldRange { region: body.region.name.clone(), parameter, min, max })
}

/// Applies `each` to all integration points of the region, up to the first error.
fn for_each_point(
    body: &Body<'_>,
    elements: &[usize],
    mut each: impl FnMut(usize, Place) -> Result<(), InputError>,
) -> Result<(), InputError> {
    let positions = body.mesh.at_points(body.mesh.nodes());
    let points = elements.iter().flat_map(|&element| body.mesh.points().of_element(element));
    points.into_iter().try_for_each(|point| {
        each(point, Place { point: body.mesh.points().locate(point), position: positions[point] })
    })
}

fn fractions(body: &Body<'_>, field: &FieldCase) -> Result<(Vec<f64>, Extent), InputErrors> {
    let elements = body.elements();
    let values = Values::<1>::of_field(body, field, &elements)?;
    let (mut of_point, mut extent) = (vec![f64::NAN; body.mesh.points().len()], Extent::EMPTY);
    for_each_point(body, &elements, |point, place| {
        let [value] = values.at(place);
        if !FRACTIONS.contains(value) {
            let expected = format!("a fiber volume fraction{}", FRACTIONS.describe());
            return Err(values.error(place, &value.to_string(), &expected, |key| key));
        }
        extent.add(value);
        of_point[point] = value;
        Ok(())
    })?;
    Ok((of_point, extent))
}

/// The whole numbers of a field.
struct Numbers<'a> {
    field: &'a ChoiceField,
    values: Values<'a, 1>,
    /// The range of the bins.
    range: [f64; 2],
}

impl<'a> Numbers<'a> {
    fn read(body: &Body<'a>, field: &'a ChoiceField, elements: &[usize]) -> Result<Self, InputErrors> {
        let values = Values::of_parameter(body, &field.values, elements)?;
        let given = field.bins.and_then(|bins| bins.range);
        Ok(Self { field, range: given.or(values.extent()).unwrap_or([0.0; 2]), values })
    }

    fn at(&self, place: Place) -> Result<u32, InputError> {
        let [value] = self.values.at(place);
        let (number, expected) = match self.field.bins {
            Some(bins) => {
                let [low, high] = self.range;
                let expected = format!("a number from {low} to {high}, the range of the bins of `{}`", self.field.name);
                (bins.number(value, self.range), expected)
            }
            None => {
                let is_whole = value.fract() == 0.0 && (0.0..LARGEST).contains(&value);
                (is_whole.then_some(value as u32), format!("a whole number from 0, for `{}`", self.field.name))
            }
        };
        number.ok_or_else(|| self.values.error(place, &value.to_string(), &expected, |key| key))
    }
}

/// The networks that fields choose.
struct Chosen {
    /// The files.
    networks: Vec<PathBuf>,
    of_point: PointNetworks,
    /// The ranges of the fields.
    ranges: Vec<FieldRange>,
}

/// Evaluates the fields that choose networks. If several files match the numbers of a point, it has one of them by the
/// seed of the material.
fn chosen(
    body: &Body<'_>,
    choice: &NetworkChoice,
    rve: &FiberRve<FormulaCase, NetworkChoice, FieldCase>,
) -> Result<Chosen, InputErrors> {
    let elements = body.elements();
    let fields = all(choice.fields.iter().map(|field| Numbers::read(body, field, &elements)))?;
    let mut of_point = vec![PointNetworks::NONE; body.mesh.points().len()];
    let mut extents = vec![Extent::EMPTY; fields.len()];
    let mut candidates = Candidates {
        networks: if choice.pattern.is_some() { Vec::new() } else { rve.networks.clone() },
        of_numbers: HashMap::new(),
    };
    for_each_point(body, &elements, |point, place| {
        let numbers = fields.iter().map(|field| field.at(place)).collect::<Result<Vec<u32>, _>>()?;
        extents.iter_mut().zip(&numbers).for_each(|(extent, &number)| extent.add(number.into()));
        let number = |name: &str| {
            let field = fields.iter().position(|field| field.field.name == name);
            field.map_or(0, |field| numbers[field])
        };
        let found = match &choice.pattern {
            None => {
                let count = candidates.networks.len();
                if numbers[0] as usize >= count {
                    let expected = format!("the index of one of {count} networks, from 0");
                    return Err(fields[0].values.error(place, &numbers[0].to_string(), &expected, |key| key));
                }
                numbers[0]..numbers[0] + 1
            }
            Some(pattern) => candidates.find(&numbers, || pattern.files(number)),
        };
        if let (true, Some(pattern)) = (found.is_empty(), &choice.pattern) {
            return Err(missing(body, choice, place, &numbers, &pattern.path(number)));
        }
        of_point[point] = found.start + random_network(rve.seed, point, found.len()) as u32;
        Ok(())
    })?;
    let names = choice.fields.iter().map(|field| format!("choose.{}", field.name));
    let ranges = names.zip(extents).filter_map(|(name, extent)| range(body, name, extent)).collect();
    Ok(Chosen { networks: candidates.networks, of_point: PointNetworks::new(of_point), ranges })
}

/// The networks from which points choose.
struct Candidates {
    networks: Vec<PathBuf>,
    /// The indices of those of each combination of numbers that occurs.
    of_numbers: HashMap<Vec<u32>, Range<u32>>,
}

impl Candidates {
    /// Returns the indices of the networks of these numbers; `files` finds them when the numbers first occur.
    fn find(&mut self, numbers: &[u32], files: impl FnOnce() -> Vec<PathBuf>) -> Range<u32> {
        if let Some(known) = self.of_numbers.get(numbers) {
            return known.clone();
        }
        let begin = self.networks.len() as u32;
        self.networks.extend(files());
        let found = begin..self.networks.len() as u32;
        self.of_numbers.insert(numbers.to_vec(), found.clone());
        found
    }
}

/// Reports a network that an element needs and that does not exist.
fn missing(
    body: &Body<'_>,
    choice: &NetworkChoice,
    place: Place,
    numbers: &[u32],
    path: &std::path::Path,
) -> InputError {
    let values: Vec<String> =
        choice.fields.iter().zip(numbers).map(|(field, number)| format!("{} = {number}", field.name)).collect();
    let problem =
        format!("{} needs the network {}, which does not exist ({})", place.point, path.display(), values.join(", "));
    let cure = "add the file, correct the path, or let the bins begin at another number (`first`)";
    InputError::at_line(&body.case.file, choice.line, problem, "a file for every combination that occurs", cure)
}
