//! Averages of the values of elements at their nodes.

use std::collections::HashMap;

use crate::app::results::Fields;

/// The mean of the values of the elements around each node, within each region: where regions meet, a node has one value
/// for each of them.
#[derive(Clone, Debug)]
pub(super) struct NodalAverages<'a> {
    region: Option<&'a [i64]>,
    sums: HashMap<(u32, i64), (f64, f64)>,
}

impl<'a> NodalAverages<'a> {
    /// Averages one value per element; elements without a value (NaN) do not count.
    pub fn of(fields: &'a Fields, values: &[f64]) -> Self {
        let mut averages = Self { region: fields.cell_integer("region"), sums: HashMap::new() };
        for ((element, nodes), value) in
            fields.elements.iter().enumerate().zip(values).filter(|(_, value)| !value.is_nan())
        {
            let region = averages.region_of(element);
            for &node in nodes {
                let (sum, count) = averages.sums.entry((node, region)).or_default();
                (*sum, *count) = (*sum + value, *count + 1.0);
            }
        }
        averages
    }

    fn region_of(&self, element: usize) -> i64 {
        self.region.and_then(|region| region.get(element).copied()).unwrap_or(0)
    }

    /// Returns the value at a node as a part of an element.
    pub fn at(&self, node: u32, element: usize) -> f64 {
        self.sums.get(&(node, self.region_of(element))).map_or(f64::NAN, |(sum, count)| sum / count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_are_averaged_apart() {
        let fields = Fields {
            elements: vec![[0, 1, 2, 3], [1, 2, 3, 4], [1, 2, 4, 5]].into(),
            cell_integers: vec![("region".into(), vec![1, 1, 2])],
            ..Fields::default()
        };
        let averages = NodalAverages::of(&fields, &[1.0, 3.0, 7.0]);
        assert_eq!(
            [(0, 0), (1, 0), (1, 1), (4, 1), (4, 2)].map(|(node, of)| averages.at(node, of)),
            [1.0, 2.0, 2.0, 3.0, 7.0]
        );
        assert!(averages.at(9, 0).is_nan());
        let averages = NodalAverages::of(&fields, &[1.0, f64::NAN, f64::NAN]);
        assert!(averages.at(1, 1) == 1.0 && averages.at(4, 1).is_nan() && averages.at(1, 2).is_nan());
    }
}
