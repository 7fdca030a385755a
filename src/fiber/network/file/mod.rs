//! Network files, as published networks come: see [`read`] for the format.

mod body;
#[cfg(feature = "app")]
pub mod family;
#[cfg(feature = "app")]
mod fiber_types;
#[cfg(feature = "app")]
mod generated;
mod lines;
#[cfg(feature = "app")]
mod named_law;
mod params;
#[cfg(feature = "app")]
pub mod sidecar;
#[cfg(test)]
mod tests;
mod write;

use std::io::ErrorKind;
use std::path::Path;

use super::{Cube, Network};
#[cfg(feature = "app")]
use crate::fiber::law::FiberMaterial;
use crate::input::{InputError, InputErrors};

pub use write::{fits_params, remove_params, write, write_params, write_parts};

/// A network with what its files say beyond it.
#[derive(Clone, Debug)]
pub struct NetworkFile {
    /// The network, with the materials of the files beside it.
    pub network: Network,
    /// What was strange but could be read, a sentence each, with the file and the line.
    pub warnings: Vec<String>,
    /// The cube that the nodes filled, in the units of the file.
    pub cube: Cube,
    /// Pairs of nodes (from 0) that the file calls periodic. They are not used: the boundary moves affinely.
    pub periodic: Vec<[u32; 2]>,
    /// What the `.toml` file beside the network says, if there is one.
    #[cfg(feature = "app")]
    pub sidecar: Option<sidecar::Sidecar>,
}

/// Reads a network, and what its fibers are made of from the files beside it.
///
/// The format is whitespace-separated text:
///
/// ```text
/// NODES FIBERS PERIODIC        three counts
/// x y z                        one line a node
/// i j                          one line a fiber, nodes counted from 0
/// a b                          one line a periodic pair, counted from 1
/// ```
///
/// Beside `NAME` there may be `NAME.params`, with reactions first and then the reaction of every fiber,
///
/// ```text
/// REACTIONS FIBERS
/// 0 radius E density                    linear
/// 1 radius E B lambda_t density         exponential-stretch
/// k                                     one line a fiber: its reaction, from 0
/// ```
///
/// and (with the feature `app`) `NAME.toml`, whose laws count where there is no `.params` file. Lines may be blank;
/// numbers that trail those counted are ignored with a warning. Fibers that join two nodes that another fiber joins
/// already count each, with one warning a file. The network is centered and scaled to the unit cube.
///
/// # Errors
/// Everything wrong in the files, up to some twenty errors, each with its line: wrong counts, words that are no
/// numbers, NaN and infinity, nodes and reactions that do not exist, fibers of no length, two nodes at one place, a box
/// that is no cube, parameters that no fiber can have.
pub fn read(path: &Path) -> Result<NetworkFile, InputErrors> {
    let bytes = std::fs::read(path).map_err(|error| InputError::unreadable(path, &error))?;
    let body = body::parse(path, &bytes)?;
    let mut warnings = body.warnings;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut network = Network::in_cube(name, body.cube, body.nodes, body.fibers)
        .map_err(|error| InputError::in_file(path, error.to_string(), "a network in a cube", lines::COMPARE))?;
    let params_file = write::beside(path, ".params");
    if let Some(bytes) = read_if_present(&params_file)? {
        let params = params::parse(&params_file, &bytes, network.fibers().len())?;
        warnings.extend(params.warnings);
        network = network
            .with_materials(params.materials, params.reaction_of)
            .map_err(|error| InputError::in_file(&params_file, error.to_string(), "materials", lines::COMPARE))?;
    }
    #[cfg(feature = "app")]
    let sidecar = sidecar::read_beside(path, network.fibers().len())?;
    #[cfg(feature = "app")]
    if let Some(sidecar) = &sidecar {
        network = take_laws(network, sidecar, path, &mut warnings)?;
    }
    Ok(NetworkFile {
        network,
        warnings,
        cube: body.cube,
        periodic: body.periodic,
        #[cfg(feature = "app")]
        sidecar,
    })
}

/// The laws of the sidecar, unless the `.params` file came first.
#[cfg(feature = "app")]
fn take_laws(
    network: Network,
    sidecar: &sidecar::Sidecar,
    path: &Path,
    warnings: &mut Vec<String>,
) -> Result<Network, InputError> {
    let (materials, type_of) = match (&sidecar.fiber_types, &sidecar.material) {
        (Some(types), _) => (types.materials.clone(), types.type_of.clone()),
        (None, Some(material)) => (vec![material.clone()], vec![0; network.fibers().len()]),
        (None, None) => return Ok(network),
    };
    if network.materials().is_empty() {
        let file = write::beside(path, ".toml");
        return network
            .with_materials(materials, type_of)
            .map_err(|error| InputError::in_file(&file, error.to_string(), "materials", lines::COMPARE));
    }
    let same = |(a, b): (&FiberMaterial, &FiberMaterial)| a.law == b.law && a.radius == b.radius;
    let alike = network.materials().len() == materials.len()
        && network.materials().iter().zip(&materials).all(same)
        && network.reaction_of() == type_of;
    if !alike {
        let file = path.display();
        warnings.push(format!("{file}.toml: its law differs from that of {file}.params, which counts"));
    }
    Ok(network)
}

fn read_if_present(path: &Path) -> Result<Option<Vec<u8>>, InputError> {
    match std::fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(InputError::unreadable(path, &error)),
    }
}
