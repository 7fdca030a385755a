//! Removing the files of an earlier run.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::collection::{field_file, index_file, partial};
use super::networks::{network_collection, network_file};
use super::origin::is_report;
use super::pieces::part_file;
use super::{
    CASE_FILE, FAILED_RVE_FOLDER, FIELDS_FILE, LOADS_FILE, LOG_FILE, NETWORKS_FOLDER, REPORT_FILE, ResultsError,
};
use crate::output::final_name;

/// Removes the loads, log, fields, networks and report page of an earlier run, finished or not, from a result
/// directory. Files with other names, checkpoints, and a report page that this program did not write stay. The caller
/// must first check with [`check_origin`](super::check_origin) that the files were written by a run.
///
/// # Errors
/// Returns [`ResultsError::Write`] if a file cannot be removed, or [`ResultsError::Read`] if the report page cannot be
/// read.
pub fn clear(dir: &Path) -> Result<(), ResultsError> {
    let single = [FIELDS_FILE, LOADS_FILE, LOG_FILE];
    remove(dir, |name| single.contains(&name) || is_of_step(name))?;
    remove(&dir.join(NETWORKS_FOLDER), |name| is_network(name) || is_partial(name) || is_collection(name))?;
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
    let single = [CASE_FILE, FIELDS_FILE, LOADS_FILE, LOG_FILE, REPORT_FILE];
    remove_as(dir, |name, unfinished| is_partial(name) || unfinished && (single.contains(&name) || is_of_step(name)))?;
    remove_as(&dir.join(NETWORKS_FOLDER), |name, unfinished| {
        is_partial(name) || unfinished && (is_network(name) || is_collection(name))
    })?;
    remove_as(&dir.join(FAILED_RVE_FOLDER), |name, unfinished| unfinished && is_lost(name))
}

/// Returns true for a field file of a step, or of a state within one.
fn is_of_step(name: &str) -> bool {
    is_field(name) || is_index(name) || is_part(name) || is_partial(name)
}

/// Returns true for the field file of an undivided body.
pub(super) fn is_field(name: &str) -> bool {
    numbers(name, ["fields-", ".vtu"]).is_some_and(|[step]| name == field_file(step))
}

/// Returns true for an index file, which names the field pieces of a divided body.
pub(super) fn is_index(name: &str) -> bool {
    numbers(name, ["fields-", ".pvtu"]).is_some_and(|[step]| name == index_file(step))
}

/// Returns true for a field piece of a divided body.
pub(super) fn is_part(name: &str) -> bool {
    let numbers = numbers(name, ["fields-", "-part-", ".vtu"]);
    numbers.is_some_and(|[step, part]| name == part_file(&index_file(step), part))
}

/// Returns the element and the step of a network file.
pub(super) fn element_and_step(name: &str) -> Option<(usize, usize)> {
    let [element, step] = numbers(name, ["element-", "-step-", ".vtp"])?;
    (name == network_file(element, step)).then_some((element, step))
}

pub(super) fn is_network(name: &str) -> bool {
    element_and_step(name).is_some()
}

/// Returns true for the collection of the networks of an element.
pub(super) fn is_collection(name: &str) -> bool {
    element_of_collection(name).is_some()
}

/// Returns the element of a network collection.
pub(super) fn element_of_collection(name: &str) -> Option<usize> {
    let [element] = numbers(name, ["element-", ".pvd"])?;
    (name == network_collection(element)).then_some(element)
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

/// Returns true for a file of a state within a step.
pub(super) fn is_partial(name: &str) -> bool {
    let whole = name.replacen("-partial.", ".", 1);
    let numbers = numbers(name, ["fields-", "-partial-part-", ".vtu"]);
    numbers.is_some_and(|[step, part]| name == part_file(&partial(&index_file(step)), part))
        || name == partial(&whole) && (is_field(&whole) || is_index(&whole) || is_network(&whole))
}

/// Returns the step of a field or network file.
pub(super) fn step_of_name(name: &str) -> Option<usize> {
    let step = match name {
        _ if is_field(name) => numbers(name, ["fields-", ".vtu"]).map(|[step]| step),
        _ if is_index(name) => numbers(name, ["fields-", ".pvtu"]).map(|[step]| step),
        _ if is_network(name) => element_and_step(name).map(|(_, step)| step),
        _ => None,
    };
    step.or_else(|| numbers(name, ["fields-", "-part-", ".vtu"]).filter(|_| is_part(name)).map(|[step, _]| step))
}

/// Returns the `N - 1` numbers between the `N` given pieces of a name.
fn numbers<const N: usize, const M: usize>(name: &str, pieces: [&str; N]) -> Option<[usize; M]> {
    let mut rest = name.strip_prefix(pieces[0])?;
    let mut numbers = [0; M];
    for (number, piece) in numbers.iter_mut().zip(&pieces[1..]) {
        let (digits, after) = rest.split_once(piece)?;
        (*number, rest) = (digits.parse().ok()?, after);
    }
    rest.is_empty().then_some(numbers)
}

fn remove(folder: &Path, ours: impl Fn(&str) -> bool) -> Result<(), ResultsError> {
    remove_as(folder, |name, _| ours(name))
}

/// Removes the files for which `unwanted` returns true. Its arguments are the final name of the file, and whether the
/// file is still a temporary one.
fn remove_as(folder: &Path, unwanted: impl Fn(&str, bool) -> bool) -> Result<(), ResultsError> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(ResultsError::write(folder)(error)),
    };
    for entry in entries {
        let path = entry.map_err(ResultsError::write(folder))?.path();
        let name = path.file_name().and_then(|name| name.to_str());
        if name.is_some_and(|name| unwanted(final_name(name), final_name(name) != name)) {
            fs::remove_file(&path).map_err(ResultsError::write(&path))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(dir: &Path) -> Vec<String> {
        let entries = fs::read_dir(dir).unwrap();
        let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
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
        let others = &["fields-3.pvtu", "fields-00003-part-2.vtu", "fields-00003-part-0002.pvtu"][..];
        let dir = tempfile::tempdir().unwrap();
        for name in sorted(&[whole, partial, others]) {
            fs::write(dir.path().join(name), "").unwrap();
        }
        clear_unfinished(dir.path()).unwrap();
        assert_eq!(names(dir.path()), sorted(&[&whole[..2], others]));
        clear(dir.path()).unwrap();
        assert_eq!(names(dir.path()), sorted(&[others]));
    }
}
