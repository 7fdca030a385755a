//! The backend `batched`: the same stiffness in every lane. Times are those of one of the systems.

use biotissue::backends::batched::{Batched, Lanes, Matrix, Solver, Vector};
use biotissue::las::{Backend, Solver as _, SolverParams, Symmetry};

use crate::system::{Contender, System};

/// `N` systems side by side.
pub struct SideBySide<const N: usize> {
    solver: Solver<f64, N>,
    matrix: Matrix<f64, N>,
}

impl<const N: usize> SideBySide<N> {
    /// Returns `None` if this machine does not have registers of so many lanes.
    pub fn new(system: &System) -> Option<Self> {
        let params = SolverParams::new(Symmetry::Definite);
        let symbolic = Batched::<f64, N>::analyze(&(), &system.pattern, &params).ok()?;
        if !symbolic.uses_vectors() {
            return None;
        }
        let solver = Batched::<f64, N>::solver(&symbolic).ok()?;
        let mut matrix = Matrix::zeros(&system.pattern);
        for (lanes, &value) in matrix.values_mut().iter_mut().zip(system.stiffness.values()) {
            *lanes = Lanes([value; N]);
        }
        Some(Self { solver, matrix })
    }
}

impl<const N: usize> Contender for SideBySide<N> {
    fn name(&self) -> String {
        format!("biotissue, {N} side by side")
    }

    fn operations(&self) -> Option<f64> {
        None
    }

    fn systems(&self) -> usize {
        N
    }

    fn factor(&mut self) {
        self.solver.factor(&self.matrix).expect("a definite matrix");
    }

    fn solve(&mut self, columns: usize, right: &[f64], solution: &mut [f64]) {
        let n = self.matrix.pattern().rows();
        for (b, x) in right.chunks_exact(n).zip(solution.chunks_exact_mut(n)).take(columns) {
            let b: Vector<f64, N> = b.iter().map(|&b| Lanes([b; N])).collect::<Vec<_>>().into();
            let mut of_lanes: Vector<f64, N> = vec![Lanes([0.0; N]); n].into();
            self.solver.solve(&b, &mut of_lanes).expect("a factor");
            for (x, of_lanes) in x.iter_mut().zip(of_lanes.as_slice()) {
                *x = of_lanes.0[0];
            }
        }
    }
}
