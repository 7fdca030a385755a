//! Reading regions and their materials.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::choice::{INDEX, NetworkChoice};
use super::data::{MaterialCase, RegionCase};
use super::formula::{self, FormulaCase, FormulaModel};
use super::law;
use super::networks;
use super::parameter::{FieldCase, ParameterCase};
use super::problems::alternatives;
use super::range::Range;
use super::table::{Either, Table};
use super::value::did_you_mean;
use crate::fiber::rve::StressScale;
use crate::tissue::materials::{BeforeCreation, FiberRve, NetworkAssignment, RegionMaterial, RveLifecycle, RveScale};

#[derive(Clone, Copy, PartialEq, Eq)]
enum Model {
    Formula(FormulaModel),
    FiberRve,
}

const MODELS: [Model; 7] = [
    Model::Formula(FormulaModel::NeoHookean),
    Model::Formula(FormulaModel::LinearElastic),
    Model::Formula(FormulaModel::TransverselyIsotropic),
    Model::Formula(FormulaModel::HolmesMow),
    Model::Formula(FormulaModel::HolzapfelGasserOgden),
    Model::Formula(FormulaModel::Guccione),
    Model::FiberRve,
];

impl Model {
    fn name(self) -> &'static str {
        match self {
            Self::Formula(formula) => formula.name(),
            Self::FiberRve => "fiber-rve",
        }
    }
}

/// The range of fiber volume fractions.
pub(crate) const FRACTIONS: Range = Range::above_to(0.0, 1.0);

const NAMED_REGION: &str = "the name of a physical volume, or \"*\" for every volume not named";

/// Reads all regions and reports duplicate names.
pub(super) fn regions(root: &mut Table<'_>, base: &Path) -> Vec<RegionCase> {
    let mut regions = Vec::new();
    let mut names: HashMap<&str, usize> = HashMap::new();
    let tables = root.tables("region");
    if tables.is_empty() && !root.has("region") {
        root.report("has no region", "at least one [[region]]", "add [[region]] with `name` and `material`");
    }
    for mut table in tables {
        let line = table.line;
        let value = table.require("name", NAMED_REGION);
        let name = value.as_ref().and_then(|value| value.text(NAMED_REGION));
        let twin = name.and_then(|name| names.get(name));
        if let (Some(value), Some(before)) = (value, twin) {
            let complaint = format!("is the name of the region at line {before} too");
            value.report_error(&complaint, "one [[region]] for each name", "remove or rename one of them");
        }
        if let Some(name) = name {
            names.entry(name).or_insert(line);
        }
        let f_bar = table.boolean("f_bar").unwrap_or(false);
        if table.has("model")
            && let Some(model) = table.get("model")
        {
            // One error for all keys of the material.
            model.report_error(
                "is a key of the material, but stands directly below [[region]]",
                "`name`, `f_bar` and `material`, a table, below [[region]]",
                "write the header [region.material] above the keys of the material",
            );
            continue;
        }
        let material = table.required_table("material", "a table with its `model`");
        let material = material.and_then(|material| read(material, base));
        regions.extend(name.zip(material).map(|(name, material)| RegionCase {
            name: name.into(),
            line,
            f_bar,
            material,
        }));
        table.report_unknown_keys();
    }
    regions
}

fn read(mut table: Table<'_>, base: &Path) -> Option<MaterialCase> {
    let material = match model(&mut table, |_| true)? {
        Model::Formula(model) => formula::read(model, &mut table, base).map(RegionMaterial::Formula),
        Model::FiberRve => fiber_rve(&mut table, base).map(RegionMaterial::FiberRve),
    };
    table.report_unknown_keys();
    material
}

/// Reads the model of a material; only models for which `allowed` returns true are valid.
fn model(table: &mut Table<'_>, allowed: impl Fn(Model) -> bool) -> Option<Model> {
    let allowed: Vec<Model> = MODELS.into_iter().filter(|&model| allowed(model)).collect();
    let names: Vec<&str> = allowed.iter().map(|model| model.name()).collect();
    let expected = alternatives(names.iter().copied(), '"');
    let value = table.require("model", &expected)?;
    let text = value.text(&expected)?;
    let found = allowed.into_iter().find(|model| model.name() == text);
    if found.is_none() {
        value.report_invalid(&*expected, did_you_mean(text, &names));
    }
    found
}

fn fiber_rve(table: &mut Table<'_>, base: &Path) -> Option<FiberRve<FormulaCase, NetworkChoice, FieldCase>> {
    let networks = networks(table, base);
    // Without fibers the RVE is its matrix alone: the single-scale material, evaluated by the micro scale.
    let bare = networks.as_ref().is_some_and(|(files, _)| files.is_empty());
    let seed = table.integer("seed", 0..=i64::MAX.unsigned_abs());
    let scaled = table.has("fiber_volume_fraction") || table.has("scale");
    let scale = match (!bare || scaled).then(|| table.either("fiber_volume_fraction", "scale")).flatten() {
        Some(Either::First(fraction)) => {
            ParameterCase::read(&fraction, FRACTIONS, base).map(|fraction| match fraction {
                ParameterCase::Number(fraction) => StressScale::FiberVolumeFraction(fraction).into(),
                ParameterCase::Field(field) => RveScale::Fractions(field),
            })
        }
        Some(Either::Second(scale)) => scale.choice(&[("raw", StressScale::Raw)]).map(RveScale::from),
        None => bare.then_some(StressScale::Raw.into()),
    };
    let law = table.table("law").map(|table| law::read(table, base));
    let has_matrix = table.has("matrix");
    let matrix = table.table("matrix").map(|table| matrix(table, base));
    let lifecycle = table.table("life").map(|table| lifecycle(table, has_matrix)).unwrap_or_default();
    let (networks, assignment) = networks?;
    Some(FiberRve {
        networks,
        assignment,
        seed: seed.unwrap_or(1),
        scale: scale?,
        law: law.flatten(),
        matrix: matrix.flatten(),
        lifecycle,
    })
}

/// Reads the networks, and how they are assigned to points.
fn networks(table: &mut Table<'_>, base: &Path) -> Option<(Vec<PathBuf>, NetworkAssignment<NetworkChoice>)> {
    let listed = table.require("networks", "network files, such as [\"networks/*.txt\"]");
    let choose = table.get("choose");
    let words = [("random", NetworkAssignment::Random), ("cycle", NetworkAssignment::Cycle)];
    let word = choose.as_ref().filter(|choose| choose.inner.is_str()).map(|choose| choose.choice(&words));
    let value = listed?;
    let networks::Listed { mut files, pattern } = networks::resolve(&value, base)?;
    if files.is_empty() && !table.has("matrix") {
        value.report_invalid(
            networks::EXPECTED,
            "name at least one network file, or add a `matrix`, which is then the only material",
        );
        return None;
    }
    let assignment = match (choose, pattern) {
        (Some(choose), pattern) if choose.inner.is_table() => {
            let is_index = pattern.is_none();
            let choice = NetworkChoice::read(&choose, pattern, base)?;
            if is_index {
                // An index counts the files as they are listed.
                return Some((files, NetworkAssignment::Field(choice)));
            }
            NetworkAssignment::Field(choice)
        }
        (_, Some(pattern)) => {
            let names = pattern.names().join("`, `");
            let complaint = format!("has a path with places for `{names}`, but `choose` has no fields for them");
            let cure = format!("add `choose = {{ {} = ... }}`", pattern.names().join(" = ..., "));
            value.report_error(&complaint, networks::EXPECTED, cure);
            return None;
        }
        (None, None) => NetworkAssignment::Random,
        (Some(_), None) if word.is_some() => word??,
        (Some(choose), None) => {
            let cure = format!("write one of these, or a table such as {{ {INDEX} = {{ cells = \"network\" }} }}");
            choose.report_invalid("\"random\", \"cycle\", or fields that choose networks", cure);
            return None;
        }
    };
    files.sort();
    files.dedup();
    Some((files, assignment))
}

/// Reads when RVEs are created, sleep and are deleted. Reports an error if the matrix must replace the network but
/// `has_matrix` is false.
fn lifecycle(mut table: Table<'_>, has_matrix: bool) -> RveLifecycle {
    let default = RveLifecycle::default();
    let strain = Range::above(0.0, "");
    let lifecycle = RveLifecycle {
        created_at: table.number("created_at", strain).unwrap_or(default.created_at),
        before: table
            .choice("before", &[("linear", BeforeCreation::Linear), ("matrix", BeforeCreation::Matrix)])
            .unwrap_or(default.before),
        asleep_below: table.number("asleep_below", strain).unwrap_or(default.asleep_below),
        deleted_at: table.number("deleted_at", strain).unwrap_or(default.deleted_at),
    };
    let needs = [
        ("before = \"matrix\"", lifecycle.before == BeforeCreation::Matrix),
        ("deleted_at", lifecycle.deleted_at.is_finite()),
    ];
    for (key, _) in needs.iter().filter(|(_, is_given)| *is_given && !has_matrix) {
        let complaint = format!("has `{key}`, but its region has no `matrix` for the stress without the network");
        table.report(&complaint, "a matrix in parallel", format!("give the material a `matrix`, or remove `{key}`"));
    }
    if lifecycle.deleted_at <= lifecycle.created_at {
        table.report("deletes RVEs before it creates them", "`deleted_at` above `created_at`", "correct one of them");
    }
    table.report_unknown_keys();
    lifecycle
}

/// Reads the matrix in parallel, which is a formula of finite strain.
fn matrix(mut table: Table<'_>, base: &Path) -> Option<FormulaCase> {
    let is_finite_strain = |model| !matches!(model, Model::FiberRve | Model::Formula(FormulaModel::LinearElastic));
    let Model::Formula(model) = model(&mut table, is_finite_strain)? else { return None };
    let formula = formula::read(model, &mut table, base);
    table.report_unknown_keys();
    formula
}
