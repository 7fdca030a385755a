//! The two streams: results on stdout, everything else on stderr.

use std::io::{ErrorKind, Write};
use std::path::Path;

use biotissue::input::{MOST_SHOWN, printable};
use serde::Serialize;

use crate::failure::Failure;

/// Prints a result, ended by a line break. Whoever closed the pipe has read enough; that is no failure.
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
    let text = serde_json::to_string(value).map_err(|error| Failure::Environment {
        what: format!("the answer cannot be written as JSON: {error}"),
        expected: "an answer of text and numbers".into(),
        cure: "leave out --json, and report this as a bug with the command".into(),
    })?;
    print(&text)
}

/// Makes the folder that a file is to lie in, where there is none.
pub fn make_folder_of(file: &Path) -> Result<(), Failure> {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
    folder.map_or(Ok(()), std::fs::create_dir_all).map_err(|error| Failure::unwritable(file, &error))
}

/// Says something on stderr. That nobody hears it must not stop a run, so what the system answers is dropped.
pub fn say(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Says what the readers of files found strange: the first twenty things, and how many more there are.
pub fn warn(warnings: &[String]) {
    let (warnings, more) = warnings.split_at(warnings.len().min(MOST_SHOWN));
    warnings.iter().for_each(|warning| say(&printable(&format!("warning: {warning}"))));
    if !more.is_empty() {
        say(&format!("warning: and {} more", more.len()));
    }
}
