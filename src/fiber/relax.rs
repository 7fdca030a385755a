//! Damped dynamic relaxation: an RVE carried to its equilibrium by an explicit integration in time.
//!
//! The interior nodes get masses `m` and a viscous damping `c m v`, the boundary moves from one deformation gradient to
//! the other along a smooth step, and central differences follow `m a + c m v + r = 0` until the residual `r` is as small
//! as Newton would leave it. No matrix is assembled or factored: what makes Newton fail (an indefinite or singular
//! stiffness, a snap-through on the way) is only one more motion here. The price is thousands of steps.
//!
//! * *Mass.* Lumped, half of `rho A L` of every fiber at each of its ends ([`Masses::Density`]), or in proportion to the
//!   stiffness that meets at a node ([`Masses::Stiffness`]), which lets the slowest nodes travel as far in a step as the
//!   fastest and does not change where they come to rest.
//! * *Step.* `2 / omega` with `omega^2` Gershgorin's bound of the largest eigenvalue of `M^-1 K`, renewed as the
//!   fibers stretch, times a safety factor.
//! * *Damping.* Critical for the mode that moves: `c = 2 omega_0`, with `omega_0^2` the Rayleigh quotient of the last step
//!   (Underwood, *Dynamic relaxation*, in Computational Methods for Transient Analysis, 1983).
//! * *Energy.* The work at the boundary must be found again as strain energy, kinetic energy and what the damping took,
//!   to within a part of the largest of them (Belytschko, Liu, Moran and Elkhodary, *Nonlinear Finite Elements for
//!   Continua and Structures*, 2nd ed., 2014, eq. 6.2.42). Where it is not, the integration is repeated with half the step.

use nalgebra::Matrix3;
use thiserror::Error;

use super::path::Path;
use super::rve::transform;
use super::truss::{FiberStates, Truss};

/// The masses of the nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Masses {
    /// Half the mass of every fiber at each of its ends; fibers without a density get that of water, 1000 kg/m^3.
    Density,
    /// In proportion to the stiffness of the fibers at a node.
    #[default]
    Stiffness,
}

/// How a relaxation is to be carried out.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RelaxationParams {
    /// The masses. Default [`Masses::Stiffness`].
    pub masses: Masses,
    /// How long the boundary moves, in times that a wave takes to cross the cube: a load that is too fast may throw the
    /// network into another equilibrium. Default 25.
    pub load_crossings: f64,
    /// Steps in all. Default 200 000.
    pub max_steps: usize,
    /// The part of the stable step that is taken. Default 0.9.
    pub safety: f64,
    /// How much of the largest energy may be missing from the balance. Default 0.01.
    pub energy_error: f64,
    /// Times that the integration may be repeated with half the step. Default 3.
    pub max_repeats: u32,
}

impl Default for RelaxationParams {
    fn default() -> Self {
        Self {
            masses: Masses::default(),
            load_crossings: 25.0,
            max_steps: 200_000,
            safety: 0.9,
            energy_error: 0.01,
            max_repeats: 3,
        }
    }
}

/// What a relaxation took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RelaxationReport {
    /// Steps, those of repeated integrations included.
    pub steps: usize,
    /// Integrations repeated with half the step.
    pub repeats: u32,
    /// `|r|` of the interior at the end, N.
    pub residual: f64,
    /// Energies at the end, J in unit-cube lengths.
    pub energies: Energies,
}

/// Where the work of the boundary went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energies {
    /// Done at the boundary.
    pub work: f64,
    /// Gained by the fibers.
    pub strain: f64,
    /// Of the moving nodes.
    pub kinetic: f64,
    /// Taken by the damping.
    pub damped: f64,
}

impl Energies {
    /// What is missing from the balance, over the largest of the energies.
    #[must_use]
    pub fn error(&self) -> f64 {
        let largest = self.work.abs().max(self.strain.abs()).max(self.kinetic).max(self.damped);
        let missing = (self.strain + self.kinetic + self.damped - self.work).abs();
        // An overflow is no balance either.
        if !missing.is_finite() {
            f64::INFINITY
        } else if largest > 0.0 {
            missing / largest
        } else {
            0.0
        }
    }
}

/// Why a relaxation did not come to rest.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RelaxationError {
    /// Out of steps.
    #[error("not at rest after {steps} steps: |r| = {residual:.3e}, limit {limit:.3e}")]
    TooManySteps {
        /// How many were taken.
        steps: usize,
        /// `|r|` at the end.
        residual: f64,
        /// What it should have fallen to.
        limit: f64,
    },
    /// Energy appeared or vanished, whatever the step.
    #[error("{part:.1e} of the energy is missing after {steps} steps, with the step halved {repeats} times")]
    EnergyBalance {
        /// How much, over the largest energy.
        part: f64,
        /// Steps taken.
        steps: usize,
        /// Halvings of the step.
        repeats: u32,
    },
}

/// The nodes of a relaxation.
pub(super) struct Relaxation<'a> {
    pub truss: &'a Truss,
    /// Masses by density.
    pub masses: &'a [f64],
    /// What rounding leaves of a residual.
    pub floor: f64,
    /// All nodes; the interior ones where they start.
    pub positions: &'a mut Vec<[f64; 3]>,
    pub forces: &'a mut Vec<[f64; 3]>,
    pub states: &'a mut FiberStates,
}

/// What changes from step to step beside positions, forces and fibers.
struct Motion {
    /// Velocities half a step back.
    velocities: Vec<[f64; 3]>,
    masses: Vec<f64>,
    /// The stiffness at every node that bounds its frequency, 2 sum |K_f|.
    stiffness: Vec<f64>,
    step: f64,
    damping: f64,
    energies: Energies,
    energy_at_start: f64,
}

/// How often the stable step is renewed, and the energies compared.
const CHECK: usize = 20;

impl Relaxation<'_> {
    /// Moves the boundary along the path and lets the interior come to rest: `|r| <= max(tolerance |f|, floor)`.
    /// With an error, the positions are wherever they were.
    pub fn run(
        &mut self,
        path: &Path,
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
        path: &Path,
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
                (report.energies, report.residual) = (motion.energies, residual);
                // Before half of the load there is too little energy for a comparison.
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
        // A node that no fiber holds yet needs a mass all the same.
        let least = 1e-3 * motion.masses.iter().fold(0.0, |most: f64, &m| most.max(m));
        motion.masses.iter_mut().for_each(|m| *m = m.max(least));
        motion.take_stable_step(safety, masses);
        motion
    }

    /// One central difference, with the boundary moved to `x = F X` where it moves.
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
        // Half of the work by the forces before the move, half by those after it.
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

    /// `1/2 f . dx` over the boundary for a move to `x = F X`, and the displacements.
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
        // No more than what still lets the fastest mode move.
        if square.is_finite() { 2.0 * square.max(0.0).sqrt().min(0.5 / motion.step) } else { 0.0 }
    }

    /// The kinetic energy at the time of the positions: velocities are known half a step before.
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

    /// The time that a wave takes through the unit cube: its speed squared is the mean stiffness `k L^2 / 3` over the
    /// mean mass.
    fn crossing_time(&self, motion: &Motion) -> f64 {
        let stiffness = |(fiber, length): (usize, &f64)| {
            let along = self.states.material_stiffness[fiber] + self.states.geometric_stiffness[fiber];
            along.abs() * length * length / 3.0
        };
        let stiffness: f64 = self.truss.lengths().iter().enumerate().map(stiffness).sum();
        let square = motion.masses.iter().sum::<f64>() / stiffness;
        if square.is_finite() { square.sqrt() } else { 0.0 }
    }

    /// Norms of the forces at the interior and at all nodes.
    fn residual(&self) -> (f64, f64) {
        let square = |node: &u32| dot(&self.forces[*node as usize], &self.forces[*node as usize]);
        let network = self.truss.network();
        let interior: f64 = network.interior().iter().map(square).sum();
        let boundary: f64 = network.boundary().iter().map(square).sum();
        (interior.sqrt(), (interior + boundary).sqrt())
    }

    /// `2 sum |K_f|` at every node: Gershgorin's bound, the block of a fiber counted on and off the diagonal.
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

impl Motion {
    /// The step that is stable with the stiffness found; or, where the masses may follow the stiffness, masses that
    /// keep the step stable.
    fn take_stable_step(&mut self, safety: f64, masses: Masses) {
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

    fn kinetic(&self) -> f64 {
        self.velocities.iter().zip(&self.masses).map(|(v, m)| 0.5 * m * dot(v, v)).sum()
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

    #[test]
    fn the_balance_counts_what_is_missing() {
        let balanced = Energies { work: 3.0, strain: 1.0, kinetic: 0.5, damped: 1.5 };
        assert_eq!(balanced.error(), 0.0);
        assert_eq!(Energies { damped: 0.0, ..balanced }.error(), 0.5);
        assert_eq!(Energies::default().error(), 0.0);
        assert_eq!(Energies { strain: f64::NAN, ..balanced }.error(), f64::INFINITY);
    }
}
