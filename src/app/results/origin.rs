//! Checks which files of a result directory were written by a run; no other file is replaced or removed.
//!
//! A file is recognized by its name and its first bytes; the copy of the case also by its checksum, so that a file
//! edited by the user is not recognized. A copy without a checksum, as older versions wrote it, is recognized if it has
//! the form that a run writes.

use std::fs::{self, File};
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use super::clear::is_lost;
use super::costs;
use super::log::{self, Event};
use super::names::FileName;
use super::replace::names_in;
use super::{
    CASE_FILE, CHECKPOINT_FOLDER, COSTS_FILE, Collection, FAILED_RVE_FOLDER, FIELDS_FILE, LOADS_FILE, LOG_FILE, Loads,
    NETWORKS_FOLDER, POINTS_FILE, ResultsError,
};
use crate::app::case::Case;
use crate::app::checkpoint;
use crate::checksum::{below_checksum, with_checksum};
use crate::output::final_name;

/// Number of bytes from which a file is recognized.
const HEAD: u64 = 4096;

/// Beginning of the first line below the checksum in the copy of a case; the version follows.
const CASE_LINE: &str = "# The case as run by biotissue ";

/// Beginning of the line after it; the name of the file of the case follows.
const FILE_LINE: &str = "# Case file: ";

const GRID: &str = "<VTKFile type=\"UnstructuredGrid\"";
const DIVIDED_GRID: &str = "<VTKFile type=\"PUnstructuredGrid\"";
const NETWORK: &str = "<VTKFile type=\"PolyData\"";

/// The bytes read from a file.
type Bytes<'a> = &'a [u8];

/// Checks that everything in the result directory `dir` that a run would replace or remove was written by a run. A
/// missing directory passes. Nothing is changed.
///
/// # Errors
/// Returns [`ResultsError::UnknownOrigin`] for a file that no run has written or for a symbolic link;
/// [`ResultsError::Read`] if a file cannot be read.
pub fn check_origin(dir: &Path) -> Result<(), ResultsError> {
    check_folder(dir, |name| {
        let kind: fn(Bytes, &Path) -> bool = match name {
            CASE_FILE => is_case_copy,
            LOADS_FILE => |bytes, _| is_loads(bytes),
            LOG_FILE => |bytes, _| is_log(bytes),
            COSTS_FILE => |bytes, _| bytes.starts_with(costs::HEADER.as_bytes()),
            FIELDS_FILE | POINTS_FILE => {
                |bytes, _| is_collection_of(bytes, |name| name.is_fields() && !matches!(name, FileName::Part { .. }))
            }
            _ => match FileName::parse(name)? {
                FileName::Index { .. } => |bytes, _| has(bytes, DIVIDED_GRID, "\"displacement\""),
                name if name.is_fields() => {
                    |bytes, _| [GRID, DIVIDED_GRID].iter().any(|grid| has(bytes, grid, "\"displacement\""))
                }
                _ => return None,
            },
        };
        Some(kind)
    })?;
    check_folder(&folder(dir, NETWORKS_FOLDER)?, |name| {
        let kind: fn(Bytes, &Path) -> bool = match FileName::parse(name)? {
            FileName::Collection { .. } => {
                |bytes, _| is_collection_of(bytes, |name| matches!(name, FileName::Network { .. } | FileName::Partial))
            }
            // Files of earlier versions have no displacements: they begin with the stretches.
            FileName::Network { .. } | FileName::Partial => |bytes, _| {
                ["displacement", "stretch"].iter().any(|name| has(bytes, NETWORK, &format!("Name=\"{name}\"")))
            },
            _ => return None,
        };
        Some(kind)
    })?;
    check_folder(&folder(dir, FAILED_RVE_FOLDER)?, |name| {
        is_lost(name).then_some(|bytes: Bytes, _: &Path| begins(bytes, "{\"program\":\"biotissue "))
    })?;
    check_folder(&folder(dir, CHECKPOINT_FOLDER)?, |name| {
        checkpoint::is_file_name(name).then_some(|bytes: Bytes, _: &Path| checkpoint::is_begin(bytes))
    })
}

/// Returns a folder of a result directory; rejects a symbolic link, which could lead anywhere.
fn folder(dir: &Path, name: &str) -> Result<PathBuf, ResultsError> {
    let path = dir.join(name);
    match fs::symlink_metadata(&path) {
        Ok(there) if there.is_symlink() => Err(ResultsError::UnknownOrigin(path, LINK)),
        Ok(there) if !there.is_dir() => {
            Err(ResultsError::UnknownOrigin(path, "is not a folder; a run creates a folder of this name"))
        }
        _ => Ok(path),
    }
}

const LINK: &str = "is a symbolic link, which no run has made";
const FOREIGN: &str = "does not come from an earlier run, or was changed since; a run would replace or remove it";

/// Checks all files of a folder. For a name that a run may write, `kind_of` returns the function that recognizes the
/// content.
fn check_folder<K: Fn(Bytes, &Path) -> bool>(
    folder: &Path,
    kind_of: impl Fn(&str) -> Option<K>,
) -> Result<(), ResultsError> {
    let mut names = match names_in(folder) {
        // If this is not a folder, writing to it will report that.
        Err(error) if error.kind() == ErrorKind::NotADirectory => return Ok(()),
        names => names.map_err(ResultsError::read(folder))?,
    };
    names.sort_unstable();
    for name in names.iter().map(String::as_str) {
        let path = folder.join(name);
        let (is_unfinished, name) = (final_name(name) != name, final_name(name));
        let Some(is_ours) = kind_of(name) else { continue };
        let there = match fs::symlink_metadata(&path) {
            Ok(there) => there,
            // Another run may just have replaced the file.
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            Err(error) => return Err(ResultsError::read(&path)(error)),
        };
        if there.is_symlink() {
            return Err(ResultsError::UnknownOrigin(path, LINK));
        }
        if !there.is_file() {
            return Err(ResultsError::UnknownOrigin(path, "is not a regular file"));
        }
        // A file that a killed run was writing may end anywhere, and an empty file has nothing to lose.
        if is_unfinished || there.len() == 0 {
            continue;
        }
        let Some(bytes) = begin_of(&path, name)? else { continue };
        if !is_ours(&bytes, &path) {
            return Err(ResultsError::UnknownOrigin(path, FOREIGN));
        }
    }
    Ok(())
}

/// Reads the beginning of a file, or all of a case or a collection; `None` if the file no longer exists.
fn begin_of(path: &Path, name: &str) -> Result<Option<Vec<u8>>, ResultsError> {
    let limit = if name == CASE_FILE || name.ends_with(".pvd") { u64::MAX } else { HEAD };
    let mut bytes = Vec::new();
    match File::open(path).and_then(|file| file.take(limit).read_to_end(&mut bytes)) {
        Ok(_) => Ok(Some(bytes)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(ResultsError::read(path)(error)),
    }
}

fn begins(bytes: Bytes, with: &str) -> bool {
    let (bytes, with) = (&bytes[..bytes.len().min(with.len())], with.as_bytes());
    with.starts_with(bytes)
}

fn has(bytes: Bytes, first: &str, then: &str) -> bool {
    let text = String::from_utf8_lossy(bytes);
    text.split_once(first).is_some_and(|(_, rest)| rest.contains(then))
}

/// Returns the text of the file `case.toml` in a result directory.
pub(in crate::app) fn case_copy(case: &Case) -> String {
    let mut text = case.to_toml();
    if let (Some(name), Some(line_end)) = (file_name(case), text.find('\n')) {
        text.insert_str(line_end + 1, &format!("{FILE_LINE}{name}\n"));
    }
    with_checksum(&text)
}

/// Returns the name of the file of a case, if a line of text can hold it.
fn file_name(case: &Case) -> Option<&str> {
    case.file.file_name()?.to_str().filter(|name| !name.contains(char::is_control))
}

/// Checks that a directory does not hold the results of another case, whose file still lies beside that of this one. A
/// directory without a case, or with one of an earlier version, passes.
///
/// # Errors
/// Returns [`ResultsError::OtherCase`].
pub(in crate::app) fn check_case(dir: &Path, case: &Case) -> Result<(), ResultsError> {
    let Ok(text) = fs::read_to_string(dir.join(CASE_FILE)) else { return Ok(()) };
    let other = below_checksum(&text).and_then(|(below, _)| below.lines().nth(1)?.strip_prefix(FILE_LINE));
    let Some(other) = other.filter(|&other| Some(other) != file_name(case)) else { return Ok(()) };
    let file = case.file.with_file_name(other);
    if file.is_file() { Err(ResultsError::OtherCase(dir.to_owned(), file)) } else { Ok(()) }
}

fn is_case_copy(bytes: Bytes, path: &Path) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    if let Some((below, is_as_written)) = below_checksum(text) {
        return is_as_written && below.starts_with(CASE_LINE);
    }
    // Newer versions may write additional keys, but every line of an older copy still occurs, in the same order.
    let Some(lines) = text.strip_prefix(CASE_LINE).map(|text| text.lines().skip(1)) else { return false };
    let Ok(read) = Case::parse(text, path) else { return false };
    let written = read.case.to_toml();
    let mut written = written.lines().skip(1);
    lines.into_iter().all(|line| written.any(|other| other == line))
}

fn is_loads(bytes: Bytes) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let whole_header = text.contains('\n').then(|| Loads::is_header(text.as_bytes()));
    // The header is longer than the bytes read: a body with very many surfaces.
    whole_header.unwrap_or_else(|| text.starts_with("step,t,"))
}

fn is_log(bytes: Bytes) -> bool {
    let text = String::from_utf8_lossy(bytes);
    match text.split_once('\n') {
        Some((first, _)) => serde_json::from_str(first).is_ok_and(|event| !matches!(event, Event::Unknown)),
        // The run was killed while it wrote the first line.
        None => begins(bytes, "{\"event\":\"start\",\"title\":\""),
    }
}

fn is_collection_of(bytes: Bytes, is_member: impl Fn(FileName) -> bool) -> bool {
    let read = Collection::parse(PathBuf::new(), &String::from_utf8_lossy(bytes));
    read.is_ok_and(|read| read.entries().iter().all(|entry| FileName::parse(&entry.file).is_some_and(&is_member)))
}

/// Returns true if the beginning of a report page shows that this program wrote it.
pub(in crate::app) fn is_report(path: &Path) -> Result<bool, ResultsError> {
    if !fs::symlink_metadata(path).is_ok_and(|there| there.is_file()) {
        return Ok(false);
    }
    let Some(bytes) = begin_of(path, "")? else { return Ok(false) };
    let text = String::from_utf8_lossy(&bytes);
    // Versions without the generator tag wrote the second text.
    let is_ours = text.contains("<meta name=\"generator\" content=\"biotissue")
        || text.contains("<style>body{margin:0;background:#f3f5f7;");
    Ok(bytes.is_empty() || text.starts_with("<!DOCTYPE html>") && is_ours)
}

/// Returns the evidence that `dir`, which has no checkpoint, holds results nevertheless: a file and its content. A run
/// of the same case, up to what may change, that was interrupted before its first checkpoint leaves no such evidence:
/// resuming repeats its steps.
///
/// # Errors
/// Returns [`ResultsError::Read`] or [`ResultsError::Damaged`] if the loads, the log or a folder cannot be read.
pub(in crate::app) fn results_without_checkpoint(
    dir: &Path,
    case: &Case,
) -> Result<Option<(PathBuf, String)>, ResultsError> {
    let (loads, log) = (dir.join(LOADS_FILE), dir.join(LOG_FILE));
    let rows = if loads.exists() { Loads::read(&loads)?.rows.len() } else { 0 };
    let events = if log.exists() { log::read(&log)? } else { Vec::new() };
    let copy = dir.join(CASE_FILE);
    let before = fs::read_to_string(&copy).ok().and_then(|text| Case::parse(&text, &copy).ok()).map(|read| read.case);
    let before = before.filter(|before| checkpoint::is_same_run(before, case));
    let begun = events.iter().any(|event| matches!(event, Event::Start(_)));
    // The first checkpoint is written after the row of its step.
    let repeated = before.filter(|_| begun).map_or(0, |before| before.output.checkpoint);
    let holds = |steps: usize| format!("{steps} load step{}", if steps == 1 { "" } else { "s" });
    if rows > repeated {
        return Ok(Some((loads, holds(rows))));
    }
    let in_log = events.iter().filter_map(|event| match event {
        Event::Step(step) if step.step > repeated.max(1) => Some(step.step),
        Event::End(end) if end.steps >= repeated.max(1) => Some(end.steps),
        _ => None,
    });
    if let Some(steps) = in_log.max() {
        return Ok(Some((log, holds(steps))));
    }
    for folder in [dir.to_owned(), dir.join(NETWORKS_FOLDER)] {
        for name in names_in(&folder).map_err(ResultsError::read(&folder))? {
            let step = FileName::parse(&name).and_then(FileName::step);
            if let Some(step) = step.filter(|&step| step > rows) {
                return Ok(Some((folder.join(name), format!("the state of load step {step}"))));
            }
        }
    }
    Ok(None)
}
