//! The linear system of a body before its setup: unknowns, pattern and solver.

use super::StepParams;
use crate::fem::assembly::{NodePattern, Unknowns};
use crate::fem::boundary::Boundary;
use crate::fem::mesh::Mesh;
use crate::las::{Backend, Method, SolverChoice, SolverParams, SparsityError, Symmetry};

/// The linear system of a body.
#[derive(Clone, Debug)]
pub struct LinearSystem {
    /// The free displacement components.
    pub unknowns: Unknowns,
    /// The pattern of the stiffness, by nodes.
    pub pattern: NodePattern,
    /// The solver.
    pub solver: SolverParams,
    /// The choice of the solver, if it was chosen by the size of the system.
    pub choice: Option<SolverChoice>,
    /// Estimated number of floating-point operations of a direct factorization.
    pub operations: f64,
    /// Whether a factorization takes so long that the first iteration of a step should use that of its linearized start.
    pub has_costly_factorization: bool,
}

/// The least number of operations of a costly factorization: about a twentieth of a second on one core.
const COSTLY: f64 = 1e9;

impl LinearSystem {
    /// Numbers the unknowns node by node in the given order, and chooses the solver for a body with this number of volume
    /// constraints.
    ///
    /// # Errors
    /// Returns [`SparsityError::TooLarge`] if the system exceeds the range of 32-bit indices.
    pub fn new<B: Backend>(
        order: &[u32],
        mesh: &Mesh,
        boundary: &Boundary,
        constraints: usize,
        params: &StepParams,
    ) -> Result<Self, SparsityError> {
        let prescribed = boundary.prescribed_mask(mesh.nodes().len());
        let unknowns = Unknowns::in_order(order, |node, component| prescribed[node][component])?
            .with_kinematics(boundary.kinematics(), &boundary.prescribed_of_rigid_surfaces())?;
        let pattern = unknowns.node_pattern(mesh)?;
        let of_elements = params.solver.map_or(Symmetry::Definite, |solver| solver.symmetry);
        let elements = if mesh.patches().is_empty() { of_elements } else { Symmetry::None };
        let symmetry = match boundary.symmetry(elements) {
            // Pressures of constraints may make the matrix indefinite.
            Symmetry::Definite if constraints > 0 => Symmetry::Symmetric,
            symmetry => symmetry,
        };
        let by_size =
            SolverChoice::by_blocks((&pattern.nodes, &pattern.first), symmetry, 1 + constraints, B::HAS_MULTIGRID);
        let (solver, choice) = match params.solver {
            Some(solver) => (SolverParams { symmetry, ..solver }, None),
            None => (by_size.params(symmetry), Some(by_size)),
        };
        let operations = by_size.operations;
        let has_costly_factorization = solver.method == Method::Direct && operations > COSTLY;
        Ok(Self { unknowns, pattern, solver, choice, operations, has_costly_factorization })
    }
}
