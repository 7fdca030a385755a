//! The stiffness of a cube, on any backend.

use std::sync::Arc;

use biotissue::fem::assembly::{Assembler, Unknowns, geometry};
use biotissue::fem::material::{Material, NeoHookean};
use biotissue::fem::mesh::shapes;
use biotissue::fem::point_field::PointResponses;
use biotissue::las::RealBackend;
use nalgebra::Matrix3;

/// The displacement at a position.
type Motion = fn(&[f64; 3]) -> [f64; 3];

/// A matrix with the vectors of its near null space.
pub struct System<B: RealBackend> {
    pub matrix: B::Matrix,
    pub near_null_space: Vec<Vec<f64>>,
}

/// Returns the stiffness at rest of a cube of `cells` cells per side, six linear tetrahedra each; `is_fixed` tells which
/// components of the displacement are prescribed at a position.
pub fn cube<B: RealBackend<Index = i32>>(
    context: &B::Context,
    cells: usize,
    is_fixed: impl Fn([f64; 3]) -> [bool; 3],
) -> System<B> {
    let mesh = shapes::cuboid([cells; 3], [1.0; 3]).unwrap();
    let nodes = mesh.nodes();
    let unknowns = Unknowns::new(nodes.len(), |node, component| is_fixed(nodes[node])[component]).unwrap();
    let mut matrix = B::matrix(context, &Arc::new(unknowns.pattern(&mesh).unwrap())).unwrap();
    let assembler = Assembler::<B>::new(geometry(&mesh).unwrap(), &unknowns, &matrix).unwrap();
    let mut responses = PointResponses::zeros(mesh.points().len());
    let at_rest = NeoHookean { mu: 3.0, lambda: 5.0 }.evaluate(&Matrix3::identity()).unwrap().tangent;
    responses.tangent.fill(at_rest);
    assembler.stiffness(&vec![[0.0; 3]; nodes.len()], &[], &responses, &mut matrix).unwrap();
    let motions: [Motion; 6] = [
        |_| [1.0, 0.0, 0.0],
        |_| [0.0, 1.0, 0.0],
        |_| [0.0, 0.0, 1.0],
        |x| [0.0, -x[2], x[1]],
        |x| [x[2], 0.0, -x[0]],
        |x| [-x[1], x[0], 0.0],
    ];
    let near_null_space = motions.map(|motion| {
        let of_nodes: Vec<[f64; 3]> = nodes.iter().map(motion).collect();
        let free = unknowns.equation_numbers().iter().zip(of_nodes.as_flattened()).filter(|(number, _)| **number >= 0);
        free.map(|(_, value)| *value).collect()
    });
    System { matrix, near_null_space: near_null_space.into() }
}
