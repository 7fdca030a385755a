//! The life cycle of one RVE: when it is created, sleeps, wakes and is deleted, and its response while it sleeps.

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use crate::fem::material::Response;
use crate::tensor::contract;
use crate::tissue::materials::RveLifecycle;

/// The state of an RVE in its life cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum RveStatus {
    /// Not created yet: its matrix or its linear response at rest gives the stress.
    Waiting,
    /// It is solved at every trial state.
    Awake,
    /// It exists; its stress is extrapolated from its last response.
    Asleep,
    /// Deleted: its matrix gives the stress.
    Deleted,
}

impl RveStatus {
    /// Returns true if the RVE exists.
    pub fn exists(self) -> bool {
        matches!(self, Self::Awake | Self::Asleep)
    }
}

/// The life cycle of an RVE that is created, sleeps or is deleted.
pub(super) struct LifecycleState {
    pub rules: RveLifecycle,
    pub status: RveStatus,
    /// The status at the last commit.
    pub committed: RveStatus,
    /// The deformation gradient of the last trial state, and the response of the RVE there if it was solved.
    pub trial: (Matrix3<f64>, Option<Response>),
    /// The deformation gradient at the end of the last load step.
    pub converged: Option<Matrix3<f64>>,
    /// The deformation gradient at which it fell asleep, and its response there.
    pub extrapolation_point: Option<(Matrix3<f64>, Response)>,
}

impl LifecycleState {
    pub fn new(rules: RveLifecycle) -> Self {
        let status = if rules.created_at > 0.0 { RveStatus::Waiting } else { RveStatus::Awake };
        Self {
            rules,
            status,
            committed: status,
            trial: (Matrix3::identity(), None),
            converged: None,
            extrapolation_point: None,
        }
    }

    /// The norm of the Green-Lagrange strain.
    fn strain(&self) -> f64 {
        let f = &self.trial.0;
        ((f.transpose() * f - Matrix3::identity()) * 0.5).norm()
    }

    /// The ratio of strain to deletion strain if it exceeds 1.
    pub fn overstrain(&self) -> Option<f64> {
        let overstrain = self.strain() / self.rules.deleted_at;
        (self.status.exists() && overstrain > 1.0).then_some(overstrain)
    }

    /// Returns true if the RVE has to be created.
    pub fn must_be_created(&self) -> bool {
        self.status == RveStatus::Waiting && self.strain() > self.rules.created_at
    }

    /// Returns true if the RVE sleeps and has to wake.
    pub fn has_moved_in_sleep(&self) -> bool {
        let moved = |(from, _): &(Matrix3<f64>, Response)| (self.trial.0 - from).amax() > self.rules.asleep_below;
        self.status == RveStatus::Asleep && self.extrapolation_point.as_ref().is_none_or(moved)
    }

    /// Puts the RVE to sleep if it has hardly moved since the last converged step.
    pub fn fall_asleep(&mut self) {
        let (f, response) = self.trial;
        let is_still = self.converged.is_some_and(|before| (f - before).amax() < self.rules.asleep_below);
        if let (RveStatus::Awake, true, Some(response)) = (self.status, is_still, response) {
            (self.status, self.extrapolation_point) = (RveStatus::Asleep, Some((f, response)));
        }
    }
}

/// Extrapolates the response from `from` to `f`: stress to first order by the tangent, and the matching energy.
pub(super) fn extrapolate(from: &Matrix3<f64>, response: &Response, f: &Matrix3<f64>) -> Response {
    let moved = f - from;
    let pk1 = response.pk1 + contract(&response.tangent, &moved);
    let energy = response.energy + 0.5 * (response.pk1 + pk1).dot(&moved);
    Response { energy, pk1, tangent: response.tangent }
}
