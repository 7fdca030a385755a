//! Reading volume constraints.

use std::collections::HashMap;

use super::data::ConstraintCase;
use super::load::table_of;
use super::range::Range;
use super::table::{Either, Table};
use super::value::{Value, did_you_mean};
use crate::fem::boundary::LoadCurve;
use crate::fem::constraint::{ConstrainedVolume, ConstraintMethod, VolumeConstraint};
use crate::input::excerpt;
use crate::tissue::materials::OTHER_REGIONS;

/// Reads all volume constraints; their names are unique.
pub(super) fn constraints(root: &mut Table<'_>) -> Vec<ConstraintCase> {
    let mut constraints: Vec<ConstraintCase> = Vec::new();
    let mut lines: HashMap<String, usize> = HashMap::new();
    for mut table in root.tables("constraint") {
        let of = match table.either("region", "cavity") {
            Some(Either::First(region)) => {
                let name = region.text("the name of a physical volume, or \"*\" for all of the body");
                name.map(|name| ConstrainedVolume::Region(name.to_string()))
            }
            Some(Either::Second(surfaces)) => surfaces_of(&surfaces).map(ConstrainedVolume::Cavity),
            None => None,
        };
        let given = table.get("name").map(|value| value.text("the name of the constraint in the results"));
        let curve = target(&mut table);
        let method = method(&mut table);
        if let (Some(of), Some(curve), Some(method), None | Some(Some(_))) = (of, curve, method, given) {
            let default = match &of {
                ConstrainedVolume::Region(region) if region == OTHER_REGIONS => "all",
                ConstrainedVolume::Region(region) => region.as_str(),
                ConstrainedVolume::Cavity(surfaces) => surfaces.first().map_or("", String::as_str),
            };
            let name = given.flatten().unwrap_or(default).to_string();
            if let Some(first) = lines.insert(name.clone(), table.line) {
                let complaint = format!("has the name \"{}\" of the constraint at line {first}", excerpt(&name));
                table.report(&complaint, "a name for each constraint", "give one of them another `name`");
            }
            constraints
                .push(ConstraintCase { line: table.line, constraint: VolumeConstraint { name, of, curve, method } });
        }
        table.report_unknown_keys();
    }
    constraints
}

/// Reads the surfaces of a cavity: one name or a list of names.
fn surfaces_of(value: &Value<'_>) -> Option<Vec<String>> {
    const EXPECTED: &str = "the physical surfaces that enclose the cavity";
    const FORM: &str = "a name or a list of names, such as [\"inner\", \"lid\"]";
    if value.inner.as_str().is_some() {
        return value.text(EXPECTED).map(|name| vec![name.to_string()]);
    }
    let elements = value.list(EXPECTED, FORM)?;
    if elements.is_empty() {
        value.report_invalid(EXPECTED, format!("write {FORM}"));
        return None;
    }
    let mut names: Vec<String> = Vec::with_capacity(elements.len());
    let mut complete = true;
    for element in &elements {
        match element.text(EXPECTED) {
            Some(name) if names.iter().any(|other| other == name) => {
                element.report_error("is given twice", "each surface once", "remove one of the two");
                complete = false;
            }
            Some(name) => names.push(name.to_string()),
            None => complete = false,
        }
    }
    complete.then_some(names)
}

/// Reads the target: `Some(None)` if the volume is constant.
fn target(table: &mut Table<'_>) -> Option<Option<LoadCurve>> {
    const EXPECTED: &str = "\"constant\", or a list of [t, factor] with t ascending from 0 to 1";
    const FORM: &str = "\"constant\" or such as [[0.0, 1.0], [1.0, 1.2]]";
    let value = table.require("volume", EXPECTED)?;
    match value.inner.as_str() {
        Some("constant") => Some(None),
        Some(word) => {
            value.report_invalid(EXPECTED, did_you_mean(word, &["constant"]));
            None
        }
        None => {
            let pair = "[t, factor]: a t from 0 to 1 and the volume over that at rest";
            table_of(&value, [EXPECTED, FORM, pair], Range::above(0.0, "")).map(Some)
        }
    }
}

/// Reads the method with its parameter.
fn method(table: &mut Table<'_>) -> Option<ConstraintMethod> {
    let given = table.get("method").map(|value| value.choice(&[("multiplier", false), ("penalty", true)]));
    let penalty = table.get("penalty");
    match given {
        Some(None) => None,
        Some(Some(true)) => {
            let default = Some(ConstraintMethod::DEFAULT_PENALTY);
            let factor = penalty.map_or(default, |value| value.number(Range::above(0.0, "")))?;
            Some(ConstraintMethod::Penalty { factor })
        }
        None | Some(Some(false)) => {
            if let Some(penalty) = penalty {
                let expected = "a penalty factor only with method = \"penalty\"";
                penalty.report_error("is given for a multiplier", expected, "remove `penalty`, or change the `method`");
            }
            Some(ConstraintMethod::Multiplier)
        }
    }
}
