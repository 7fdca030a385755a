//! A network with the files that go beside it, written together; files beside it that come from elsewhere stay as they are.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::sidecar::{Sidecar, parse};
use super::write::beside;
use super::{fits_params, remove_params, write, write_params};
use crate::checksum::{below_signature, signed, sum_of};
use crate::fiber::network::Network;
use crate::output;

/// Begins the line of a sidecar that holds the checksum of the `.params` file beside it.
const PARAMS_LINE: &str = "# Checksum of the .params file: ";

/// Why a network was not written with its files.
#[derive(Debug, Error)]
pub enum FamilyError {
    /// The operating system refused.
    #[error("{}: cannot be written: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Its answer.
        source: io::Error,
    },
    /// A file would be replaced that no network was written with. Nothing was written.
    #[error("{}: {what}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// How that is known.
        what: &'static str,
    },
}

/// Writes a network to `path`, then its materials to `path.params` where the format has a place for them, then `sidecar` to
/// `path.toml`. Files of these two names are replaced only as an earlier call has written them. A device or a pipe gets the
/// network alone.
///
/// # Errors
/// [`FamilyError`].
pub fn write_family(path: &Path, network: &Network, sidecar: &Sidecar) -> Result<(), FamilyError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| FamilyError::Write { path, source }
    };
    if output::is_stream(path) {
        return write(path, network).map_err(failed(path));
    }
    check(path)?;
    let (params, toml) = (beside(path, ".params"), beside(path, ".toml"));
    let mut text = sidecar.to_toml().map_err(failed(&toml))?;
    write(path, network).map_err(failed(path))?;
    if fits_params(network) {
        write_params(path, network).map_err(failed(&params))?;
        let bytes = std::fs::read(&params).map_err(failed(&params))?;
        text = format!("{PARAMS_LINE}{:016x}\n{text}", sum_of(&bytes));
    } else {
        remove_params(path).map_err(failed(&params))?;
    }
    output::write(&toml, signed(&text).as_bytes()).map_err(failed(&toml))
}

/// That what is beside a network may be replaced with it.
fn check(path: &Path) -> Result<(), FamilyError> {
    let target = output::end_of_links(path).map_err(|source| FamilyError::Write { path: path.to_owned(), source })?;
    let [toml, params] = [".toml", ".params"].map(|suffix| beside(path, suffix));
    if target != path {
        // They would describe another network than the one they are beside.
        if let Some(path) = [".toml", ".params"].map(|suffix| beside(&target, suffix)).into_iter().find(|f| f.exists())
        {
            let what = "belongs to the network that the symbolic link leads to, and would no longer fit it";
            return Err(FamilyError::Foreign { path, what });
        }
    }
    let foreign = |path: &Path, what| Err(FamilyError::Foreign { path: path.to_owned(), what });
    let sidecar = text_of(&toml)?.map(|text| sidecar_of(&toml, &text).ok_or(())).transpose();
    let Ok(sidecar) = sidecar else {
        return foreign(&toml, "was not written with a network, or was changed since");
    };
    let Some(text) = text_of(&params)? else { return Ok(()) };
    match sidecar {
        Some(Known::Older) => Ok(()),
        Some(Known::Signed { params: Some(sum) }) if sum == sum_of(text.as_bytes()) => Ok(()),
        _ => foreign(&params, "was not written with the network, or was changed since"),
    }
}

/// A sidecar as it was written.
enum Known {
    /// With the checksum of the `.params` file that was written with it.
    Signed { params: Option<u64> },
    /// By a version that did not sign.
    Older,
}

/// `None` for a text that is not as a sidecar was written.
fn sidecar_of(file: &Path, text: &str) -> Option<Known> {
    let is_sidecar = |text: &str| {
        let fibers = text
            .parse::<toml::Table>()
            .ok()?
            .get("fibers")
            .map_or(0, |fibers| fibers.get("types").and_then(toml::Value::as_array).map_or(0, Vec::len));
        parse(file, text.as_bytes(), fibers).ok()
    };
    match below_signature(text) {
        Some((below, true)) => is_sidecar(below).map(|_| Known::Signed { params: params_sum(below) }),
        Some((_, false)) => None,
        // One that a person wrote has comments, another order, numbers in another form, or no unit.
        None => {
            let sidecar = is_sidecar(text)?;
            (sidecar.length_unit.is_some() && sidecar.to_toml().ok()? == text).then_some(Known::Older)
        }
    }
}

fn params_sum(text: &str) -> Option<u64> {
    let sum = text.lines().next()?.strip_prefix(PARAMS_LINE)?;
    u64::from_str_radix(sum, 16).ok()
}

/// The text of a regular file, or of one that a link leads to; `None` where there is none.
fn text_of(path: &Path) -> Result<Option<String>, FamilyError> {
    let what = match std::fs::metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(source) => return Err(FamilyError::Write { path: path.to_owned(), source }),
        Ok(there) if !there.is_file() => "is no regular file",
        Ok(_) => match std::fs::read(path).map(String::from_utf8) {
            Ok(Ok(text)) => return Ok(Some(text)),
            Ok(Err(_)) => "is no text, so it was not written with a network",
            Err(source) => return Err(FamilyError::Write { path: path.to_owned(), source }),
        },
    };
    Err(FamilyError::Foreign { path: path.to_owned(), what })
}
