//! The size of a problem before the solve.

use serde::Serialize;

use crate::app::case::Case;
use crate::fem::mesh::Mesh;
use crate::fiber::rve::StressScale;
use crate::las::{Method, SolverChoice};
use crate::tissue::micro_scale::TissueMaterial;

/// The size of a problem, known before the solve.
#[derive(Clone, Debug, PartialEq)]
pub struct ProblemSize {
    /// Elements of the mesh.
    pub elements: usize,
    /// Nodes of the mesh.
    pub nodes: usize,
    /// Free unknowns of the macro scale.
    pub unknowns: usize,
    /// RVEs.
    pub rves: usize,
    /// Networks, each with its unknowns and the RVEs that use it.
    pub networks: Vec<NetworkSize>,
    /// The linear solver of the body, and why it was chosen.
    pub solver: String,
    /// Whether that solver is iterative.
    pub is_iterative: bool,
    /// Load steps.
    pub steps: usize,
    /// Threads that solve the body and its RVEs.
    pub threads: usize,
    /// Ranks of the macro scale and of the RVEs; 1 and 0 in one process.
    pub ranks: [usize; 2],
}

/// A model of the library: a network with its law and scale.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NetworkSize {
    /// Its name.
    pub name: String,
    /// Unknowns of one RVE.
    pub unknowns: usize,
    /// RVEs that use it.
    pub rves: usize,
    /// The edge of its cube in the unit of its file, if the stresses are the forces of the unit cube: then they have to be
    /// divided by its square.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub raw_edge: Option<f64>,
}

impl ProblemSize {
    /// Collects the sizes from a case, its mesh and material, the number of free unknowns of the body, and the solver that
    /// was chosen by their number.
    pub(super) fn new(
        case: &Case,
        mesh: &Mesh,
        field: &impl TissueMaterial,
        unknowns: usize,
        choice: Option<&SolverChoice>,
    ) -> Self {
        let (models, counts) = (field.library().models(), field.rve_counts());
        let edges = field.library().cube_edges();
        let networks = models.iter().zip(edges).zip(counts.per_model).map(|((model, &edge), rves)| NetworkSize {
            name: model.network().name().to_owned(),
            unknowns: model.unknowns(),
            rves,
            raw_edge: (model.stress_scale() == StressScale::Raw).then_some(edge),
        });
        Self {
            elements: mesh.whole().elements,
            nodes: mesh.whole().nodes,
            unknowns,
            rves: counts.rves,
            networks: networks.collect(),
            solver: match (choice, case.newton.solver) {
                (Some(choice), _) => choice.to_string(),
                (None, Some(solver)) => solver.to_string(),
                (None, None) => "direct".into(),
            },
            is_iterative: match (choice, case.newton.solver) {
                (Some(choice), _) => choice.method != Method::Direct,
                (None, solver) => solver.is_some_and(|solver| solver.method != Method::Direct),
            },
            steps: case.steps.count,
            threads: rayon::current_num_threads(),
            ranks: field.ranks(),
        }
    }
}
