//! Reading the fiber law of a case.

use std::path::Path;

use crate::fiber::law::{BUCKLING_STRAIN, COMPRESSION, FiberMaterial, Law, Table as Curve};

use super::networks::missing_file;
use super::problems::alternatives;
use super::range::Range;
use super::table::{Either, Table};
use super::value::Value;

#[derive(Clone, Copy, PartialEq, Eq)]
enum LawName {
    Linear,
    Exponential,
    ExponentialStretch,
    Table,
}

const LAWS: [(&str, LawName); 4] = [
    ("linear", LawName::Linear),
    ("exponential", LawName::Exponential),
    ("exponential-stretch", LawName::ExponentialStretch),
    ("table", LawName::Table),
];

const POSITIVE: Range = Range::above(0.0, "");

/// Reads the law of all fibers. The path of a table file is relative to `base`, the folder of the case.
pub(super) fn read(mut table: Table<'_>, base: &Path) -> Option<FiberMaterial> {
    let names = alternatives(LAWS.iter().map(|&(name, _)| name), '"');
    let name = table.require("name", &names).and_then(|value| value.choice(&LAWS));
    let radius = table.required_number("radius", Range::above(0.0, "m"));
    let buckling = buckling(&mut table);
    let law = match name {
        Some(name) => law(&mut table, name, base),
        None => judge_values(&mut table),
    };
    table.report_unknown_keys();
    let law = match buckling? {
        None => law?,
        Some([compression, strain]) => law?.with_buckling(compression, strain),
    };
    Some(FiberMaterial { law, radius: radius?, density: None })
}

/// Checks only the ranges of the parameters, because an unknown law name leaves open which parameters belong to it.
fn judge_values(table: &mut Table<'_>) -> Option<Law> {
    table.number("youngs_modulus", Range::above(0.0, "Pa"));
    table.number("nonlinearity", POSITIVE);
    table.number("transition", Range::above(1.0, ""));
    table.get("file");
    table.get("points");
    None
}

/// Returns residual stiffness and buckling strain if the table has one of them; the outer `None` means that a value was
/// invalid.
fn buckling(table: &mut Table<'_>) -> Option<Option<[f64; 2]>> {
    let (compression, strain) = (table.get("compression"), table.get("buckling_strain"));
    if compression.is_none() && strain.is_none() {
        return Some(None);
    }
    let compression = compression.map_or(Some(COMPRESSION), |value| value.number(Range::from_to(0.0, 1.0)));
    let strain = strain.map_or(Some(BUCKLING_STRAIN), |value| value.number(POSITIVE));
    Some(Some([compression?, strain?]))
}

fn law(table: &mut Table<'_>, name: LawName, base: &Path) -> Option<Law> {
    if name == LawName::Table {
        for (key, owner) in [("youngs_modulus", "linear"), ("nonlinearity", "exponential")] {
            unused(table.get(key), owner, "table");
        }
        unused(table.get("transition"), "exponential-stretch", "table");
        return curve(table, base).map(Law::table);
    }
    let own = LAWS.iter().find(|(_, law)| *law == name).map_or("", |&(name, _)| name);
    for key in ["file", "points"] {
        unused(table.get(key), "table", own);
    }
    let youngs_modulus = table.required_number("youngs_modulus", Range::above(0.0, "Pa"));
    let nonlinearity = match name {
        LawName::Linear => unused(table.get("nonlinearity"), "exponential", own),
        _ => table.required_number("nonlinearity", POSITIVE),
    };
    let transition = match name {
        LawName::ExponentialStretch => table.required_number("transition", Range::above(1.0, "")),
        _ => unused(table.get("transition"), "exponential-stretch", own),
    };
    let youngs_modulus = youngs_modulus?;
    Some(match name {
        LawName::ExponentialStretch => {
            Law::ExponentialStretch { youngs_modulus, nonlinearity: nonlinearity?, transition: transition? }
        }
        LawName::Exponential => Law::Exponential { youngs_modulus, nonlinearity: nonlinearity? },
        _ => Law::Linear { youngs_modulus },
    })
}

/// Reports a parameter that does not belong to the chosen law.
fn unused(value: Option<Value<'_>>, owner: &str, law: &str) -> Option<f64> {
    let value = value?;
    value.report_error(
        &format!("has no meaning for the law \"{law}\""),
        format!("only the parameters of \"{law}\""),
        format!("remove it, or choose the law \"{owner}\""),
    );
    None
}

/// Reads the curve of a tabulated law from its CSV file or from points in the case.
fn curve(table: &mut Table<'_>, base: &Path) -> Option<Curve> {
    match table.either("file", "points")? {
        Either::First(file) => {
            let expected = "a CSV file with the columns stretch and nominal stress in Pa, relative to the case file";
            let text = file.text(expected)?;
            let path = base.join(text);
            if !path.is_file() {
                file.report_error(&format!("names {text:?}, which is no file"), expected, missing_file(&path));
                return None;
            }
            match Curve::read(&path) {
                Ok(curve) => Some(curve),
                Err(errors) => {
                    // Reported at the line of the case, so that all errors stay in the order of its lines.
                    for error in errors.0 {
                        let place = error.line.map(|line| format!("{text}:{line}")).unwrap_or_else(|| text.into());
                        file.report_error(
                            &format!("names a table with an error: {place}: {}", error.what),
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
                    place.report_error(&format!("makes no law: {error}"), error.expected(), error.cure());
                })
                .ok()
        }
    }
}
