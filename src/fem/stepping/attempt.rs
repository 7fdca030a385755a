//! An attempt at an increment: from the committed state to an equilibrium that may be committed.

use super::{StepFailure, StepReport, StepStart, Stepper, Watch};
use crate::fem::equilibrium::{Equilibrium, EquilibriumError, LargestResidual};
use crate::fem::point_field::PointField;
use crate::las::{
    Backend, NewtonError, NewtonFailure, NewtonParams, NewtonReport, NonlinearProblem, RealBackend, SolveError,
    VectorOps,
};

/// The result of an attempt or of a part of one.
pub(super) type Attempt<B, P, T> = Result<T, FailedAttemptOf<B, P>>;
pub(super) type FailedAttemptOf<B, P> = Box<Failed<<P as PointField>::Error, <B as Backend>::Error>>;
type SolveFailure<B, P> =
    NewtonFailure<EquilibriumError<<P as PointField>::Error, <B as Backend>::Error>, <B as Backend>::Error>;

/// The reason why an attempt failed, and the report of its Newton solve.
pub(super) struct Failed<E, F> {
    pub reason: StepFailure<E, F>,
    pub newton: NewtonReport,
    /// True if smaller increments cannot help.
    pub unrecoverable: bool,
    /// True if the attempt failed at its start, so that the other start may help.
    pub at_start: bool,
    /// Where the residual is largest.
    pub largest_residual: Option<Box<LargestResidual>>,
}

impl<B: RealBackend, P: PointField> Stepper<B, P> {
    /// Advances from the committed state to an equilibrium state at pseudo-time `t` in which every response continues
    /// the committed state, all constraints hold, and no point changes its material. Material changes last, because
    /// they are decided by the state that the step would end in. `solves` collects the reports of the converged Newton
    /// solves.
    pub(super) fn attempt(
        &mut self,
        t: f64,
        report: &mut StepReport,
        solves: &mut Vec<NewtonReport>,
        watch: Watch<'_>,
    ) -> Attempt<B, P, ()> {
        /// If responses still do not continue the committed state after this many rounds, they alternate between
        /// branches, and only a smaller increment helps.
        const MAX_REPLACEMENTS: usize = 5;
        // An attempt depends on the committed state alone: not on earlier ones, which a resumed run does not repeat.
        self.system.start_anew();
        let own_unknowns = self.system.residual.len();
        self.body.set_near_null_space(own_unknowns, &mut self.system.solver).map_err(|error| {
            Self::failed(NewtonFailure { reason: NewtonError::Solve(error), report: Box::default() })
        })?;
        solves.push(self.start(t, report, watch)?);
        let (mut evolutions, mut replacements, mut augmentations) = (0, 0, 0);
        loop {
            if self.body.verify().map_err(Self::rejected)? {
                if replacements == MAX_REPLACEMENTS {
                    return Err(Self::rejected(EquilibriumError::OffBranch(replacements)));
                }
                replacements += 1;
                report.verification_rounds += 1;
            } else if self.body.augment(self.params.newton.tolerance) {
                if augmentations == self.params.max_augmentations {
                    return Err(Self::rejected(self.body.volume_not_reached(augmentations)));
                }
                (augmentations, replacements) = (augmentations + 1, 0);
                report.augmentations += 1;
            } else if self.body.evolve().map_err(Self::rejected)? {
                if evolutions == self.params.max_evolutions {
                    return Err(Self::rejected(EquilibriumError::StillChanging(evolutions)));
                }
                (evolutions, replacements, augmentations) = (evolutions + 1, 0, 0);
                report.evolutions += 1;
            } else {
                break;
            }
            let solved = self.system.solve_watched(&mut self.body, &self.params.newton, watch);
            solves.push(solved.map_err(Self::failed)?);
        }
        self.body.check_balance(self.params.newton.tolerance).map_err(Self::rejected)
    }

    /// Solves from the committed state to pseudo-time `t` by Newton, starting from the linearization or from the
    /// prescribed displacements, and from the other one if the chosen start fails: the tangent may be singular, and
    /// moving only the boundary may invert the adjacent elements. The undeformed body always starts from the
    /// linearization.
    fn start(&mut self, t: f64, report: &mut StepReport, watch: Watch<'_>) -> Attempt<B, P, NewtonReport> {
        let first = if self.undeformed { StepStart::Tangent } else { self.params.start };
        match self.solve_from(first, t, report, watch) {
            Err(failed) if failed.at_start && !self.undeformed && !failed.unrecoverable => {
                self.body.revert().map_err(|error| Self::unrecoverable(error, NewtonReport::default()))?;
                let second = match first {
                    StepStart::Tangent => StepStart::Prescribed,
                    StepStart::Prescribed => StepStart::Tangent,
                };
                self.solve_from(second, t, report, watch)
            }
            outcome => outcome,
        }
    }

    fn solve_from(
        &mut self,
        start: StepStart,
        t: f64,
        report: &mut StepReport,
        watch: Watch<'_>,
    ) -> Attempt<B, P, NewtonReport> {
        match start {
            StepStart::Prescribed => self.body.begin_step(t),
            StepStart::Tangent => {
                if let Some(forcing) = self.params.newton.forcing {
                    self.system.set_tolerance(forcing.largest);
                }
                let start = self.body.linearize(t, &mut self.system).map_err(|error| {
                    Box::new(Failed {
                        // The tangent of the undeformed body does not depend on the increment, so cutting cannot help.
                        unrecoverable: self.undeformed || matches!(error, SolveError::Backend(_)),
                        at_start: true,
                        reason: NewtonError::Solve(error),
                        newton: NewtonReport::default(),
                        largest_residual: None,
                    })
                })?;
                report.add_linearized(&start);
            }
        }
        let reuse_factorization = self.reuses_factorization && start == StepStart::Tangent;
        let newton = NewtonParams { reuse_factorization, ..self.params.newton };
        self.system.solve_watched(&mut self.body, &newton, watch).map_err(|failure| {
            let at_start = start == StepStart::Prescribed && Self::failed_at_first_residual(&failure);
            Box::new(Failed { at_start, ..*Self::failed(failure) })
        })
    }

    /// Finds the largest residual force of an attempt in which Newton's method ended without a small residual, before the
    /// state is reverted.
    pub(super) fn locate_residual(
        &mut self,
        failed: &mut Failed<P::Error, B::Error>,
    ) -> Result<(), EquilibriumError<P::Error, B::Error>> {
        if matches!(failed.reason, NewtonError::LineSearch { .. } | NewtonError::TooManyIterations { .. }) {
            failed.largest_residual = self.body.largest_residual().map_err(EquilibriumError::Backend)?.map(Box::new);
        }
        Ok(())
    }

    /// Returns true if Newton failed at its first residual for a reason that another start may avoid.
    fn failed_at_first_residual(failure: &SolveFailure<B, P>) -> bool {
        let undefined = match &failure.reason {
            NewtonError::Problem(EquilibriumError::PointField(error)) => !P::is_final(error),
            // The ranks of a divided body must decide alike.
            NewtonError::Problem(EquilibriumError::OtherRank) => true,
            reason => matches!(reason, NewtonError::NotFinite),
        };
        undefined && failure.report.residuals.is_empty()
    }

    fn failed(NewtonFailure { reason, report }: SolveFailure<B, P>) -> FailedAttemptOf<B, P> {
        let unrecoverable = match &reason {
            NewtonError::Solve(SolveError::Backend(_)) => true,
            NewtonError::Problem(error) => <Equilibrium<B, P> as NonlinearProblem<B>>::is_final(error),
            _ => false,
        };
        Box::new(Failed { reason, newton: *report, unrecoverable, at_start: false, largest_residual: None })
    }

    /// Converts the error of a converged state that cannot be committed; a smaller increment may help.
    fn rejected(error: EquilibriumError<P::Error, B::Error>) -> FailedAttemptOf<B, P> {
        Self::failed(NewtonFailure { reason: NewtonError::Problem(error), report: Box::default() })
    }

    /// Converts an error of commit or revert; no further attempt is possible.
    pub(super) fn unrecoverable(
        error: EquilibriumError<P::Error, B::Error>,
        newton: NewtonReport,
    ) -> FailedAttemptOf<B, P> {
        Box::new(Failed {
            reason: NewtonError::Problem(error),
            newton,
            unrecoverable: true,
            at_start: false,
            largest_residual: None,
        })
    }
}
