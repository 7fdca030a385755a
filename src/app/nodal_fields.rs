//! Averages at the nodes of the fields of the elements, on request.

use super::case::{NODAL, OF_FIBERS};
use super::results::FieldSet;
use crate::tissue::micro_scale::TissueFieldError;

/// The mean of fields over the elements around each node, of all regions, as one table. Elements without fibers do not count
/// in the means of fields of fibers.
///
/// The mean at a node is summed in the order of the elements, so that it depends on nothing but their values.
#[derive(Debug, Default, PartialEq)]
pub(super) struct NodalFields {
    scalars: Vec<(&'static str, Vec<f64>)>,
    vectors: Vec<(&'static str, Vec<[f64; 3]>)>,
    tensors: Vec<(&'static str, Vec<[f64; 9]>)>,
}

/// A field of the elements and the name of its average.
struct Column<'a> {
    name: &'static str,
    /// Numbers per element.
    size: usize,
    values: &'a [f64],
    of_fibers: bool,
}

impl Column<'_> {
    /// Returns the numbers of an element; `None` if they describe fibers, and the element has none: its numbers are 0 then.
    fn of_element(&self, element: usize) -> Option<&[f64]> {
        let values = &self.values[self.size * element..][..self.size];
        let has_value = !self.of_fibers || values.iter().any(|&value| value != 0.0);
        has_value.then_some(values)
    }
}

impl NodalFields {
    /// Averages the fields whose averages are among `names`. `share` gets the table, with its numbers per node, and replaces
    /// the means at nodes whose elements are not all known here; it is called on all ranks if any average is selected.
    ///
    /// # Errors
    /// Returns the error of `share`.
    pub fn of(
        fields: &FieldSet<'_>,
        names: &[&'static str],
        share: impl FnOnce(usize, &mut [f64]) -> Result<(), TissueFieldError>,
    ) -> Result<Self, TissueFieldError> {
        let columns = columns(fields, names);
        let width: usize = columns.iter().map(|column| column.size).sum();
        if width == 0 {
            return Ok(Self::default());
        }
        let mut table = means(fields, &columns, width);
        share(width, &mut table)?;
        let (mut averages, mut first) = (Self::default(), 0);
        for Column { name, size, .. } in columns {
            let rows = || table.chunks_exact(width).map(|row| &row[first..first + size]);
            match size {
                1 => averages.scalars.push((name, rows().map(|row| row[0]).collect())),
                3 => averages.vectors.push((name, rows().map(|row| std::array::from_fn(|k| row[k])).collect())),
                _ => averages.tensors.push((name, rows().map(|row| std::array::from_fn(|k| row[k])).collect())),
            }
            first += size;
        }
        Ok(averages)
    }

    /// Adds the averages to the fields of the points.
    pub fn add_to<'a>(&'a self, fields: &mut FieldSet<'a>) {
        fields.point_scalars.extend(self.scalars.iter().map(|(name, values)| (*name, values.as_slice())));
        fields.point_vectors.extend(self.vectors.iter().map(|(name, values)| (*name, values.as_slice())));
        fields.point_tensors.extend(self.tensors.iter().map(|(name, values)| (*name, values.as_slice())));
    }
}

/// Returns the selected fields, in the order of the files.
fn columns<'a>(fields: &FieldSet<'a>, names: &[&'static str]) -> Vec<Column<'a>> {
    let scalars = fields.cell_scalars.iter().map(|&(name, values)| (name, 1, values));
    let vectors = fields.cell_vectors.iter().map(|&(name, values)| (name, 3, values.as_flattened()));
    let tensors = fields.cell_tensors.iter().map(|&(name, values)| (name, 9, values.as_flattened()));
    let selected = |field: &str| names.iter().copied().find(|name| name.strip_prefix(NODAL) == Some(field));
    let all = scalars.chain(vectors).chain(tensors);
    all.filter_map(|(field, size, values)| {
        Some(Column { name: selected(field)?, size, values, of_fibers: OF_FIBERS.contains(&field) })
    })
    .collect()
}

/// Returns the means at all nodes, `width` numbers for each; 0 at a node none of whose elements has a value.
fn means(fields: &FieldSet<'_>, columns: &[Column<'_>], width: usize) -> Vec<f64> {
    let mut table = vec![0.0; width * fields.points.len()];
    let mut counts = vec![0.0_f64; fields.points.len()];
    let mut first = 0;
    for column in columns {
        counts.fill(0.0);
        for (element, nodes) in fields.elements.iter().enumerate() {
            let Some(values) = column.of_element(element) else { continue };
            for &node in nodes {
                let node = node as usize;
                counts[node] += 1.0;
                table[width * node + first..].iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
            }
        }
        for (row, count) in table.chunks_exact_mut(width).zip(&counts) {
            row[first..first + column.size].iter_mut().for_each(|sum| *sum /= count.max(1.0));
        }
        first += column.size;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_have_the_means_of_their_elements() {
        let elements = vec![[0, 1, 2, 3], [1, 2, 3, 4]].into();
        let (energy, stress) = ([1.0, 4.0], [[2.0; 9], [3.0; 9]]);
        let fields = FieldSet {
            points: &[[0.0; 3]; 6],
            elements: &elements,
            cell_scalars: vec![("energy_density", &energy), ("stretch_min", &energy), ("stretch_max", &[0.0, 1.5])],
            cell_tensors: vec![("cauchy_stress", &stress)],
            ..FieldSet::default()
        };
        let names = ["cauchy_stress", "nodal_cauchy_stress", "nodal_energy_density", "nodal_stretch_max"];
        let share = |width: usize, table: &mut [f64]| {
            assert_eq!((width, table.len()), (11, 66));
            table[55] = 7.0;
            Ok(())
        };
        let found = NodalFields::of(&fields, &names, share).unwrap();
        let expected = NodalFields {
            scalars: vec![
                ("nodal_energy_density", vec![1.0, 2.5, 2.5, 2.5, 4.0, 7.0]),
                // The first element has no fibers.
                ("nodal_stretch_max", vec![0.0, 1.5, 1.5, 1.5, 1.5, 0.0]),
            ],
            vectors: Vec::new(),
            tensors: vec![("nodal_cauchy_stress", [2.0, 2.5, 2.5, 2.5, 3.0, 0.0].map(|value| [value; 9]).to_vec())],
        };
        assert_eq!(found, expected);
        let none = NodalFields::of(&fields, &names[..1], |_, _| panic!("nothing is shared")).unwrap();
        assert_eq!(none, NodalFields::default());
    }
}
