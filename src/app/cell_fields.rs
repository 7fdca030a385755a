//! The fields of the elements in the field files.

use nalgebra::Matrix3;

use crate::fem::equilibrium::BodyState;
use crate::tensor::{row_major, von_mises};
use crate::tissue::micro_scale::{PointSummary, RveStatus};

/// The element fields, collected for the writer.
#[derive(Default)]
pub(super) struct CellFields {
    pub cauchy: Vec<[f64; 9]>,
    pub gradient: Vec<[f64; 9]>,
    pub von_mises: Vec<f64>,
    pub orientation: Vec<[f64; 9]>,
    pub direction: Vec<[f64; 3]>,
    pub alignment: Vec<f64>,
    pub stretch_min: Vec<f64>,
    pub stretch_max: Vec<f64>,
    pub iterations: Vec<i64>,
    pub status: Vec<i64>,
    pub network: Vec<i64>,
}

impl CellFields {
    pub fn new(
        state: &BodyState,
        stress: impl Fn(usize, &Matrix3<f64>, &Matrix3<f64>) -> Matrix3<f64>,
        summaries: &[Option<PointSummary>],
        status: impl Fn(usize) -> Option<RveStatus>,
    ) -> Self {
        let mut cells = Self::default();
        let states = state.gradients.iter().zip(&state.responses.pk1);
        for (element, ((f, pk1), summary)) in states.zip(summaries).enumerate() {
            let cauchy = stress(element, f, pk1);
            cells.von_mises.push(von_mises(&cauchy));
            cells.cauchy.push(row_major(&cauchy));
            cells.gradient.push(row_major(f));
            // Elements without fibers have 0 in the fiber fields, and -1 in `iterations` and `network`.
            let s = summary.as_ref();
            cells.orientation.push(s.map_or([0.0; 9], |s| row_major(&s.orientation.into())));
            cells.direction.push(s.map_or([0.0; 3], |s| s.direction));
            cells.alignment.push(s.map_or(0.0, |s| s.alignment));
            cells.stretch_min.push(s.map_or(0.0, |s| s.stretch[0]));
            cells.stretch_max.push(s.map_or(0.0, |s| s.stretch[1]));
            cells.iterations.push(s.map_or(-1, |s| s.iterations as i64));
            cells.status.push(status(element).map_or(-1, |status| match status {
                RveStatus::Awake => 0,
                RveStatus::Asleep => 1,
                RveStatus::Waiting => 2,
                RveStatus::Deleted => 3,
            }));
            cells.network.push(s.map_or(-1, |s| s.network as i64));
        }
        cells
    }
}
