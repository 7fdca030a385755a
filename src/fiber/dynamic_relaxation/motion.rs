//! The motion of the nodes: velocities, masses, and the step that is stable with them.

use super::dot;
use super::params::Masses;
use super::report::Energies;

/// What changes from step to step beside positions, forces and fibers.
pub(super) struct Motion {
    /// Velocities half a step back.
    pub velocities: Vec<[f64; 3]>,
    pub masses: Vec<f64>,
    /// The stiffness at every node that bounds its frequency, 2 sum |K_f|.
    pub stiffness: Vec<f64>,
    pub step: f64,
    pub damping: f64,
    pub energies: Energies,
    pub energy_at_start: f64,
}

impl Motion {
    /// The step that is stable with the stiffness found; or, where the masses may follow the stiffness, masses that
    /// keep the step stable.
    pub fn take_stable_step(&mut self, safety: f64, masses: Masses) {
        if masses == Masses::Stiffness {
            let kinetic = self.kinetic();
            for ((mass, &k), v) in self.masses.iter_mut().zip(&self.stiffness).zip(&mut self.velocities) {
                let before = *mass;
                *mass = before.max(0.25 * k);
                // The momentum stays what it was.
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
