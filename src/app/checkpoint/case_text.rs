//! Cases as text, in which the lines that the results depend on are compared.

use std::path::{Path, PathBuf};

use crate::app::case::{
    Case, FormulaCase, MeshSource, NetworkAssignment, NetworkPattern, OutputCase, RegionMaterial, RveScale, ScalesCase,
};

/// The case as TOML, reduced to the entries that the results depend on.
pub(super) fn text_of(case: &Case) -> String {
    text_with(case, OutputCase::default())
}

pub(super) fn text_with(case: &Case, output: OutputCase) -> String {
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

/// Returns the files that the mesh and the fields of a case come from.
pub(super) fn files_mut(case: &mut Case) -> Vec<&mut PathBuf> {
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
pub(super) fn without_optional(case: &str) -> (String, [Option<&str>; OPTIONAL.len()]) {
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

pub(super) struct Difference<'a> {
    pub section: &'a str,
    pub before: &'a str,
    pub now: &'a str,
}

/// Compares the cases line by line; returns the lines that differ, with their table. The solver settings are at the end
/// and have a fixed number of lines, so an additional or missing table elsewhere is found before them.
pub(super) fn differences<'a>(before: &'a str, now: &'a str) -> Vec<Difference<'a>> {
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
pub(super) fn is_setting(section: &str, before: &str, now: &str) -> bool {
    let both = |key: &str| [before, now].iter().all(|line| line.starts_with(key));
    matches!(section, "[newton]" | "[micro]") && !before.starts_with('[') && !now.starts_with('[')
        || section == "[steps]" && (["max_cuts = ", "adaptive = "].into_iter().any(both))
}
