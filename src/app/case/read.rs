//! Reading a case: first the TOML document, then section by section.

use std::path::{Path, PathBuf};

use toml::de::DeTable;

use crate::app::mesh_files::ENDINGS;
use crate::input::{InputError, InputErrors, excerpt};

use super::data::Case;
use super::problems::Problems;
use super::table::Table;
use super::{constraint, load, material, section};
use crate::tissue::materials::RegionMaterial;

/// A case that was read, with its warnings.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseFile {
    /// The case.
    pub case: Case,
    /// Valid but possibly unintended settings: one line of text each, with file and line.
    pub warnings: Vec<String>,
}

impl Case {
    /// Reads a case file.
    ///
    /// # Errors
    /// Returns all errors in the file, in the order of its lines, or the one reason why it could not be read at all.
    pub fn read(path: &Path) -> Result<CaseFile, InputErrors> {
        if path.is_dir() {
            let cure = "name the case file in it; `biotissue report` draws a result directory";
            return Err(InputError::in_file(path, "is a folder", "a case file (.toml)", cure).into());
        }
        let bytes = std::fs::read(path).map_err(|error| InputError::unreadable(path, &error))?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let good = error.utf8_error().valid_up_to();
            let bytes = error.as_bytes();
            let line = 1 + bytes.iter().take(good).filter(|&&byte| byte == b'\n').count();
            let byte = bytes.get(good).copied().unwrap_or_default();
            let what = format!("byte 0x{byte:02x} is not UTF-8 text");
            InputError::at_line(path, line, what, "a TOML file in UTF-8", "save the file in UTF-8")
        })?;
        Self::parse(&text, path)
    }

    /// Reads a case from the text of a file at `path`. The file itself is not opened, but relative paths in it are
    /// resolved against its folder.
    ///
    /// # Errors
    /// See [`Case::read`].
    pub fn parse(text: &str, path: &Path) -> Result<CaseFile, InputErrors> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let problems = Problems::new(path, text);
        let base = folder_of(path)?;
        let document = DeTable::parse(text).map_err(|error| syntax_error(&problems, path, text, &error))?;
        let mut root = Table::new(&problems, String::new(), 1, document.get_ref());
        let case = read(&mut root, path, &base);
        root.report_unknown_keys();
        let warnings = problems.finish()?;
        // `problems` already reported every reason why a part was not read.
        let case = case.ok_or_else(|| InputErrors(Vec::new()))?;
        Ok(CaseFile { case, warnings })
    }
}

fn read(root: &mut Table<'_>, path: &Path, base: &Path) -> Option<Case> {
    let title = root.get("title").and_then(|value| value.text("the title of the run"));
    let mesh = section::mesh(root, base);
    let regions = material::regions(root, base);
    let boundaries = load::boundaries(root);
    let points = load::points(root);
    let body_forces = load::body_forces(root);
    let hold_free_modes = load::hold_free_modes(root);
    let constraints = constraint::constraints(root);
    let steps = section::steps(root);
    let newton = section::newton(root);
    let micro = section::micro(root);
    let scales = section::scales(root);
    let any_network = regions.iter().any(|region| matches!(region.material, RegionMaterial::FiberRve(_)));
    let output = section::output(root, base, any_network);
    let section::MeshSection { source: mesh, line: mesh_line, scale: mesh_scale, scale_line, quadratic } = mesh?;
    let stem = || path.file_stem().map_or_else(|| "case".into(), |stem| stem.to_string_lossy().into_owned());
    Some(Case {
        file: path.into(),
        title: title.map_or_else(stem, str::to_string),
        mesh,
        mesh_line,
        mesh_scale,
        mesh_scale_line: scale_line,
        quadratic,
        regions,
        boundaries,
        points,
        body_forces,
        hold_free_modes,
        constraints,
        steps,
        newton,
        micro,
        scales,
        output,
    })
}

/// Returns the absolute path of the folder of the case file.
pub(super) fn folder_of(path: &Path) -> Result<PathBuf, InputError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    if folder.as_os_str().is_empty() {
        return std::env::current_dir().map_err(|error| InputError::unreadable(path, &error));
    }
    std::path::absolute(folder).map_err(|error| InputError::unreadable(path, &error))
}

/// Returns true if the first value of a line of TOML is a number with a decimal comma, outside of a list.
fn has_decimal_comma(line: &str) -> bool {
    line.split('=').skip(1).any(|value| {
        let value = value.trim_start().trim_start_matches(['+', '-']);
        let rest = value.trim_start_matches(|c: char| c.is_ascii_digit());
        rest.len() < value.len()
            && rest.strip_prefix(',').is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()))
    })
}

/// Returns the cure if a file with this ending is an input of a case rather than a case.
fn cure_of_other_file(ending: &str) -> Option<&'static str> {
    match ending {
        mesh if ENDINGS.contains(&mesh) => Some(
            "this looks like a mesh: name it as `file` in [mesh] of a case, or look at it with `biotissue mesh info`",
        ),
        "txt" => Some(
            "if this is a fiber network, name it in `networks` of a case, or look at it with `biotissue network check`",
        ),
        _ => None,
    }
}

/// Converts a TOML syntax error to an input error that shows the text of the line.
fn syntax_error(problems: &Problems<'_>, path: &Path, text: &str, error: &toml::de::Error) -> InputError {
    let line = problems.line_of(error.span().map_or(0, |span| span.start));
    let content = excerpt(text.lines().nth(line - 1).unwrap_or_default());
    let what = format!("not TOML: {} in `{content}`", excerpt(&error.message().replace('\n', ", ")));
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let (expected, cure) = if let Some(cure) = cure_of_other_file(&ending) {
        ("a case: a TOML file that names the mesh, materials and loads", cure)
    } else if has_decimal_comma(&content) {
        ("numbers with a decimal point, such as 0.5", "write a decimal point instead of the comma")
    } else if error.message().starts_with("duplicate key") {
        (
            "each key once in its table, each [header] once in the file",
            "remove one of the two, or write [[header]] for a list",
        )
    } else {
        ("TOML: `key = value`, [header] or [[header]]; strings in quotes", "correct the line; see https://toml.io")
    };
    InputError::at_line(path, line, what, expected, cure)
}
