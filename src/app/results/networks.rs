//! A deformed fiber network as a VTK file (`.vtp`, PolyData): one line per fiber, numbers as in [`super::fields`].

use std::path::Path;

use vtkio::IOBuffer;
use vtkio::model::{
    Attribute, Attributes, ByteOrder, DataArray, DataSet, Piece, PolyDataPiece, Version, VertexNumbers, Vtk,
};

use super::ResultsError;
use super::fields::{array, sign};
use super::fields_read::{check_arrays, groups};
use crate::output;

/// A network, borrowed for writing; the fiber arrays have one entry per fiber.
#[derive(Clone, Copy, Debug, Default)]
pub struct NetworkSet<'a> {
    /// Positions of the nodes, in units of the unit cube.
    pub points: &'a [[f64; 3]],
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
    /// The two nodes of every fiber, each below the number of points.
    pub fibers: Vec<[u32; 2]>,
    /// Current length divided by reference length.
    pub stretch: Vec<f64>,
    /// Axial force, N, positive in tension.
    pub force: Vec<f64>,
    /// Index of the fiber's material in the network file, from 0.
    pub kind: Vec<i64>,
}

/// Returns the name of the file of an element and a step, in the folder of networks.
#[must_use]
pub fn network_file(element: usize, step: usize) -> String {
    format!("element-{element:05}-step-{step:05}.vtp")
}

/// Returns the name of the collection of an element, in the folder of networks.
#[must_use]
pub fn network_collection(element: usize) -> String {
    format!("element-{element:05}.pvd")
}

/// Writes a network to `path`, which should end in `.vtp`. An existing file is replaced atomically; symbolic links,
/// devices and pipes are treated as in [`output::write`].
///
/// # Errors
/// Returns [`ResultsError::Length`] or [`ResultsError::ElementNode`] (of a fiber) if the arrays do not match (nothing
/// is written), [`ResultsError::Encode`] if the data cannot be encoded, or [`ResultsError::Write`] if the file cannot
/// be written.
pub fn write_vtp(path: &Path, network: &NetworkSet) -> Result<(), ResultsError> {
    let expected = network.fibers.len();
    let lengths = [("stretch", network.stretch.len()), ("force", network.force.len()), ("type", network.kind.len())];
    for (name, found) in lengths {
        if found != expected {
            return Err(ResultsError::Length { path: path.into(), name: name.into(), found, expected });
        }
    }
    let nodes = network.points.len();
    for (element, ends) in network.fibers.iter().enumerate() {
        if let Some(&node) = ends.iter().find(|&&node| node as usize >= nodes) {
            return Err(ResultsError::ElementNode { path: path.into(), element, node: node.into(), nodes });
        }
    }
    let encode = |source| ResultsError::Encode { path: path.into(), source };
    let mut bytes = Vec::new();
    vtk(network).write_xml(&mut bytes).map_err(encode)?;
    for array in ["connectivity", "offsets"] {
        sign(&mut bytes, array);
    }
    output::write(path, &bytes).map_err(ResultsError::write(path))
}

fn vtk(network: &NetworkSet) -> Vtk {
    let lines = VertexNumbers::XML {
        connectivity: network.fibers.as_flattened().iter().map(|&node| node.into()).collect(),
        offsets: (1..=network.fibers.len() as u64).map(|fiber| 2 * fiber).collect(),
    };
    let cell = vec![
        array(DataArray::new("stretch", 1), network.stretch.to_vec()),
        array(DataArray::new("force", 1), network.force.to_vec()),
        array(DataArray::new("type", 1), network.kind.to_vec()),
    ];
    Vtk {
        version: Version::XML { major: 1, minor: 0 },
        title: String::new(),
        byte_order: ByteOrder::LittleEndian,
        file_path: None,
        data: DataSet::inline(PolyDataPiece {
            points: network.points.as_flattened().to_vec().into(),
            lines: Some(lines),
            data: Attributes { point: Vec::new(), cell },
            ..PolyDataPiece::default()
        }),
    }
}

/// Reads a file written by [`write_vtp`].
///
/// # Errors
/// Returns [`ResultsError::Read`] if the file cannot be read; [`ResultsError::Damaged`], [`ResultsError::Length`] or
/// [`ResultsError::ElementNode`] (of a fiber) if it does not hold a valid network.
pub fn read_vtp(path: &Path) -> Result<Networks, ResultsError> {
    let text = std::fs::read(path).map_err(ResultsError::read(path))?;
    check_arrays(path, &text)?;
    let damaged = |what: String| ResultsError::damaged(path, None, what, "a fiber network in VTK's XML form");
    let vtk = Vtk::parse_xml(text.as_slice()).map_err(|error| damaged(error.to_string()))?;
    let DataSet::PolyData { pieces, .. } = vtk.data else {
        return Err(damaged("holds another kind of data set".into()));
    };
    let Some(Piece::Inline(piece)) = pieces.into_iter().next() else {
        return Err(damaged("holds no piece of a network".into()));
    };
    let IOBuffer::F64(points) = piece.points else {
        return Err(damaged("positions are no 64-bit numbers".into()));
    };
    let Some(VertexNumbers::XML { connectivity, offsets }) = piece.lines else {
        return Err(damaged("holds no lines".into()));
    };
    if offsets.iter().zip(1..).any(|(&offset, fiber)| offset != 2 * fiber) {
        return Err(damaged("holds other lines than fibers of two nodes".into()));
    }
    let mut network = Networks { points: groups(&points), ..Networks::default() };
    let nodes = network.points.len();
    for (element, ends) in connectivity.as_chunks::<2>().0.iter().enumerate() {
        let beyond = |&node: &u64| usize::try_from(node).map_or(true, |node| node >= nodes);
        if let Some(&node) = ends.iter().find(|node| beyond(node)) {
            return Err(ResultsError::ElementNode { path: path.into(), element, node, nodes });
        }
        network.fibers.push(ends.map(|node| node as u32));
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
    let expected = network.fibers.len();
    let lengths = [("stretch", network.stretch.len()), ("force", network.force.len()), ("type", network.kind.len())];
    match lengths.into_iter().find(|(_, found)| *found != expected) {
        Some((name, found)) => Err(ResultsError::Length { path: path.into(), name: name.into(), found, expected }),
        None => Ok(network),
    }
}
