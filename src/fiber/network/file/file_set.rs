//! Joint writing of a network and the files beside it, without replacing files from other sources.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::sidecar::{Sidecar, parse};
use super::write::{beside, params_text};
use super::{fits_params, remove_params, write};
use crate::checksum::{below_checksum, sum_of, with_checksum};
use crate::fiber::network::Network;
use crate::output;

/// Prefix of the line of a sidecar that contains the checksum of the `.params` file beside it.
const PARAMS_LINE: &str = "# Checksum of the .params file: ";

/// Error in the writing of a network and its files.
#[derive(Debug, Error)]
pub enum FileSetError {
    /// The operating system reported an error.
    #[error("{}: cannot be written: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// A file that was not written with a network would be replaced. Nothing was written.
    #[error("{}: {what}", path.display())]
    UnknownOrigin {
        /// The file.
        path: PathBuf,
        /// The property that shows its origin, as the predicate of a sentence.
        what: &'static str,
    },
}

/// Writes a network to `path`, its materials to `path.params` if that format supports them, and `sidecar` to
/// `path.toml`. Existing files with the latter two names are replaced only if an earlier call wrote them, even if its
/// process was killed, and they have not been changed since. A device or a pipe receives the network only.
///
/// # Errors
/// Returns [`FileSetError::Write`] if a file cannot be written, and [`FileSetError::UnknownOrigin`] if a file from
/// another source would be replaced.
pub fn write_file_set(path: &Path, network: &Network, sidecar: &Sidecar) -> Result<(), FileSetError> {
    write_one_by_one(path, network, sidecar, || Ok(()))
}

/// Implements [`write_file_set`]; calls `before_each` before each write or removal and stops if it fails.
fn write_one_by_one(
    path: &Path,
    network: &Network,
    sidecar: &Sidecar,
    mut before_each: impl FnMut() -> io::Result<()>,
) -> Result<(), FileSetError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| FileSetError::Write { path, source }
    };
    if output::is_stream(path) {
        return write(path, network).map_err(failed(path));
    }
    let found = check(path)?;
    let (params, toml) = (beside(path, ".params"), beside(path, ".toml"));
    let text = sidecar.to_toml().map_err(failed(&toml))?;
    let materials = fits_params(network).then(|| params_text(network)).transpose().map_err(failed(&params))?;
    let sum = materials.as_ref().map(|text| sum_of(text.as_bytes()));
    // A process may be killed after any file: the sidecar lists the checksums of both the old and the new `.params`
    // file, so that the next call recognizes either.
    if sum.is_some() {
        let either: Vec<u64> = found.params.into_iter().chain(sum).collect();
        let sidecar = with_sums(&found.sidecar, &either);
        before_each().and_then(|()| output::write(&toml, sidecar.as_bytes())).map_err(failed(&toml))?;
    }
    before_each().and_then(|()| write(path, network)).map_err(failed(path))?;
    let done = before_each().and_then(|()| match materials {
        Some(text) => output::write(&params, text.as_bytes()),
        None => remove_params(path),
    });
    done.map_err(failed(&params))?;
    let sidecar = with_sums(&text, sum.as_slice());
    before_each().and_then(|()| output::write(&toml, sidecar.as_bytes())).map_err(failed(&toml))
}

/// Returns the text of a sidecar with the checksums `params` of `.params` files and its own checksum.
fn with_sums(sidecar: &str, params: &[u64]) -> String {
    let lines: String = params.iter().map(|sum| format!("{PARAMS_LINE}{sum:016x}\n")).collect();
    with_checksum(&format!("{lines}{sidecar}"))
}

/// The files beside a network that may be replaced with it.
struct Found {
    /// The sidecar without its own checksum and those of `.params` files; empty if there is no sidecar.
    sidecar: String,
    /// Checksum of the `.params` file; `None` if there is no such file.
    params: Option<u64>,
}

/// Returns the files beside a network at `path`.
///
/// # Errors
/// Returns [`FileSetError::UnknownOrigin`] if one of them was not written with a network, and [`FileSetError::Write`]
/// if one cannot be read.
fn check(path: &Path) -> Result<Found, FileSetError> {
    let target = output::resolve_links(path).map_err(|source| FileSetError::Write { path: path.to_owned(), source })?;
    let [toml, params] = [".toml", ".params"].map(|suffix| beside(path, suffix));
    if target != path {
        // The files beside the target of the link describe the network that would be overwritten.
        if let Some(path) = [".toml", ".params"].map(|suffix| beside(&target, suffix)).into_iter().find(|f| f.exists())
        {
            let what = "belongs to the network that is the target of the symbolic link, and would no longer match it";
            return Err(FileSetError::UnknownOrigin { path, what });
        }
    }
    let unknown = |path: &Path, what| Err(FileSetError::UnknownOrigin { path: path.to_owned(), what });
    let sidecar = text_of(&toml)?.map(|text| sidecar_of(&toml, &text).ok_or(())).transpose();
    let Ok(sidecar) = sidecar else {
        return unknown(&toml, "was not written with a network, or has been changed since");
    };
    let sums = sidecar.as_ref().map(|known| known.params.clone());
    let sidecar = sidecar.map_or_else(String::new, |known| known.text);
    let Some(text) = text_of(&params)? else { return Ok(Found { sidecar, params: None }) };
    let sum = sum_of(text.as_bytes());
    match sums {
        Some(sums) if sums.as_ref().is_none_or(|sums| sums.contains(&sum)) => Ok(Found { sidecar, params: Some(sum) }),
        _ => unknown(&params, "was not written with the network, or has been changed since"),
    }
}

/// A sidecar that was written by this module.
struct Known {
    /// The text without checksums.
    text: String,
    /// The checksums of `.params` files that may exist beside it; `None` if a version of this program without checksums
    /// has written the sidecar.
    params: Option<Vec<u64>>,
}

/// Parses the text of a sidecar; `None` if this module did not write it.
fn sidecar_of(file: &Path, text: &str) -> Option<Known> {
    let is_sidecar = |text: &str| {
        let fibers = text
            .parse::<toml::Table>()
            .ok()?
            .get("fibers")
            .map_or(0, |fibers| fibers.get("types").and_then(toml::Value::as_array).map_or(0, Vec::len));
        parse(file, text.as_bytes(), fibers).ok()
    };
    match below_checksum(text) {
        Some((below, true)) => is_sidecar(below).map(|_| without_sums(below)),
        Some((_, false)) => None,
        // A sidecar written by hand has comments, another order, another number format, or no unit.
        None => {
            let sidecar = is_sidecar(text)?;
            let is_written = sidecar.length_unit.is_some() && sidecar.to_toml().ok()? == text;
            is_written.then(|| Known { text: text.to_owned(), params: None })
        }
    }
}

/// Separates the checksums from the rest of the sidecar.
fn without_sums(mut text: &str) -> Known {
    let mut sums = Vec::new();
    while let Some((line, rest)) = text.split_once('\n')
        && let Some(sum) = line.strip_prefix(PARAMS_LINE)
    {
        sums.extend(u64::from_str_radix(sum, 16));
        text = rest;
    }
    Known { text: text.to_owned(), params: Some(sums) }
}

/// Reads the text of a regular file or of the target of a link; `None` if there is no such file.
fn text_of(path: &Path) -> Result<Option<String>, FileSetError> {
    let what = match std::fs::metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(source) => return Err(FileSetError::Write { path: path.to_owned(), source }),
        Ok(there) if !there.is_file() => "is not a regular file",
        Ok(_) => match std::fs::read(path).map(String::from_utf8) {
            Ok(Ok(text)) => return Ok(Some(text)),
            Ok(Err(_)) => "is not text, so it was not written with a network",
            Err(source) => return Err(FileSetError::Write { path: path.to_owned(), source }),
        },
    };
    Err(FileSetError::UnknownOrigin { path: path.to_owned(), what })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fiber::law::{FiberMaterial, Law};
    use crate::fiber::network::file::{read, write_params};

    const BARE: &str = "9 8 0\n0 0 0\n2 0 0\n0 2 0\n2 2 0\n0 0 2\n2 0 2\n0 2 2\n2 2 2\n1 1 1\n\
                        0 8\n1 8\n2 8\n3 8\n4 8\n5 8\n6 8\n7 8\n";

    fn network(folder: &Path, law: Law) -> (Network, Sidecar) {
        let path = folder.join("bare.txt");
        std::fs::write(&path, BARE).unwrap();
        let material = FiberMaterial { law, radius: 1e-7, density: None };
        let network = Network::clone(&read(&path).unwrap().network).of_one_material(material.clone());
        let length_unit = Some("edge of the cube".to_owned());
        (network, Sidecar { material: Some(material), length_unit, ..Sidecar::default() })
    }

    #[test]
    fn the_files_of_a_killed_process_can_be_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let [soft, stiff] = [1e6, 1e8].map(|youngs_modulus| network(folder.path(), Law::Linear { youngs_modulus }));
        // The `.params` format cannot hold this law.
        let curved = network(folder.path(), Law::Exponential { youngs_modulus: 1e7, nonlinearity: 1.2 });
        for (number, (before, after)) in
            [(None, &soft), (Some(&soft), &stiff), (Some(&soft), &curved), (Some(&curved), &stiff)]
                .into_iter()
                .enumerate()
        {
            for files in 0.. {
                let path = folder.path().join(format!("net-{number}-{files}.txt"));
                if let Some((network, sidecar)) = before {
                    write_file_set(&path, network, sidecar).unwrap();
                }
                let mut left: usize = files;
                let before_each = || {
                    left = left.checked_sub(1).ok_or_else(|| io::Error::other("killed"))?;
                    Ok(())
                };
                if write_one_by_one(&path, &after.0, &after.1, before_each).is_ok() {
                    assert!(files >= 3);
                    break;
                }
                for (network, sidecar) in [after, &soft] {
                    write_file_set(&path, network, sidecar)
                        .unwrap_or_else(|error| panic!("after {files} files: {error}"));
                    let law = read(&path).unwrap().network.materials()[0].law.clone();
                    assert_eq!(law, network.materials()[0].law, "after {files} files");
                }
            }
        }
    }

    #[test]
    fn a_params_file_from_another_source_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let [soft, stiff] = [1e6, 1e8].map(|youngs_modulus| network(folder.path(), Law::Linear { youngs_modulus }));
        let path = folder.path().join("net.txt");
        write_file_set(&path, &soft.0, &soft.1).unwrap();
        write_params(&path, &stiff.0).unwrap();
        let error = write_file_set(&path, &stiff.0, &stiff.1).unwrap_err().to_string();
        assert!(error.contains("net.txt.params: was not written with the network"), "{error}");
    }
}
