//! Resolving paths and patterns to the network files of a library.

use std::path::{Path, PathBuf};

use super::choice::NetworkPattern;
use super::problems::nearest;
use super::value::Value;

/// Extensions of the parameter files beside a network; they are never networks themselves.
const COMPANIONS: [&str; 2] = ["params", "toml"];

pub(super) const EXPECTED: &str = "network files: paths or patterns with * ? [...], relative to the case file";

/// The networks of a material.
pub(super) struct Listed {
    /// The files in the order in which they are listed, those of each pattern by the numbers in
    /// their names.
    pub files: Vec<PathBuf>,
    /// The pattern that matches the files, if it has places for numbers.
    pub pattern: Option<NetworkPattern>,
}

/// Returns the files that `networks` (a string or a list of strings) names; an empty list gives none. Reports every error
/// and then returns `None`.
pub(super) fn resolve(networks: &Value<'_>, base: &Path) -> Option<Listed> {
    let patterns = if networks.inner.is_str() {
        vec![networks.clone()]
    } else {
        networks.list(EXPECTED, "a path in quotes, or a list of them in brackets")?
    };
    let mut listed = Listed { files: Vec::new(), pattern: None };
    let mut complete = true;
    for value in &patterns {
        match value.text(EXPECTED).and_then(|text| matches(value, text, base)) {
            Some(found) => {
                listed.files.extend(found.files);
                listed.pattern = listed.pattern.or(found.pattern);
            }
            None => complete = false,
        }
    }
    if complete && listed.pattern.is_some() && patterns.len() > 1 {
        let cure = "name all networks by one path with places, or list them and choose by `index`";
        networks.report_error("has a path with places in braces and other paths", EXPECTED, cure);
        return None;
    }
    complete.then_some(listed)
}

/// Returns the files of one path or pattern. An existing file with exactly this name takes precedence over the pattern.
fn matches(value: &Value<'_>, text: &str, base: &Path) -> Option<Listed> {
    let literal = base.join(text);
    if literal.is_file() {
        return Some(Listed { files: vec![literal], pattern: None });
    }
    let pattern = match NetworkPattern::parse(text) {
        Ok(pattern) => pattern.map(|pattern| pattern.in_folder(base)),
        Err(reason) => {
            let cure = "write a place as {angle} or {angle:02}, and a brace in a name twice";
            value.report_error(&format!("has {text:?}, which is not a pattern: {reason}"), EXPECTED, cure);
            return None;
        }
    };
    if literal.is_dir() {
        let cure = format!("write \"{}/*.txt\"", text.trim_end_matches('/'));
        value.report_error(&format!("names {text:?}, which is a folder"), EXPECTED, cure);
        return None;
    }
    if pattern.is_none() && !text.contains(['*', '?', '[']) {
        value.report_error(&format!("names {text:?}, but this file does not exist"), EXPECTED, missing_file(&literal));
        return None;
    }
    let whole = if let Some(pattern) = &pattern {
        pattern.glob()
    } else if Path::new(text).is_absolute() {
        text.to_string()
    } else {
        Path::new(&glob::Pattern::escape(&base.to_string_lossy())).join(text).to_string_lossy().into_owned()
    };
    let Matching { networks, companions } = match matching(&whole) {
        Ok(found) => found,
        Err(error) => {
            value.report_error(
                &format!("has {text:?}, which is not a pattern: {}", error.msg),
                EXPECTED,
                "correct the pattern",
            );
            return None;
        }
    };
    if networks.is_empty() {
        value.report_error(
            &format!("has {text:?}, which matches no network"),
            EXPECTED,
            nothing_found(&literal, companions),
        );
        return None;
    }
    Some(Listed { files: networks, pattern })
}

/// The files that match a pattern.
pub(super) struct Matching {
    /// The networks, in the order of the numbers in their names.
    pub networks: Vec<PathBuf>,
    /// The number of parameter files.
    companions: usize,
}

/// Finds the files that match a pattern of `glob`.
///
/// # Errors
/// Returns the error of `glob` if the text is not a pattern.
pub(super) fn matching(pattern: &str) -> Result<Matching, glob::PatternError> {
    let mut found = Matching { networks: Vec::new(), companions: 0 };
    for path in glob::glob(pattern)?.filter_map(Result::ok).filter(|path| path.is_file()) {
        if path.extension().is_some_and(|extension| COMPANIONS.iter().any(|&companion| extension == companion)) {
            found.companions += 1;
        } else {
            found.networks.push(path);
        }
    }
    found.networks.sort_by_cached_key(|path| natural_order(path));
    Ok(found)
}

/// Returns a key by which paths are sorted so that numbers in them count, `a-2` before `a-10`.
fn natural_order(path: &Path) -> (Vec<(String, u64)>, PathBuf) {
    let (mut parts, mut text, mut number) = (Vec::new(), String::new(), None::<u64>);
    for letter in path.to_string_lossy().chars() {
        match letter.to_digit(10) {
            Some(digit) => number = Some(number.unwrap_or(0).saturating_mul(10).saturating_add(digit.into())),
            None => {
                parts.extend(number.take().map(|number| (std::mem::take(&mut text), number)));
                text.push(letter);
            }
        }
    }
    parts.push((text, number.unwrap_or(0)));
    (parts, path.into())
}

/// Returns the cure for a pattern without matches, with the folder that was searched.
fn nothing_found(pattern: &Path, companions: usize) -> String {
    let folder: PathBuf = pattern
        .parent()
        .unwrap_or(pattern)
        .components()
        .take_while(|part| !part.as_os_str().to_string_lossy().contains(['*', '?', '[', '{']))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_count() {
        let mut names = ["d/a-10.txt", "d/a-2-b-1.txt", "d/a-2.txt", "d/b.txt", "d/a-02-b-03.txt"].map(PathBuf::from);
        names.sort_by_cached_key(|path| natural_order(path));
        let expected = ["d/a-2-b-1.txt", "d/a-02-b-03.txt", "d/a-2.txt", "d/a-10.txt", "d/b.txt"].map(PathBuf::from);
        assert_eq!(names, expected);
    }
}
