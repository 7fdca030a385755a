//! Elastic constants: any two of four, converted to the Lame constants.

use std::path::Path;

use super::formula::Unstable;
use super::parameter::ParameterCase;
use super::range::Range;
use super::table::Table;

pub(super) const KEYS: [(&str, Range); 4] = [
    ("youngs_modulus", Range::above(0.0, "Pa")),
    ("poisson_ratio", Range::between(-1.0, 0.5)),
    ("shear_modulus", Range::above(0.0, "Pa")),
    ("lame_lambda", Range::any("Pa")),
];

/// Reads exactly two constants from `table`.
pub(super) fn read(table: &mut Table<'_>, base: &Path) -> Option<Vec<(&'static str, ParameterCase)>> {
    let present = KEYS.map(|(key, _)| table.has(key));
    let given = KEYS.map(|(key, range)| {
        let value = table.get(key)?;
        ParameterCase::read(&value, range, base).map(|parameter| (key, parameter))
    });
    let names: Vec<&str> = KEYS.iter().zip(present).filter(|(_, there)| *there).map(|((key, _), _)| *key).collect();
    if names.len() != 2 {
        let cure = if names.len() < 2 { "add a constant" } else { "remove the additional constants" };
        let listed = names.iter().map(|name| format!(" `{name}`")).collect::<Vec<_>>().join(",");
        let what = match names.len() {
            0 => "has no elastic constants".to_string(),
            1 => format!("has one elastic constant:{listed}"),
            count => format!("has {count} elastic constants:{listed}"),
        };
        table.report(&what, "exactly two of youngs_modulus, poisson_ratio, shear_modulus, lame_lambda", cure);
        return None;
    }
    Some(given.into_iter().flatten().collect()).filter(|given: &Vec<_>| given.len() == 2)
}

/// Converts two constants to `[mu, lambda]` in Pa; an error unless shear modulus and bulk modulus are positive and finite.
pub(super) fn lame_constants(value: &dyn Fn(&str) -> Option<f64>) -> Result<[f64; 2], Unstable> {
    let given = KEYS.map(|(key, _)| value(key));
    let (shear_modulus, lame_lambda) = reduce(given);
    let bulk = lame_lambda + 2.0 / 3.0 * shear_modulus;
    if shear_modulus > 0.0 && bulk > 0.0 && shear_modulus.is_finite() && bulk.is_finite() {
        return Ok([shear_modulus, lame_lambda]);
    }
    let listed = KEYS.iter().zip(given).filter_map(|((name, _), value)| Some(format!(" {name} = {}", value?)));
    let listed: Vec<String> = listed.collect();
    Err(Unstable {
        what: format!("gives mu = {shear_modulus} Pa and K = {bulk} Pa from{}", listed.join(",")),
        expected: "constants of a stable material: shear modulus mu > 0 and bulk modulus K = lambda + 2 mu/3 > 0, both \
                   finite",
        cure: "correct one of the two constants",
    })
}

/// Returns `(mu, lambda)` for two constants; the values are not finite if the constants contradict each other.
fn reduce(given: [Option<f64>; 4]) -> (f64, f64) {
    match given {
        [Some(e), Some(nu), None, None] => (e / (2.0 * (1.0 + nu)), e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))),
        [Some(e), None, Some(mu), None] => (mu, mu * (e - 2.0 * mu) / (3.0 * mu - e)),
        [Some(e), None, None, Some(lambda)] => {
            let root = (e * e + 9.0 * lambda * lambda + 2.0 * e * lambda).sqrt();
            // (e - 3 lambda + root) / 4, rewritten if the subtraction would cancel.
            let away = 3.0 * lambda - e;
            (if away > 0.0 { 2.0 * e * lambda / (root + away) } else { (root - away) / 4.0 }, lambda)
        }
        [None, Some(nu), Some(mu), None] => (mu, 2.0 * mu * nu / (1.0 - 2.0 * nu)),
        [None, Some(nu), None, Some(lambda)] => (lambda * (1.0 - 2.0 * nu) / (2.0 * nu), lambda),
        [None, None, Some(mu), Some(lambda)] => (mu, lambda),
        // `read` returns two constants.
        _ => (f64::NAN, f64::NAN),
    }
}
