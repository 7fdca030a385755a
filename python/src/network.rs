//! `Network`: fiber networks from files, generators and arrays.

use std::path::PathBuf;
use std::sync::Arc;

use biotissue::fiber::network::file::file_set::{FileSetError, write_file_set};
use biotissue::fiber::network::file::sidecar::{FiberTypes, Sidecar};
use biotissue::fiber::network::generate::{Alignment, GeneratorParams, Kind};
use biotissue::fiber::network::{Network, file};
use numpy::PyArrayDyn;
use pyo3::exceptions::{PyFileExistsError, PyOSError};
use pyo3::prelude::*;

use crate::arrays::{Numbers, array, array_of_rows, indices};
use crate::errors::{check_exists, input_error, value_error, warn};
use crate::law::PyLaw;

/// A fiber network in the unit cube ``[-1/2, 1/2]**3``.
///
/// Nodes with a coordinate of -1/2 or 1/2 are boundary nodes, whose positions follow the deformation gradient; all
/// others are interior nodes, which find their equilibrium. A network does not change.
///
/// Parameters
/// ----------
/// nodes : array_like, shape (n, 3)
///     Positions in any unit of length. Their bounding box must be a cube, which is scaled to the unit cube.
/// fibers : array_like of int, shape (m, 2)
///     The two nodes of every fiber, from 0.
/// name : str
///     The name in messages.
///
/// Raises
/// ------
/// ValueError
///     If the nodes and fibers do not form a network.
#[pyclass(frozen, name = "Network", module = "biotissue")]
pub struct PyNetwork {
    pub network: Arc<Network>,
}

impl From<Network> for PyNetwork {
    fn from(network: Network) -> Self {
        Self { network: Arc::new(network) }
    }
}

#[pymethods]
impl PyNetwork {
    #[new]
    #[pyo3(signature = (nodes, fibers, name = "network"))]
    fn new(nodes: &Bound<'_, PyAny>, fibers: &Bound<'_, PyAny>, name: &str) -> PyResult<Self> {
        let nodes = Numbers::of(nodes)?.rows::<3>("nodes", "x, y, z")?;
        let ends = Numbers::of(fibers)?.rows::<2>("fibers", "the two nodes of a fiber")?;
        let mut fibers = Vec::with_capacity(ends.len());
        for (fiber, ends) in ends.into_iter().enumerate() {
            for end in ends {
                if !(end.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&end)) {
                    return Err(value_error(format!("fiber {fiber} ends at node {end}; nodes are numbered from 0")));
                }
            }
            fibers.push(ends.map(|end| end as u32));
        }
        Ok(Network::new(name, nodes, fibers).map_err(value_error)?.into())
    }

    /// Read a network from a file, with the laws in the files ``PATH.params`` or ``PATH.toml`` beside it.
    ///
    /// Irregularities that do not prevent reading are reported as warnings.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///     A text file in the format of published networks, the current or the older one.
    ///
    /// Raises
    /// ------
    /// FileNotFoundError
    ///     If there is no such file.
    /// ValueError
    ///     If the file has errors; the message lists them with their lines.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        check_exists(&path)?;
        let read = py.detach(|| file::read(&path)).map_err(|errors| input_error(&errors))?;
        warn(py, &read.warnings)?;
        Ok(read.network.into())
    }

    /// Generate a Delaunay network: the edges between random points; rigid, about 15 fibers at a node.
    ///
    /// The same arguments give the same network on every machine.
    ///
    /// Parameters
    /// ----------
    /// points : int
    ///     Number of points in the cube, which are the interior nodes.
    /// seed : int
    ///     Seed of the random numbers.
    /// direction : array_like, shape (3,), optional
    ///     The preferred direction of the fibers, of any length.
    /// strength : float
    ///     The order parameter ``P2`` of the fibers about `direction`, from 0 (isotropic) to 0.95.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If an argument is out of range, or the network does not fill the cube.
    #[staticmethod]
    #[pyo3(signature = (points, seed, *, direction = None, strength = 0.0))]
    fn delaunay(
        py: Python<'_>,
        points: usize,
        seed: u64,
        direction: Option<&Bound<'_, PyAny>>,
        strength: f64,
    ) -> PyResult<Self> {
        generate(py, Kind::Delaunay, points, seed, (direction, strength))
    }

    /// Generate a Voronoi network: the edges of the cells of random points; floppy, 4 fibers at a node.
    ///
    /// The same arguments give the same network on every machine.
    ///
    /// Parameters
    /// ----------
    /// points : int
    ///     Number of points in the cube; a network has about 6.7 nodes for each.
    /// seed : int
    ///     Seed of the random numbers.
    /// direction : array_like, shape (3,), optional
    ///     The preferred direction of the fibers, of any length.
    /// strength : float
    ///     The order parameter ``P2`` of the fibers about `direction`, from 0 (isotropic) to 0.95.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If an argument is out of range, or the network does not fill the cube.
    #[staticmethod]
    #[pyo3(signature = (points, seed, *, direction = None, strength = 0.0))]
    fn voronoi(
        py: Python<'_>,
        points: usize,
        seed: u64,
        direction: Option<&Bound<'_, PyAny>>,
        strength: f64,
    ) -> PyResult<Self> {
        generate(py, Kind::Voronoi, points, seed, (direction, strength))
    }

    /// Write the network, and its laws to the files beside it, completely or not at all.
    ///
    /// Coordinates are in units of the cube's edge, and are read back exactly.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///     The network file; the laws are in ``PATH.toml`` and, if it can hold them, ``PATH.params``.
    ///
    /// Raises
    /// ------
    /// FileExistsError
    ///     If a file beside it was not written with a network; nothing is written.
    /// OSError
    ///     If a file cannot be written.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let network = &self.network;
        py.detach(|| write_file_set(&path, network, &laws_of(network))).map_err(|error| match error {
            FileSetError::UnknownOrigin { .. } => PyFileExistsError::new_err(error.to_string()),
            FileSetError::Write { .. } => PyOSError::new_err(error.to_string()),
        })
    }

    /// str: The name of the file, or the name that the generator or the caller has given.
    #[getter]
    fn name(&self) -> &str {
        self.network.name()
    }

    /// numpy.ndarray: Positions of the nodes at rest in units of the cube's edge; float64, shape (n, 3).
    #[getter]
    fn nodes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        array_of_rows(py, self.network.nodes())
    }

    /// numpy.ndarray: The two nodes of every fiber, from 0; int64, shape (m, 2).
    #[getter]
    fn fibers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        let fibers: Vec<[i64; 2]> = self.network.fibers().iter().map(|ends| ends.map(i64::from)).collect();
        array_of_rows(py, &fibers)
    }

    /// numpy.ndarray: Lengths of the fibers at rest in units of the cube's edge; float64, shape (m,).
    #[getter]
    fn lengths<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let lengths = self.network.lengths();
        array(py, lengths.to_vec(), &[lengths.len()])
    }

    /// numpy.ndarray: The boundary nodes, ascending; int64.
    #[getter]
    fn boundary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        indices(py, self.network.boundary().iter().copied())
    }

    /// numpy.ndarray: The interior nodes, ascending; int64.
    #[getter]
    fn interior<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        indices(py, self.network.interior().iter().copied())
    }

    /// list[Law]: The laws that were read with the network; empty if there are none.
    #[getter]
    fn laws(&self) -> Vec<PyLaw> {
        self.network.materials().iter().map(|material| PyLaw { material: material.clone() }).collect()
    }

    /// numpy.ndarray: The law of every fiber, as an index into `laws`; int64, shape (m,). Zeros if there are no laws.
    #[getter]
    fn law_of<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        indices(py, self.network.material_of().iter().copied().map(u32::from))
    }

    fn __repr__(&self) -> String {
        let network = &self.network;
        format!(
            "<biotissue.Network {}: {} nodes ({} interior), {} fibers>",
            network.name(),
            network.nodes().len(),
            network.interior().len(),
            network.fibers().len()
        )
    }
}

fn generate(
    py: Python<'_>,
    kind: Kind,
    points: usize,
    seed: u64,
    (direction, strength): (Option<&Bound<'_, PyAny>>, f64),
) -> PyResult<PyNetwork> {
    let alignment = match direction {
        Some(direction) => {
            let direction = Numbers::of(direction)?.column("direction")?;
            let &[x, y, z] = &direction[..] else {
                return Err(value_error(format!("direction has {} components, not 3", direction.len())));
            };
            Some(Alignment::new([x, y, z], strength).map_err(value_error)?)
        }
        None if strength != 0.0 => return Err(value_error("a strength of alignment needs a direction")),
        None => None,
    };
    let params = GeneratorParams { alignment, ..GeneratorParams::new(kind, seed) };
    let made = py.detach(|| params.of_points(points)).map_err(value_error)?;
    Ok(made.network.into())
}

/// Returns what the file beside a network tells of its laws.
fn laws_of(network: &Network) -> Sidecar {
    let material = match network.materials() {
        [material] => Some(material.clone()),
        _ => None,
    };
    Sidecar { material, fiber_types: FiberTypes::of(network), ..Sidecar::default() }
}
