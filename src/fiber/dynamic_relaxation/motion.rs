//! The motion of the nodes: velocities, masses and the stable time step.

use super::dot;
use super::params::Masses;
use super::report::Energies;

/// The quantities that change from step to step, besides positions, forces and fiber states.
pub(super) struct Motion {
    /// Velocities half a step before the positions.
    pub velocities: Vec<[f64; 3]>,
    pub masses: Vec<f64>,
    /// The stiffness at every node that bounds its frequency, `2 sum |K_f|`.
    pub stiffness: Vec<f64>,
    pub step: f64,
    pub damping: f64,
    pub energies: Energies,
    pub energy_at_start: f64,
}

impl Motion {
    /// Sets the stable step for the current stiffness. With [`Masses::Stiffness`], masses first grow with the stiffness
    /// such that the step stays stable.
    pub fn take_stable_step(&mut self, safety: f64, masses: Masses) {
        if masses == Masses::Stiffness {
            let kinetic = self.kinetic();
            for ((mass, &k), v) in self.masses.iter_mut().zip(&self.stiffness).zip(&mut self.velocities) {
                let before = *mass;
                *mass = before.max(0.25 * k);
                // The momentum is conserved.
                v.iter_mut().for_each(|v| *v *= before / *mass);
            }
            self.energies.damped += kinetic - self.kinetic();
        }
        let square = self.stiffness.iter().zip(&self.masses).map(|(k, m)| k / m).fold(0.0, f64::max);
        if square > 0.0 {
            self.step = safety * 2.0 / square.sqrt();
        }
    }

    pub fn kinetic(&self) -> f64 {
        self.velocities.iter().zip(&self.masses).map(|(v, m)| 0.5 * m * dot(v, v)).sum()
    }
}
