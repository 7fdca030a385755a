//! The box.

use super::grid::Grid;
use super::{ShapeError, positive};
use crate::fem::mesh::{Mesh, Surface};

/// A box with its lowest corner at the origin: `cells` along x, y and z over `size` (m), six tetrahedra a cell.
///
/// Nodes are numbered with x running fastest, then y, then z; the elements of a cell follow one another in the order
/// of [`KUHN`](super::KUHN). The region is `body`, the surfaces are `x0 x1 y0 y1 z0 z1`.
///
/// # Errors
/// [`ShapeError::NoCells`], [`ShapeError::NotPositive`] or [`ShapeError::TooManyElements`].
pub fn cuboid(cells: [usize; 3], size: [f64; 3]) -> Result<Mesh, ShapeError> {
    let grid = Grid::uniform(cells)?;
    for (what, length) in ["the size along x", "the size along y", "the size along z"].into_iter().zip(size) {
        positive(what, length)?;
    }
    // The fraction first: it is exactly 1 at the far side.
    let along = |axis: usize, step: usize| size[axis] * (step as f64 / cells[axis] as f64);
    let nodes = grid.nodes(|i, j, k| [along(0, i), along(1, j), along(2, k)]);
    let (elements, region_of) = grid.elements(|_| 0);
    let surfaces =
        [("x0", 0, false), ("x1", 0, true), ("y0", 1, false), ("y1", 1, true), ("z0", 2, false), ("z1", 2, true)]
            .map(|(name, axis, upper)| Surface { name: name.into(), triangles: grid.side(axis, upper) });
    Ok(Mesh::trusted(nodes, elements, region_of, vec!["body".into()], surfaces.into()))
}
