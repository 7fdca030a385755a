//! The two output streams: results on stdout, everything else on stderr.

use std::io::{ErrorKind, Write};
use std::path::Path;

use biotissue::input::{MOST_SHOWN, printable};
use serde::Serialize;

use crate::failure::Failure;

/// Prints a result and a line break. A pipe closed by its reader is not a failure.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    let written = stdout.write_all(text.trim_end().as_bytes()).and_then(|()| stdout.write_all(b"\n"));
    match written.and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::unwritable(Path::new("standard output"), &error))
        }
        _ => Ok(()),
    }
}

/// Prints a result as one JSON object on one line.
pub fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string(value).map_err(|error| {
        Failure::environment(
            format!("the result cannot be written as JSON: {error}"),
            "a result that JSON can represent",
            "leave out --json, and report this as a bug with the command",
        )
    })?;
    print(&text)
}

/// Creates the folder of a file if it does not exist.
pub fn make_folder_of(file: &Path) -> Result<(), Failure> {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
    folder.map_or(Ok(()), std::fs::create_dir_all).map_err(|error| Failure::unwritable(file, &error))
}

/// Prints a message to stderr. Errors are ignored, because a closed stderr must not stop a run.
pub fn message(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Prints warnings: the first twenty, and the number of the others.
pub fn warn(warnings: &[String]) {
    let (warnings, more) = warnings.split_at(warnings.len().min(MOST_SHOWN));
    warnings.iter().for_each(|warning| message(&printable(&format!("warning: {warning}"))));
    if !more.is_empty() {
        message(&format!("warning: and {} more", more.len()));
    }
}
