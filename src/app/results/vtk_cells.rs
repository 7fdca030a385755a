//! Elements in VTK files: cell types and the order of their nodes.

use std::path::Path;

use vtkio::model::{CellType as VtkType, Cells, VertexNumbers};

use super::ResultsError;
use crate::fem::element::{CellType, ElementType};
use crate::fem::mesh::Elements;

/// The type of each element type in VTK.
const TYPES: [(ElementType, VtkType); 6] = [
    (ElementType::Tet4, VtkType::Tetra),
    (ElementType::Tet10, VtkType::QuadraticTetra),
    (ElementType::Hex8, VtkType::Hexahedron),
    (ElementType::Hex20, VtkType::QuadraticHexahedron),
    (ElementType::Hex27, VtkType::TriquadraticHexahedron),
    (ElementType::Wedge6, VtkType::Wedge),
];

/// Returns the element type of a number of VTK.
pub(in crate::app) fn volume_type(number: i64) -> Option<ElementType> {
    TYPES.iter().find(|(_, vtk)| i64::from(*vtk as u8) == number).map(|&(element_type, _)| element_type)
}

/// Returns the place in VTK's order of a node, and the reverse: only the triangles of the wedge run the other way round.
pub(in crate::app) fn place(element_type: ElementType, node: usize) -> usize {
    match element_type {
        ElementType::Wedge6 => [0, 2, 1, 3, 5, 4][node],
        _ => node,
    }
}

/// Returns the elements as cells of VTK.
pub(super) fn to_vtk(elements: &Elements) -> Cells {
    let (mut connectivity, mut offsets, mut types) = (Vec::new(), Vec::new(), Vec::new());
    for block in elements.blocks() {
        let element_type = block.cell_type();
        for nodes in block.iter() {
            connectivity.extend((0..nodes.len()).map(|node| u64::from(nodes[place(element_type, node)])));
            offsets.push(connectivity.len() as u64);
            types.push(TYPES[element_type as usize].1);
        }
    }
    Cells { cell_verts: VertexNumbers::XML { connectivity, offsets }, types }
}

/// Returns the elements in cells of VTK; all their nodes must be below `points`.
///
/// # Errors
/// Returns [`ResultsError::Damaged`] for cells of other types or inconsistent offsets, and
/// [`ResultsError::ElementNode`] for a node that does not exist.
pub(super) fn from_vtk(path: &Path, cells: Cells, points: usize) -> Result<Elements, ResultsError> {
    let damaged =
        |what: &str| ResultsError::damaged(path, None, what, "a mesh of tetrahedra, hexahedra and linear wedges");
    let VertexNumbers::XML { connectivity, offsets } = cells.cell_verts else {
        return Err(damaged("cells are in another form"));
    };
    let mut elements = Elements::default();
    let (mut rest, mut start) = (connectivity.as_slice(), 0);
    if offsets.len() != cells.types.len() {
        return Err(damaged("cells have no types"));
    }
    for (element, (vtk, end)) in cells.types.iter().zip(offsets).enumerate() {
        let Some((element_type, _)) = TYPES.iter().find(|(_, other)| other == vtk) else {
            return Err(damaged("holds other cells than tetrahedra, hexahedra and linear wedges"));
        };
        let count = element_type.nodes();
        let Some((of_cell, others)) = rest.split_at_checked(count).filter(|_| start + count as u64 == end) else {
            return Err(damaged("the nodes of the cells do not fit their types"));
        };
        if let Some(&node) = of_cell.iter().find(|&&node| node >= points as u64) {
            return Err(ResultsError::ElementNode { path: path.into(), element, node, nodes: points });
        }
        let nodes: Vec<u32> = (0..count).map(|node| of_cell[place(*element_type, node)] as u32).collect();
        elements.push(*element_type, &nodes);
        (rest, start) = (others, end);
    }
    Ok(elements)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_of_all_types_are_recovered() {
        let mut elements = Elements::default();
        for element_type in ElementType::ALL {
            let nodes: Vec<u32> = (0..element_type.nodes() as u32).collect();
            elements.push(element_type, &nodes);
        }
        let path = Path::new("a.vtu");
        assert_eq!(from_vtk(path, to_vtk(&elements), 27).unwrap(), elements);
        assert!(matches!(from_vtk(path, to_vtk(&elements), 26), Err(ResultsError::ElementNode { element: 4, .. })));
        let mut other = to_vtk(&elements);
        other.types[1] = VtkType::Pyramid;
        assert!(from_vtk(path, other, 27).is_err());
        let mut shifted = to_vtk(&elements);
        shifted.types.swap(0, 1);
        assert!(from_vtk(path, shifted, 27).is_err());
    }

    /// The face 0, 1, 2 of VTK's wedge has its normal toward the other triangle if it points outward.
    #[test]
    fn the_triangles_of_a_wedge_are_reversed() {
        let mut elements = Elements::default();
        elements.push(ElementType::Wedge6, &[10, 11, 12, 13, 14, 15]);
        let VertexNumbers::XML { connectivity, .. } = to_vtk(&elements).cell_verts else { panic!("another form") };
        assert_eq!(connectivity, [10, 12, 11, 13, 15, 14]);
    }
}
