//! Writing of network files, completely or not at all.

use std::ffi::OsString;
use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};

use super::super::Network;
use crate::fiber::law::{FiberMaterial, Law};
use crate::output;

/// Density, in kg/m^3, written for a material without one: the format requires a value, but static analyses do not use
/// it.
const NO_DENSITY: f64 = 1.0;

/// Writes the nodes (in unit-cube units) and fibers of a network in the text format, without the materials.
///
/// Coordinates are written such that they are read back bitwise. The file is written completely or not at all;
/// symbolic links, devices and pipes are treated as in [`output::write`].
///
/// # Errors
/// Returns the error of the operating system.
pub fn write(path: &Path, network: &Network) -> io::Result<()> {
    write_parts(path, network.nodes(), network.fibers())
}

/// Like [`write()`], for nodes and fibers that do not form a [`Network`], in any unit.
///
/// # Errors
/// Returns the error of the operating system.
pub fn write_parts(path: &Path, nodes: &[[f64; 3]], fibers: &[[u32; 2]]) -> io::Result<()> {
    let mut text = format!("{} {} 0\n", nodes.len(), fibers.len());
    for [x, y, z] in nodes {
        // This format gives the shortest digits that are read back as the same number. Writing to a string cannot fail.
        let _ = writeln!(text, "{x} {y} {z}");
    }
    for [a, b] in fibers {
        let _ = writeln!(text, "{a} {b}");
    }
    output::write(path, text.as_bytes())
}

/// Writes the materials of a network to the `.params` file beside `path`, the file of the network. A material without a
/// density gets the density 1 kg/m^3.
///
/// # Errors
/// Returns [`io::ErrorKind::InvalidInput`] if [`fits_params`] is false, and otherwise the error of the operating
/// system.
pub fn write_params(path: &Path, network: &Network) -> io::Result<()> {
    output::write(&beside(path, ".params"), params_text(network)?.as_bytes())
}

/// Formats the `.params` file for [`write_params`].
pub(super) fn params_text(network: &Network) -> io::Result<String> {
    if network.materials().is_empty() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "the network has no materials"));
    }
    let mut text = format!("{} {}\n", network.materials().len(), network.fibers().len());
    for material in network.materials() {
        let Some(line) = reaction(material) else {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                "the .params format supports only the laws linear and exponential-stretch",
            ));
        };
        text.push_str(&line);
        text.push('\n');
    }
    for reaction in network.material_of() {
        let _ = writeln!(text, "{reaction}");
    }
    Ok(text)
}

/// Returns true if the `.params` format supports the materials of a network: there is at least one, and all laws are
/// `linear` or `exponential-stretch` without buckling.
pub fn fits_params(network: &Network) -> bool {
    !network.materials().is_empty() && network.materials().iter().all(|material| reaction(material).is_some())
}

/// Removes the `.params` file beside `path`, if there is one, so that a new network at `path` does not get the
/// materials of the one it replaces.
///
/// # Errors
/// Returns the error of the operating system, unless the file does not exist.
pub fn remove_params(path: &Path) -> io::Result<()> {
    match std::fs::remove_file(beside(path, ".params")) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Formats the line of a material in a `.params` file; `None` if the format has no reaction for its law.
pub(super) fn reaction(material: &FiberMaterial) -> Option<String> {
    let radius = material.radius;
    let density = material.density.unwrap_or(NO_DENSITY);
    match material.law {
        Law::Linear { youngs_modulus } => Some(format!("0 {radius:e} {youngs_modulus:e} {density}")),
        Law::ExponentialStretch { youngs_modulus, nonlinearity, transition } => {
            Some(format!("1 {radius:e} {youngs_modulus:e} {nonlinearity} {transition} {density}"))
        }
        // The format has these two laws only.
        _ => None,
    }
}

/// Returns the path of a file beside a network: the full name of the network file plus `suffix`.
pub(super) fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(suffix);
    name.into()
}
