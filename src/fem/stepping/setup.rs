//! Creating a stepper: of a whole body, or of the part of one rank.

use std::sync::Arc;

use super::increments::Increments;
use super::{BodyPart, LinearSystem, SetupError, StepParams, Stepper, merged};
use crate::fem::assembly::{self, Assembler, Geometry, Unknowns};
use crate::fem::boundary::{Boundary, Conditions};
use crate::fem::constraint::Constraints;
use crate::fem::equilibrium::Equilibrium;
use crate::fem::mesh::Mesh;
use crate::fem::point_field::PointField;
use crate::fem::rigid_modes;
use crate::las::{Forcing, NewtonSystem, RealBackend, SolveError, SolverChoice};

impl<B: RealBackend, P: PointField> Stepper<B, P> {
    /// Creates a stepper with the undeformed body at `t = 0`.
    ///
    /// # Errors
    /// Returns [`SetupError`] if the conditions, the mesh, the linear system or the point field prevent the setup.
    pub fn new(
        context: &B::Context,
        mesh: Arc<Mesh>,
        conditions: &Conditions,
        field: P,
        params: StepParams,
    ) -> Result<Self, SetupError<P::Error, B::Error>> {
        let order: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
        Self::in_order(&order, context, mesh, conditions, field, params)
    }

    /// Creates a stepper whose unknowns are numbered node by node in the given order, a permutation of all nodes. The
    /// order determines which unknowns are neighboring rows of a linear system that is distributed over ranks.
    ///
    /// # Errors
    /// As for [`Stepper::new`].
    ///
    /// # Panics
    /// Panics if `order` does not have one entry per node or contains an index that is not a node.
    pub fn in_order(
        order: &[u32],
        context: &B::Context,
        mesh: Arc<Mesh>,
        conditions: &Conditions,
        field: P,
        params: StepParams,
    ) -> Result<Self, SetupError<P::Error, B::Error>> {
        assert_eq!(order.len(), mesh.nodes().len(), "the order has one entry per node");
        let boundary = Boundary::new(&mesh, conditions)?;
        let geometry = assembly::geometry(&mesh)?;
        rigid_modes::check(&mesh, &boundary.restraints(&mesh), boundary.kinematics().rigid_surfaces())?;
        let fixed = boundary.fixed_components(mesh.nodes().len());
        let constraints = Constraints::new(&mesh, &geometry, &conditions.constraints, &fixed)?;
        let LinearSystem { unknowns, pattern, solver, choice, has_costly_factorization, .. } =
            LinearSystem::new::<B>(order, &mesh, &boundary, constraints.len(), &params)?;
        let pattern = Arc::new(pattern.expanded()?);
        let symbolic = B::analyze(context, &pattern, &solver)?;
        let system = NewtonSystem::bordered(context, &pattern, &symbolic, constraints.len())?;
        let assembler = assembler(geometry, &unknowns, &boundary, &constraints, &system.matrix);
        let assembler = assembler.map_err(SolveError::Backend)?;
        let break_points = merged(boundary.break_points(), constraints.break_points());
        let body = Equilibrium::constrained(mesh, boundary, constraints, assembler, field)?;
        let unknowns = pattern.rows();
        Ok(Self::assembled(body, system, (choice, has_costly_factorization), (unknowns, break_points), params))
    }

    /// Creates a stepper for a part of a body; all ranks call it, and all other methods, alike. The point field has the
    /// points of the part; if it communicates, it must fail on all ranks if it fails on one. `context` is that of all
    /// ranks.
    ///
    /// # Errors
    /// As for [`Stepper::new`]. Returns [`SolveError::Unsupported`] if the backend does not distribute systems
    /// ([`Backend::with_rows`](crate::las::Backend::with_rows)).
    pub fn on_part(
        context: &B::Context,
        part: BodyPart,
        field: P,
        params: StepParams,
    ) -> Result<Self, SetupError<P::Error, B::Error>> {
        let BodyPart { mesh, boundary, constraints, unknowns, geometry, pattern, rows, .. } = part;
        let (solver, choice, has_costly_factorization) = (part.solver, part.choice, part.has_costly_factorization);
        let total = rows.total;
        let context = B::with_rows(context, rows).map_err(SolveError::Backend)?.ok_or(SolveError::Unsupported {
            backend: B::NAME,
            what: "a linear system of which every rank holds a part",
            cure: "use a backend that distributes systems, or let every rank hold the whole body",
        })?;
        let symbolic = B::analyze(&context, &pattern, &solver)?;
        let system = NewtonSystem::bordered(&context, &pattern, &symbolic, constraints.len())?;
        let assembler = assembler(geometry, &unknowns, &boundary, &constraints, &system.matrix);
        let mut assembler = assembler.map_err(SolveError::Backend)?;
        assembler.count_own_points(&mesh);
        let body = Equilibrium::on_part((context, total), mesh, boundary, constraints, assembler, field)?;
        Ok(Self::assembled(body, system, (choice, has_costly_factorization), (total, part.break_points), params))
    }

    fn assembled(
        body: Equilibrium<B, P>,
        system: NewtonSystem<B>,
        (choice, has_costly_factorization): (Option<SolverChoice>, bool),
        (unknowns, break_points): (usize, Vec<f64>),
        mut params: StepParams,
    ) -> Self {
        if choice.is_some() {
            params.newton.forcing = params.newton.forcing.or_else(|| Some(Forcing::default()));
        }
        let increments = Increments::new(&params);
        let reuses_factorization = has_costly_factorization && body.field().is_cheap();
        Self {
            body,
            system,
            params,
            choice,
            reuses_factorization,
            unknowns,
            completed_steps: 0,
            increments,
            break_points,
            undeformed: true,
        }
    }
}

/// Locates the elements, the loads and the constraints in the matrix.
fn assembler<B: RealBackend>(
    geometry: Geometry,
    unknowns: &Unknowns,
    boundary: &Boundary,
    constraints: &Constraints,
    matrix: &B::Matrix,
) -> Result<Assembler<B>, B::Error> {
    let mut assembler = Assembler::new(geometry, unknowns, matrix)?;
    assembler.locate_loads(boundary.loads(), matrix)?;
    assembler.locate_constraints(constraints, matrix)?;
    Ok(assembler)
}
