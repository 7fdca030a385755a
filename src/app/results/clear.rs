//! Removing the files of an earlier run.

use std::fs;
use std::path::{Path, PathBuf};

use super::names::{FileName, numbers};
use super::origin::is_report;
use super::replace::names_in;
use super::{
    CASE_FILE, COSTS_FILE, FAILED_RVE_FOLDER, FIELDS_FILE, LOADS_FILE, LOG_FILE, NETWORKS_FOLDER, POINTS_FILE,
    REPORT_FILE, ResultsError,
};
use crate::output::final_name;

/// Removes the loads, costs, log, fields, integration points, networks and report page of an earlier run, finished or not, from a result
/// directory. Files with other names, checkpoints, and a report page that this program did not write stay. The caller
/// must first check with [`check_origin`](super::check_origin) that the files were written by a run.
///
/// # Errors
/// Returns [`ResultsError::Write`] if a file cannot be removed, or [`ResultsError::Read`] if the report page cannot be
/// read.
pub fn clear(dir: &Path) -> Result<(), ResultsError> {
    let single = [FIELDS_FILE, POINTS_FILE, LOADS_FILE, LOG_FILE, COSTS_FILE];
    remove(dir, |name| single.contains(&name) || is_fields(name))?;
    remove(&dir.join(NETWORKS_FOLDER), is_networks)?;
    remove(&dir.join(FAILED_RVE_FOLDER), is_lost)?;
    let report = dir.join(REPORT_FILE);
    if is_report(&report)? {
        fs::remove_file(&report).map_err(ResultsError::write(&report))?;
    }
    Ok(())
}

/// Removes the unfinished output of an interrupted run: the fields and networks of a state within a step, since a
/// resumed run repeats that step, and temporary files that were being written.
///
/// # Errors
/// Returns [`ResultsError::Write`] if a file cannot be removed.
pub fn clear_unfinished(dir: &Path) -> Result<(), ResultsError> {
    let single = [CASE_FILE, FIELDS_FILE, POINTS_FILE, LOADS_FILE, LOG_FILE, COSTS_FILE, REPORT_FILE];
    remove_as(dir, |name, unfinished| is_partial(name) || unfinished && (single.contains(&name) || is_fields(name)))?;
    remove_as(&dir.join(NETWORKS_FOLDER), |name, unfinished| is_partial(name) || unfinished && is_networks(name))?;
    remove_as(&dir.join(FAILED_RVE_FOLDER), |name, unfinished| unfinished && is_lost(name))
}

/// Removes the fields, integration points and networks of all steps after step `steps`, which a resumed run repeats.
///
/// # Errors
/// Returns [`ResultsError::Write`] if a file cannot be removed.
pub fn clear_after(dir: &Path, steps: usize) -> Result<(), ResultsError> {
    let is_after = |name: &str| FileName::parse(name).and_then(FileName::step).is_some_and(|step| step > steps);
    remove(dir, is_after)?;
    remove(&dir.join(NETWORKS_FOLDER), is_after)
}

/// Returns true if `name` is that of a file of fields.
fn is_fields(name: &str) -> bool {
    FileName::parse(name).is_some_and(FileName::is_fields)
}

/// Returns true if `name` is that of a network file or of a collection of them.
fn is_networks(name: &str) -> bool {
    FileName::parse(name).is_some_and(FileName::is_networks)
}

fn is_partial(name: &str) -> bool {
    FileName::parse(name) == Some(FileName::Partial)
}

/// Returns the path, within a result directory, of the dump of an RVE that failed in a load step.
pub(in crate::app) fn failed_rve_file(step: usize, halvings: u32, element: usize) -> PathBuf {
    Path::new(FAILED_RVE_FOLDER).join(format!("step-{step:05}-cut-{halvings:02}-element-{element}.json"))
}

pub(super) fn is_lost(name: &str) -> bool {
    let numbers = numbers(name, ["step-", "-cut-", "-element-", ".json"]);
    numbers.is_some_and(|[step, cut, element]| {
        u32::try_from(cut)
            .is_ok_and(|cut| failed_rve_file(step, cut, element) == Path::new(FAILED_RVE_FOLDER).join(name))
    })
}

fn remove(folder: &Path, ours: impl Fn(&str) -> bool) -> Result<(), ResultsError> {
    remove_as(folder, |name, _| ours(name))
}

/// Removes the files for which `unwanted` returns true. Its arguments are the final name of the file, and whether the
/// file is still a temporary one.
pub(in crate::app) fn remove_as(folder: &Path, unwanted: impl Fn(&str, bool) -> bool) -> Result<(), ResultsError> {
    for name in names_in(folder).map_err(ResultsError::write(folder))? {
        if unwanted(final_name(&name), final_name(&name) != name) {
            let path = folder.join(&name);
            fs::remove_file(&path).map_err(ResultsError::write(&path))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(dir: &Path) -> Vec<String> {
        let mut names = names_in(dir).unwrap();
        names.sort();
        names
    }

    fn sorted(names: &[&[&'static str]]) -> Vec<&'static str> {
        let mut names: Vec<&str> = names.concat();
        names.sort_unstable();
        names
    }

    #[test]
    fn fields_of_a_body_in_parts_are_removed() {
        let whole = &["fields-00003.pvtu", "fields-00003-part-0002.vtu", ".fields-00003-part-0002.vtu.17.part"][..];
        let partial = &[
            "fields-00003-partial.pvtu",
            "fields-00003-partial-part-0000.vtu",
            ".fields-00003-partial-part-0000.vtu.17.part",
        ][..];
        let points = &["points-00003.vtu", "points-00003.pvtu", "points-00003-part-0002.vtu", "points.pvd"][..];
        let others = &["points-3.vtu", "fields-3.pvtu", "fields-00003-part-2.vtu", "fields-00003-part-0002.pvtu"][..];
        let dir = tempfile::tempdir().unwrap();
        for name in sorted(&[whole, partial, points, others]) {
            fs::write(dir.path().join(name), "").unwrap();
        }
        clear_unfinished(dir.path()).unwrap();
        assert_eq!(names(dir.path()), sorted(&[&whole[..2], points, others]));
        clear_after(dir.path(), 3).unwrap();
        assert_eq!(names(dir.path()), sorted(&[&whole[..2], points, others]));
        clear_after(dir.path(), 2).unwrap();
        assert_eq!(names(dir.path()), sorted(&[&points[3..], others]));
        clear(dir.path()).unwrap();
        assert_eq!(names(dir.path()), sorted(&[others]));
    }
}
