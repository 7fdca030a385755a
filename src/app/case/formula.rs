//! Reading and writing of the materials that are formulas.

use nalgebra::Vector3;

use super::elastic;
use super::range::Range;
use super::table::Table;
use super::value::Value;
use super::write::{Entry, entry};
use crate::fem::material::{Guccione, HolmesMow, HolzapfelGasserOgden, LinearElastic, NeoHookean, TransverseModuli};
use crate::tissue::materials::{Formula, TransverseFormula};

/// A material that is a formula.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum FormulaModel {
    NeoHookean,
    LinearElastic,
    TransverselyIsotropic,
    HolmesMow,
    HolzapfelGasserOgden,
    Guccione,
}

const MODULUS: Range = Range::above(0.0, "Pa");
const EXPONENT: Range = Range::above(0.0, "");

/// Reads the parameters of a formula.
pub(super) fn read(model: FormulaModel, table: &mut Table<'_>) -> Option<Formula> {
    match model {
        FormulaModel::NeoHookean => {
            elastic::lame_constants(table).map(|[mu, lambda]| Formula::NeoHookean(NeoHookean { mu, lambda }))
        }
        FormulaModel::LinearElastic => {
            elastic::lame_constants(table).map(|[mu, lambda]| Formula::LinearElastic(LinearElastic { mu, lambda }))
        }
        FormulaModel::TransverselyIsotropic => transversely_isotropic(table),
        FormulaModel::HolmesMow => {
            let (constants, beta) = (elastic::lame_constants(table), table.required_number("beta", EXPONENT));
            let ([mu, lambda], beta) = (constants?, beta?);
            Some(Formula::HolmesMow(HolmesMow { mu, lambda, beta }))
        }
        FormulaModel::HolzapfelGasserOgden => holzapfel_gasser_ogden(table),
        FormulaModel::Guccione => guccione(table),
    }
}

fn transversely_isotropic(table: &mut Table<'_>) -> Option<Formula> {
    let youngs_modulus = table.required_number("youngs_modulus", MODULUS);
    let poisson_ratio = table.required_number("poisson_ratio", Range::between(-1.0, 0.5));
    let axial_youngs_modulus = table.required_number("axial_youngs_modulus", MODULUS);
    let axial_shear_modulus = table.required_number("axial_shear_modulus", MODULUS);
    let axis = axis(table);
    let moduli = TransverseModuli {
        youngs_modulus: youngs_modulus?,
        poisson_ratio: poisson_ratio?,
        axial_youngs_modulus: axial_youngs_modulus?,
        axial_shear_modulus: axial_shear_modulus?,
    };
    let formula = TransverseFormula::new(moduli, axis?.into());
    if formula.is_none() {
        let what = format!("gives m = {} with m = 1 - nu - 2 nu^2 E_A / E", (moduli.stability() * 1e6).round() / 1e6);
        let cure = "reduce `poisson_ratio` or `axial_youngs_modulus`";
        table.report(&what, "constants of a stable material: m above 0", cure);
    }
    formula.map(Formula::TransverselyIsotropic)
}

fn holzapfel_gasser_ogden(table: &mut Table<'_>) -> Option<Formula> {
    let mu = table.required_number("shear_modulus", MODULUS);
    let k1 = table.required_number("k1", MODULUS);
    let k2 = table.required_number("k2", EXPONENT);
    let dispersion = table.number("dispersion", Range::from_to(0.0, 1.0 / 3.0));
    let bulk_modulus = table.required_number("bulk_modulus", MODULUS);
    let axes = axes(table);
    Some(Formula::HolzapfelGasserOgden(HolzapfelGasserOgden {
        mu: mu?,
        k1: k1?,
        k2: k2?,
        dispersion: dispersion.unwrap_or(0.0),
        bulk_modulus: bulk_modulus?,
        axes: axes?,
    }))
}

fn guccione(table: &mut Table<'_>) -> Option<Formula> {
    let c = table.required_number("c", MODULUS);
    let [bf, bt, bfs] = ["bf", "bt", "bfs"].map(|key| table.required_number(key, EXPONENT));
    let (bulk_modulus, axis) = (table.required_number("bulk_modulus", MODULUS), axis(table));
    let (bf, bt, bfs) = (bf?, bt?, bfs?);
    Some(Formula::Guccione(Guccione { c: c?, bf, bt, bfs, bulk_modulus: bulk_modulus?, axis: axis? }))
}

const AXIS: &str = "the direction of the fibers: three numbers x, y, z, not all zero";

fn axis(table: &mut Table<'_>) -> Option<Vector3<f64>> {
    unit(&table.require("axis", AXIS)?)
}

/// Reads the axes of one or two families of fibers.
fn axes(table: &mut Table<'_>) -> Option<[Option<Vector3<f64>>; 2]> {
    const AXES: &str = "the directions of one or two families of fibers: a list of vectors";
    let value = table.require("axes", AXES)?;
    let listed = value.list(AXES, "a list of one or two vectors, such as [[1.0, 0.0, 0.0]]")?;
    let read: Vec<Option<Vector3<f64>>> = listed.iter().map(unit).collect();
    match read[..] {
        [first] => Some([Some(first?), None]),
        [first, second] => Some([Some(first?), Some(second?)]),
        _ => {
            let complaint = format!("has {} vectors", read.len());
            value.report_error(&complaint, AXES, "give the axis of each family");
            None
        }
    }
}

/// Reads a vector and divides it by its length. A vector whose length is one up to rounding stays as it is, so that a
/// case that is written and read again does not change.
fn unit(value: &Value<'_>) -> Option<Vector3<f64>> {
    let vector = Vector3::from(value.vector(Range::any(""))?);
    // Scaled first, so that neither large nor small components overflow.
    let largest = vector.amax();
    if largest == 0.0 {
        value.report_error("has no direction", AXIS, "give a vector that is not zero; its length does not matter");
        return None;
    }
    let is_unit = (vector.norm_squared() - 1.0).abs() <= 8.0 * f64::EPSILON;
    Some(if is_unit { vector } else { (vector / largest).normalize() })
}

/// Formats the model and the parameters of a formula.
pub(super) fn entries(formula: &Formula) -> Vec<Entry<'static>> {
    let lame = |model, mu: f64, lambda: f64| {
        vec![entry("model", model), entry("shear_modulus", mu), entry("lame_lambda", lambda)]
    };
    let vector = |axis: &Vector3<f64>| <[f64; 3]>::from(*axis);
    match formula {
        Formula::NeoHookean(NeoHookean { mu, lambda }) => lame("neo-hookean", *mu, *lambda),
        Formula::LinearElastic(LinearElastic { mu, lambda }) => lame("linear-elastic", *mu, *lambda),
        Formula::HolmesMow(HolmesMow { mu, lambda, beta }) => {
            let mut entries = lame("holmes-mow", *mu, *lambda);
            entries.push(entry("beta", beta));
            entries
        }
        Formula::TransverselyIsotropic(formula) => {
            let TransverseModuli { youngs_modulus, poisson_ratio, axial_youngs_modulus, axial_shear_modulus } =
                formula.moduli();
            vec![
                entry("model", "transversely-isotropic"),
                entry("youngs_modulus", youngs_modulus),
                entry("poisson_ratio", poisson_ratio),
                entry("axial_youngs_modulus", axial_youngs_modulus),
                entry("axial_shear_modulus", axial_shear_modulus),
                entry("axis", formula.axis()),
            ]
        }
        Formula::HolzapfelGasserOgden(HolzapfelGasserOgden { mu, k1, k2, dispersion, bulk_modulus, axes }) => vec![
            entry("model", "holzapfel-gasser-ogden"),
            entry("shear_modulus", mu),
            entry("k1", k1),
            entry("k2", k2),
            entry("dispersion", dispersion),
            entry("bulk_modulus", bulk_modulus),
            entry("axes", axes.iter().flatten().map(vector).collect::<Vec<_>>()),
        ],
        Formula::Guccione(Guccione { c, bf, bt, bfs, bulk_modulus, axis }) => vec![
            entry("model", "guccione"),
            entry("c", c),
            entry("bf", bf),
            entry("bt", bt),
            entry("bfs", bfs),
            entry("bulk_modulus", bulk_modulus),
            entry("axis", vector(axis)),
        ],
    }
}
