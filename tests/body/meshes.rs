//! Meshes of several tests: boxes whose inner nodes are moved, and a body of three element types.

use biotissue::fem::element::{CellType, ElementType};
use biotissue::fem::mesh::{Elements, Mesh, QuadraticHexahedron, shapes};

/// Returns the mesh with its nodes at other positions.
pub fn moved(mesh: &Mesh, position: impl Fn(&[f64; 3]) -> [f64; 3]) -> Mesh {
    let nodes = mesh.nodes().iter().map(position).collect();
    let (regions, surfaces) = (mesh.regions().to_vec(), mesh.surfaces().to_vec());
    Mesh::new(nodes, mesh.elements().clone(), mesh.region_of().to_vec(), regions, surfaces).unwrap()
}

/// Returns a smooth displacement of the inside of the unit cube, which is at most `by` along each axis.
fn wave(x: &[f64; 3], by: f64) -> [f64; 3] {
    let is_inner = x.iter().all(|&c| c > 1e-9 && c < 1.0 - 1e-9);
    let along = |i: usize| (7.0 * x[i] + 11.0 * x[(i + 1) % 3] + 5.0 * x[(i + 2) % 3]).sin();
    std::array::from_fn(|i| if is_inner { by * along(i) } else { 0.0 })
}

/// Returns the unit cube, whose inner corners are moved by up to 0.15 cells along each axis; the nodes between corners
/// stay at their centers.
pub fn distorted(element_type: ElementType, cells: usize) -> Mesh {
    let linear = match element_type {
        ElementType::Tet10 => ElementType::Tet4,
        ElementType::Hex20 | ElementType::Hex27 => ElementType::Hex8,
        other => other,
    };
    let regular = shapes::cuboid_of(linear, [cells; 3], [1.0; 3]).unwrap();
    let by = 0.15 / cells as f64;
    let mesh = moved(&regular, |x| {
        let wave = wave(x, by);
        std::array::from_fn(|i| x[i] + wave[i])
    });
    match element_type {
        ElementType::Tet10 | ElementType::Hex20 => mesh.quadratic(QuadraticHexahedron::Serendipity).unwrap(),
        ElementType::Hex27 => mesh.quadratic(QuadraticHexahedron::Triquadratic).unwrap(),
        _ => mesh,
    }
}

/// Returns the unit cube without the part `x < 1/2, z > 1/2`, with moved inner nodes: hexahedra in `x < 1/2`, wedges
/// below `z = 1/2` in the rest, which share quadrilaterals with the hexahedra, and tetrahedra above, which share
/// triangles with the wedges.
pub fn mixed() -> Mesh {
    const CELLS: usize = 4;
    let [hexahedra, wedges, tetrahedra] = [ElementType::Hex8, ElementType::Wedge6, ElementType::Tet4]
        .map(|element_type| shapes::cuboid_of(element_type, [CELLS; 3], [1.0; 3]).unwrap());
    let parts = [(&hexahedra, [false, false]), (&wedges, [true, false]), (&tetrahedra, [true, true])];
    // The three boxes have the same nodes.
    let (mut number, mut nodes, mut elements) =
        (vec![u32::MAX; hexahedra.nodes().len()], Vec::new(), Elements::default());
    for (mesh, quarter) in parts {
        for (element, (element_type, of_box)) in mesh.elements().typed().enumerate() {
            let center = mesh.center(element);
            if [center[0] > 0.5, center[2] > 0.5] != quarter {
                continue;
            }
            let mut own = Vec::with_capacity(element_type.nodes());
            for &node in of_box {
                let number = &mut number[node as usize];
                if *number == u32::MAX {
                    *number = nodes.len() as u32;
                    let x = mesh.nodes()[node as usize];
                    let wave = if is_on_boundary_of_mixed(&x) { [0.0; 3] } else { wave(&x, 0.15 / CELLS as f64) };
                    nodes.push(std::array::from_fn(|i| x[i] + wave[i]));
                }
                own.push(*number);
            }
            elements.push(element_type, &own);
        }
    }
    let region_of = vec![0; elements.len()];
    Mesh::new(nodes, elements, region_of, vec!["body".into()], Vec::new()).unwrap()
}

/// Returns true if a node of [`mixed`] lies on its boundary.
pub fn is_on_boundary_of_mixed(x: &[f64; 3]) -> bool {
    x.iter().any(|&c| c == 0.0 || c == 1.0) || (x[0] <= 0.5 && x[2] >= 0.5)
}
