//! The part of a body that one rank holds.

use std::sync::Arc;

use super::system::LinearSystem;
use super::{SetupError, StepParams, merged};
use crate::fem::assembly::{self, Geometry, Unknowns};
use crate::fem::boundary::{Boundary, Conditions};
use crate::fem::constraint::Constraints;
use crate::fem::mesh::{Division, Mesh};
use crate::fem::rigid_modes;
use crate::las::{Backend, RankRows, SolverChoice, SolverParams, Sparsity};

/// The part of a body that one rank holds, with its rows of the linear system, ready for
/// [`Stepper::on_part`](super::Stepper::on_part). Of the whole body it keeps nothing but numbers.
#[derive(Debug)]
pub struct BodyPart {
    pub(super) mesh: Arc<Mesh>,
    pub(super) boundary: Boundary,
    pub(super) constraints: Constraints,
    /// The unknowns of the part, by local numbers.
    pub(super) unknowns: Unknowns,
    pub(super) geometry: Geometry,
    pub(super) pattern: Arc<Sparsity>,
    pub(super) rows: RankRows,
    pub(super) solver: SolverParams,
    pub(super) choice: Option<SolverChoice>,
    pub(super) has_costly_factorization: bool,
    pub(super) break_points: Vec<f64>,
}

impl BodyPart {
    /// Divides a body. `boundary` holds the conditions, resolved on the whole mesh. Every rank passes the same body and
    /// keeps the part of `rank`; nothing is communicated. `None` if the body has loads that cannot be divided
    /// ([`Load::on_part`](crate::fem::boundary::Load::on_part)); every rank then holds the whole body.
    ///
    /// # Errors
    /// Returns [`SetupError`] if the linear system would be too large, a constraint cannot be imposed, or the conditions
    /// leave a rigid-body mode.
    ///
    /// # Panics
    /// Panics if the division is not one of this mesh.
    pub fn new<B: Backend, E: std::fmt::Display>(
        mesh: &Mesh,
        boundary: &Boundary,
        conditions: &Conditions,
        division: &Division,
        rank: usize,
        params: &StepParams,
    ) -> Result<Option<Self>, SetupError<E, B::Error>> {
        let of_part = mesh.divided(division, rank);
        let Some(part) = of_part.part() else { return Ok(None) };
        let Ok(own_boundary) = boundary.on_part(part) else { return Ok(None) };
        let order: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
        let constraints = if conditions.constraints.is_empty() {
            Constraints::default()
        } else {
            let (geometry, fixed) = (assembly::geometry(mesh)?, boundary.fixed_components(mesh.nodes().len()));
            Constraints::new(mesh, &geometry, &conditions.constraints, &fixed)?.on_part(&of_part)
        };
        rigid_modes::check(mesh, &boundary.restraints(mesh), boundary.kinematics().rigid_surfaces())?;
        let LinearSystem { unknowns: of_body, pattern, solver, choice, has_costly_factorization, .. } =
            LinearSystem::new::<B>(&order, mesh, boundary, constraints.len(), params)?;
        drop(pattern);
        let (unknowns, rows) = of_body.on_part(division, part, own_boundary.kinematics());
        drop(of_body);
        let (geometry, pattern) =
            (assembly::geometry(&of_part)?, unknowns.pattern(&of_part)?.first_rows(rows.own.len()));
        Ok(Some(Self {
            boundary: own_boundary,
            unknowns,
            geometry,
            pattern: Arc::new(pattern),
            rows,
            solver,
            choice,
            has_costly_factorization,
            break_points: merged(boundary.break_points(), constraints.break_points()),
            constraints,
            mesh: Arc::new(of_part),
        }))
    }

    /// Returns the mesh.
    pub fn mesh(&self) -> &Arc<Mesh> {
        &self.mesh
    }

    /// Returns the rows of the linear system that the rank owns, and its ghost rows.
    pub fn rows(&self) -> &RankRows {
        &self.rows
    }
}
