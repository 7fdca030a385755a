//! The case that the division of a body belongs to.

use std::path::PathBuf;

use super::case_text::{Difference, differences, files_mut, is_setting, text_with, without_optional};
use super::identity::Mismatch;
use crate::app::case::{Case, NetworkAssignment, OutputCase, RegionMaterial};

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
