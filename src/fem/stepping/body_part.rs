//! The part of a body that one rank holds.

use std::sync::Arc;

use super::{BodyPiece, SetupError};
use crate::fem::assembly::{self, Geometry, Unknowns};
use crate::fem::boundary::{Boundary, Conditions};
use crate::fem::constraint::Constraints;
use crate::fem::mesh::Mesh;
use crate::las::{RankRows, SolverChoice, SolverParams, Sparsity};

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
    /// Sets up the part of a rank. `conditions` are those of the whole body, which
    /// [`BodyDivision::new`](super::BodyDivision::new) has checked. Does not communicate. `None` if there is a load that
    /// cannot be divided.
    ///
    /// # Errors
    /// Returns [`SetupError`] if the piece does not belong to these conditions.
    pub fn new<E: std::fmt::Display, F: std::fmt::Display>(
        piece: BodyPiece,
        conditions: &Conditions,
    ) -> Result<Option<Self>, SetupError<E, F>> {
        let BodyPiece { excerpt, supports, volumes, unknowns, solver, choice, .. } = piece;
        let (mesh, place) = excerpt.part();
        let boundary = Boundary::on_excerpt(excerpt.mesh(), conditions, &supports)?;
        let Ok(boundary) = boundary.on_part(&place) else { return Ok(None) };
        let constraints = Constraints::on_part((excerpt.mesh(), &place), &mesh, &conditions.constraints, &volumes)?;
        drop(excerpt);
        let (unknowns, rows) = unknowns.with_kinematics(boundary.kinematics());
        let (geometry, pattern) = (assembly::geometry(&mesh)?, unknowns.pattern(&mesh)?.first_rows(rows.own.len()));
        Ok(Some(Self {
            boundary,
            constraints,
            unknowns,
            geometry,
            pattern: Arc::new(pattern),
            rows,
            solver,
            choice,
            has_costly_factorization: piece.has_costly_factorization,
            break_points: piece.break_points,
            mesh: Arc::new(mesh),
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
