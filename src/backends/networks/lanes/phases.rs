//! The seconds of the phases of solutions in lanes.

use std::time::Instant;

/// A phase of the solution of a group of networks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The states are written into the lanes, moved to their starts.
    Start,
    /// Forces and stiffness of the fibers, and their sums at the nodes.
    Forces,
    /// Factorization of the stiffness, with the forward substitution of the residual, and directions by earlier factors;
    /// in mixed precision, also the backward substitution and the corrections of the direction.
    Factor,
    /// Backward substitution, line search without its forces, and decisions.
    Step,
    /// Sensitivities, tangent, stress and energy.
    Tangent,
    /// The new states are read from the lanes.
    End,
}

impl Phase {
    /// All phases, in their order.
    pub const ALL: [Self; 6] = [Self::Start, Self::Forces, Self::Factor, Self::Step, Self::Tangent, Self::End];
}

/// Seconds by phase, summed over all groups whose solution was given these times.
#[derive(Clone, Copy, Debug, Default)]
pub struct PhaseTimes([f64; Phase::ALL.len()]);

impl PhaseTimes {
    /// Returns the seconds of a phase.
    pub fn seconds(&self, phase: Phase) -> f64 {
        self.0[phase as usize]
    }
}

/// Measures the phases of a group; without times, it reads no clock.
pub(super) struct Clock<'a>(Option<(&'a mut PhaseTimes, Instant)>);

impl<'a> Clock<'a> {
    pub fn new(times: Option<&'a mut PhaseTimes>) -> Self {
        Self(times.map(|times| (times, Instant::now())))
    }

    /// Counts the time since the end of the previous phase as that of this one.
    pub fn end(&mut self, phase: Phase) {
        if let Some((times, last)) = &mut self.0 {
            let now = Instant::now();
            times.0[phase as usize] += (now - *last).as_secs_f64();
            *last = now;
        }
    }
}
