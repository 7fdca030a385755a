//! Reading the fiber law of a case.

use std::path::Path;

use crate::fiber::law::{
    BUCKLING, BUCKLING_STRAIN, COMPRESSION, FiberMaterial, FormulaLaw, Law, LawName, Parameter, ParameterRange, RADIUS,
    Table as Curve, formula_parameters,
};

use super::problems::alternatives;
use super::range::Range;
use super::table::{Either, Table};

/// Reads the law of all fibers. The path of a table file is relative to `base`, the folder of the case.
pub(super) fn read(mut table: Table<'_>, base: &Path) -> Option<FiberMaterial> {
    let names: Vec<_> = LawName::all().map(|law| (law.as_str(), law)).collect();
    let expected = alternatives(names.iter().map(|&(name, _)| name), '"');
    let name = table.require("name", &expected).and_then(|value| value.choice(&names));
    let radius = table.required_number(RADIUS.name, range(&RADIUS));
    let buckling = buckling(&mut table);
    let law = match name {
        Some(LawName::Formula(formula)) => formula_law(&mut table, formula),
        Some(LawName::Table) => {
            scalars(&mut table, LawName::Table);
            curve(&mut table, base).map(Law::table)
        }
        None => {
            check_ranges(&mut table);
            None
        }
    };
    table.report_unknown_keys();
    let law = match buckling? {
        None => law?,
        Some([compression, strain]) => law?.with_buckling(compression, strain),
    };
    Some(FiberMaterial { law, radius: radius?, density: None })
}

fn range(parameter: &Parameter) -> Range {
    match parameter.range {
        ParameterRange::Above(low) => Range::above(low, parameter.unit),
        ParameterRange::AtLeast(low) => Range::at_least(low, parameter.unit),
        ParameterRange::FromTo(low, high) => Range::from_to(low, high),
    }
}

/// Checks only the ranges of the parameters, because an unknown law name leaves open which parameters belong to it.
fn check_ranges(table: &mut Table<'_>) {
    for parameter in formula_parameters() {
        table.number(parameter.name, range(parameter));
    }
    table.get("file");
    table.get("points");
}

/// Returns residual stiffness and buckling strain if the table has one of them; the outer `None` means that a value was
/// invalid.
fn buckling(table: &mut Table<'_>) -> Option<Option<[f64; 2]>> {
    if !BUCKLING.iter().any(|parameter| table.has(parameter.name)) {
        BUCKLING.iter().for_each(|parameter| drop(table.get(parameter.name)));
        return Some(None);
    }
    let (compression, strain) = (value(table, &COMPRESSION), value(table, &BUCKLING_STRAIN));
    Some(Some([compression?, strain?]))
}

/// Reads a parameter; an absent one has its default, or is reported if it has none.
fn value(table: &mut Table<'_>, parameter: &Parameter) -> Option<f64> {
    match parameter.default {
        Some(default) if !table.has(parameter.name) => {
            table.get(parameter.name);
            Some(default)
        }
        _ => table.required_number(parameter.name, range(parameter)),
    }
}

fn formula_law(table: &mut Table<'_>, formula: FormulaLaw) -> Option<Law> {
    for key in ["file", "points"] {
        report_foreign(table, key, LawName::Table, LawName::Formula(formula));
    }
    let values = scalars(table, LawName::Formula(formula));
    let value_of = |parameter| values.iter().find(|(other, _)| *other == parameter).and_then(|&(_, value)| value);
    formula.law(|parameter| value_of(parameter).ok_or(())).ok()
}

/// Reads the scalar parameters of a law, `None` for an invalid value, and reports those of other laws.
fn scalars(table: &mut Table<'_>, law: LawName) -> Vec<(&'static Parameter, Option<f64>)> {
    let mut values = Vec::new();
    for parameter in formula_parameters() {
        if law.parameters().contains(parameter) {
            values.push((parameter, value(table, parameter)));
        } else if let Some(owner) = LawName::all().find(|owner| owner.parameters().contains(parameter)) {
            report_foreign(table, parameter.name, owner, law);
        }
    }
    values
}

/// Reports a key of the law `owner` that has no meaning for `law`.
fn report_foreign(table: &mut Table<'_>, key: &'static str, owner: LawName, law: LawName) {
    let Some(value) = table.get(key) else { return };
    let (owner, law) = (owner.as_str(), law.as_str());
    value.report_error(
        &format!("has no meaning for the law \"{law}\""),
        format!("only the parameters of \"{law}\""),
        format!("remove it, or choose the law \"{owner}\""),
    );
}

/// Reads the curve of a tabulated law from its CSV file or from points in the case.
fn curve(table: &mut Table<'_>, base: &Path) -> Option<Curve> {
    match table.either("file", "points")? {
        Either::First(file) => {
            let expected = "a CSV file with the columns stretch and nominal stress in Pa, relative to the case file";
            let text = file.text(expected)?;
            let path = file.existing_file(base, expected)?;
            match Curve::read(&path) {
                Ok(curve) => Some(curve),
                Err(errors) => {
                    // Reported at the line of the case, so that all errors stay in the order of its lines.
                    for error in errors.0 {
                        let place = error.line.map(|line| format!("{text}:{line}")).unwrap_or_else(|| text.into());
                        file.report_error(
                            &format!("names a table with an error: {place}: {}", error.problem),
                            error.expected,
                            error.cure,
                        );
                    }
                    None
                }
            }
        }
        Either::Second(list) => {
            let expected = "points: stretch, nominal stress in Pa";
            let points = list.list(expected, "a list of points, such as [[1.0, 0.0], [1.1, 1.0e6]]")?;
            let ranges = [Range::above(0.0, ""), Range::any("Pa")];
            let read: Vec<Option<[f64; 2]>> = points.iter().map(|point| point.pair(ranges, expected)).collect();
            let read = read.into_iter().collect::<Option<Vec<[f64; 2]>>>()?;
            Curve::new(read)
                .map_err(|error| {
                    let place = error.point().and_then(|point| points.get(point)).unwrap_or(&list);
                    let [expected, cure] = error.advice();
                    place.report_error(&format!("does not define a valid law: {error}"), expected, cure);
                })
                .ok()
        }
    }
}
