//! Elastic constants: any two of four, converted to the Lame constants.

use super::range::Range;
use super::table::Table;

const KEYS: [(&str, Range); 4] = [
    ("youngs_modulus", Range::above(0.0, "Pa")),
    ("poisson_ratio", Range::between(-1.0, 0.5)),
    ("shear_modulus", Range::above(0.0, "Pa")),
    ("lame_lambda", Range::any("Pa")),
];

/// Reads exactly two constants from `table`, converts them to `[mu, lambda]` in Pa, and reports an error unless shear
/// modulus and bulk modulus are positive and finite.
pub(super) fn lame_constants(table: &mut Table<'_>) -> Option<[f64; 2]> {
    let present = KEYS.map(|(key, _)| table.has(key));
    let given = KEYS.map(|(key, range)| table.number(key, range));
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
    let (shear_modulus, lame_lambda) = reduce(given)?;
    let bulk = lame_lambda + 2.0 / 3.0 * shear_modulus;
    if !(shear_modulus > 0.0 && bulk > 0.0 && shear_modulus.is_finite() && bulk.is_finite()) {
        table.report(
            &format!("gives mu = {shear_modulus} Pa and K = {bulk} Pa from{}", values(&names, given)),
            "constants of a stable material: shear modulus mu > 0 and bulk modulus K = lambda + 2 mu/3 > 0, both finite",
            "correct one of the two constants",
        );
        return None;
    }
    Some([shear_modulus, lame_lambda])
}

fn values(names: &[&str], given: [Option<f64>; 4]) -> String {
    let listed: Vec<String> =
        names.iter().zip(given.into_iter().flatten()).map(|(name, value)| format!(" {name} = {value}")).collect();
    listed.join(",")
}

/// Returns `(mu, lambda)` for two constants; the values are not finite if the constants contradict each other.
fn reduce(given: [Option<f64>; 4]) -> Option<(f64, f64)> {
    Some(match given {
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
        _ => return None,
    })
}
