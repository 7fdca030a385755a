//! The tube mesh: a hollow cylinder.

use super::grid::Grid;
use super::{ShapeError, positive};
use crate::fem::element::{CellType, ElementType};
use crate::fem::mesh::Cells;
use crate::fem::mesh::{Elements, Mesh, Surface};

/// Dimensions of a tube around the z axis, from `z = 0` to `z = length`, in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TubeShape {
    /// Radius of the lumen.
    pub inner_radius: f64,
    /// Outer radius.
    pub outer_radius: f64,
    /// Length along z.
    pub length: f64,
}

/// Creates a tube; `cells` are the numbers of cells through the wall, around the axis and along it. A cell consists of
/// six linear tetrahedra, one hexahedron, or two wedges, which extend along z; for elements of order 2, pass
/// [`between_on_tube`] to [`Mesh::quadratic_between`].
///
/// Nodes are numbered from the inner to the outer surface fastest, then around the axis, then along z. The region is
/// `wall`; the surfaces are `inner`, `outer`, `z0` and `z1`. The corners lie on the cylinders, so the tube is a prism
/// whose volume is smaller by the factor `sin(a) / a` with `a = 2 pi / cells[1]`.
///
/// # Errors
/// Returns [`ShapeError::TubeCells`] if there is no cell along an axis or fewer than three around it,
/// [`ShapeError::NotPositive`] or [`ShapeError::NoWall`] for dimensions that form no tube,
/// [`ShapeError::TooManyElements`] if there are too many cells, or [`ShapeError::Mesh`] if elements are flat in
/// floating-point arithmetic.
pub fn tube(element_type: ElementType, cells: [usize; 3], shape: &TubeShape) -> Result<Mesh, ShapeError> {
    let [through, around, along] = cells;
    if through == 0 || around < 3 || along == 0 {
        return Err(ShapeError::TubeCells(cells));
    }
    shape.check()?;
    let grid = Grid::new(cells, None)?;
    let elements = match element_type {
        ElementType::Tet4 | ElementType::Tet10 => grid.elements(|_| 0).0,
        ElementType::Hex8 | ElementType::Hex20 | ElementType::Hex27 => grid.uncut(false),
        ElementType::Wedge6 => grid.uncut(true),
    };
    // The grid is closed around the axis: its last row of nodes is the first one.
    let number = |node: u32| {
        let [i, j, k] = grid.grid_indices(node);
        (i + (through + 1) * (j % around + around * k)) as u32
    };
    let side = |(name, axis, upper): (&str, usize, bool)| Surface {
        name: name.into(),
        faces: renumbered(&grid.side_of(&elements, axis, upper), number),
    };
    let surfaces = [("inner", 0, false), ("outer", 0, true), ("z0", 2, false), ("z1", 2, true)].map(side);
    let (nodes, region_of) = (shape.nodes(cells), vec![0; elements.len()]);
    let elements: Elements = renumbered(&elements, number);
    Ok(Mesh::from_shape(nodes, (elements, region_of), &["wall"], surfaces.into())?)
}

fn renumbered<T: CellType>(cells: &Cells<T>, number: impl Fn(u32) -> u32) -> Cells<T> {
    let mut renumbered = Cells::default();
    for (cell_type, nodes) in cells.typed() {
        renumbered.push(cell_type, &nodes.iter().map(|&node| number(node)).collect::<Vec<u32>>());
    }
    renumbered
}

/// Returns the position of a node between corners of elements of a [`tube`]: at the mean of their radii, of their
/// directions from the axis and of their positions along it, so that nodes between corners on a cylinder lie on it.
pub fn between_on_tube(corners: &[[f64; 3]]) -> [f64; 3] {
    let count = corners.len() as f64;
    let (mut radius, mut direction, mut z) = (0.0, [0.0; 2], 0.0);
    for x in corners {
        let from_axis = x[0].hypot(x[1]);
        radius += from_axis / count;
        z += x[2] / count;
        direction = [direction[0] + x[0] / from_axis, direction[1] + x[1] / from_axis];
    }
    let [x, y] = direction.map(|component| component * (radius / direction[0].hypot(direction[1])));
    [x, y, z]
}

impl TubeShape {
    fn check(&self) -> Result<(), ShapeError> {
        let Self { inner_radius, outer_radius, length } = *self;
        positive("the inner radius", inner_radius)?;
        positive("the outer radius", outer_radius)?;
        positive("the length", length)?;
        if inner_radius < outer_radius { Ok(()) } else { Err(ShapeError::NoWall { inner_radius, outer_radius }) }
    }

    fn nodes(&self, [through, around, along]: [usize; 3]) -> Vec<[f64; 3]> {
        let mut nodes = Vec::with_capacity((through + 1) * around * (along + 1));
        // Quotients are computed first, because they are exactly 1 at the ends.
        for k in 0..=along {
            let z = self.length * (k as f64 / along as f64);
            for j in 0..around {
                let (sin, cos) = (std::f64::consts::TAU * (j as f64 / around as f64)).sin_cos();
                for i in 0..=through {
                    let outward = i as f64 / through as f64;
                    let radius = self.inner_radius * (1.0 - outward) + self.outer_radius * outward;
                    nodes.push([radius * cos, radius * sin, z]);
                }
            }
        }
        nodes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::mesh::shapes::assert_valid;
    use crate::fem::mesh::{MeshError, QuadraticHexahedron};
    use std::f64::consts::{PI, TAU};

    const SHAPE: TubeShape = TubeShape { inner_radius: 2.0, outer_radius: 3.0, length: 5.0 };
    const LINEAR: [(ElementType, usize); 3] =
        [(ElementType::Tet4, 6), (ElementType::Hex8, 1), (ElementType::Wedge6, 2)];

    #[test]
    fn tubes_of_all_linear_elements_are_prisms() {
        for (element_type, per_cell) in LINEAR {
            for around in [3, 8] {
                let mesh = tube(element_type, [2, around, 4], &SHAPE).unwrap();
                assert_valid(&mesh);
                assert_eq!(mesh.elements().len(), per_cell * 2 * around * 4);
                assert_eq!(mesh.nodes().len(), 3 * around * 5);
                let angle = TAU / around as f64;
                let (section, side) = (5.0 * PI * angle.sin() / angle, 2.0 * around as f64 * (0.5 * angle).sin());
                assert!((mesh.volume() / (section * 5.0) - 1.0).abs() < 1e-14, "{element_type:?}");
                let areas: Vec<f64> = mesh.surfaces().iter().map(|surface| mesh.surface_area(surface)).collect();
                for (area, expected) in areas.iter().zip([2.0 * side * 5.0, 3.0 * side * 5.0, section, section]) {
                    assert!((area / expected - 1.0).abs() < 1e-14, "{element_type:?}: {areas:?}");
                }
            }
        }
    }

    #[test]
    fn surfaces_have_their_positions_and_outward_normals() {
        for (element_type, _) in LINEAR {
            let mesh = tube(element_type, [2, 8, 4], &SHAPE).unwrap();
            assert_eq!(mesh.surface_names().collect::<Vec<_>>(), ["inner", "outer", "z0", "z1"]);
            for (surface, at) in mesh.surfaces().iter().zip([2.0, 3.0, 0.0, 5.0]) {
                for (face_type, nodes) in surface.faces.typed() {
                    let center =
                        mesh.positions_of(nodes).iter().fold([0.0; 2], |sum, x| [sum[0] + x[0], sum[1] + x[1]]);
                    let normal = mesh.area_vector(face_type, nodes);
                    let outward = match surface.name.as_str() {
                        "inner" => -(normal[0] * center[0] + normal[1] * center[1]),
                        "outer" => normal[0] * center[0] + normal[1] * center[1],
                        "z0" => -normal[2],
                        _ => normal[2],
                    };
                    assert!(outward > 0.0, "{element_type:?} {}", surface.name);
                }
                for x in surface.nodes().iter().map(|&node| mesh.nodes()[node as usize]) {
                    let found = if surface.name.starts_with('z') { x[2] } else { x[0].hypot(x[1]) };
                    assert!((found - at).abs() < 1e-15 * at.max(1.0), "{element_type:?} {}: {found}", surface.name);
                }
            }
        }
    }

    /// Elements of order 2 approximate the curved wall: the error of the volume is of the order of `angle^4`.
    #[test]
    fn nodes_between_corners_lie_on_the_cylinders() {
        for (element_type, hexahedra) in [
            (ElementType::Tet4, QuadraticHexahedron::Serendipity),
            (ElementType::Hex8, QuadraticHexahedron::Serendipity),
            (ElementType::Hex8, QuadraticHexahedron::Triquadratic),
        ] {
            let errors = [8, 16].map(|around| {
                let linear = tube(element_type, [1, around, 2], &SHAPE).unwrap();
                let mesh = linear.quadratic_between(hexahedra, between_on_tube).unwrap();
                for (surface, radius) in mesh.surfaces().iter().zip([2.0, 3.0]) {
                    for x in surface.nodes().iter().map(|&node| mesh.nodes()[node as usize]) {
                        assert!((x[0].hypot(x[1]) - radius).abs() < 1e-14, "{element_type:?}: {x:?}");
                    }
                }
                (mesh.volume() / (25.0 * PI) - 1.0).abs()
            });
            assert!(errors[1] < 1e-4 && errors[1] < errors[0] / 12.0, "{element_type:?}: {errors:?}");
        }
    }

    #[test]
    fn invalid_tubes_are_errors() {
        let message = |cells, shape| tube(ElementType::Hex8, cells, &shape).unwrap_err().to_string();
        assert_eq!(
            message([1, 2, 1], SHAPE),
            "[1, 2, 1] cells through the wall, around the axis and along it: there must be at least 1, 3 and 1"
        );
        assert!(matches!(tube(ElementType::Tet4, [0, 8, 1], &SHAPE), Err(ShapeError::TubeCells(_))));
        assert_eq!(
            message([1, 8, 1], TubeShape { inner_radius: 3.0, ..SHAPE }),
            "an inner radius of 3 is not below the outer radius, 3"
        );
        assert_eq!(
            message([1, 8, 1], TubeShape { length: f64::NAN, ..SHAPE }),
            "the length is NaN: it must be positive and finite"
        );
        assert_eq!(tube(ElementType::Hex8, [1000; 3], &SHAPE), Err(ShapeError::TooManyElements(6_000_000_000)));
        let thin = TubeShape { inner_radius: 3.0 - 1e-13, ..SHAPE };
        assert!(matches!(tube(ElementType::Hex8, [1, 8, 1], &thin), Err(ShapeError::Mesh(MeshError::Flat { .. }))));
    }
}
