//! A deformed fiber network as a VTK file (`.vtp`, PolyData): one line per fiber, numbers as in [`super::fields`].

use std::fmt;
use std::path::Path;

use super::ResultsError;
use super::vtk::{check_count, check_points, groups, integers, positions, read};
use super::vtk_write::{Array, Cells, Piece, write};
use crate::app::vtu::decode::Numbers;
use crate::app::vtu::file::Content;
use crate::fem::mesh::IntegrationPoint;
use crate::output;

/// Name of the array of displacements.
const DISPLACEMENT: &str = "displacement";

/// A network, borrowed for writing; the fiber arrays have one entry per fiber.
#[derive(Clone, Copy, Debug, Default)]
pub struct NetworkSet<'a> {
    /// Positions of the nodes, in units of the unit cube.
    pub points: &'a [[f64; 3]],
    /// Displacements of the nodes from the undeformed network, in the same units; not written if empty.
    pub displacements: &'a [[f64; 3]],
    /// The two nodes of every fiber, from 0.
    pub fibers: &'a [[u32; 2]],
    /// Current length divided by reference length.
    pub stretch: &'a [f64],
    /// Axial force, N, positive in tension.
    pub force: &'a [f64],
    /// Index of the fiber's material in the network file, from 0.
    pub kind: &'a [i64],
}

/// A network read from a file: the owned counterpart of [`NetworkSet`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Networks {
    /// Positions of the nodes, in units of the unit cube.
    pub points: Vec<[f64; 3]>,
    /// Displacements of the nodes from the undeformed network, in the same units; empty if the file has none.
    pub displacements: Vec<[f64; 3]>,
    /// The two nodes of every fiber, each below the number of points.
    pub fibers: Vec<[u32; 2]>,
    /// Current length divided by reference length.
    pub stretch: Vec<f64>,
    /// Axial force, N, positive in tension.
    pub force: Vec<f64>,
    /// Index of the fiber's material in the network file, from 0.
    pub kind: Vec<i64>,
}

/// The RVE whose network a file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct NetworkPoint {
    /// The element, from 0.
    pub element: usize,
    /// The integration point within the element, from 0; `None` if the element has a single one.
    pub point: Option<usize>,
}

impl From<IntegrationPoint> for NetworkPoint {
    fn from(IntegrationPoint { element, point, points }: IntegrationPoint) -> Self {
        Self { element: element as usize, point: (points > 1).then_some(point.into()) }
    }
}

impl fmt::Display for NetworkPoint {
    /// Writes the first part of the names of files: `element-00012` or `element-00012-point-03`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "element-{:05}", self.element)?;
        self.point.map_or(Ok(()), |point| write!(f, "-point-{point:02}"))
    }
}

/// Returns the name of the file of an RVE and a step, in the folder of networks.
pub fn network_file(point: NetworkPoint, step: usize) -> String {
    format!("{point}-step-{step:05}.vtp")
}

/// Returns the name of the collection of an RVE, in the folder of networks.
pub fn network_collection(point: NetworkPoint) -> String {
    format!("{point}.pvd")
}

/// Writes a network to `path`, which should end in `.vtp`. An existing file is replaced atomically; symbolic links,
/// devices and pipes are treated as in [`output::write`].
///
/// # Errors
/// Returns [`ResultsError::Length`] or [`ResultsError::ElementNode`] (of a fiber) if the arrays do not match (nothing
/// is written), or [`ResultsError::Write`] if the file cannot be written.
pub fn write_vtp(path: &Path, network: &NetworkSet) -> Result<(), ResultsError> {
    let lengths = [("stretch", network.stretch.len()), ("force", network.force.len()), ("type", network.kind.len())];
    for (name, found) in lengths {
        ResultsError::check_length(path, name, found, network.fibers.len())?;
    }
    if !network.displacements.is_empty() {
        ResultsError::check_length(path, DISPLACEMENT, network.displacements.len(), network.points.len())?;
    }
    check_points(path, network.fibers.iter().map(<[u32; 2]>::as_slice), network.points.len())?;
    output::write_by(path, |file| write(file, &piece(network))).map_err(ResultsError::write(path))
}

/// Returns what a file of the network holds: a line for each fiber.
fn piece<'a>(network: &NetworkSet<'a>) -> Piece<'a> {
    let cells = Cells {
        connectivity: network.fibers.as_flattened().iter().map(|&node| node.into()).collect(),
        offsets: (1..=network.fibers.len() as i64).map(|fiber| 2 * fiber).collect(),
        types: None,
    };
    let displacements = Array::vectors(DISPLACEMENT, network.displacements);
    Piece {
        positions: network.points,
        cells,
        of_points: if network.displacements.is_empty() { Vec::new() } else { vec![displacements] },
        of_cells: vec![
            Array::scalars("stretch", network.stretch),
            Array::scalars("force", network.force),
            Array::integers("type", network.kind),
        ],
    }
}

/// Reads a file written by [`write_vtp`].
///
/// # Errors
/// Returns [`ResultsError::Read`] if the file cannot be read; [`ResultsError::Damaged`], [`ResultsError::Length`] or
/// [`ResultsError::ElementNode`] (of a fiber) if it does not hold a valid network.
pub fn read_vtp(path: &Path) -> Result<Networks, ResultsError> {
    const EXPECTED: &str = "a fiber network in VTK's XML form";
    let grid = read(path, Content::Lines, EXPECTED)?;
    let (line, ends) = (grid.offsets.line, integers(path, &grid.offsets, EXPECTED)?);
    let nodes = integers(path, &grid.connectivity, EXPECTED)?;
    if ends.iter().zip(1..).any(|(&end, fiber)| end != 2 * fiber) || nodes.len() != 2 * ends.len() {
        let what = "holds other lines than fibers of two nodes";
        return Err(ResultsError::damaged(path, Some(line), what, EXPECTED));
    }
    let points = positions(path, grid.positions, EXPECTED)?;
    let fibers = fibers(path, nodes.as_chunks().0, points.len())?;
    let mut network = Networks { points, fibers, ..Networks::default() };
    for array in grid.of_points {
        check_count(path, &array, network.points.len())?;
        if let (DISPLACEMENT, 3, Numbers::Reals(values)) = (array.name.as_str(), array.components, array.numbers) {
            network.displacements = groups(&values);
        }
    }
    for array in grid.of_cells {
        match (array.name.as_str(), array.numbers) {
            ("stretch", Numbers::Reals(values)) => network.stretch = values,
            ("force", Numbers::Reals(values)) => network.force = values,
            ("type", Numbers::Integers(values)) => network.kind = values,
            _ => {}
        }
    }
    let lengths = [("stretch", network.stretch.len()), ("force", network.force.len()), ("type", network.kind.len())];
    for (name, found) in lengths {
        ResultsError::check_length(path, name, found, network.fibers.len())?;
    }
    Ok(network)
}

/// Returns the nodes of the fibers, which must be below `points`.
fn fibers(path: &Path, lines: &[[i64; 2]], points: usize) -> Result<Vec<[u32; 2]>, ResultsError> {
    let of = |(element, line): (usize, &[i64; 2])| match line.iter().find(|&&node| node < 0 || node >= points as i64) {
        Some(&node) => Err(ResultsError::ElementNode { path: path.into(), element, node, nodes: points }),
        None => Ok(line.map(|node| node as u32)),
    };
    lines.iter().enumerate().map(of).collect()
}
