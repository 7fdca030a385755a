//! Reading and writing of the materials that are formulas.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;

use super::elastic;
use super::parameter::{AxisCase, ParameterCase, required};
use super::range::Range;
use super::table::Table;
use super::write::{Entry, entry};
use crate::fem::material::{Guccione, HolmesMow, HolzapfelGasserOgden, LinearElastic, NeoHookean, TransverseModuli};
use crate::tissue::materials::{CustomMaterial, Formula, TransverseFormula};

/// A formula as a case gives it.
#[derive(Clone, Debug, PartialEq)]
pub enum FormulaCase {
    /// The same at all points.
    Constant(Formula),
    /// Parameters or axes that vary over the body.
    Field(FieldFormula),
}

/// A formula with parameters or axes that vary over the body.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldFormula {
    /// The formula.
    pub model: FormulaModel,
    /// The parameters with their keys.
    pub parameters: Vec<(&'static str, ParameterCase)>,
    /// The axes of the families of fibers.
    pub axes: Vec<AxisCase>,
    /// The key of the material in the case file, such as `region.material`.
    pub key: String,
    /// Line of the case file.
    pub line: usize,
}

/// A kind of formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FormulaModel {
    /// Neo-Hookean.
    NeoHookean,
    /// Linear elasticity at small strain.
    LinearElastic,
    /// Transversely isotropic, of Bonet and Burton.
    TransverselyIsotropic,
    /// Of Holmes and Mow.
    HolmesMow,
    /// Of Holzapfel, Gasser and Ogden.
    HolzapfelGasserOgden,
    /// Of Guccione.
    Guccione,
}

/// Constants in their ranges that do not define a stable material.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Unstable {
    /// What the constants give.
    pub what: String,
    /// The expected constants.
    pub expected: &'static str,
    /// The action that the user should take.
    pub cure: &'static str,
}

const MODULUS: Range = Range::above(0.0, "Pa");
const EXPONENT: Range = Range::above(0.0, "");
const POISSON_RATIO: Range = Range::between(-1.0, 0.5);
const DISPERSION: Range = Range::from_to(0.0, 1.0 / 3.0);

impl FormulaModel {
    /// The name in a case.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::NeoHookean => "neo-hookean",
            Self::LinearElastic => "linear-elastic",
            Self::TransverselyIsotropic => "transversely-isotropic",
            Self::HolmesMow => "holmes-mow",
            Self::HolzapfelGasserOgden => "holzapfel-gasser-ogden",
            Self::Guccione => "guccione",
        }
    }

    fn is_isotropic(self) -> bool {
        matches!(self, Self::NeoHookean | Self::LinearElastic | Self::HolmesMow)
    }

    /// The parameters in the order of their keys, without the elastic constants of isotropic formulas.
    fn parameters(self) -> &'static [(&'static str, Range)] {
        match self {
            Self::NeoHookean | Self::LinearElastic => &[],
            Self::HolmesMow => &[("beta", EXPONENT)],
            Self::TransverselyIsotropic => &[
                ("youngs_modulus", MODULUS),
                ("poisson_ratio", POISSON_RATIO),
                ("axial_youngs_modulus", MODULUS),
                ("axial_shear_modulus", MODULUS),
            ],
            Self::HolzapfelGasserOgden => &[
                ("shear_modulus", MODULUS),
                ("k1", MODULUS),
                ("k2", EXPONENT),
                ("dispersion", DISPERSION),
                ("bulk_modulus", MODULUS),
            ],
            Self::Guccione => {
                &[("c", MODULUS), ("bf", EXPONENT), ("bt", EXPONENT), ("bfs", EXPONENT), ("bulk_modulus", MODULUS)]
            }
        }
    }

    /// The range of a parameter.
    pub(crate) fn range(self, key: &str) -> Range {
        let elastic = elastic::KEYS.iter().filter(|_| self.is_isotropic());
        let mut all = self.parameters().iter().chain(elastic);
        all.find(|(name, _)| *name == key).map_or(Range::any(""), |(_, range)| *range)
    }

    /// Makes the formula from parameters in their ranges and unit axes.
    pub(crate) fn formula(
        self,
        value: &dyn Fn(&str) -> Option<f64>,
        axes: &[Vector3<f64>],
    ) -> Result<Formula, Unstable> {
        let of = |key: &str| value(key).unwrap_or_default();
        let axis = axes.first().copied().unwrap_or_default();
        let lame = || elastic::lame_constants(value);
        Ok(match self {
            Self::NeoHookean => lame().map(|[mu, lambda]| Formula::NeoHookean(NeoHookean { mu, lambda }))?,
            Self::LinearElastic => lame().map(|[mu, lambda]| Formula::LinearElastic(LinearElastic { mu, lambda }))?,
            Self::HolmesMow => {
                let [mu, lambda] = lame()?;
                Formula::HolmesMow(HolmesMow { mu, lambda, beta: of("beta") })
            }
            Self::TransverselyIsotropic => {
                let moduli = TransverseModuli {
                    youngs_modulus: of("youngs_modulus"),
                    poisson_ratio: of("poisson_ratio"),
                    axial_youngs_modulus: of("axial_youngs_modulus"),
                    axial_shear_modulus: of("axial_shear_modulus"),
                };
                let formula = TransverseFormula::new(moduli, axis.into()).ok_or_else(|| Unstable {
                    what: format!("gives m = {} with m = 1 - nu - 2 nu^2 E_A / E", rounded(moduli.stability())),
                    expected: "constants of a stable material: m above 0",
                    cure: "reduce `poisson_ratio` or `axial_youngs_modulus`",
                })?;
                Formula::TransverselyIsotropic(formula)
            }
            Self::HolzapfelGasserOgden => Formula::HolzapfelGasserOgden(HolzapfelGasserOgden {
                mu: of("shear_modulus"),
                k1: of("k1"),
                k2: of("k2"),
                dispersion: of("dispersion"),
                bulk_modulus: of("bulk_modulus"),
                axes: [axes.first().copied(), axes.get(1).copied()],
            }),
            Self::Guccione => Formula::Guccione(Guccione {
                c: of("c"),
                bf: of("bf"),
                bt: of("bt"),
                bfs: of("bfs"),
                bulk_modulus: of("bulk_modulus"),
                axis,
            }),
        })
    }
}

fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

/// Reads the parameters of a formula.
pub(super) fn read(model: FormulaModel, table: &mut Table<'_>, base: &Path) -> Option<FormulaCase> {
    let elastic = if model.is_isotropic() { elastic::read(table, base) } else { Some(Vec::new()) };
    let mut others = Vec::new();
    for &(key, range) in model.parameters() {
        // All fibers lie along their axis where nothing else is given.
        let parameter = if key == "dispersion" && !table.has(key) {
            table.get(key);
            Some(ParameterCase::Number(0.0))
        } else {
            required(table, key, range, base)
        };
        others.push(parameter.map(|parameter| (key, parameter)));
    }
    let axes = match model {
        FormulaModel::HolzapfelGasserOgden => axes(table, base),
        FormulaModel::TransverselyIsotropic | FormulaModel::Guccione => {
            let axis = table.require("axis", AxisCase::EXPECTED);
            axis.and_then(|value| AxisCase::read(&value, base)).map(|axis| vec![axis])
        }
        _ => Some(Vec::new()),
    };
    let (mut parameters, axes) = (elastic?, axes?);
    parameters.extend(others.into_iter().collect::<Option<Vec<_>>>()?);
    let number = |key: &str| parameters.iter().find(|(name, _)| *name == key).and_then(|(_, of)| of.number());
    let constant_axes: Option<Vec<Vector3<f64>>> = axes.iter().map(AxisCase::constant).collect();
    match constant_axes.filter(|_| parameters.iter().all(|(_, parameter)| parameter.number().is_some())) {
        Some(axes) => match model.formula(&number, &axes) {
            Ok(formula) => Some(FormulaCase::Constant(formula)),
            Err(Unstable { what, expected, cure }) => {
                table.report(&what, expected, cure);
                None
            }
        },
        None => {
            let (key, line) = (table.path().to_owned(), table.line);
            Some(FormulaCase::Field(FieldFormula { model, parameters, axes, key, line }))
        }
    }
}

/// Reads the axes of one or two families of fibers.
fn axes(table: &mut Table<'_>, base: &Path) -> Option<Vec<AxisCase>> {
    const AXES: &str = "the directions of one or two families of fibers: a list of vectors";
    let value = table.require("axes", AXES)?;
    let listed = value.list(AXES, "a list of one or two vectors, such as [[1.0, 0.0, 0.0]]")?;
    let read: Vec<Option<AxisCase>> = listed.iter().map(|axis| AxisCase::read(axis, base)).collect();
    if !(1..=2).contains(&read.len()) {
        value.report_error(&format!("has {} vectors", read.len()), AXES, "give the axis of each family");
        return None;
    }
    read.into_iter().collect()
}

impl FormulaCase {
    /// Returns true for the formula of small strains.
    pub fn is_small_strain(&self) -> bool {
        match self {
            Self::Constant(formula) => matches!(formula, Formula::LinearElastic(_)),
            Self::Field(field) => field.model == FormulaModel::LinearElastic,
        }
    }

    /// Returns the formula if it is the same at all points.
    pub fn constant(&self) -> Option<&Formula> {
        if let Self::Constant(formula) = self { Some(formula) } else { None }
    }

    /// Formats the model and the parameters.
    pub(super) fn entries(&self) -> Vec<Entry<'static>> {
        match self {
            Self::Constant(formula) => entries(formula),
            Self::Field(field) => field.entries(),
        }
    }
}

impl FieldFormula {
    /// Returns the files that the fields are read from, without the mesh.
    pub fn files_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        let parameters = self.parameters.iter_mut().map(|(_, parameter)| parameter);
        let (mut scalars, mut fields) = (parameters.collect::<Vec<_>>(), Vec::new());
        for axis in &mut self.axes {
            match axis {
                AxisCase::Constant(_) => {}
                AxisCase::Components(components) => scalars.extend(components),
                AxisCase::Field(field) => fields.push(field),
            }
        }
        let of_scalars = scalars.into_iter().filter_map(|parameter| match parameter {
            ParameterCase::Number(_) => None,
            ParameterCase::Field(field) => Some(field),
        });
        of_scalars.chain(fields).filter_map(|field| field.source.file_mut())
    }

    fn entries(&self) -> Vec<Entry<'static>> {
        let mut entries = vec![entry("model", self.model.name())];
        entries.extend(self.parameters.iter().map(|(key, parameter)| (*key, parameter.toml())));
        let axes: Vec<String> = self.axes.iter().map(AxisCase::toml).collect();
        entries.extend(match (self.model, &axes[..]) {
            (FormulaModel::HolzapfelGasserOgden, axes) => Some(("axes", format!("[{}]", axes.join(", ")))),
            (_, [axis]) => Some(("axis", axis.clone())),
            _ => None,
        });
        entries
    }
}

/// Formats the model and the parameters of a formula.
pub(crate) fn entries(formula: &Formula) -> Vec<Entry<'static>> {
    let lame = |model: FormulaModel, mu: f64, lambda: f64| {
        vec![entry("model", model.name()), entry("shear_modulus", mu), entry("lame_lambda", lambda)]
    };
    let vector = |axis: &Vector3<f64>| <[f64; 3]>::from(*axis);
    match formula {
        Formula::NeoHookean(NeoHookean { mu, lambda }) => lame(FormulaModel::NeoHookean, *mu, *lambda),
        Formula::LinearElastic(LinearElastic { mu, lambda }) => lame(FormulaModel::LinearElastic, *mu, *lambda),
        Formula::HolmesMow(HolmesMow { mu, lambda, beta }) => {
            let mut entries = lame(FormulaModel::HolmesMow, *mu, *lambda);
            entries.push(entry("beta", beta));
            entries
        }
        Formula::TransverselyIsotropic(formula) => {
            let TransverseModuli { youngs_modulus, poisson_ratio, axial_youngs_modulus, axial_shear_modulus } =
                formula.moduli();
            vec![
                entry("model", FormulaModel::TransverselyIsotropic.name()),
                entry("youngs_modulus", youngs_modulus),
                entry("poisson_ratio", poisson_ratio),
                entry("axial_youngs_modulus", axial_youngs_modulus),
                entry("axial_shear_modulus", axial_shear_modulus),
                entry("axis", formula.axis()),
            ]
        }
        Formula::HolzapfelGasserOgden(HolzapfelGasserOgden { mu, k1, k2, dispersion, bulk_modulus, axes }) => vec![
            entry("model", FormulaModel::HolzapfelGasserOgden.name()),
            entry("shear_modulus", mu),
            entry("k1", k1),
            entry("k2", k2),
            entry("dispersion", dispersion),
            entry("bulk_modulus", bulk_modulus),
            entry("axes", axes.iter().flatten().map(vector).collect::<Vec<_>>()),
        ],
        Formula::Guccione(Guccione { c, bf, bt, bfs, bulk_modulus, axis }) => vec![
            entry("model", FormulaModel::Guccione.name()),
            entry("c", c),
            entry("bf", bf),
            entry("bt", bt),
            entry("bfs", bfs),
            entry("bulk_modulus", bulk_modulus),
            entry("axis", vector(axis)),
        ],
        Formula::Custom(material) => custom_entries(material),
    }
}

/// Formats a material of another crate, which no case file can name, with all its parameters.
fn custom_entries(material: &CustomMaterial) -> Vec<Entry<'static>> {
    let parameters = material.material().parameters().into_iter().map(|(key, value)| entry(key, value));
    std::iter::once(entry("model", material.material().name())).chain(parameters).collect()
}
