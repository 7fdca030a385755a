//! The folder of the published networks, which are not part of the repository.

use std::path::PathBuf;

use super::skip::skip;

/// Returns a file of the folder given by `BIOTISSUE_NETWORKS`. If there is no such file, records that the running test
/// is skipped and returns `None`; if `BIOTISSUE_REQUIRE_NETWORKS` is set, as in continuous integration, it panics
/// instead.
pub fn published_file(name: &str) -> Option<PathBuf> {
    let file = std::env::var_os("BIOTISSUE_NETWORKS").map(|folder| PathBuf::from(folder).join(name));
    let missing = match file {
        Some(file) if file.is_file() => return Some(file),
        Some(file) => format!("there is no {}", file.display()),
        None => format!("needs {name}, but BIOTISSUE_NETWORKS is not set"),
    };
    let required =
        std::env::var_os("BIOTISSUE_REQUIRE_NETWORKS").is_some_and(|value| !value.is_empty() && value != "0");
    assert!(!required, "{missing}; BIOTISSUE_NETWORKS must be the folder of the published networks");
    skip(&missing);
    None
}
