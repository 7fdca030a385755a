//! Elastic foundation: springs between a surface and the ground.

use nalgebra::{Matrix3, Vector3};

use super::{
    BoundaryError, CoupledNodes, Indivisible, Load, LoadCondition, Source, Support, check_finite, find_surface,
};
use crate::fem::mesh::{Faces, Mesh, Part};

/// Linear springs per reference area of a surface (a Robin condition). The traction per reference area on the body is
/// `-(k_n N (x) N + k_t (I - N (x) N)) u`, with the unit normal `N` of the reference surface. The springs have no force
/// in the undeformed state, and their stiffness does not depend on pseudo-time. A foundation with normal stiffness
/// alone lets the surface slide in its plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Foundation {
    /// The surface's name.
    pub surface: String,
    /// The stiffness `k_n` along the normal, Pa/m; not negative.
    pub normal: f64,
    /// The stiffness `k_t` along the surface, Pa/m; not negative.
    pub tangential: f64,
}

/// The stiffness of the springs, face by face.
#[derive(Debug)]
struct Springs {
    surface: usize,
    faces: Faces,
    /// For each face the square block `integral N_a N_b (k_n N (x) N + k_t (I - N (x) N)) dA`, row-major, N/m.
    blocks: Vec<Vec<f64>>,
    supports: Vec<Support>,
}

impl LoadCondition for Foundation {
    fn resolve(&self, mesh: &Mesh) -> Result<Box<dyn Load>, BoundaryError> {
        let (surface, of_mesh) = find_surface(mesh, &self.surface)?;
        check_finite(|| format!("surface `{}`", self.surface), &[self.normal, self.tangential])?;
        let (mut blocks, mut supports) = (Vec::with_capacity(of_mesh.faces.len()), Vec::new());
        for (face_type, nodes) in of_mesh.faces.typed() {
            let size = 3 * nodes.len();
            let mut block = vec![0.0; size * size];
            face_type.integrate(&mesh.positions_of(nodes), |values, area| {
                let area = Vector3::from(area);
                let (size_of_area, normal) = (area.norm(), area.normalize());
                let stiffness = self.stiffness(normal);
                for row in 0..size {
                    for column in 0..size {
                        let weight = values[row / 3] * values[column / 3] * size_of_area;
                        block[row * size + column] += weight * stiffness[(row % 3, column % 3)];
                    }
                }
                self.support(nodes, normal, &mut supports);
            });
            blocks.push(block);
        }
        Ok(Box::new(Springs { surface, faces: of_mesh.faces.clone(), blocks, supports }))
    }
}

impl Foundation {
    fn stiffness(&self, normal: Vector3<f64>) -> Matrix3<f64> {
        let projection = normal * normal.transpose();
        projection * self.normal + (Matrix3::identity() - projection) * self.tangential
    }

    /// Adds the directions in which the springs resist motions of the nodes of a face.
    fn support(&self, nodes: &[u32], normal: Vector3<f64>, supports: &mut Vec<Support>) {
        let mut directions = Vec::new();
        if self.normal > 0.0 {
            directions.push(normal);
        }
        if self.tangential > 0.0 {
            let one = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize();
            directions.extend([one, normal.cross(&one)]);
        }
        for &node in nodes {
            supports.extend(directions.iter().map(|&direction| Support { node, direction: direction.into() }));
        }
    }
}

impl Springs {
    /// Calls `add` with each node and its force, N.
    fn forces(&self, displacements: &[[f64; 3]], mut add: impl FnMut(u32, [f64; 3])) {
        for ((_, nodes), block) in self.faces.typed().zip(&self.blocks) {
            let size = 3 * nodes.len();
            for (rows, &node) in block.chunks_exact(3 * size).zip(nodes) {
                add(
                    node,
                    std::array::from_fn(|i| {
                        let row = rows[i * size..(i + 1) * size].chunks_exact(3).zip(nodes);
                        let product = |(k, &of): (&[f64], &u32)| {
                            let u = displacements[of as usize];
                            k[0] * u[0] + k[1] * u[1] + k[2] * u[2]
                        };
                        -row.map(product).sum::<f64>()
                    }),
                );
            }
        }
    }
}

impl Load for Springs {
    fn add_forces(&self, _: f64, displacements: &[[f64; 3]], forces: &mut [[f64; 3]]) {
        self.forces(displacements, |node, force| {
            forces[node as usize].iter_mut().zip(force).for_each(|(sum, force)| *sum += force);
        });
    }

    fn resultant(&self, _: f64, displacements: &[[f64; 3]]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        self.forces(displacements, |_, force| sum.iter_mut().zip(force).for_each(|(sum, force)| *sum += force));
        sum
    }

    fn source(&self) -> Option<Source> {
        Some(Source::Surface(self.surface))
    }

    fn supports(&self) -> &[Support] {
        &self.supports
    }

    fn coupled_nodes(&self) -> CoupledNodes<'_> {
        CoupledNodes::Faces(&self.faces)
    }

    fn add_stiffness(&self, _: f64, _: &[[f64; 3]], group: usize, block: &mut [f64]) {
        block.iter_mut().zip(&self.blocks[group]).for_each(|(sum, entry)| *sum += entry);
    }

    fn on_part(&self, part: &Part) -> Result<Option<Box<dyn Load>>, Indivisible> {
        let (faces, numbers) = part.faces(&self.faces);
        let blocks = numbers.iter().map(|&number| self.blocks[number].clone()).collect();
        let support = |support: &Support| Some(Support { node: part.own_node(support.node)?, ..*support });
        let supports = self.supports.iter().filter_map(support).collect();
        let surface = self.surface;
        let springs = || -> Box<dyn Load> { Box::new(Self { surface, faces, blocks, supports }) };
        Ok((!numbers.is_empty()).then(springs))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::mesh::shapes;

    #[test]
    fn springs_resist_along_and_across_the_normal() {
        let mesh = shapes::cuboid([2, 3, 1], [1.0, 2.0, 3.0]).unwrap();
        let springs = Foundation { surface: "x1".into(), normal: 5.0, tangential: 0.5 }.resolve(&mesh).unwrap();
        let displacements = vec![[0.1, 0.2, -0.4]; mesh.nodes().len()];
        // The surface has 6 m^2.
        let expected = [-5.0 * 0.1 * 6.0, -0.5 * 0.2 * 6.0, 0.5 * 0.4 * 6.0];
        let mut forces = vec![[0.0; 3]; mesh.nodes().len()];
        springs.add_forces(0.0, &displacements, &mut forces);
        let sum = forces.iter().fold([0.0; 3], |sum, f| std::array::from_fn(|i| sum[i] + f[i]));
        for found in [sum, springs.resultant(1.0, &displacements)] {
            assert!((0..3).all(|i| (found[i] - expected[i]).abs() < 1e-13), "{found:?}");
        }
        assert!(mesh.nodes().iter().zip(&forces).all(|(x, force)| x[0] == 1.0 || *force == [0.0; 3]));
    }

    #[test]
    fn the_stiffness_is_the_derivative_of_the_forces() {
        let mesh = shapes::cuboid([1, 1, 1], [1.0, 2.0, 3.0]).unwrap();
        let springs = Foundation { surface: "y0".into(), normal: 5.0, tangential: 0.5 }.resolve(&mesh).unwrap();
        let zeros = vec![[0.0; 3]; mesh.nodes().len()];
        for (group, nodes) in springs.coupled_nodes().groups().enumerate() {
            let size = 3 * nodes.len();
            let mut block = vec![0.0; size * size];
            springs.add_stiffness(0.0, &zeros, group, &mut block);
            for row in 0..size {
                for column in 0..size {
                    let (entry, transposed) = (block[row * size + column], block[column * size + row]);
                    assert!((entry - transposed).abs() < 1e-14);
                }
            }
        }
        // The forces are linear: one displacement gives a column of all blocks.
        let mut displacements = zeros.clone();
        displacements[0] = [0.0, 1.0, 0.0];
        let (mut forces, mut expected) = (zeros.clone(), zeros.clone());
        springs.add_forces(0.0, &displacements, &mut forces);
        for (group, nodes) in springs.coupled_nodes().groups().enumerate() {
            let size = 3 * nodes.len();
            let mut block = vec![0.0; size * size];
            springs.add_stiffness(0.0, &zeros, group, &mut block);
            let Some(column) = nodes.iter().position(|&node| node == 0).map(|at| 3 * at + 1) else { continue };
            for row in 0..size {
                expected[nodes[row / 3] as usize][row % 3] -= block[row * size + column];
            }
        }
        for (found, expected) in forces.as_flattened().iter().zip(expected.as_flattened()) {
            assert!((found - expected).abs() < 1e-14);
        }
        assert!(forces[0][1] < 0.0);
    }
}
