//! Reading and writing of network files in the format of published networks; see [`read`].

mod body;
#[cfg(feature = "app")]
mod fiber_types;
#[cfg(feature = "app")]
pub mod file_set;
#[cfg(feature = "app")]
mod generated;
mod lines;
#[cfg(feature = "app")]
mod named_law;
mod older;
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

/// A network and the other contents of its files.
#[derive(Clone, Debug)]
pub struct NetworkFile {
    /// The network, with the materials from its own files.
    pub network: Network,
    /// Irregularities that do not prevent reading, one sentence each, with the file and the line.
    pub warnings: Vec<String>,
    /// The cube that the nodes fill, in the units of the file.
    pub cube: Cube,
    /// Pairs of periodic nodes (from 0) listed in the file. They are not used: the boundary moves affinely.
    pub periodic: Vec<[u32; 2]>,
    /// The contents of the `.toml` file beside the network, if there is one.
    #[cfg(feature = "app")]
    pub sidecar: Option<sidecar::Sidecar>,
}

/// Reads a network, with the fiber materials from the files beside it.
///
/// The format is whitespace-separated text:
///
/// ```text
/// NODES FIBERS PERIODIC        three counts
/// x y z                        one line per node
/// i j                          one line per fiber, nodes counted from 0
/// a b                          one line per periodic pair, counted from 1
/// ```
///
/// The older format of such files is read too. It gives the ends of every fiber with their positions, and may end with
/// half the edge `h` of the cube `[-h, h]^3`:
///
/// ```text
/// NODES DOFS FIBERS            three counts, DOFS = 3 NODES
/// id n1 n2 x y z x y z         one line per fiber, nodes counted from 1
/// h                            optional
/// ```
///
/// It is recognized by the nine columns of its first fiber, where the counts do not agree with the current format.
/// Without `h`, the cube is the unit cube `[-1/2, 1/2]^3` if all nodes lie in it and one on its faces, and otherwise the
/// bounding box. If the fibers do not reach all faces of the cube, nodes without fibers are added at two corners.
///
/// A file `NAME.params` beside `NAME` may first list reactions, that is, fiber materials, and then the reaction of
/// every fiber:
///
/// ```text
/// REACTIONS FIBERS
/// 0 radius E density                    linear
/// 1 radius E B lambda_t density         exponential-stretch
/// k                                     one line per fiber: its reaction, from 0
/// ```
///
/// With the feature `app`, a file `NAME.toml` may define laws, which are used if there is no `.params` file. Blank
/// lines are allowed; extra numbers on a line are ignored with a warning. If several fibers join the same two nodes,
/// all of them contribute, with one warning per file. The network is centered and scaled to the unit cube, whatever the
/// unit of its coordinates; [`NetworkFile::cube`] is the cube in that unit.
///
/// # Errors
/// Returns all errors in the files, up to about twenty, each with its line: wrong counts, words that are not numbers,
/// NaN and infinity, nodes and reactions that do not exist, fibers of zero length, two nodes at the same position, a
/// bounding box that is not a cube, parameters out of range.
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
            .with_materials(params.materials, params.material_of)
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

/// Returns the network with the materials of the sidecar, if it gives any and there is no `.params` file; adds a
/// warning if both give materials that differ.
#[cfg(feature = "app")]
fn take_laws(
    network: Network,
    sidecar: &sidecar::Sidecar,
    path: &Path,
    warnings: &mut Vec<String>,
) -> Result<Network, InputError> {
    let (materials, material_of) = match (&sidecar.fiber_types, &sidecar.material) {
        (Some(types), _) => (types.materials.clone(), types.material_of.clone()),
        (None, Some(material)) => (vec![material.clone()], vec![0; network.fibers().len()]),
        (None, None) => return Ok(network),
    };
    if network.materials().is_empty() {
        let file = write::beside(path, ".toml");
        return network
            .with_materials(materials, material_of)
            .map_err(|error| InputError::in_file(&file, error.to_string(), "materials", lines::COMPARE));
    }
    let same = |(a, b): (&FiberMaterial, &FiberMaterial)| a.law == b.law && a.radius == b.radius;
    let alike = network.materials().len() == materials.len()
        && network.materials().iter().zip(&materials).all(same)
        && network.material_of() == material_of;
    if !alike {
        let file = path.display();
        warnings.push(format!("{file}.toml: its law differs from that of {file}.params, which takes precedence"));
    }
    Ok(network)
}

/// Reads a file; `None` if it does not exist.
fn read_if_present(path: &Path) -> Result<Option<Vec<u8>>, InputError> {
    match std::fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(InputError::unreadable(path, &error)),
    }
}
