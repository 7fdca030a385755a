//! Writing network files: whole or not at all.

use std::ffi::OsString;
use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};

use super::super::Network;
use crate::fiber::law::{FiberMaterial, Law};
use crate::output;

/// Density written where a material states none: the format has a column for it, and nothing static reads it.
const NO_DENSITY: f64 = 1.0;

/// Writes the nodes (in unit-cube units) and fibers of a network in the text format, without the materials.
///
/// Coordinates are written so that reading gives the same bits. The file appears complete or not at all; symbolic links,
/// devices and pipes are treated as [`output::write`] does.
///
/// # Errors
/// What the operating system says.
pub fn write(path: &Path, network: &Network) -> io::Result<()> {
    write_parts(path, network.nodes(), network.fibers())
}

/// The same for nodes and fibers that are no [`Network`], in whatever units they are.
///
/// # Errors
/// What the operating system says.
pub fn write_parts(path: &Path, nodes: &[[f64; 3]], fibers: &[[u32; 2]]) -> io::Result<()> {
    let mut text = format!("{} {} 0\n", nodes.len(), fibers.len());
    for [x, y, z] in nodes {
        // The shortest digits that read back as the same number; writing to a string cannot fail.
        let _ = writeln!(text, "{x} {y} {z}");
    }
    for [a, b] in fibers {
        let _ = writeln!(text, "{a} {b}");
    }
    output::write(path, text.as_bytes())
}

/// Writes the materials of a network into the `.params` file beside `path` (the network's own file). A material
/// without a density gets 1.
///
/// # Errors
/// [`io::ErrorKind::InvalidInput`] where [`fits_params`] says no; otherwise what the operating system says.
pub fn write_params(path: &Path, network: &Network) -> io::Result<()> {
    output::write(&beside(path, ".params"), params_text(network)?.as_bytes())
}

/// What [`write_params`] writes.
pub(super) fn params_text(network: &Network) -> io::Result<String> {
    if network.materials().is_empty() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "the network has no materials"));
    }
    let mut text = format!("{} {}\n", network.materials().len(), network.fibers().len());
    for material in network.materials() {
        let Some(line) = reaction(material) else {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                "the .params format knows the laws linear and exponential-stretch only",
            ));
        };
        text.push_str(&line);
        text.push('\n');
    }
    for reaction in network.reaction_of() {
        let _ = writeln!(text, "{reaction}");
    }
    Ok(text)
}

/// Whether the `.params` format can hold the materials of a network: there are some, and all their laws are `linear` or
/// `exponential-stretch` and take compression as they do tension.
#[must_use]
pub fn fits_params(network: &Network) -> bool {
    !network.materials().is_empty() && network.materials().iter().all(|material| reaction(material).is_some())
}

/// Removes the `.params` file beside `path`, if there is one: a network written anew must not find the materials of
/// the one it replaces.
///
/// # Errors
/// What the operating system says, unless it is that there is no such file.
pub fn remove_params(path: &Path) -> io::Result<()> {
    match std::fs::remove_file(beside(path, ".params")) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// The line of a material in a `.params` file; `None` for a law that has no number there.
pub(super) fn reaction(material: &FiberMaterial) -> Option<String> {
    let radius = material.radius;
    let density = material.density.unwrap_or(NO_DENSITY);
    match material.law {
        Law::Linear { youngs_modulus } => Some(format!("0 {radius:e} {youngs_modulus:e} {density}")),
        Law::ExponentialStretch { youngs_modulus, nonlinearity, transition } => {
            Some(format!("1 {radius:e} {youngs_modulus:e} {nonlinearity} {transition} {density}"))
        }
        Law::Exponential { .. } | Law::Table(_) | Law::NoCompression { .. } | Law::Custom(_) => None,
    }
}

/// The file that goes with a network: its whole name with something behind it.
pub(super) fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(suffix);
    name.into()
}
