//! The result for an RVE, as the documented JSON object and as text.

use std::fmt::Write;

use biotissue::fiber::equilibrium::{EquilibriumReport, RveError, Stage, StageError};
use biotissue::fiber::homogenize::Tangent;
use biotissue::fiber::network::Network;
use biotissue::fiber::rve::RveModel;
use serde::Serialize;

use crate::dispatch::ProgramBackend;

/// The object that `--json` prints.
#[derive(Serialize)]
pub struct RveResult {
    pub converged: bool,
    pub iterations: usize,
    /// Norm of the residual, and the same divided by the norm of all nodal forces.
    pub residuals: Vec<[f64; 2]>,
    #[serde(rename = "J")]
    pub determinant: f64,
    pub network: NetworkSize,
    pub scale: f64,
    /// `None` if there is no equilibrium.
    #[serde(flatten)]
    pub state: Option<State>,
    /// `None` if no stage found an equilibrium, stable or not, or if a fiber force is excessive.
    #[serde(flatten)]
    pub stability: Option<Stability>,
    #[serde(rename = "ladder")]
    pub stages: StageReport,
    pub seconds: Seconds,
}

#[derive(Serialize)]
pub struct NetworkSize {
    nodes: usize,
    fibers: usize,
    boundary_nodes: usize,
    free_dofs: usize,
    total_length: f64,
    /// The edge of the cube in the unit of the file; absent for a replayed RVE.
    #[serde(skip_serializing_if = "Option::is_none")]
    cube_edge: Option<f64>,
}

/// The state of an RVE in equilibrium; stresses and tangent in Pa, row-major.
#[derive(Serialize)]
pub struct State {
    pub pk1: [[f64; 3]; 3],
    pub cauchy: [[f64; 3]; 3],
    pub tangent: Vec<[f64; 9]>,
    pub energy: f64,
    /// The stress-gradient term `Q`, Pa/m; null if loaded fibers lie in faces.
    pub stress_gradient: Option<[f64; 3]>,
    /// Number of such fibers.
    pub stress_gradient_undefined: usize,
    pub stretch: Stretch,
    pub orientation: Orientation,
}

/// Whether the equilibrium is a minimum of the energy.
#[derive(Clone, Copy, Serialize)]
pub struct Stability {
    /// True also for a neutral state.
    stable: bool,
    /// Whether there are motions without stiffness.
    neutral: bool,
    /// Number of negative pivots of the LDL^T factorization of the stiffness, beyond rounding errors; null if the
    /// backend does not count them.
    negative_pivots: Option<usize>,
}

#[derive(Serialize)]
pub struct Stretch {
    pub min: f64,
    pub max: f64,
}

#[derive(Serialize)]
pub struct Orientation {
    pub reference: [[f64; 3]; 3],
    pub current: [[f64; 3]; 3],
}

/// The work beyond full Newton steps.
#[derive(Default, Serialize)]
pub struct StageReport {
    stage: Option<&'static str>,
    predicted: usize,
    cuts: u32,
    line_search_cuts: usize,
    indefinite: usize,
    singular: usize,
    regularized_iterations: usize,
    relaxation_steps: usize,
    /// Number of saddle points of the energy that were reached and left for a minimum.
    saddles: usize,
    /// Whether the residual stays above the tolerance but is as small as rounding errors permit.
    at_rounding: bool,
}

/// Wall time, s.
#[derive(Default, Serialize)]
pub struct Seconds {
    pub analyze: f64,
    pub solve: f64,
    pub tangent: f64,
}

impl NetworkSize {
    pub fn of(network: &Network, model: &RveModel<impl ProgramBackend>, cube_edge: Option<f64>) -> Self {
        Self {
            nodes: network.nodes().len(),
            fibers: network.fibers().len(),
            boundary_nodes: network.boundary().len(),
            free_dofs: model.unknowns(),
            total_length: network.total_length(),
            cube_edge,
        }
    }
}

impl Stability {
    /// Returns the stability of the equilibrium found, or of the last unstable one that was rejected.
    pub fn of<F: std::error::Error>(outcome: Result<&EquilibriumReport, &RveError<F>>) -> Option<Self> {
        let failures = match outcome {
            Ok(&EquilibriumReport { neutral, negative_pivots, .. }) => {
                return Some(Self { stable: true, neutral, negative_pivots });
            }
            Err(RveError::NotConverged { failures, .. }) => failures,
            Err(_) => return None,
        };
        failures.iter().rev().find_map(|failure| match failure.reason {
            StageError::Unstable(negative_pivots) => Some(Self { stable: false, neutral: false, negative_pivots }),
            _ => None,
        })
    }
}

impl StageReport {
    /// Extracts the counts from the report of an equilibrium that was solved with `tolerance`.
    pub fn of(report: &EquilibriumReport, tolerance: f64) -> Self {
        let EquilibriumReport { stage, predicted, cuts, backtracks, indefinite, singular, .. } = *report;
        Self {
            stage: stage.map(Stage::name),
            predicted,
            cuts,
            line_search_cuts: backtracks,
            indefinite,
            singular,
            regularized_iterations: report.regularized,
            relaxation_steps: report.relaxation.steps,
            saddles: report.saddles,
            at_rounding: stage.is_some() && report.newton.relative.last().is_some_and(|&r| r > tolerance),
        }
    }
}

/// Returns a tangent as its rows.
pub fn tangent_rows(tangent: &Tangent) -> Vec<[f64; 9]> {
    (0..9).map(|row| std::array::from_fn(|column| tangent[(row, column)])).collect()
}

impl RveResult {
    /// Formats the result for the terminal. Writing to a string cannot fail.
    pub fn text(&self) -> String {
        let mut out = String::new();
        let n = &self.network;
        let _ = writeln!(
            out,
            "network      {} nodes, {} fibers, {} boundary nodes, {} unknowns",
            n.nodes, n.fibers, n.boundary_nodes, n.free_dofs
        );
        if let Some(edge) = n.cube_edge {
            let _ = writeln!(out, "cube         edge {edge} in the file, scaled to 1");
        }
        let [norm, relative] = self.residuals.last().copied().unwrap_or_default();
        let StageReport { stage, relaxation_steps, at_rounding, .. } = self.stages;
        let relaxation = match relaxation_steps {
            0 => String::new(),
            steps => format!(" and {steps} steps of relaxation"),
        };
        let by = stage.and_then(Stage::named).map_or_else(String::new, |stage| format!(", by {stage}"));
        let _ = writeln!(
            out,
            "converged    {} iterations{relaxation}, |r| = {norm:.3e} N ({relative:.1e} of all forces{}){by}",
            self.iterations,
            if at_rounding { ", at rounding" } else { "" }
        );
        if let Some(stability) = self.stability {
            let neutral = if stability.neutral { ", except for motions without stiffness" } else { "" };
            let saddles = match self.stages.saddles {
                0 => String::new(),
                1 => "; reached after leaving 1 saddle point".into(),
                count => format!("; reached after leaving {count} saddle points"),
            };
            let _ = writeln!(out, "stability    a minimum of the energy{neutral}{saddles}");
        }
        let _ = writeln!(out, "det F        {:?}", self.determinant);
        let _ = writeln!(out, "scale kappa  {:e}", self.scale);
        if let Some(state) = &self.state {
            state.write(&mut out);
        }
        let s = &self.seconds;
        let _ =
            writeln!(out, "seconds      analyze {:.2e}, solve {:.2e}, tangent {:.2e}", s.analyze, s.solve, s.tangent);
        out
    }
}

impl State {
    fn write(&self, out: &mut String) {
        let mut matrix = |name: &str, rows: &[[f64; 3]; 3]| {
            for (i, row) in rows.iter().enumerate() {
                let name = if i == 0 { name } else { "" };
                let _ = writeln!(out, "{name:<13}{:>16.8e} {:>16.8e} {:>16.8e}", row[0], row[1], row[2]);
            }
        };
        matrix("P (Pa)", &self.pk1);
        matrix("sigma (Pa)", &self.cauchy);
        matrix("orientation", &self.orientation.current);
        let _ = writeln!(out, "dP/dF (Pa)   row 3 i + J, column 3 k + L");
        for row in &self.tangent {
            let cells: Vec<String> = row.iter().map(|a| format!("{a:>11.4e}")).collect();
            let _ = writeln!(out, "  {}", cells.join(" "));
        }
        let _ = writeln!(out, "energy       {:.8e} J/m^3", self.energy);
        let _ = match self.stress_gradient {
            Some([x, y, z]) => writeln!(out, "Q (Pa/m)     {x:>16.8e} {y:>16.8e} {z:>16.8e}"),
            None => {
                writeln!(out, "Q            undefined: {} loaded fibers lie in faces", self.stress_gradient_undefined)
            }
        };
        let _ = writeln!(out, "stretch      {:.6} to {:.6}", self.stretch.min, self.stretch.max);
    }
}
