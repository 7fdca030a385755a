//! Resolving paths and patterns to the network files of a library.

use std::path::{Path, PathBuf};

use super::problems::nearest;
use super::value::Value;

/// Extensions of the parameter files beside a network; they are never networks themselves.
const COMPANIONS: [&str; 2] = ["params", "toml"];

pub(super) const EXPECTED: &str = "network files: paths or patterns with * ? [...], relative to the case file";

/// Returns the files that `networks` (a string or a list of strings) names, sorted and without duplicates; an empty
/// list gives an empty vector. Reports every error and then returns `None`.
pub(super) fn resolve(networks: &Value<'_>, base: &Path) -> Option<Vec<PathBuf>> {
    let patterns = if networks.inner.is_str() {
        vec![networks.clone()]
    } else {
        networks.list(EXPECTED, "a path in quotes, or a list of them in brackets")?
    };
    let mut files = Vec::new();
    let mut complete = true;
    for pattern in &patterns {
        match pattern.text(EXPECTED).and_then(|text| matches(pattern, text, base)) {
            Some(found) => files.extend(found),
            None => complete = false,
        }
    }
    files.sort();
    files.dedup();
    complete.then_some(files)
}

/// Returns the files of one path or pattern. An existing file with exactly this name takes precedence over the pattern.
fn matches(value: &Value<'_>, text: &str, base: &Path) -> Option<Vec<PathBuf>> {
    let literal = base.join(text);
    if literal.is_file() {
        return Some(vec![literal]);
    }
    if literal.is_dir() {
        let cure = format!("write \"{}/*.txt\"", text.trim_end_matches('/'));
        value.report_error(&format!("names {text:?}, which is a folder"), EXPECTED, cure);
        return None;
    }
    if !text.contains(['*', '?', '[']) {
        value.report_error(&format!("names {text:?}, but this file does not exist"), EXPECTED, missing_file(&literal));
        return None;
    }
    let whole = if Path::new(text).is_absolute() {
        text.to_string()
    } else {
        Path::new(&glob::Pattern::escape(&base.to_string_lossy())).join(text).to_string_lossy().into_owned()
    };
    let paths = match glob::glob(&whole) {
        Ok(paths) => paths,
        Err(error) => {
            value.report_error(
                &format!("has {text:?}, which is not a pattern: {}", error.msg),
                EXPECTED,
                "correct the pattern",
            );
            return None;
        }
    };
    let mut companions = 0;
    let mut found = Vec::new();
    for path in paths.filter_map(Result::ok).filter(|path| path.is_file()) {
        if path.extension().is_some_and(|extension| COMPANIONS.iter().any(|&companion| extension == companion)) {
            companions += 1;
        } else {
            found.push(path);
        }
    }
    if found.is_empty() {
        value.report_error(
            &format!("has {text:?}, which matches no network"),
            EXPECTED,
            nothing_found(&literal, companions),
        );
        return None;
    }
    Some(found)
}

/// Returns the cure for a pattern without matches, with the folder that was searched.
fn nothing_found(pattern: &Path, companions: usize) -> String {
    let folder: PathBuf = pattern
        .parent()
        .unwrap_or(pattern)
        .components()
        .take_while(|part| !part.as_os_str().to_string_lossy().contains(['*', '?', '[']))
        .collect();
    if !folder.is_dir() {
        return format!("there is no folder {}: create it or correct the pattern", folder.display());
    }
    if companions > 0 {
        return format!("only .params and .toml files match in {}: correct the pattern", folder.display());
    }
    format!("no file in {} matches: add network files there or correct the pattern", folder.display())
}

/// Returns the cure for a missing file: the most similar name in its folder.
pub(super) fn missing_file(file: &Path) -> String {
    let (Some(folder), Some(name)) = (file.parent(), file.file_name().and_then(|name| name.to_str())) else {
        return "name a file".into();
    };
    let Ok(entries) = std::fs::read_dir(folder) else {
        return format!("there is no folder {}: create it or correct the path", folder.display());
    };
    let names: Vec<String> =
        entries.filter_map(Result::ok).filter_map(|entry| entry.file_name().into_string().ok()).collect();
    match nearest(name, names.iter().map(String::as_str)) {
        Some(near) => format!("{} holds \"{near}\": did you mean that?", folder.display()),
        None => format!("no such file in {}: put it there or correct the path", folder.display()),
    }
}
