//! Damped dynamic relaxation: explicit time integration of an RVE to its equilibrium.
//!
//! The interior nodes get masses `m` and viscous damping `c m v`. The boundary moves from one deformation gradient to
//! the other along a smooth step, and central differences integrate `m a + c m v + r = 0` until the residual `r`
//! satisfies the given tolerance. No matrix is assembled or factored: an indefinite or singular stiffness or a
//! snap-through, where Newton fails, does not stop the integration. The integration takes thousands of steps.
//!
//! * *Mass.* Lumped: half of `rho A L` of every fiber at each of its ends ([`Masses::Density`]), or proportional to the
//!   stiffness of the fibers at a node ([`Masses::Stiffness`]). The latter gives all nodes a similar stable
//!   step; the equilibria do not depend on the masses.
//! * *Step.* `2 / omega` times a safety factor, with `omega^2` Gershgorin's bound of the largest eigenvalue of
//!   `M^-1 K`, updated as the fibers stretch.
//! * *Damping.* Critical for the current motion: `c = 2 omega_0`, with `omega_0^2` the Rayleigh quotient of the last
//!   step (Underwood, *Dynamic relaxation*, in Computational Methods for Transient Analysis, 1983).
//! * *Energy.* The work at the boundary must equal the sum of strain energy, kinetic energy and dissipation, to within
//!   a fraction of the largest of them (Belytschko, Liu, Moran and Elkhodary, *Nonlinear Finite Elements for Continua
//!   and Structures*, 2nd ed., 2014, chapter 6). Otherwise the integration is repeated with half the step.

mod motion;
mod params;
mod report;

use nalgebra::Matrix3;

use motion::Motion;
pub use params::{Masses, RelaxationParams};
pub use report::{Energies, RelaxationError, RelaxationReport};

use super::deformation_path::DeformationPath;
use super::rve::transform;
use super::truss::{FiberStates, Truss};

/// The fibers and nodes of a relaxation.
pub(super) struct Relaxation<'a> {
    pub truss: &'a Truss,
    /// Lumped masses from the density.
    pub masses: &'a [f64],
    /// The rounding error of a residual.
    pub floor: f64,
    /// Positions of all nodes; those of interior nodes are the initial state.
    pub positions: &'a mut Vec<[f64; 3]>,
    pub forces: &'a mut Vec<[f64; 3]>,
    pub states: &'a mut FiberStates,
}

/// Number of steps between updates of the stable step and checks of the energy balance.
const CHECK: usize = 20;

impl Relaxation<'_> {
    /// Moves the boundary along the path and integrates until the interior is at rest:
    /// `|r| <= max(tolerance |f|, floor)`. After an error, the positions are those of the last step.
    pub fn run(
        &mut self,
        path: &DeformationPath,
        tolerance: f64,
        params: &RelaxationParams,
    ) -> (RelaxationReport, Option<RelaxationError>) {
        let start = self.positions.clone();
        let mut report = RelaxationReport::default();
        loop {
            match self.integrate(path, tolerance, params, &mut report) {
                Err(RelaxationError::EnergyBalance { .. }) if report.repeats < params.max_repeats => {
                    report.repeats += 1;
                    self.positions.clone_from(&start);
                }
                outcome => return (report, outcome.err()),
            }
        }
    }

    fn integrate(
        &mut self,
        path: &DeformationPath,
        tolerance: f64,
        params: &RelaxationParams,
        report: &mut RelaxationReport,
    ) -> Result<(), RelaxationError> {
        let safety = params.safety * 0.5_f64.powi(report.repeats as i32);
        self.move_boundary(&path.at(0.0));
        self.evaluate();
        let mut motion = self.at_rest(safety, params.masses);
        let load = (params.load_crossings * self.crossing_time(&motion)).max(motion.step);
        let mut part = 0.0;
        for step in 1.. {
            let before = part;
            part += motion.step / load;
            self.advance(&mut motion, (before < 1.0).then(|| path.at(smooth_step(part.min(1.0)))));
            report.steps += 1;
            let (residual, all) = self.residual();
            let limit = (tolerance * all).max(self.floor);
            let arrived = part >= 1.0 && residual <= limit;
            if step % CHECK == 0 || arrived {
                self.bound_stiffness(&mut motion);
                motion.take_stable_step(safety, params.masses);
                motion.energies.kinetic = self.kinetic_now(&motion);
                motion.energies.strain = self.truss.energy(self.states) - motion.energy_at_start;
                report.energies = motion.energies;
                (report.residual, report.relative) = (residual, if all > 0.0 { residual / all } else { 0.0 });
                // In the first half of the load the energies are too small for a comparison.
                let error = motion.energies.error();
                if error > params.energy_error && (part >= 0.5 || error.is_infinite()) {
                    let (steps, repeats) = (report.steps, report.repeats);
                    return Err(RelaxationError::EnergyBalance { part: error, steps, repeats });
                }
            }
            if arrived {
                return Ok(());
            }
            if report.steps >= params.max_steps {
                return Err(RelaxationError::TooManySteps { steps: report.steps, residual, limit });
            }
        }
        Ok(())
    }

    fn at_rest(&self, safety: f64, masses: Masses) -> Motion {
        let nodes = self.positions.len();
        let mut motion = Motion {
            velocities: vec![[0.0; 3]; nodes],
            masses: self.masses.to_vec(),
            stiffness: vec![0.0; nodes],
            step: 1.0,
            damping: 0.0,
            energies: Energies::default(),
            energy_at_start: self.truss.energy(self.states),
        };
        self.bound_stiffness(&mut motion);
        if masses == Masses::Stiffness {
            motion.masses.iter_mut().zip(&motion.stiffness).for_each(|(m, k)| *m = 0.25 * k);
        }
        // A node without stiffness needs a mass too.
        let least = 1e-3 * motion.masses.iter().fold(0.0, |most: f64, &m| most.max(m));
        motion.masses.iter_mut().for_each(|m| *m = m.max(least));
        motion.take_stable_step(safety, masses);
        motion
    }

    /// Advances one central-difference step, with the boundary moved to `x = F X` if `boundary` is given.
    fn advance(&mut self, motion: &mut Motion, boundary: Option<Matrix3<f64>>) {
        let Motion { velocities, masses, step, damping, energies, .. } = motion;
        let network = self.truss.network();
        let dt = *step;
        let (keep, push) =
            ((1.0 - 0.5 * *damping * dt) / (1.0 + 0.5 * *damping * dt), dt / (1.0 + 0.5 * *damping * dt));
        for &node in network.interior() {
            let node = node as usize;
            let (v, x) = (&mut velocities[node], &mut self.positions[node]);
            let mut mean = 0.0;
            for i in 0..3 {
                let before = v[i];
                v[i] = keep * before - push * self.forces[node][i] / masses[node];
                mean += (0.5 * (before + v[i])).powi(2);
                x[i] += dt * v[i];
            }
            energies.damped += *damping * masses[node] * mean * dt;
        }
        // Trapezoidal rule: half of the work with the forces before the move, half with those after it.
        let moved = boundary.map(|f| {
            let work = self.boundary_work(&f);
            self.move_boundary(&f);
            work
        });
        let before = self.rates_before(velocities);
        self.evaluate();
        if let Some((half, displacements)) = moved {
            energies.work += half + 0.5 * self.dot_boundary(&displacements);
        }
        motion.damping = self.critical_damping(motion, before);
    }

    /// Returns `1/2 f . dx` summed over the boundary for a move to `x = F X`, and the displacements.
    fn boundary_work(&self, f: &Matrix3<f64>) -> (f64, Vec<[f64; 3]>) {
        let network = self.truss.network();
        let displacements: Vec<[f64; 3]> = network
            .boundary()
            .iter()
            .map(|&node| {
                let (to, from) = (transform(f, &network.nodes()[node as usize]), &self.positions[node as usize]);
                [to[0] - from[0], to[1] - from[1], to[2] - from[2]]
            })
            .collect();
        (0.5 * self.dot_boundary(&displacements), displacements)
    }

    fn dot_boundary(&self, displacements: &[[f64; 3]]) -> f64 {
        let forces = self.truss.network().boundary().iter().map(|&node| &self.forces[node as usize]);
        forces.zip(displacements).map(|(f, d)| f[0] * d[0] + f[1] * d[1] + f[2] * d[2]).sum()
    }

    fn move_boundary(&mut self, f: &Matrix3<f64>) {
        let network = self.truss.network();
        for &node in network.boundary() {
            self.positions[node as usize] = transform(f, &network.nodes()[node as usize]);
        }
    }

    fn evaluate(&mut self) {
        self.truss.evaluate_with_forces(self.positions, self.states, self.forces);
    }

    /// `v . r` over the interior.
    fn rates_before(&self, velocities: &[[f64; 3]]) -> f64 {
        let interior = self.truss.network().interior().iter();
        interior.map(|&node| dot(&velocities[node as usize], &self.forces[node as usize])).sum()
    }

    /// Twice the frequency of the motion of the last step: `omega^2 = v . K v / v . M v`, with `K v = dr / dt`.
    fn critical_damping(&self, motion: &Motion, before: f64) -> f64 {
        let after = self.rates_before(&motion.velocities);
        let inertia = 2.0 * motion.kinetic();
        let square = (after - before) / (motion.step * inertia);
        // Upper limit that does not overdamp the fastest mode.
        if square.is_finite() { 2.0 * square.max(0.0).sqrt().min(0.5 / motion.step) } else { 0.0 }
    }

    /// The kinetic energy at the time of the positions; the stored velocities are those half a step earlier.
    fn kinetic_now(&self, motion: &Motion) -> f64 {
        let half = 0.5 * motion.step;
        let energy = |&node: &u32| {
            let (v, r) = (&motion.velocities[node as usize], &self.forces[node as usize]);
            let mass = motion.masses[node as usize];
            let now = [0, 1, 2].map(|i| (v[i] - half * r[i] / mass) / (1.0 + half * motion.damping));
            0.5 * mass * dot(&now, &now)
        };
        self.truss.network().interior().iter().map(energy).sum()
    }

    /// The time that a wave takes to cross the unit cube: the wave speed squared is the mean stiffness `k L^2 / 3` over
    /// the mean mass.
    fn crossing_time(&self, motion: &Motion) -> f64 {
        let stiffness = |(fiber, length): (usize, &f64)| {
            let along = self.states.material_stiffness[fiber] + self.states.geometric_stiffness[fiber];
            along.abs() * length * length / 3.0
        };
        let stiffness: f64 = self.truss.lengths().iter().enumerate().map(stiffness).sum();
        let square = motion.masses.iter().sum::<f64>() / stiffness;
        if square.is_finite() { square.sqrt() } else { 0.0 }
    }

    /// Norms of the forces at the interior nodes and at all nodes.
    fn residual(&self) -> (f64, f64) {
        let square = |node: &u32| dot(&self.forces[*node as usize], &self.forces[*node as usize]);
        let network = self.truss.network();
        let interior: f64 = network.interior().iter().map(square).sum();
        let boundary: f64 = network.boundary().iter().map(square).sum();
        (interior.sqrt(), (interior + boundary).sqrt())
    }

    /// Sets `2 sum |K_f|` at every node: Gershgorin's bound, with the block of a fiber counted on and off the diagonal.
    fn bound_stiffness(&self, motion: &mut Motion) {
        motion.stiffness.fill(0.0);
        for (fiber, ends) in self.truss.ends().iter().enumerate() {
            let across = self.states.geometric_stiffness[fiber];
            let along = self.states.material_stiffness[fiber] + across;
            for &node in ends {
                motion.stiffness[node as usize] += 2.0 * along.abs().max(across.abs());
            }
        }
    }
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `s^3 (10 - 15 s + 6 s^2)`: from 0 to 1 with velocity and acceleration zero at both ends.
fn smooth_step(s: f64) -> f64 {
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_load_starts_and_ends_at_rest() {
        let rate = |s: f64| (smooth_step(s + 1e-6) - smooth_step(s - 1e-6)) / 2e-6;
        assert_eq!((smooth_step(0.0), smooth_step(1.0)), (0.0, 1.0));
        assert!(rate(0.0).abs() < 1e-8 && rate(1.0).abs() < 1e-8);
        assert!((rate(0.5) - 1.875).abs() < 1e-6);
    }
}
