//! Libraries of networks with consecutive seeds, for `biotissue network generate --count`.

use std::path::{Path, PathBuf};

use crate::failure::Failure;

/// Digits of the numbers in file names, unless a seed has more.
const DIGITS: usize = 4;

/// A file of a library, with its seed.
pub struct Member {
    pub seed: u64,
    pub path: PathBuf,
}

/// The most seeds without a network that are passed over in a row.
pub const MOST_SKIPPED: usize = 20;

/// Returns the files that a library may have: the seeds from `first` on, each in `DIRECTORY/network-SEED.txt`, padded with zeros
/// to the same width, so that the names are sorted like the seeds.
pub fn members(directory: &Path, first: u64, count: usize) -> Result<impl Iterator<Item = Member>, Failure> {
    if count == 0 {
        return Err(Failure::arguments("--count is 0", "a number of networks above 0", "give the number of networks"));
    }
    // A seed must fit into a TOML integer of the sidecar.
    let most = count.saturating_mul(1 + MOST_SKIPPED);
    let beyond = first.saturating_add(most as u64 - 1).min(i64::MAX.unsigned_abs());
    let last = first.checked_add(count as u64 - 1).filter(|&last| i64::try_from(last).is_ok());
    let Some(last) = last else {
        return Err(Failure::arguments(
            format!("--seed {first} and --count {count} give seeds above {}", i64::MAX),
            format!("seeds up to {}", i64::MAX),
            "lower --seed",
        ));
    };
    let width = last.to_string().len().max(DIGITS);
    let directory = directory.to_owned();
    let path = move |seed| directory.join(format!("network-{seed:0width$}.txt"));
    let member = move |seed| Member { seed, path: path(seed) };
    refuse_existing(&(first..=last).map(&member).collect::<Vec<_>>())?;
    Ok((first..=beyond).map(member))
}

/// Returns an error if one of the files, or a file beside it, exists.
pub fn refuse_existing(members: &[Member]) -> Result<(), Failure> {
    let beside =
        |path: &Path| ["", ".params", ".toml"].map(|suffix| PathBuf::from(format!("{}{suffix}", path.display())));
    let existing = |member: &Member| beside(&member.path).into_iter().find(|path| path.symlink_metadata().is_ok());
    let mut existing = members.iter().filter_map(existing);
    let Some(first) = existing.next() else { return Ok(()) };
    let more = match existing.count() {
        0 => String::new(),
        more => format!(", and so do those of {more} other seeds"),
    };
    Err(Failure::arguments(
        format!("{} exists{more}; nothing is written", first.display()),
        "a directory without the files of these seeds: no network is replaced",
        "name another --directory, remove the files, or give a --seed after the existing ones to add networks",
    ))
}
