//! The rigid-body motions of the body, on which its stiffness is almost zero.

use super::Equilibrium;
use crate::fem::point_field::PointField;
use crate::las::{Index, RealBackend, SolveError, Solver};

impl<B: RealBackend, P: PointField> Equilibrium<B, P> {
    /// Passes the three translations and the three rotations of the body in the committed state to the preconditioner
    /// of `solver`, if it uses them, at its `unknowns` own unknowns. Prescribed components are left out.
    ///
    /// # Errors
    /// Returns the error of the solver.
    pub(in crate::fem) fn set_near_null_space(
        &self,
        unknowns: usize,
        solver: &mut B::Solver,
    ) -> Result<(), SolveError<B::Error>> {
        if !solver.uses_near_null_space() {
            return Ok(());
        }
        let nodes = self.mesh.nodes().iter().zip(&self.committed.displacements);
        let positions: Vec<[f64; 3]> = nodes.map(|(x, u)| std::array::from_fn(|i| x[i] + u[i])).collect();
        // About the center of the body, rotations are independent of the translations.
        let (mut center, nodes) = ([0.0; 3], self.ranks.nodes(positions.len()) as f64);
        for (_, x) in (0..).zip(&positions).filter(|(node, _)| self.mesh.is_own_node(*node)) {
            (0..3).for_each(|i| center[i] += x[i] / nodes);
        }
        self.ranks.sum(&mut center).map_err(SolveError::Backend)?;
        let motions = (0..6).map(|motion| self.rigid_motion(motion, &positions, center, unknowns));
        solver.set_near_null_space(&motions.collect::<Vec<_>>())
    }

    /// Returns the unknowns of a rigid-body motion: a translation along axis `motion`, or a rotation about axis
    /// `motion - 3` through the center.
    fn rigid_motion(&self, motion: usize, positions: &[[f64; 3]], center: [f64; 3], unknowns: usize) -> Vec<f64> {
        let axis = motion % 3;
        let is_rotation = motion >= 3;
        let displacement = |x: &[f64; 3]| {
            let mut u = [0.0; 3];
            if is_rotation {
                let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
                u[next] = -(x[last] - center[last]);
                u[last] = x[next] - center[next];
            } else {
                u[axis] = 1.0;
            }
            u
        };
        let mut values = vec![0.0; unknowns];
        let mut write = |rows: &[B::Index], of_rows: &[f64]| {
            for (row, value) in rows.iter().zip(of_rows) {
                if let Some(entry) = row.position().and_then(|row| values.get_mut(row)) {
                    *entry = *value;
                }
            }
        };
        let mut of_nodes: Vec<[f64; 3]> = positions.iter().map(displacement).collect();
        let kinematics = self.boundary.kinematics();
        kinematics.rotate_to_frames(&mut of_nodes);
        write(self.assembler.equation_numbers(), of_nodes.as_flattened());
        for (surface, rows) in self.assembler.rigid_equations().iter().enumerate() {
            let rigid = &kinematics.rigid_surfaces()[surface];
            let moved = self.committed.rigid[surface].displacement;
            let [u, v, w] = displacement(&std::array::from_fn(|i| rigid.reference[i] + moved[i]));
            // The rate of the rotation vector is the angular velocity as long as the rotation is small; a
            // preconditioner needs no more.
            let mut rotation = [0.0; 3];
            rotation[axis] = if is_rotation { rigid.length } else { 0.0 };
            write(rows, &[u, v, w, rotation[0], rotation[1], rotation[2]]);
        }
        values
    }
}
