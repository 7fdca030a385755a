//! The case, the mesh and the networks that a checkpoint belongs to.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::app::case::{
    Case, FiberRve, Formula, FormulaCase, MeshSource, NetworkAssignment, NetworkPattern, OutputCase, RegionMaterial,
    RveScale, ScalesCase, formula_entries,
};
use crate::checksum::Fnv;
use crate::fem::element::CellType;
use crate::fem::mesh::{Cells, Mesh};
use crate::fiber::law::{FiberLaw, FiberMaterial, Law};
use crate::fiber::network::Network;
use crate::tissue::materials::{Formulas, Region};
use crate::tissue::micro_scale::TissueMaterial;

/// The case, mesh and networks of a run, without the location of files, the title and the output settings.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// Version of the program.
    program: String,
    /// The linear-algebra backend.
    backend: String,
    /// The case as text.
    case: String,
    /// Hash of the mesh.
    mesh: u64,
    /// Hash of the networks.
    networks: u64,
}

/// The reason why a run cannot resume from the state of another.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum Mismatch {
    /// The cases differ.
    #[error("the case differs in {section}: {} before, {} now", entry(before), entry(now))]
    Case {
        /// The table of the case, such as `[steps]`.
        section: String,
        /// The line in the checkpoint; empty if there was none.
        before: String,
        /// The line in the current case; empty if there is none.
        now: String,
    },
    /// The meshes differ.
    #[error("the mesh differs (nodes, elements, regions or surfaces)")]
    Mesh,
    /// The values of material parameters or axes, the choice of networks or the fiber volume fractions differ.
    #[error("the material fields differ (parameters, axes, networks or fiber volume fractions by element)")]
    Fields,
    /// The networks differ.
    #[error("the fiber networks differ (nodes, fibers or materials)")]
    Networks,
}

fn entry(line: &str) -> String {
    if line.is_empty() { "nothing".into() } else { format!("`{line}`") }
}

impl Identity {
    /// Returns the identity of a run on a mesh with this hash ([`hash_of_mesh`]), whose materials have this hash
    /// ([`hash_of_fields`]).
    pub fn new(backend: &str, case: &Case, (mesh, fields): (u64, Option<u64>), field: &impl TissueMaterial) -> Self {
        let mut networks = Fnv::new();
        for model in field.library().models() {
            hash_network(model.network(), &mut networks);
        }
        Self {
            program: env!("CARGO_PKG_VERSION").into(),
            backend: backend.into(),
            case: text_of(case) + &fields_entry(fields),
            mesh,
            networks: networks.finish(),
        }
    }

    /// Checks whether run `now` can resume from a state of this run. Returns differences that may slightly change the
    /// results: another version, backend, or solver setting.
    ///
    /// # Errors
    /// Returns [`Mismatch`] if the case, the mesh or the networks differ otherwise.
    pub fn check(&self, now: &Self) -> Result<Vec<String>, Mismatch> {
        let mut remarks = Vec::new();
        for (what, before, now) in [("version", &self.program, &now.program), ("backend", &self.backend, &now.backend)]
        {
            if before != now {
                remarks.push(format!("{what} {before} before, {now} now"));
            }
        }
        let ((before, set_before), (after, set_now)) = (without_optional(&self.case), without_optional(&now.case));
        for (before, now) in set_before.into_iter().zip(set_now).filter(|(before, now)| before != now) {
            let entry = |line: Option<&str>| line.map_or("the default".into(), entry);
            remarks.push(format!("[micro] {} before, {} now", entry(before), entry(now)));
        }
        for Difference { section, before, now } in differences(&before, &after) {
            if is_setting(section, before, now) {
                remarks.push(format!("{section} {} before, {} now", entry(before), entry(now)));
            } else if section == FIELDS {
                return Err(Mismatch::Fields);
            } else {
                return Err(Mismatch::Case { section: section.into(), before: before.into(), now: now.into() });
            }
        }
        if self.mesh != now.mesh {
            return Err(Mismatch::Mesh);
        }
        if self.networks != now.networks {
            return Err(Mismatch::Networks);
        }
        Ok(remarks)
    }
}

/// Returns true if a run of case `now` can continue one of case `before`, as far as the cases show: if they differ in nothing
/// but settings.
pub(in crate::app) fn is_same_run(before: &Case, now: &Case) -> bool {
    let (before, now) = (text_of(before), text_of(now));
    let ((before, _), (now, _)) = (without_optional(&before), without_optional(&now));
    differences(&before, &now).iter().all(|of| is_setting(of.section, of.before, of.now))
}

/// What the division of a body depends on.
pub(in crate::app) struct DivisionCase {
    /// The case as text.
    pub text: String,
    /// The files that its mesh and its fields come from, once for each use.
    pub files: Vec<PathBuf>,
}

/// Returns what the division of the body of a case depends on: the content and the names of files, those in the folder of the
/// case relative to it.
pub(in crate::app) fn division_of(case: &Case) -> DivisionCase {
    let files: Vec<PathBuf> = files_mut(&mut case.clone()).into_iter().map(|file| file.clone()).collect();
    // The points whose networks are written are part of the division.
    let output = OutputCase { rve: case.output.rve.clone(), ..OutputCase::default() };
    let mut text = text_with(case, output);
    let chosen = case.regions.iter().filter_map(|region| match &region.material {
        RegionMaterial::FiberRve(rve) => matches!(rve.assignment, NetworkAssignment::Field(_)).then_some(&rve.networks),
        RegionMaterial::Formula(_) => None,
    });
    let folder = case.folder();
    text.push_str("[files]\n");
    for file in files.iter().chain(chosen.flatten()) {
        text.push_str(&format!("{:?}\n", file.strip_prefix(&folder).unwrap_or(file)));
    }
    DivisionCase { text, files }
}

impl DivisionCase {
    /// Returns the first difference that makes this another division than one of a case with the text `before`.
    pub fn difference_from(&self, before: &str) -> Option<Mismatch> {
        let ((before, _), (now, _)) = (without_optional(before), without_optional(&self.text));
        let is_of_division = |&Difference { section, before, now }: &Difference<'_>| {
            // The solver of the body is chosen with its division.
            let is_solver = section == "[newton]" && [before, now].iter().any(|line| line.starts_with("solver"));
            is_solver || !is_setting(section, before, now)
        };
        let Difference { section, before, now } = differences(&before, &now).into_iter().find(is_of_division)?;
        Some(Mismatch::Case { section: section.into(), before: before.into(), now: now.into() })
    }
}

/// The case as TOML, reduced to the entries that the results depend on.
fn text_of(case: &Case) -> String {
    text_with(case, OutputCase::default())
}

fn text_with(case: &Case, output: OutputCase) -> String {
    let mut case = case.clone();
    case.title.clear();
    case.scales = ScalesCase::default();
    case.output = output;
    // A run stays the same if its folder is moved; the content of the files is compared by hash.
    files_mut(&mut case).into_iter().for_each(|file| *file = name_of(file));
    for region in &mut case.regions {
        let RegionMaterial::FiberRve(rve) = &mut region.material else { continue };
        rve.networks.iter_mut().for_each(|file| *file = name_of(file));
        if let NetworkAssignment::Field(choice) = &mut rve.assignment {
            choice.pattern.iter_mut().for_each(NetworkPattern::remove_folders);
        }
    }
    let text = case.to_toml();
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines.map(|line| format!("{line}\n")).collect()
}

/// The table below the case that holds the hash of the fields.
const FIELDS: &str = "[fields]";

/// Returns a table with the hash of the fields, or nothing without any. The hash is part of the text, so that cases
/// without fields have the same identity as in earlier versions.
fn fields_entry(hash: Option<u64>) -> String {
    hash.map_or_else(String::new, |hash| format!("{FIELDS}\nhash = {hash:016x}\n"))
}

/// Returns the hash of all formulas that are not the same at all points, of networks chosen by fields, and of fiber volume
/// fractions that vary; `None` without any. The materials must be those of the whole body.
pub fn hash_of_fields<'a>(regions: impl IntoIterator<Item = &'a Region>) -> Option<u64> {
    let mut hash = None;
    for region in regions {
        if let RegionMaterial::FiberRve(rve) = &region.material {
            hash_network_fields(&region.name, rve, &mut hash);
        }
        let Some(formulas) = region.material.formula() else { continue };
        let is_custom = formulas.distinct().iter().any(|formula| matches!(**formula, Formula::Custom(_)));
        if !is_custom && matches!(formulas, Formulas::Uniform(_)) {
            continue;
        }
        let hash = hash.get_or_insert_with(Fnv::new);
        hash.add_str(&region.name);
        for (key, value) in formulas.distinct().iter().flat_map(|formula| formula_entries(formula)) {
            hash.add_str(key);
            hash.add_str(&value);
        }
        if let Formulas::Points(points) = formulas {
            points.of_point().iter().for_each(|&formula| hash.add_u64(formula.into()));
        }
    }
    hash.map(|hash| hash.finish())
}

fn hash_network_fields(region: &str, rve: &FiberRve, hash: &mut Option<Fnv>) {
    if let NetworkAssignment::Field(networks) = &rve.assignment {
        let hash = hash.get_or_insert_with(Fnv::new);
        hash.add_str(region);
        hash.add_str("networks");
        networks.of_point().iter().for_each(|&network| hash.add_u64(network.into()));
    }
    if let RveScale::Fractions(fractions) = &rve.scale {
        let hash = hash.get_or_insert_with(Fnv::new);
        hash.add_str(region);
        hash.add_str("fiber_volume_fraction");
        // NaN, outside of the region, may have any bits.
        fractions.of_point().iter().for_each(|&fraction| hash.add_f64(if fraction.is_nan() { 0.0 } else { fraction }));
    }
}

/// Returns the files that the mesh and the fields of a case come from.
fn files_mut(case: &mut Case) -> Vec<&mut PathBuf> {
    let mut files = Vec::new();
    if let MeshSource::File(file) = &mut case.mesh {
        files.push(file);
    }
    for region in &mut case.regions {
        let formula = match &mut region.material {
            RegionMaterial::Formula(formula) => Some(formula),
            RegionMaterial::FiberRve(rve) => {
                if let NetworkAssignment::Field(choice) = &mut rve.assignment {
                    files.extend(choice.files_mut());
                }
                if let RveScale::Fractions(field) = &mut rve.scale {
                    files.extend(field.source.file_mut());
                }
                rve.matrix.as_mut()
            }
        };
        if let Some(FormulaCase::Field(field)) = formula {
            files.extend(field.files_mut());
        }
    }
    files
}

fn name_of(file: &Path) -> PathBuf {
    file.file_name().map_or_else(|| file.into(), PathBuf::from)
}

/// The settings of `[micro]` that have a line only if they are not the default, as in cases of earlier versions.
const OPTIONAL: [&str; 2] = ["device = ", "lanes = "];

/// Returns a case without the lines of [`OPTIONAL`], and these.
fn without_optional(case: &str) -> (String, [Option<&str>; OPTIONAL.len()]) {
    let (mut rest, mut found, mut section) = (String::with_capacity(case.len()), [None; OPTIONAL.len()], "");
    for line in case.lines() {
        if line.starts_with('[') {
            section = line;
        }
        match OPTIONAL.iter().position(|key| section == "[micro]" && line.starts_with(key)) {
            Some(setting) => found[setting] = Some(line),
            None => rest.extend([line, "\n"]),
        }
    }
    (rest, found)
}

struct Difference<'a> {
    section: &'a str,
    before: &'a str,
    now: &'a str,
}

/// Compares the cases line by line; returns the lines that differ, with their table. The solver settings are at the end
/// and have a fixed number of lines, so an additional or missing table elsewhere is found before them.
fn differences<'a>(before: &'a str, now: &'a str) -> Vec<Difference<'a>> {
    let (mut before, mut now, mut section) = (before.lines(), now.lines(), "the title");
    let mut found = Vec::new();
    loop {
        let (before, now) = match (before.next(), now.next()) {
            (None, None) => return found,
            (before, now) => (before.unwrap_or_default(), now.unwrap_or_default()),
        };
        if let Some(table) = [now, before].into_iter().find(|line| line.starts_with('[')) {
            section = table;
        }
        if before != now {
            found.push(Difference { section, before, now });
        }
    }
}

/// Returns true if the line is a solver setting.
fn is_setting(section: &str, before: &str, now: &str) -> bool {
    let both = |key: &str| [before, now].iter().all(|line| line.starts_with(key));
    matches!(section, "[newton]" | "[micro]") && !before.starts_with('[') && !now.starts_with('[')
        || section == "[steps]" && (["max_cuts = ", "adaptive = "].into_iter().any(both))
}

/// Returns the hash of nodes, elements, regions and surfaces of a mesh.
pub fn hash_of_mesh(mesh: &Mesh) -> u64 {
    let mut hash = Fnv::new();
    hash.add_positions(mesh.nodes());
    hash_cells(mesh.elements(), &mut hash);
    mesh.region_of().iter().for_each(|&region| hash.add_u64(region.into()));
    hash.add_u64(mesh.regions().len() as u64);
    mesh.regions().iter().for_each(|region| hash.add_str(region));
    for surface in mesh.surfaces() {
        hash.add_str(&surface.name);
        hash_cells(&surface.faces, &mut hash);
    }
    hash.finish()
}

fn hash_cells<T: CellType>(cells: &Cells<T>, hash: &mut Fnv) {
    for block in cells.blocks() {
        hash.add_u64(block.cell_type().nodes() as u64);
        hash.add_u64(block.len() as u64);
        block.nodes().iter().for_each(|&node| hash.add_u64(node.into()));
    }
}

fn hash_network(network: &Network, hash: &mut Fnv) {
    hash.add_positions(network.nodes());
    hash.add_indices(network.fibers());
    network.material_of().iter().for_each(|&reaction| hash.add_u64(reaction.into()));
    hash.add_u64(network.materials().len() as u64);
    for FiberMaterial { law, radius, .. } in network.materials() {
        hash_law(law, hash);
        hash.add_f64(*radius);
    }
}

/// The laws that the first version knew. Their hash begins with their position in this list, followed by three
/// parameters; that of all later laws, with their name.
const NUMBERED: [&str; 3] = ["linear", "exponential", "exponential-stretch"];

fn hash_law(law: &Law, hash: &mut Fnv) {
    let mut values = |values: &[f64]| values.iter().for_each(|&value| hash.add_f64(value));
    if let Some((formula, parameters)) = law.formula()
        && let Some(number) = NUMBERED.iter().position(|&name| name == formula.name())
    {
        values(&[number as f64]);
        values(&parameters);
        return values(&[0.0; 3][parameters.len().min(3)..]);
    }
    match law {
        Law::Table(table) => {
            values(&[3.0, table.points().len() as f64]);
            values(table.points().as_flattened());
        }
        Law::Buckling { law, compression, buckling_strain } => {
            values(&[4.0, *compression, *buckling_strain]);
            hash_law(law, hash);
        }
        law => {
            values(&[5.0]);
            hash.add_str(law.name());
            for (name, value) in law.parameters() {
                hash.add_str(name);
                hash.add_f64(value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fiber::law::Table;

    #[derive(Debug)]
    struct Hooke(f64);

    impl FiberLaw for Hooke {
        fn name(&self) -> &str {
            "hooke"
        }

        fn parameters(&self) -> Vec<(&'static str, f64)> {
            vec![("youngs_modulus", self.0)]
        }

        fn stress(&self, stretch: f64) -> (f64, f64) {
            (self.0 * (stretch - 1.0), self.0)
        }
    }

    #[test]
    fn every_parameter_of_every_law_changes_the_hash() {
        let table = |stress: f64| Law::table(Table::new(vec![[0.9, -1.0], [1.0, 0.0], [1.1, stress]]).unwrap());
        let linear = |youngs_modulus: f64| Law::Linear { youngs_modulus };
        let exponential = |nonlinearity: f64| Law::Exponential { youngs_modulus: 1.0, nonlinearity };
        let laws = [
            linear(1.0),
            linear(2.0),
            exponential(1.0),
            exponential(2.0),
            Law::ExponentialStretch { youngs_modulus: 1.0, nonlinearity: 1.0, transition: 1.1 },
            Law::ExponentialStretch { youngs_modulus: 1.0, nonlinearity: 1.0, transition: 1.2 },
            table(1.0),
            table(2.0),
            linear(1.0).with_buckling(0.1, 0.01),
            linear(1.0).with_buckling(0.2, 0.01),
            linear(1.0).with_buckling(0.1, 0.02),
            exponential(1.0).with_buckling(0.1, 0.01),
            table(1.0).with_buckling(0.1, 0.01),
            Law::custom(Hooke(1.0)),
            Law::custom(Hooke(2.0)),
        ];
        let sum = |law: &Law| {
            let mut hash = Fnv::new();
            hash_law(law, &mut hash);
            hash.finish()
        };
        for (k, law) in laws.iter().enumerate() {
            assert_eq!(sum(law), sum(&law.clone()));
            for other in &laws[..k] {
                assert_ne!(sum(law), sum(other), "{law:?} {other:?}");
                assert_ne!(law, other);
            }
        }
        assert_eq!(sum(&laws[13]), sum(&Law::custom(Hooke(1.0))));
    }

    /// Settings that have no line at their default leave the lines of the tables behind them where they are.
    #[test]
    fn a_setting_may_change_from_its_default_and_back() {
        let of = |micro: &str| Identity {
            program: "1".into(),
            backend: "sparse".into(),
            case: format!("[[region]]\nlanes = 3\n[micro]\npredictor = true\n{micro}[scales]\nmacro = 1\n[output]\n"),
            mesh: 0,
            networks: 0,
        };
        let [plain, off, device] = ["", "lanes = \"off\"\n", "device = \"cuda\"\nlanes = \"mixed\"\n"].map(of);
        assert_eq!(plain.check(&plain), Ok(vec![]));
        assert_eq!(plain.check(&off), Ok(vec!["[micro] the default before, `lanes = \"off\"` now".into()]));
        let message = |setting: &str| format!("[micro] {setting} before, the default now");
        let both = ["`device = \"cuda\"`", "`lanes = \"mixed\"`"].map(message).to_vec();
        assert_eq!(device.check(&plain), Ok(both));
        assert_eq!(off.check(&device).map(|remarks| remarks.len()), Ok(2));
        let other = Identity { case: off.case.replace("lanes = 3", "lanes = 4"), ..off.clone() };
        assert!(matches!(off.check(&other), Err(Mismatch::Case { section, .. }) if section == "[[region]]"));
    }
}
