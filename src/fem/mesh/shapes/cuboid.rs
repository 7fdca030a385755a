//! The box mesh.

use super::grid::Grid;
use super::{ShapeError, positive};
use crate::fem::element::ElementType;
use crate::fem::mesh::{Mesh, QuadraticHexahedron, Surface};

/// Creates a box of the edge lengths `size` (m) with its lowest corner at the origin; `cells` are the numbers of cells
/// along x, y and z, with six tetrahedra each.
///
/// Nodes are numbered with x running fastest, then y, then z; the elements of a cell are consecutive, in the order of
/// [`KUHN`](super::KUHN). The region is `body`, the surfaces are `x0 x1 y0 y1 z0 z1`.
///
/// # Errors
/// Returns [`ShapeError::NoCells`] or [`ShapeError::NotPositive`] if a number of cells or a length is not positive,
/// [`ShapeError::TooManyElements`] if there are too many cells, or [`ShapeError::Mesh`] if elements are flat in
/// floating-point arithmetic.
pub fn cuboid(cells: [usize; 3], size: [f64; 3]) -> Result<Mesh, ShapeError> {
    let (grid, nodes) = grid(cells, size)?;
    let surfaces = SIDES.map(|(name, axis, upper)| Surface { name: name.into(), faces: grid.side(axis, upper).into() });
    Ok(Mesh::from_shape(nodes, grid.elements(|_| 0), &["body"], surfaces.into())?)
}

/// Creates a box as [`cuboid`] does, of elements of another type: tetrahedra, one hexahedron per cell, or two wedges per
/// cell, which extend along z. The nodes of quadratic elements that are not corners follow the corners.
///
/// # Errors
/// As for [`cuboid`].
pub fn cuboid_of(element_type: ElementType, cells: [usize; 3], size: [f64; 3]) -> Result<Mesh, ShapeError> {
    let linear = match element_type {
        ElementType::Tet4 | ElementType::Tet10 => cuboid(cells, size)?,
        ElementType::Hex8 | ElementType::Hex20 | ElementType::Hex27 => uncut(false, cells, size)?,
        ElementType::Wedge6 => uncut(true, cells, size)?,
    };
    Ok(match element_type {
        ElementType::Tet10 | ElementType::Hex20 => linear.quadratic(QuadraticHexahedron::Serendipity)?,
        ElementType::Hex27 => linear.quadratic(QuadraticHexahedron::Triquadratic)?,
        ElementType::Tet4 | ElementType::Hex8 | ElementType::Wedge6 => linear,
    })
}

/// Name, axis and end of each side.
const SIDES: [(&str, usize, bool); 6] =
    [("x0", 0, false), ("x1", 0, true), ("y0", 1, false), ("y1", 1, true), ("z0", 2, false), ("z1", 2, true)];

/// Returns the box of two wedges per cell, or of one hexahedron.
fn uncut(has_wedges: bool, cells: [usize; 3], size: [f64; 3]) -> Result<Mesh, ShapeError> {
    let (grid, nodes) = grid(cells, size)?;
    let elements = grid.uncut(has_wedges);
    let side = |(name, axis, upper): (&str, usize, bool)| Surface {
        name: name.into(),
        faces: grid.side_of(&elements, axis, upper),
    };
    let (surfaces, region_of) = (SIDES.map(side), vec![0; elements.len()]);
    Ok(Mesh::from_shape(nodes, (elements, region_of), &["body"], surfaces.into())?)
}

/// Returns the grid of a box and the positions of its nodes.
fn grid(cells: [usize; 3], size: [f64; 3]) -> Result<(Grid, Vec<[f64; 3]>), ShapeError> {
    let grid = Grid::new(cells, None)?;
    for (what, length) in ["the size along x", "the size along y", "the size along z"].into_iter().zip(size) {
        positive(what, length)?;
    }
    // The quotient is computed first, because it is exactly 1 at the upper side.
    let along = |axis: usize, step: usize| size[axis] * (step as f64 / cells[axis] as f64);
    let nodes = grid.nodes(|i, j, k| [along(0, i), along(1, j), along(2, k)]);
    Ok((grid, nodes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::mesh::MeshError;
    use crate::fem::mesh::shapes::assert_valid;

    #[test]
    fn one_cell_is_cut_as_documented() {
        let mesh = cuboid([1, 1, 1], [1.0, 2.0, 3.0]).unwrap();
        let corners = (0..8).map(|n| [f64::from(n & 1), f64::from(n >> 1 & 1) * 2.0, f64::from(n >> 2) * 3.0]);
        assert_eq!(mesh.nodes(), corners.collect::<Vec<_>>());
        let documented = ["0137", "0327", "0267", "0647", "0457", "0517"];
        let written: Vec<String> =
            mesh.elements().iter().map(|nodes| nodes.iter().map(u32::to_string).collect::<String>()).collect();
        assert_eq!(written, documented);
        assert_valid(&mesh);
    }

    #[test]
    fn volumes_areas_and_names() {
        let (cells, size) = ([3, 2, 5], [0.3, 0.7, 1.1]);
        let mesh = cuboid(cells, size).unwrap();
        assert_valid(&mesh);
        assert_eq!(mesh.elements().len(), 6 * 3 * 2 * 5);
        assert_eq!(mesh.regions(), ["body"]);
        assert_eq!(mesh.bounding_box(), [[0.0; 3], size]);
        assert!((mesh.volume() - 0.3 * 0.7 * 1.1).abs() < 1e-15);
        assert!((0..mesh.elements().len()).all(|e| (mesh.element_volume(e) * 6.0 - 0.1 * 0.35 * 0.22).abs() < 1e-16));
        assert_eq!(mesh.surface_names().collect::<Vec<_>>(), ["x0", "x1", "y0", "y1", "z0", "z1"]);
        for (k, surface) in mesh.surfaces().iter().enumerate() {
            let (axis, upper) = (k / 2, k % 2);
            let area = size[(axis + 1) % 3] * size[(axis + 2) % 3];
            assert!((mesh.surface_area(surface) - area).abs() < 1e-15, "{}", surface.name);
            let plane = if upper == 1 { size[axis] } else { 0.0 };
            assert!(surface.nodes().iter().all(|&node| mesh.nodes()[node as usize][axis] == plane));
            let center = mesh.surface_center(surface).unwrap();
            let expected = |k: usize| if k == axis { plane } else { size[k] / 2.0 };
            assert!((0..3).all(|k| (center[k] - expected(k)).abs() < 1e-14), "{}: {center:?}", surface.name);
            for (face_type, nodes) in surface.faces.typed() {
                let normal = mesh.area_vector(face_type, nodes);
                assert_eq!(normal[axis] > 0.0, upper == 1, "{} points inward", surface.name);
            }
        }
    }

    #[test]
    fn boxes_of_all_element_types() {
        for (element_type, elements, nodes) in [
            (ElementType::Tet4, 36, 24),
            (ElementType::Tet10, 36, 105),
            (ElementType::Hex8, 6, 24),
            (ElementType::Hex20, 6, 70),
            (ElementType::Hex27, 6, 105),
            (ElementType::Wedge6, 12, 24),
        ] {
            let size = [0.3, 0.7, 1.1];
            let mesh = cuboid_of(element_type, [3, 2, 1], size).unwrap();
            assert_valid(&mesh);
            assert_eq!((mesh.elements().len(), mesh.nodes().len()), (elements, nodes), "{element_type:?}");
            assert!((mesh.volume() - 0.3 * 0.7 * 1.1).abs() < 1e-15);
            for (k, surface) in mesh.surfaces().iter().enumerate() {
                let (axis, upper) = (k / 2, k % 2);
                let area = size[(axis + 1) % 3] * size[(axis + 2) % 3];
                assert!((mesh.surface_area(surface) - area).abs() < 1e-15, "{element_type:?} {}", surface.name);
                let plane = if upper == 1 { size[axis] } else { 0.0 };
                assert!(surface.nodes().iter().all(|&node| mesh.nodes()[node as usize][axis] == plane));
                for (face_type, nodes) in surface.faces.typed() {
                    assert_eq!(
                        mesh.area_vector(face_type, nodes)[axis] > 0.0,
                        upper == 1,
                        "{} points inward",
                        surface.name
                    );
                }
            }
        }
    }

    #[test]
    fn invalid_boxes_are_errors() {
        let unit = [1.0; 3];
        assert_eq!(cuboid([1, 0, 1], unit), Err(ShapeError::NoCells([1, 0, 1])));
        assert_eq!(cuboid([1000; 3], unit), Err(ShapeError::TooManyElements(6_000_000_000)));
        assert_eq!(cuboid([usize::MAX; 3], unit), Err(ShapeError::TooManyElements(u64::MAX)));
        for bad in [0.0, -1.0, f64::INFINITY, f64::NAN] {
            let error = cuboid([1; 3], [1.0, bad, 1.0]).unwrap_err();
            assert_eq!(error.to_string(), format!("the size along y is {bad}: it must be positive and finite"));
        }
        for flat in [[1.0, 1.0, 1e-13], [1e200; 3], [1e-200; 3]] {
            assert!(
                matches!(cuboid([1; 3], flat), Err(ShapeError::Mesh(MeshError::Flat { element: 0, .. }))),
                "{flat:?}"
            );
        }
    }
}
