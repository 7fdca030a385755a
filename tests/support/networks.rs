//! Where published networks lie: they are no part of the repository.

use std::path::PathBuf;

/// A file of the folder that `BIOTISSUE_NETWORKS` names. Where there is no such file this says so and gives `None`, so that
/// the test skips; with `BIOTISSUE_REQUIRE_NETWORKS=1`, as in continuous integration, that fails the test instead.
pub fn published_file(name: &str) -> Option<PathBuf> {
    let file = std::env::var_os("BIOTISSUE_NETWORKS").map(|folder| PathBuf::from(folder).join(name));
    let missing = match file {
        Some(file) if file.is_file() => return Some(file),
        Some(file) => format!("there is no {}", file.display()),
        None => format!("BIOTISSUE_NETWORKS is not set, so there is no {name}"),
    };
    let required =
        std::env::var_os("BIOTISSUE_REQUIRE_NETWORKS").is_some_and(|value| !value.is_empty() && value != "0");
    assert!(
        !required,
        "{missing}, and BIOTISSUE_REQUIRE_NETWORKS is set: let BIOTISSUE_NETWORKS name the folder of the published networks"
    );
    println!("skipped: {missing}");
    None
}
