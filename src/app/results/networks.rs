//! A deformed fiber network as a VTK file (`.vtp`, PolyData): one line per fiber, numbers as in [`super::fields`].

use std::fmt;
use std::path::Path;

use vtkio::IOBuffer;
use vtkio::model::{Attribute, Attributes, DataArray, DataSet, Piece, PolyDataPiece, VertexNumbers};

use super::ResultsError;
use super::vtk::{array, cells, check_points, encode, groups, read};
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
/// is written), [`ResultsError::Encode`] if the data cannot be encoded, or [`ResultsError::Write`] if the file cannot
/// be written.
pub fn write_vtp(path: &Path, network: &NetworkSet) -> Result<(), ResultsError> {
    let lengths = [("stretch", network.stretch.len()), ("force", network.force.len()), ("type", network.kind.len())];
    for (name, found) in lengths {
        ResultsError::check_length(path, name, found, network.fibers.len())?;
    }
    if !network.displacements.is_empty() {
        ResultsError::check_length(path, DISPLACEMENT, network.displacements.len(), network.points.len())?;
    }
    check_points(path, network.fibers.iter().map(<[u32; 2]>::as_slice), network.points.len())?;
    let bytes = encode(path, data_set(network))?;
    output::write(path, &bytes).map_err(ResultsError::write(path))
}

fn data_set(network: &NetworkSet) -> DataSet {
    let lines = VertexNumbers::XML {
        connectivity: network.fibers.as_flattened().iter().map(|&node| node.into()).collect(),
        offsets: (1..=network.fibers.len() as u64).map(|fiber| 2 * fiber).collect(),
    };
    let cell = vec![
        array(DataArray::new("stretch", 1), network.stretch),
        array(DataArray::new("force", 1), network.force),
        array(DataArray::new("type", 1), network.kind),
    ];
    let displacement = array(DataArray::vectors(DISPLACEMENT), network.displacements.as_flattened());
    let point = if network.displacements.is_empty() { Vec::new() } else { vec![displacement] };
    DataSet::inline(PolyDataPiece {
        points: network.points.as_flattened().to_vec().into(),
        lines: Some(lines),
        data: Attributes { point, cell },
        ..PolyDataPiece::default()
    })
}

/// Reads a file written by [`write_vtp`].
///
/// # Errors
/// Returns [`ResultsError::Read`] if the file cannot be read; [`ResultsError::Damaged`], [`ResultsError::Length`] or
/// [`ResultsError::ElementNode`] (of a fiber) if it does not hold a valid network.
pub fn read_vtp(path: &Path) -> Result<Networks, ResultsError> {
    const EXPECTED: &str = "a fiber network in VTK's XML form";
    let damaged = |what: &str| ResultsError::damaged(path, None, what, EXPECTED);
    let DataSet::PolyData { pieces, .. } = read(path, EXPECTED)? else {
        return Err(damaged("holds another kind of data set"));
    };
    let Some(Piece::Inline(piece)) = pieces.into_iter().next() else {
        return Err(damaged("holds no piece of a network"));
    };
    let IOBuffer::F64(points) = piece.points else {
        return Err(damaged("positions are not 64-bit numbers"));
    };
    let Some(VertexNumbers::XML { connectivity, offsets }) = piece.lines else {
        return Err(damaged("holds no lines"));
    };
    if offsets.iter().zip(1..).any(|(&offset, fiber)| offset != 2 * fiber) {
        return Err(damaged("holds other lines than fibers of two nodes"));
    }
    let points: Vec<[f64; 3]> = groups(&points);
    let fibers = cells(path, &connectivity, points.len())?;
    let mut network = Networks { points, fibers, ..Networks::default() };
    for attribute in piece.data.point {
        if let Attribute::DataArray(array) = attribute
            && let (DISPLACEMENT, 3, IOBuffer::F64(values)) = (array.name.as_str(), array.elem.num_comp(), array.data)
        {
            network.displacements = groups(&values);
        }
    }
    for attribute in piece.data.cell {
        let Attribute::DataArray(array) = attribute else { continue };
        match (array.name.as_str(), array.data) {
            ("stretch", IOBuffer::F64(values)) => network.stretch = values,
            ("force", IOBuffer::F64(values)) => network.force = values,
            ("type", IOBuffer::I64(values)) => network.kind = values,
            _ => {}
        }
    }
    let lengths = [("stretch", network.stretch.len()), ("force", network.force.len()), ("type", network.kind.len())];
    for (name, found) in lengths {
        ResultsError::check_length(path, name, found, network.fibers.len())?;
    }
    if !network.displacements.is_empty() {
        ResultsError::check_length(path, DISPLACEMENT, network.displacements.len(), network.points.len())?;
    }
    Ok(network)
}
