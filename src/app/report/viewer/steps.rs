//! The steps that the page holds, and the numbers of each.

use std::collections::HashMap;
use std::fs;

use serde::Serialize;

use super::body::Body;
use super::pack::{Packed, pack, pack_scalars, signed_bytes};
use crate::app::report::ReportError;
use crate::app::report::directory::Directory;
use crate::app::report::picture::color;
use crate::app::report::quantity::Quantity;
use crate::app::report::units::prefix;
use crate::app::results::Fields;
use crate::app::results::collection::Entry;

/// Most steps of a page.
const MOST_STEPS: usize = 60;
/// Most bytes of the numbers of all steps.
const MOST_BYTES: usize = 24 << 20;
/// Most bytes of field files that a report reads: of large bodies it reads a few steps only.
const MOST_READ: u64 = 2 << 30;

/// A quantity whose values the page holds for every step.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Field {
    pub name: String,
    pub label: String,
    /// The unit with its prefix, which is that of all fields of this unit.
    pub unit: String,
    /// The values are multiplied by this factor when they are displayed.
    pub factor: f64,
    /// Whether the values are those of elements, rather than averages at the vertices.
    pub of_elements: bool,
    /// The values at the ends of the color map in all steps.
    pub range: [f64; 2],
    /// The smallest and the largest value of all steps.
    pub extremes: [f64; 2],
}

/// The numbers of a step.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Step {
    /// The number of the step; absent for a state within a step.
    pub step: Option<usize>,
    pub time: f64,
    /// The displacement of each vertex, m.
    pub displacement: Packed,
    /// The values of each field.
    pub values: Vec<Packed>,
    /// For each glyph the mean fiber direction, times 127 and an alignment from 0 to 1.
    pub directions: Option<String>,
}

/// The values of a quantity in the steps.
#[derive(Default)]
struct Series {
    of_step: Vec<Vec<f64>>,
}

/// The fields and steps of a page.
pub(super) struct Steps {
    pub fields: Vec<Field>,
    pub steps: Vec<Step>,
    /// The range of the lengths of displacements in all steps, m.
    pub displacement_range: [f64; 2],
    /// Number of steps with fields that the page does not hold.
    pub omitted: usize,
}

/// Collects the numbers of the steps. `last` are the fields of the last step, `glyphs` the elements whose fiber direction
/// is drawn, `wanted` a step that must be among those of the page.
pub(super) fn collect(
    directory: &Directory,
    body: &Body,
    last: &Fields,
    glyphs: &[u32],
    wanted: Option<usize>,
) -> Result<Steps, ReportError> {
    let names: Vec<String> = Quantity::all(last).into_iter().map(|quantity| quantity.name).collect();
    let per_step = body.nodes.len() * 2 * (3 + names.len()) + 3 * glyphs.len();
    let chosen = choose(directory, per_step, wanted);
    let omitted = directory.fields.len() - chosen.len();
    let mut series: Vec<(Quantity, Series)> =
        names.iter().filter_map(|name| Some((Quantity::named(last, name)?, Series::default()))).collect();
    let (mut steps, mut lengths) = (Vec::new(), Vec::new());
    for entry in &chosen {
        let fields = directory.read_fields(entry)?;
        let Some(fields) = in_order_of(last, fields) else { continue };
        let displacements = fields.point_vector("displacement").unwrap_or_default();
        let moved = |&node: &u32| displacements.get(node as usize).copied().unwrap_or_default();
        let of_vertices: Vec<[f64; 3]> = body.nodes.iter().map(moved).collect();
        lengths.push(of_vertices.iter().map(|u| u.iter().map(|x| x * x).sum::<f64>().sqrt()).collect::<Vec<_>>());
        for (quantity, series) in &mut series {
            let values = Quantity::named(&fields, &quantity.name).map(|quantity| quantity.values).unwrap_or_default();
            series.of_step.push(match quantity.is_integer {
                true => body.elements.iter().map(|&e| values.get(e as usize).copied().unwrap_or(f64::NAN)).collect(),
                false => body.averages(&values),
            });
        }
        steps.push(Step {
            step: entry.step(),
            time: entry.time,
            displacement: pack(&of_vertices),
            values: Vec::new(),
            directions: directions(&fields, glyphs),
        });
    }
    // Numbers that are the same everywhere and at all times say nothing: one region, one rank, no sleeping RVE.
    series.retain(|(quantity, series)| {
        let mut values = series.of_step.iter().flatten();
        let first = values.next();
        !quantity.is_integer || values.any(|value| Some(value) != first)
    });
    for (_, series) in &series {
        for (step, values) in steps.iter_mut().zip(&series.of_step) {
            step.values.push(pack_scalars(values));
        }
    }
    let displacement_range = color::range(&lengths.concat()).into();
    let sizes: Vec<(&str, f64)> =
        series.iter().map(|(quantity, _)| (quantity.unit, largest(&quantity.values))).collect();
    let mut fields: Vec<Field> = series.into_iter().map(|(quantity, series)| field(quantity, &series)).collect();
    share_prefixes(&mut fields, &sizes);
    Ok(Steps { fields, steps, displacement_range, omitted })
}

/// Returns the largest size of the finite numbers.
fn largest(numbers: &[f64]) -> f64 {
    numbers.iter().map(|number| number.abs()).filter(|size| size.is_finite()).fold(0.0, f64::max)
}

/// Gives all fields of a unit the same prefix, that of the largest of the `sizes` of its quantities: the values of the elements
/// at the last step, as in the tables of the page.
fn share_prefixes(fields: &mut [Field], sizes: &[(&str, f64)]) {
    for field in fields.iter_mut().filter(|field| !field.unit.is_empty()) {
        let of_unit = sizes.iter().filter(|(unit, _)| *unit == field.unit);
        let (power, name) = prefix(of_unit.map(|(_, size)| *size).fold(0.0, f64::max));
        (field.unit, field.factor) = (format!("{name}{}", field.unit), 1.0 / power);
    }
}

/// Describes a quantity, in its unit without prefix.
fn field(quantity: Quantity, series: &Series) -> Field {
    let values = series.of_step.concat();
    let finite = values.iter().copied().filter(|value| value.is_finite());
    let extremes = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], value| [a.min(value), b.max(value)]);
    let (low, high) = color::range(&values);
    Field {
        name: quantity.name,
        label: quantity.label,
        unit: quantity.unit.to_owned(),
        factor: 1.0,
        of_elements: quantity.is_integer,
        range: [low, high],
        extremes: if extremes[0] <= extremes[1] { extremes } else { [low, high] },
    }
}

/// Chooses steps, evenly, up to the limits of a page; the last one and the wanted one are always among them. Steps whose
/// files were removed are left out.
fn choose(directory: &Directory, bytes_per_step: usize, wanted: Option<usize>) -> Vec<Entry> {
    let size = |entry: &Entry| fs::metadata(directory.path.join(&entry.file)).ok().map(|file| file.len());
    let all: Vec<&Entry> = directory.fields.iter().filter(|entry| size(entry).is_some()).collect();
    let of_file = all.last().and_then(|entry| size(entry)).unwrap_or(0).max(1);
    let count = MOST_STEPS.min(MOST_BYTES / bytes_per_step.max(1)).min((MOST_READ / of_file) as usize).max(2);
    let wanted = wanted.and_then(|step| all.iter().rposition(|entry| entry.step() == Some(step)));
    let mut places = evenly(all.len(), count);
    if let Some(wanted) = wanted.filter(|wanted| !places.contains(wanted)) {
        places.push(wanted);
        places.sort_unstable();
    }
    places.into_iter().map(|place| all[place].clone()).collect()
}

/// Returns up to `count` of the numbers from 0 to `all - 1`, evenly spaced, the last one among them.
pub(super) fn evenly(all: usize, count: usize) -> Vec<usize> {
    if all <= count {
        return (0..all).collect();
    }
    let mut places: Vec<usize> = match count {
        0 | 1 => vec![all - 1],
        _ => (0..count).map(|k| (k * (all - 1) + (count - 1) / 2) / (count - 1)).collect(),
    };
    places.dedup();
    places
}

/// Returns fields with the points and elements in the order of `base`; the order changes if a run is resumed on another
/// number of ranks. `None` if they are those of another mesh.
fn in_order_of(base: &Fields, fields: Fields) -> Option<Fields> {
    if fields.points == base.points && fields.elements == base.elements {
        return Some(fields);
    }
    let bits = |point: &[f64; 3]| point.map(f64::to_bits);
    let place: HashMap<[u64; 3], u32> = base.points.iter().map(bits).zip(0..).collect();
    let points: Vec<u32> = fields.points.iter().map(|point| place.get(&bits(point)).copied()).collect::<Option<_>>()?;
    let element: HashMap<&[u32], usize> = base.elements.iter().zip(0..).collect();
    let moved = fields.elements.map(|node| points[node as usize]);
    let elements: Vec<usize> = moved.iter().map(|nodes| element.get(nodes).copied()).collect::<Option<_>>()?;
    if points.len() != base.points.len() || elements.len() != base.elements.len() {
        return None;
    }
    fn sorted<T: Copy + Default>(values: Vec<T>, places: impl Iterator<Item = usize>) -> Vec<T> {
        let mut sorted = vec![T::default(); values.len()];
        values.into_iter().zip(places).for_each(|(value, place)| sorted[place] = value);
        sorted
    }
    let at_points = || points.iter().map(|&point| point as usize);
    let at_elements = || elements.iter().copied();
    Some(Fields {
        points: base.points.clone(),
        elements: base.elements.clone(),
        point_scalars: fields.point_scalars.into_iter().map(|(name, v)| (name, sorted(v, at_points()))).collect(),
        point_vectors: fields.point_vectors.into_iter().map(|(name, v)| (name, sorted(v, at_points()))).collect(),
        point_tensors: fields.point_tensors.into_iter().map(|(name, v)| (name, sorted(v, at_points()))).collect(),
        cell_scalars: fields.cell_scalars.into_iter().map(|(name, v)| (name, sorted(v, at_elements()))).collect(),
        cell_integers: fields.cell_integers.into_iter().map(|(name, v)| (name, sorted(v, at_elements()))).collect(),
        cell_vectors: fields.cell_vectors.into_iter().map(|(name, v)| (name, sorted(v, at_elements()))).collect(),
        cell_tensors: fields.cell_tensors.into_iter().map(|(name, v)| (name, sorted(v, at_elements()))).collect(),
    })
}

/// Returns the fiber directions of elements, each with a length that grows with its alignment, on the same scale in all steps:
/// 0.35 for fibers in all directions, 1 for fibers along one, whose alignment is 2/3. The root makes weak alignment visible.
fn directions(fields: &Fields, glyphs: &[u32]) -> Option<String> {
    let directions = fields.cell_vector("fiber_direction")?;
    let alignment = fields.cell_scalar("fiber_alignment");
    let strength = |&element: &u32| alignment.map_or(1.0, |all| all.get(element as usize).map_or(0.0, |a| 1.5 * a));
    let scaled = glyphs.iter().flat_map(|element| {
        let part = 0.35 + 0.65 * strength(element).clamp(0.0, 1.0).sqrt();
        let [x, y, z] = directions.get(*element as usize).copied().unwrap_or_default();
        [x, y, z].map(|component| (127.0 * part * component).round() as i8)
    });
    Some(signed_bytes(scaled))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_chosen_evenly_with_the_last_one() {
        assert_eq!(evenly(3, 5), [0, 1, 2]);
        assert_eq!(evenly(101, 5), [0, 25, 50, 75, 100]);
        assert_eq!(evenly(9, 1), [8]);
        assert!(evenly(0, 4).is_empty());
        assert_eq!(*evenly(1000, 60).last().unwrap(), 999);
    }

    #[test]
    fn fields_of_one_unit_have_the_same_prefix() {
        let of = |name: &str, values: Vec<f64>| {
            let quantity = Quantity::named(
                &Fields { cell_scalars: vec![(name.into(), values.clone())], ..Fields::default() },
                name,
            );
            field(quantity.unwrap(), &Series { of_step: vec![values] })
        };
        let mut fields = [
            of("von_mises_stress", vec![0.0, 2e4]),
            of("shear_stress", vec![-3.0, 1.0]),
            of("fiber_alignment", vec![0.1, 0.2]),
        ];
        let sizes = [("Pa", 2e4), ("Pa", 3.0), ("", 0.2)];
        share_prefixes(&mut fields, &sizes);
        assert_eq!([0, 1, 2].map(|k| (&*fields[k].unit, fields[k].factor)), [("kPa", 1e-3), ("kPa", 1e-3), ("", 1.0)]);
    }

    #[test]
    fn fiber_lines_have_the_same_length_for_the_same_alignment_in_all_steps() {
        let step = |alignment: [f64; 3]| {
            let fields = Fields {
                cell_vectors: vec![("fiber_direction".into(), vec![[0.0, 1.0, 0.0]; 3])],
                cell_scalars: vec![("fiber_alignment".into(), alignment.to_vec())],
                ..Fields::default()
            };
            directions(&fields, &[0, 1, 2]).unwrap()
        };
        let lengths = |lengths: [i8; 3]| signed_bytes(lengths.into_iter().flat_map(|y| [0, y, 0]));
        assert_eq!(step([0.0, 1.0 / 6.0, 2.0 / 3.0]), lengths([44, 86, 127]));
        // The strongest alignment of this step is weak.
        assert_eq!(step([0.0, 1.0 / 6.0, 0.0]), lengths([44, 86, 44]));
    }

    #[test]
    fn fields_of_another_numbering_are_sorted() {
        let base = Fields {
            points: (0..5).map(|k| [f64::from(k), f64::from(k * k), f64::from(k % 2)]).collect(),
            elements: vec![[0, 1, 2, 3], [1, 2, 3, 4]].into(),
            point_vectors: vec![("displacement".into(), (0..5).map(|k| [f64::from(k); 3]).collect())],
            cell_scalars: vec![("energy_density".into(), vec![1.0, 2.0])],
            ..Fields::default()
        };
        // The points in reverse order, and the second element first.
        let mut other = base.clone();
        other.points.reverse();
        other.point_vectors[0].1.reverse();
        other.elements = vec![[3, 2, 1, 0], [4, 3, 2, 1]].into();
        other.cell_scalars[0].1.reverse();
        assert_eq!(in_order_of(&base, other.clone()), Some(base.clone()));
        other.points[0][0] = 7.0;
        assert_eq!(in_order_of(&base, other), None);
    }
}
