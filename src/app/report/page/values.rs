//! The table of the values of the elements: mean, median, 95th percentile and extremes.

use std::fmt::Write;

use super::Run;
use crate::app::report::quantity::Quantity;
use crate::app::report::units::{escape, prefix, significant};

/// The smallest value, the median, the mean, the 95th percentile and the largest value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Statistics([f64; 5]);

impl Statistics {
    /// Returns the statistics of the finite values; `None` if there are none.
    pub(super) fn of(values: &[f64]) -> Option<Self> {
        let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        // A percentile between two values is interpolated.
        let percentile = |part: f64| {
            let place = part * last as f64;
            let (lower, upper) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
            lower + (upper - lower) * place.fract()
        };
        let mean = sorted.iter().sum::<f64>() / sorted.len() as f64;
        Some(Self([sorted[0], percentile(0.5), mean, percentile(0.95), sorted[last]]))
    }
}

/// The statistics of a quantity at the last step with fields.
pub(super) struct Row {
    label: String,
    /// How many elements have a value, if not all do.
    of_part: String,
    unit: &'static str,
    is_integer: bool,
    numbers: [f64; 5],
}

/// Returns the statistics of the quantities at the last step with fields; those of numbered things, as networks, are
/// omitted.
pub(super) fn rows(run: &Run) -> Vec<Row> {
    let Some(fields) = &run.last_fields else { return Vec::new() };
    let row = |quantity: Quantity| {
        // Iterations can be averaged; elements without RVE have -1.
        let is_counted = !quantity.is_integer || quantity.name == "rve_iterations";
        let values: Vec<f64> = quantity.values.iter().copied().filter(|&x| !quantity.is_integer || x >= 0.0).collect();
        let Statistics(numbers) = Statistics::of(&values).filter(|_| is_counted)?;
        let (count, all) = (values.iter().filter(|value| value.is_finite()).count(), fields.elements.len());
        let of_part = if count < all { format!(" ({count} of {all} elements)") } else { String::new() };
        Some(Row { label: quantity.label, of_part, unit: quantity.unit, is_integer: quantity.is_integer, numbers })
    };
    Quantity::all(fields).into_iter().filter_map(row).collect()
}

/// Returns the power of ten and the prefix of all values of a unit.
pub(super) fn prefix_of_unit(rows: &[Row], unit: &str) -> (f64, &'static str) {
    let numbers = rows.iter().filter(|row| row.unit == unit).flat_map(|row| row.numbers);
    let largest = numbers.map(f64::abs).fold(0.0, f64::max);
    if unit.is_empty() { (1.0, "") } else { prefix(largest) }
}

/// Returns the table of the quantities.
pub(super) fn table(run: &Run, of_quantities: &[Row]) -> String {
    let Some(entry) = run.directory.fields.last() else { return String::new() };
    let mut rows = String::new();
    for Row { label, of_part, unit, is_integer, numbers } in of_quantities {
        let (power, prefix) = prefix_of_unit(of_quantities, unit);
        let label = if unit.is_empty() { label.clone() } else { format!("{label} in {prefix}{unit}") };
        let text = |number: f64| match *is_integer && number.fract() == 0.0 {
            true => format!("{number:.0}"),
            false => significant(number / power),
        };
        let cells = numbers.map(text).join("</td><td>");
        let _ = writeln!(rows, "<tr><td class=\"text\">{}</td><td>{cells}</td></tr>", escape(&(label + of_part)));
    }
    if rows.is_empty() {
        return String::new();
    }
    let within = || format!("at t = {}, within a step", significant(entry.time));
    let of = entry.step().map_or_else(within, |step| format!("at step {step}"));
    format!(
        "<h2>Values of the elements {of}</h2>\n<div class=\"scroll wide\"><table class=\"values\"><thead><tr><th></th>\
         <th>smallest</th><th>median</th><th>mean</th><th>95th percentile</th><th>largest</th></tr></thead>\n<tbody>\n\
         {rows}</tbody></table></div>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_interpolated() {
        let values: Vec<f64> = (0..=20).rev().map(f64::from).chain([f64::NAN]).collect();
        assert_eq!(Statistics::of(&values), Some(Statistics([0.0, 10.0, 10.0, 19.0, 20.0])));
        assert_eq!(Statistics::of(&[1.0, 2.0, 6.0, 9.0]).unwrap().0[1..3], [4.0, 4.5]);
        assert_eq!(Statistics::of(&[f64::NAN]), None);
    }
}
