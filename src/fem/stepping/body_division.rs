//! The division of a body among ranks, on the one that holds it whole.

use super::system::LinearSystem;
use super::{SetupError, StepParams, merged};
use crate::fem::assembly::{self, PartUnknowns, RankNumbers};
use crate::fem::boundary::{Boundary, Conditions};
use crate::fem::constraint::Constraints;
use crate::fem::mesh::{Division, Excerpt, ExcerptElements, Mesh};
use crate::fem::rigid_modes;
use crate::las::{Backend, SolverChoice, SolverParams};

/// A body that one rank holds whole and divides among all.
pub struct BodyDivision<'a> {
    mesh: &'a Mesh,
    division: &'a Division,
    elements: ExcerptElements,
    supports: Vec<(u32, u8)>,
    volumes: Vec<f64>,
    numbers: RankNumbers,
    solver: SolverParams,
    choice: Option<SolverChoice>,
    has_costly_factorization: bool,
    break_points: Vec<f64>,
}

/// What a rank needs to set up its part of a body ([`BodyPart::new`](super::BodyPart::new)): the elements and nodes of the
/// part and those at the surfaces of the body, the numbers of its unknowns, and what depends on the whole body.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct BodyPiece {
    pub(super) excerpt: Excerpt,
    /// The supports of free rigid-body modes, by nodes of the whole mesh.
    pub(super) supports: Vec<(u32, u8)>,
    /// The reference volumes of the constraints, m^3.
    pub(super) volumes: Vec<f64>,
    pub(super) unknowns: PartUnknowns,
    pub(super) solver: SolverParams,
    pub(super) choice: Option<SolverChoice>,
    pub(super) has_costly_factorization: bool,
    pub(super) break_points: Vec<f64>,
}

impl<'a> BodyDivision<'a> {
    /// Divides a body. `boundary` holds the conditions, resolved on the whole mesh.
    ///
    /// # Errors
    /// Returns [`SetupError`] if the linear system would be too large, a constraint cannot be imposed, or the conditions
    /// leave a rigid-body mode.
    ///
    /// # Panics
    /// Panics if the division is not one of this mesh.
    pub fn new<B: Backend, E: std::fmt::Display>(
        mesh: &'a Mesh,
        boundary: &Boundary,
        conditions: &Conditions,
        division: &'a Division,
        params: &StepParams,
    ) -> Result<Self, SetupError<E, B::Error>> {
        let order: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
        let constraints = if conditions.constraints.is_empty() {
            Constraints::default()
        } else {
            let (geometry, fixed) = (assembly::geometry(mesh)?, boundary.fixed_components(mesh.nodes().len()));
            Constraints::new(mesh, &geometry, &conditions.constraints, &fixed)?
        };
        rigid_modes::check(mesh, &boundary.restraints(mesh), boundary.kinematics().rigid_surfaces())?;
        let LinearSystem { unknowns, solver, choice, has_costly_factorization, .. } =
            LinearSystem::new::<B>(&order, mesh, boundary, constraints.len(), params)?;
        Ok(Self {
            mesh,
            division,
            elements: ExcerptElements::new(mesh, division, boundary.point_nodes().iter().copied().flatten()),
            supports: boundary.free_mode_supports().collect(),
            volumes: constraints.reference_volumes(),
            numbers: unknowns.by_rank(division),
            solver,
            choice,
            has_costly_factorization,
            break_points: merged(boundary.break_points(), constraints.break_points()),
        })
    }

    /// Returns the integration points of the part of a rank, by their numbers in the whole mesh, ascending.
    ///
    /// # Panics
    /// Panics if the division has fewer ranks.
    pub fn points(&self, rank: usize) -> Vec<usize> {
        let elements = self.elements.of_part(rank).iter();
        elements.flat_map(|&element| self.mesh.points().of_element(element as usize)).collect()
    }

    /// Returns what a rank needs.
    ///
    /// # Panics
    /// Panics if the division has fewer ranks.
    pub fn piece(&self, rank: usize) -> BodyPiece {
        let excerpt = Excerpt::new(self.mesh, self.division, rank, &self.elements);
        let unknowns = self.numbers.on_part(rank, &excerpt.part_nodes());
        BodyPiece {
            excerpt,
            supports: self.supports.clone(),
            volumes: self.volumes.clone(),
            unknowns,
            solver: self.solver,
            choice: self.choice,
            has_costly_factorization: self.has_costly_factorization,
            break_points: self.break_points.clone(),
        }
    }
}
