//! An RVE in equilibrium, with its stress, energy and tangent for the macro scale.

use std::fmt;

use nalgebra::Matrix3;

use super::report::{EquilibriumReport, RveError};
use crate::fiber::homogenize::{self, Tangent};
use crate::fiber::rve::{Rve, RveModel};
use crate::fiber::stress_gradient::{StressGradient, stress_gradient};
use crate::fiber::truss::FiberStates;
use crate::fiber::workspace::Workspace;
use crate::las::{Backend, RealBackend};

/// An RVE in equilibrium, returned by [`equilibrate`](super::equilibrate).
///
/// It borrows the RVE and the workspace with its solution, so that no other RVE can be solved in that workspace while
/// stress and tangent of this one may still be computed:
///
/// ```compile_fail
/// # use biotissue::fiber::{equilibrium::*, rve::*, workspace::Workspace};
/// # use biotissue::las::{Backend, RealBackend, Scalar};
/// # fn two<B: RealBackend>(model: &RveModel<B>, a: &mut Rve, b: &mut Rve, workspace: &mut Workspace<B>)
/// # {
/// # let (f, params) = (nalgebra::Matrix3::identity(), EquilibriumParams::default());
/// let mut first = equilibrate(model, a, &f, &params, workspace).unwrap();
/// let second = equilibrate(model, b, &f, &params, workspace).unwrap(); // error: `workspace` is still borrowed
/// first.tangent().unwrap();
/// # }
/// ```
pub struct EquilibriumState<'a, B: Backend> {
    model: &'a RveModel<B>,
    rve: &'a mut Rve,
    workspace: &'a mut Workspace<B>,
    report: EquilibriumReport,
    /// Whether the workspace holds the sensitivities to the strain modes.
    has_modes: bool,
}

impl<B: Backend> fmt::Debug for EquilibriumState<'_, B> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("EquilibriumState").field("report", &self.report).finish_non_exhaustive()
    }
}

impl<'a, B: RealBackend> EquilibriumState<'a, B> {
    pub(super) fn new(
        model: &'a RveModel<B>,
        rve: &'a mut Rve,
        workspace: &'a mut Workspace<B>,
        report: EquilibriumReport,
    ) -> Self {
        Self { model, rve, workspace, report, has_modes: false }
    }

    /// The statistics of the solve.
    pub fn report(&self) -> &EquilibriumReport {
        &self.report
    }

    /// Consumes `self` and returns the statistics of the solve.
    #[must_use]
    pub fn into_report(self) -> EquilibriumReport {
        self.report
    }

    /// The RVE.
    pub fn rve(&self) -> &Rve {
        self.rve
    }

    /// First Piola-Kirchhoff stress `P_iJ = kappa sum_b T_b,i X_b,J` over boundary nodes, in Pa (N over unit-cube area
    /// for `kappa = 1`).
    pub fn pk1(&self) -> Matrix3<f64> {
        homogenize::pk1(self.model, self.workspace)
    }

    /// Strain energy `W = kappa sum_f A L integral_1^lambda s` per reference volume, in J/m^3.
    pub fn energy(&self) -> f64 {
        self.model.scale() * self.model.truss().energy(self.workspace.states())
    }

    /// The term `Q` of the volume-averaged balance of momentum, a body force that the macro scale does not apply; see
    /// [`stress_gradient`](crate::fiber::stress_gradient).
    ///
    /// # Errors
    /// Returns [`RveError::Inverted`] if `F` has no inverse.
    pub fn stress_gradient(&self) -> Result<StressGradient, RveError<B::Error>> {
        let f = self.rve.gradient();
        stress_gradient(self.model, f, self.workspace).ok_or(RveError::Inverted(f.determinant()))
    }

    /// The consistent tangent `A = dP/dF` of the network after static condensation of its interior, in Pa.
    ///
    /// The boundary moves in six strain modes `dF = S F` of the current state. The interior follows by
    /// back-substitution with the factor from the stability test of the equilibrium; the interior force sensitivities
    /// of each mode are checked and corrected until they vanish. If the stiffness is singular, or so nearly singular
    /// that its own factor is too inaccurate, a small shift is added to its diagonal. The form
    /// `S_k F : A : S_l F = kappa v_k . K v_l` is stationary in the sensitivities `v`: their error enters squared.
    /// Rotations need no solve, `A : (W F) = W P` for skew `W`. The tangent is valid at any `F`, including rotations by
    /// 90 degrees.
    ///
    /// # Errors
    /// Returns [`RveError::Tangent`] if the stiffness is singular and a strain mode loads its null space.
    pub fn tangent(&mut self) -> Result<Tangent, RveError<B::Error>> {
        self.solve_modes()?;
        homogenize::tangent(self.model, self.rve.gradient(), &self.pk1(), self.workspace)
    }

    /// Stores in the RVE the sensitivities of its interior nodes to a further strain: the next equilibrium starts from
    /// a first-order prediction instead of an affine motion. Takes 72 bytes per interior node, and almost no time after
    /// [`EquilibriumState::tangent`].
    ///
    /// # Errors
    /// As for [`EquilibriumState::tangent`].
    pub fn keep_sensitivities(&mut self) -> Result<(), RveError<B::Error>> {
        self.solve_modes()?;
        self.rve.keep_sensitivities(self.model, self.workspace);
        Ok(())
    }

    fn solve_modes(&mut self) -> Result<(), RveError<B::Error>> {
        if !self.has_modes {
            homogenize::solve_modes(self.model, self.workspace)?;
            self.has_modes = true;
        }
        Ok(())
    }

    /// Positions of all nodes, unit-cube units.
    pub fn positions(&self) -> &[[f64; 3]] {
        self.workspace.positions()
    }

    /// Stretches, directions and forces of all fibers.
    pub fn states(&self) -> &FiberStates {
        self.workspace.states()
    }
}
