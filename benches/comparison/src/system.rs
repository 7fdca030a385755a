//! The systems to solve, and the trait of the solvers.

use std::sync::Arc;

use biotissue::backends::sparse::{Matrix, Sparse};
use biotissue::fiber::equilibrium::{EquilibriumParams, EquilibriumReport, equilibrate};
use biotissue::fiber::rve::{Rve, RveModel};
use biotissue::fiber::stiffness::{self, StiffnessSlots};
use biotissue::fiber::workspace::Workspace;
use biotissue::las::{Backend, Sparsity};
use nalgebra::Matrix3;

/// A solver that factors the same matrix repeatedly and solves with it.
pub trait Contender {
    fn name(&self) -> String;
    /// Predicted number of operations of a factorization.
    fn operations(&self) -> Option<f64>;
    /// The systems that it factors and solves at once.
    fn systems(&self) -> usize {
        1
    }
    fn factor(&mut self);
    /// Solves for `columns` right-hand sides, stored column by column.
    fn solve(&mut self, columns: usize, right: &[f64], solution: &mut [f64]);
}

/// The parameters of equilibria: a new factorization for each step, so that all iterations take the same time.
pub fn params() -> EquilibriumParams {
    let mut params = EquilibriumParams::default();
    params.chord_steps = Some(0);
    params
}

/// A network in equilibrium and its stiffness.
pub struct System {
    pub name: String,
    pub model: RveModel<Sparse>,
    pub workspace: Workspace<Sparse>,
    pub report: EquilibriumReport,
    pub target: Matrix3<f64>,
    pub pattern: Arc<Sparsity>,
    pub slots: StiffnessSlots<Sparse>,
    pub stiffness: Matrix,
    /// Column offsets, rows and values of the lower triangle by columns.
    pub lower_start: Vec<u32>,
    pub lower_rows: Vec<u32>,
    pub lower_values: Vec<f64>,
}

impl System {
    pub fn new(name: &str, model: RveModel<Sparse>, target: Matrix3<f64>) -> Self {
        let mut workspace = Workspace::new(&(), &model).expect("memory");
        let mut rve = Rve::at_rest(model.network());
        let report = equilibrate(&model, &mut rve, &target, &params(), &mut workspace);
        let report = report.expect("the networks of the comparison converge").into_report();
        let pattern = Arc::new(stiffness::pattern(model.network()).expect("few unknowns"));
        let slots = StiffnessSlots::locate(&(), model.truss(), &pattern).expect("the backend cannot fail");
        let mut stiffness = Sparse::<f64>::matrix(&(), &pattern).expect("the backend cannot fail");
        slots.assemble(model.truss(), workspace.states(), &mut Vec::new(), &mut stiffness).expect("it cannot fail");
        let (mut lower_start, mut lower_rows, mut lower_values) = (vec![0], Vec::new(), Vec::new());
        // The upper triangle by rows equals the lower triangle by columns.
        for row in 0..pattern.rows() {
            let first = pattern.row_offsets()[row] as usize;
            for (k, &column) in (first..).zip(pattern.row(row)).filter(|&(_, &column)| column as usize >= row) {
                lower_rows.push(column);
                lower_values.push(stiffness.values()[k]);
            }
            lower_start.push(lower_rows.len() as u32);
        }
        let name = name.to_owned();
        Self {
            name,
            model,
            workspace,
            report,
            target,
            pattern,
            slots,
            stiffness,
            lower_start,
            lower_rows,
            lower_values,
        }
    }

    /// Returns the largest entry of `K x - b`, relative to that of `b`.
    pub fn residual(&self, b: &[f64], x: &[f64]) -> f64 {
        let row = |row: usize| -> f64 {
            let first = self.pattern.row_offsets()[row] as usize;
            let entries = (first..).zip(self.pattern.row(row));
            entries.map(|(k, &column)| self.stiffness.values()[k] * x[column as usize]).sum()
        };
        let worst = (0..b.len()).map(|k| (row(k) - b[k]).abs()).fold(0.0, f64::max);
        worst / b.iter().fold(0.0, |largest: f64, b| largest.max(b.abs()))
    }
}
