//! Follower pressure: a force per current area, normal to the deformed surface.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::{
    BoundaryError, CoupledNodes, ENDS, Indivisible, Load, LoadCondition, LoadCurve, Source, check_finite,
    check_finite_at, find_surface, position_at,
};
use crate::fem::element::{CellType, FaceType};
use crate::fem::mesh::{Faces, Mesh, Part};
use crate::las::Symmetry;

/// A pressure on the deformed surface. The force on an element of its current area is `-p n da`, where `n` is its
/// outward normal: a positive pressure presses on the body. On a surface between two elements, the normal is that of
/// the faces as given in the mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Pressure {
    /// The surface's name.
    pub surface: String,
    /// The pressure at a factor of 1, Pa.
    pub value: f64,
    /// The factor over pseudo-time.
    pub curve: LoadCurve,
}

/// A pressure on the faces of a mesh.
///
/// With the tangents `t_j = dx/dxi_j` of a deformed face, `n da = t_1 x t_2 dxi`, so that
///
/// ```text
/// f_a         = -p sum_q w N_a t_1 x t_2
/// -df_a/du_b  =  p sum_q w N_a (dN_b/dxi_2 [t_1] - dN_b/dxi_1 [t_2])        ([t] v = t x v)
/// ```
#[derive(Debug)]
struct FollowerPressure {
    surface: usize,
    /// The surface in messages.
    name: String,
    faces: Faces,
    /// Positions of the nodes of the mesh in the reference state, m.
    positions: Vec<[f64; 3]>,
    is_closed: bool,
    value: f64,
    curve: LoadCurve,
}

impl LoadCondition for Pressure {
    fn resolve(&self, mesh: &Mesh) -> Result<Box<dyn Load>, BoundaryError> {
        let (surface, of_mesh) = find_surface(mesh, &self.surface)?;
        let name = format!("surface `{}`", self.surface);
        check_finite(|| name.clone(), &[self.value])?;
        let faces = of_mesh.faces.clone();
        let load = FollowerPressure {
            surface,
            name,
            is_closed: unmatched_edges(&faces).is_empty(),
            faces,
            positions: mesh.nodes().to_vec(),
            value: self.value,
            curve: self.curve.clone(),
        };
        if let LoadCurve::Function(_) = load.curve {
            ENDS.into_iter().try_for_each(|t| load.check_points(t))?;
        }
        Ok(Box::new(load))
    }
}

/// Returns the edges, by their corners in ascending order, that not as many faces pass in one direction as in the
/// other, with their number of faces. A closed surface of one orientation has none.
pub(in crate::fem) fn unmatched_edges(faces: &Faces) -> Vec<([u32; 2], usize)> {
    let mut edges: BTreeMap<[u32; 2], (i64, usize)> = BTreeMap::new();
    for (face_type, nodes) in faces.typed() {
        let corners = &nodes[..face_type.corners()];
        for (&a, &b) in corners.iter().zip(corners.iter().cycle().skip(1)) {
            let (balance, count) = edges.entry([a.min(b), a.max(b)]).or_default();
            *balance += if a < b { 1 } else { -1 };
            *count += 1;
        }
    }
    let unmatched = edges.into_iter().filter(|(_, (balance, _))| *balance != 0);
    unmatched.map(|(edge, (_, faces))| (edge, faces)).collect()
}

/// Adds the stiffness of a pressure on a face with these current node positions, m, to the row-major square block of
/// its nodes, N/m. `pressure` gives the pressure at a point from the values of the shape functions there, Pa.
pub(in crate::fem) fn add_pressure_stiffness(
    face_type: FaceType,
    current: &[[f64; 3]],
    pressure: impl Fn(&[f64]) -> f64,
    block: &mut [f64],
) {
    let columns = 3 * current.len();
    face_type.integrate_tangents(current, |values, gradients, tangents, weight| {
        let pressure = pressure(values);
        let [first, second] = tangents.map(|tangent| Vector3::from(tangent).cross_matrix());
        for (b, [along_first, along_second]) in gradients.iter().enumerate() {
            let turned = (first * *along_second - second * *along_first) * (pressure * weight);
            for (a, value) in values.iter().enumerate() {
                for (i, k) in (0..9).map(|n| (n / 3, n % 3)) {
                    block[(3 * a + i) * columns + 3 * b + k] += value * turned[(i, k)];
                }
            }
        }
    });
}

impl FollowerPressure {
    /// Checks the pressure at the integration points of all faces.
    fn check_points(&self, t: f64) -> Result<(), BoundaryError> {
        let mut checked = Ok(());
        for (face_type, nodes) in self.faces.typed() {
            let positions: Vec<[f64; 3]> = nodes.iter().map(|&node| self.positions[node as usize]).collect();
            face_type.integrate(&positions, |values, _| {
                if checked.is_ok() {
                    let position = position_at(positions.iter().copied(), values);
                    checked = check_finite_at(|| self.name.clone(), (&[self.value], &self.curve), t, position);
                }
            });
        }
        checked
    }

    fn current(&self, nodes: &[u32], displacements: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let at = |node: usize| std::array::from_fn(|i| self.positions[node][i] + displacements[node][i]);
        nodes.iter().map(|&node| at(node as usize)).collect()
    }

    /// Returns the pressure at a point of a face, given the values of the shape functions there, Pa.
    fn pressure(&self, t: f64, nodes: &[u32], values: &[f64]) -> f64 {
        let positions = nodes.iter().map(|&node| self.positions[node as usize]);
        self.value * self.curve.factor(t, position_at(positions, values))
    }
}

impl Load for FollowerPressure {
    fn add_forces(&self, t: f64, displacements: &[[f64; 3]], forces: &mut [[f64; 3]]) {
        for (face_type, nodes) in self.faces.typed() {
            face_type.integrate(&self.current(nodes, displacements), |values, area| {
                let pressure = self.pressure(t, nodes, values);
                for (&node, value) in nodes.iter().zip(values) {
                    forces[node as usize].iter_mut().zip(area).for_each(|(force, a)| *force -= pressure * value * a);
                }
            });
        }
    }

    fn resultant(&self, t: f64, displacements: &[[f64; 3]]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (face_type, nodes) in self.faces.typed() {
            face_type.integrate(&self.current(nodes, displacements), |values, area| {
                let pressure = self.pressure(t, nodes, values);
                sum.iter_mut().zip(area).for_each(|(sum, area)| *sum -= pressure * area);
            });
        }
        sum
    }

    fn break_points(&self) -> Vec<f64> {
        self.curve.break_points()
    }

    fn check_finite(&self, t: f64) -> Result<(), BoundaryError> {
        if self.curve.is_separable() { Ok(()) } else { self.check_points(t) }
    }

    fn source(&self) -> Option<Source> {
        Some(Source::Surface(self.surface))
    }

    fn coupled_nodes(&self) -> CoupledNodes<'_> {
        CoupledNodes::Faces(&self.faces)
    }

    /// A pressure that is the same everywhere on a closed surface has a potential, the enclosed volume. A pressure that
    /// depends on the reference position has none, nor has that on an open surface unless its edges are held.
    fn symmetry(&self) -> Symmetry {
        if self.is_closed && !self.curve.depends_on_position() { Symmetry::Symmetric } else { Symmetry::None }
    }

    fn add_stiffness(&self, t: f64, displacements: &[[f64; 3]], group: usize, block: &mut [f64]) {
        let Some((face_type, nodes)) = self.faces.get(group) else { return };
        let pressure = |values: &[f64]| self.pressure(t, nodes, values);
        add_pressure_stiffness(face_type, &self.current(nodes, displacements), pressure, block);
    }

    fn on_part(&self, part: &Part) -> Result<Option<Box<dyn Load>>, Indivisible> {
        let (faces, _) = part.faces(&self.faces);
        let positions = || part.nodes.iter().map(|&node| self.positions[node as usize]).collect();
        Ok((!faces.is_empty()).then(|| -> Box<dyn Load> {
            Box::new(Self {
                surface: self.surface,
                name: self.name.clone(),
                faces,
                positions: positions(),
                is_closed: self.is_closed,
                value: self.value,
                curve: self.curve.clone(),
            })
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::element::ElementType;
    use crate::fem::mesh::shapes;

    /// A box of each element type with a deformed upper side, and the pressure on it.
    fn pressed(element_type: ElementType) -> (Vec<[f64; 3]>, Box<dyn Load>) {
        let mesh = shapes::cuboid_of(element_type, [2, 1, 1], [1.0, 0.7, 0.5]).unwrap();
        let moved = |&[x, y, z]: &[f64; 3]| [0.1 * x + 0.2 * y * z, -0.15 * x * x, 0.2 * x * y + 0.1 * y * y];
        let pressure = Pressure { surface: "z1".into(), value: 3.0, curve: LoadCurve::Ramp };
        (mesh.nodes().iter().map(moved).collect(), pressure.resolve(&mesh).unwrap())
    }

    #[test]
    fn the_stiffness_is_the_slope_of_the_forces() {
        for element_type in ElementType::ALL {
            let (displacements, load) = pressed(element_type);
            let (nodes, h) = (displacements.len(), 1e-6);
            let mut assembled = vec![0.0; 9 * nodes * nodes];
            for (group, of_face) in load.coupled_nodes().groups().enumerate() {
                let size = 3 * of_face.len();
                let mut block = vec![0.0; size * size];
                load.add_stiffness(0.5, &displacements, group, &mut block);
                let equation = |k: usize| 3 * of_face[k / 3] as usize + k % 3;
                for (n, entry) in block.iter().enumerate() {
                    assembled[equation(n / size) * 3 * nodes + equation(n % size)] += entry;
                }
            }
            let forces = |k: usize, by: f64| {
                let (mut moved, mut forces) = (displacements.clone(), vec![[0.0; 3]; nodes]);
                moved.as_flattened_mut()[k] += by;
                load.add_forces(0.5, &moved, &mut forces);
                forces
            };
            for k in 0..3 * nodes {
                let (up, down) = (forces(k, h), forces(k, -h));
                for (row, (up, down)) in up.as_flattened().iter().zip(down.as_flattened()).enumerate() {
                    let slope = (down - up) / (2.0 * h);
                    let entry = assembled[row * 3 * nodes + k];
                    assert!((slope - entry).abs() < 1e-9, "{element_type:?}, ({row}, {k}): {entry}, slope {slope}");
                }
            }
        }
    }

    #[test]
    fn the_resultant_is_the_sum_of_the_forces() {
        for element_type in ElementType::ALL {
            let (displacements, load) = pressed(element_type);
            let mut forces = vec![[0.0; 3]; displacements.len()];
            load.add_forces(1.0, &displacements, &mut forces);
            let resultant = load.resultant(1.0, &displacements);
            for (i, part) in resultant.into_iter().enumerate() {
                let sum: f64 = forces.iter().map(|force| force[i]).sum();
                assert!((sum - part).abs() < 1e-14, "{element_type:?}: {sum} {part}");
            }
            let mut at_rest = vec![[0.0; 3]; displacements.len()];
            assert!((load.resultant(1.0, &at_rest)[2] + 3.0 * 0.7).abs() < 1e-14);
            at_rest.iter_mut().for_each(|u| u[0] += 5.0);
            assert!((load.resultant(1.0, &at_rest)[2] + 3.0 * 0.7).abs() < 1e-13);
        }
    }

    /// A pressure that increases with depth, or with time alone.
    #[derive(Debug)]
    struct Varying(bool);

    impl crate::fem::boundary::LoadFunction for Varying {
        fn factor(&self, t: f64, [_, _, z]: [f64; 3]) -> f64 {
            if self.0 { t * (1.0 - z) } else { t * t }
        }

        fn depends_on_position(&self) -> bool {
            self.0
        }
    }

    #[test]
    fn only_closed_surfaces_have_a_symmetric_stiffness() {
        let mesh = shapes::cuboid([2, 1, 1], [1.0; 3]).unwrap();
        let mut all = Faces::default();
        mesh.surfaces().iter().for_each(|surface| all.extend(&surface.faces));
        assert!(unmatched_edges(&all).is_empty() && !unmatched_edges(&mesh.surfaces()[0].faces).is_empty());
        assert_eq!(pressed(ElementType::Tet4).1.symmetry(), Symmetry::None);

        let surface = crate::fem::mesh::Surface { name: "all".into(), faces: all };
        let (nodes, elements) = (mesh.nodes().to_vec(), mesh.elements().clone());
        let (region_of, regions) = (mesh.region_of().to_vec(), mesh.regions().to_vec());
        let mesh = Mesh::new(nodes, elements, region_of, regions, vec![surface]).unwrap();
        let symmetry = |curve| {
            let load = Pressure { surface: "all".into(), value: 3.0, curve }.resolve(&mesh).unwrap();
            let nodes = mesh.nodes().len();
            let mut assembled = nalgebra::DMatrix::<f64>::zeros(3 * nodes, 3 * nodes);
            for (group, of_face) in load.coupled_nodes().groups().enumerate() {
                let size = 3 * of_face.len();
                let mut block = vec![0.0; size * size];
                load.add_stiffness(0.5, &vec![[0.0; 3]; nodes], group, &mut block);
                let equation = |k: usize| 3 * of_face[k / 3] as usize + k % 3;
                block.iter().enumerate().for_each(|(n, x)| assembled[(equation(n / size), equation(n % size))] += x);
            }
            let is_symmetric = (&assembled - assembled.transpose()).amax() < 1e-12 * assembled.amax();
            (load.symmetry(), is_symmetric)
        };
        let function = |by_depth| LoadCurve::Function(std::sync::Arc::new(Varying(by_depth)));
        assert_eq!(symmetry(LoadCurve::Ramp), (Symmetry::Symmetric, true));
        assert_eq!(symmetry(function(false)), (Symmetry::Symmetric, true));
        assert_eq!(symmetry(function(true)), (Symmetry::None, false));
    }
}
