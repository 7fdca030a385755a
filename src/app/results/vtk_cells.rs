//! Elements in VTK files: cell types and the order of their nodes.

use std::path::Path;

use super::ResultsError;
use super::vtk::integers;
use super::vtk_write::Cells;
use crate::app::vtu::file::Grid;
use crate::fem::element::{CellType, ElementType};
use crate::fem::mesh::Elements;

/// The number of each element type in VTK.
const TYPES: [(ElementType, u8); 6] = [
    (ElementType::Tet4, 10),
    (ElementType::Tet10, 24),
    (ElementType::Hex8, 12),
    (ElementType::Hex20, 25),
    (ElementType::Hex27, 29),
    (ElementType::Wedge6, 13),
];

/// Returns the element type of a number of VTK.
pub(in crate::app) fn volume_type(number: i64) -> Option<ElementType> {
    TYPES.iter().find(|(_, vtk)| i64::from(*vtk) == number).map(|&(element_type, _)| element_type)
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
            connectivity.extend((0..nodes.len()).map(|node| i64::from(nodes[place(element_type, node)])));
            offsets.push(connectivity.len() as i64);
            types.push(TYPES[element_type as usize].1);
        }
    }
    Cells { connectivity, offsets, types: Some(types) }
}

/// Returns the elements in the cells of a grid.
///
/// # Errors
/// Returns [`ResultsError::Damaged`] for cells of other types or inconsistent offsets, and
/// [`ResultsError::ElementNode`] for a node that does not exist.
pub(super) fn from_vtk(path: &Path, grid: &Grid) -> Result<Elements, ResultsError> {
    const EXPECTED: &str = "a mesh of tetrahedra, hexahedra and linear wedges";
    let damaged = |line, what: &str| ResultsError::damaged(path, Some(line), what, EXPECTED);
    let of = |array| integers(path, array, EXPECTED);
    let (connectivity, offsets, types) = (of(&grid.connectivity)?, of(&grid.offsets)?, of(&grid.types)?);
    let points = grid.positions.numbers.len() / 3;
    let mut elements = Elements::default();
    let (mut rest, mut start) = (connectivity, 0);
    for (element, (&vtk, &end)) in types.iter().zip(offsets).enumerate() {
        let element_type = volume_type(vtk).ok_or_else(|| {
            damaged(grid.types.line, "holds other cells than tetrahedra, hexahedra and linear wedges")
        })?;
        let count = element_type.nodes();
        let (of_cell, others) = rest
            .split_at_checked(count)
            .filter(|_| start + count as i64 == end)
            .ok_or_else(|| damaged(grid.offsets.line, "the nodes of the cells do not fit their types"))?;
        if let Some(&node) = of_cell.iter().find(|&&node| node < 0 || node >= points as i64) {
            return Err(ResultsError::ElementNode { path: path.into(), element, node, nodes: points });
        }
        let nodes: Vec<u32> = (0..count).map(|node| of_cell[place(element_type, node)] as u32).collect();
        elements.push(element_type, &nodes);
        (rest, start) = (others, end);
    }
    Ok(elements)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::vtu::decode::Numbers;
    use crate::app::vtu::file::Array;

    fn grid(cells: Cells, points: usize) -> Grid {
        let array = |numbers| Array { name: String::new(), line: 1, components: 1, numbers };
        let integers = |values| array(Numbers::Integers(values));
        let types = cells.types.unwrap_or_default().into_iter().map(i64::from).collect();
        Grid {
            line: 1,
            positions: Array { components: 3, ..array(Numbers::Reals(vec![0.0; 3 * points])) },
            connectivity: integers(cells.connectivity),
            offsets: integers(cells.offsets),
            types: integers(types),
            of_points: Vec::new(),
            of_cells: Vec::new(),
        }
    }

    #[test]
    fn elements_of_all_types_are_recovered() {
        let mut elements = Elements::default();
        for element_type in ElementType::ALL {
            let nodes: Vec<u32> = (0..element_type.nodes() as u32).collect();
            elements.push(element_type, &nodes);
        }
        let path = Path::new("a.vtu");
        let read = |cells: Cells, points: usize| from_vtk(path, &grid(cells, points));
        assert_eq!(read(to_vtk(&elements), 27).unwrap(), elements);
        assert!(matches!(read(to_vtk(&elements), 26), Err(ResultsError::ElementNode { element: 4, .. })));
        let changed = |change: fn(&mut Cells)| {
            let mut cells = to_vtk(&elements);
            change(&mut cells);
            read(cells, 27)
        };
        const PYRAMID: u8 = 14;
        assert!(changed(|cells| cells.types.as_mut().unwrap()[1] = PYRAMID).is_err());
        assert!(changed(|cells| cells.types.as_mut().unwrap().swap(0, 1)).is_err());
        assert!(matches!(
            changed(|cells| cells.connectivity[2] = -1),
            Err(ResultsError::ElementNode { element: 0, node: -1, .. })
        ));
    }

    /// The face 0, 1, 2 of VTK's wedge has its normal toward the other triangle if it points outward.
    #[test]
    fn the_triangles_of_a_wedge_are_reversed() {
        let mut elements = Elements::default();
        elements.push(ElementType::Wedge6, &[10, 11, 12, 13, 14, 15]);
        assert_eq!(to_vtk(&elements).connectivity, [10, 12, 11, 13, 15, 14]);
    }
}
