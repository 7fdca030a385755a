//! A network of trusses: lengths, forces and stiffness of the fibers at given node positions.
//!
//! A fiber from node `a` to node `b` with `d = x_b - x_a`, length `l = |d|`, direction `n = d / l` and axial force `f`
//! pulls with `T_b = f n = -T_a` (Tobin 2018, eqs. B.3 to B.5). Its stiffness is the block `k n (x) n + (f / l) I` with
//! `k = df/dl - f / l` (B.13, B.14), positive on the two nodes and negative between them.

use std::ops::Range;
use std::sync::Arc;

use super::law::{FiberMaterial, FiberMaterialError, Law};
use super::network::Network;
use thiserror::Error;

/// The mechanical side of a network: fibers grouped by law, with their areas. Immutable and shared.
#[derive(Clone, Debug)]
pub struct Truss {
    network: Arc<Network>,
    /// Ends of the fibers, in the order of their laws.
    ends: Vec<[u32; 2]>,
    /// Reference lengths, unit-cube units.
    lengths: Vec<f64>,
    /// Area over reference length of every fiber.
    area_per_length: Vec<f64>,
    /// Area of the cross-section of every fiber.
    areas: Vec<f64>,
    /// The law of every run of fibers.
    laws: Vec<(Law, Range<usize>)>,
    /// Position of every fiber in the network's own order.
    original: Vec<u32>,
}

/// What a truss computes of a deformed state; sized once, overwritten by every evaluation. One entry a fiber.
#[derive(Clone, Debug, Default)]
pub struct FiberStates {
    /// Unit vectors from the first to the second end.
    pub directions: Vec<[f64; 3]>,
    /// `l / L`.
    pub stretches: Vec<f64>,
    /// Axial force `f`, N.
    pub forces: Vec<f64>,
    /// `df/dl - f / l`: the material part of the stiffness, N per unit-cube length.
    pub material_stiffness: Vec<f64>,
    /// `f / l`: the geometric part.
    pub geometric_stiffness: Vec<f64>,
}

/// Why a network has no mechanics.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TrussError {
    /// Neither the caller nor the network's files say what the fibers are made of.
    #[error("the network {network} comes without fiber materials (no .params file), and none was given")]
    NoMaterial {
        /// The network.
        network: String,
    },
    /// A parameter without sense.
    #[error("{0}")]
    Material(#[from] FiberMaterialError),
}

impl Truss {
    /// The mechanics of a network whose fibers are all of one `material`, or of the materials of its own files.
    ///
    /// # Errors
    /// [`TrussError`].
    pub fn new(network: Arc<Network>, material: Option<FiberMaterial>) -> Result<Self, TrussError> {
        let materials = material.map_or_else(|| network.materials().to_vec(), |m| vec![m]);
        if materials.is_empty() {
            return Err(TrussError::NoMaterial { network: network.name().to_owned() });
        }
        for material in &materials {
            material.check()?;
        }
        let material_of =
            |fiber: u32| if material.is_some() { 0 } else { usize::from(network.reaction_of()[fiber as usize]) };
        let mut original: Vec<u32> = (0..network.fibers().len() as u32).collect();
        original.sort_by_key(|&fiber| material_of(fiber));

        let areas: Vec<f64> = original.iter().map(|&f| materials[material_of(f)].area()).collect();
        let lengths: Vec<f64> = original.iter().map(|&f| network.lengths()[f as usize]).collect();
        let mut laws: Vec<(Law, Range<usize>)> = Vec::new();
        let mut start = 0;
        for (number, material) in materials.iter().enumerate() {
            let count = original[start..].iter().take_while(|&&f| material_of(f) == number).count();
            if count > 0 {
                laws.push((material.law, start..start + count));
            }
            start += count;
        }
        Ok(Self {
            ends: original.iter().map(|&f| network.fibers()[f as usize]).collect(),
            area_per_length: areas.iter().zip(&lengths).map(|(a, l)| a / l).collect(),
            areas,
            lengths,
            laws,
            original,
            network,
        })
    }

    /// The geometry.
    #[must_use]
    pub fn network(&self) -> &Arc<Network> {
        &self.network
    }

    /// The two nodes of every fiber, in this truss' own order (by law).
    #[must_use]
    pub fn ends(&self) -> &[[u32; 2]] {
        &self.ends
    }

    /// For every fiber of this truss its number in the network.
    #[must_use]
    pub fn original(&self) -> &[u32] {
        &self.original
    }

    /// Reference lengths in this truss' order, unit-cube units.
    #[must_use]
    pub fn lengths(&self) -> &[f64] {
        &self.lengths
    }

    /// `sum_f A_f L_f`: fiber volume in the unit cube, areas in the units of the radii squared.
    #[must_use]
    pub fn volume(&self) -> f64 {
        self.areas.iter().zip(&self.lengths).map(|(a, l)| a * l).sum()
    }

    /// What rounding alone leaves of a residual: `8 eps sqrt(sum_f (E A / (2 L))^2)`, in N.
    ///
    /// Coordinates of size 1/2 carry an error of `eps / 2`, which a fiber turns into a force of `E A / L` times as much.
    #[must_use]
    pub fn rounding_floor(&self) -> f64 {
        let squares: f64 = self
            .laws
            .iter()
            .flat_map(|(law, range)| self.area_per_length[range.clone()].iter().map(|a| 0.5 * law.youngs_modulus() * a))
            .map(|stiffness| stiffness * stiffness)
            .sum();
        8.0 * f64::EPSILON * squares.sqrt()
    }

    /// Stretches, forces and stiffness of all fibers at the given node positions.
    pub fn evaluate(&self, positions: &[[f64; 3]], states: &mut FiberStates) {
        states.resize(self.ends.len());
        for (fiber, &[a, b]) in self.ends.iter().enumerate() {
            let (xa, xb) = (&positions[a as usize], &positions[b as usize]);
            let d = [xb[0] - xa[0], xb[1] - xa[1], xb[2] - xa[2]];
            // The same operations in the same order as for the reference lengths: at rest the stretch is exactly 1.
            let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            states.directions[fiber] = [d[0] / length, d[1] / length, d[2] / length];
            states.stretches[fiber] = length / self.lengths[fiber];
        }
        for (law, range) in &self.laws {
            let stretches = &states.stretches[range.clone()];
            // Nominal stress and slope, turned into force and stiffness below.
            law.stresses(stretches, &mut states.forces[range.clone()], &mut states.material_stiffness[range.clone()]);
        }
        for fiber in 0..self.ends.len() {
            let stress = states.forces[fiber];
            let per_length = self.area_per_length[fiber];
            let geometric = stress * per_length / states.stretches[fiber];
            states.forces[fiber] = stress * self.areas[fiber];
            states.geometric_stiffness[fiber] = geometric;
            states.material_stiffness[fiber] = states.material_stiffness[fiber] * per_length - geometric;
        }
    }

    /// The internal force at every node, `sum_f T`, in N.
    pub fn nodal_forces(&self, states: &FiberStates, forces: &mut [[f64; 3]]) {
        forces.fill([0.0; 3]);
        for (fiber, &[a, b]) in self.ends.iter().enumerate() {
            let n = &states.directions[fiber];
            let f = states.forces[fiber];
            for i in 0..3 {
                let t = f * n[i];
                forces[a as usize][i] -= t;
                forces[b as usize][i] += t;
            }
        }
    }

    /// `sum_f A L integral_1^lambda s`: the energy of all fibers in J per (unit-cube length times area).
    #[must_use]
    pub fn energy(&self, states: &FiberStates) -> f64 {
        // The fiber volumes are not worth storing for a number that is wanted once a converged state.
        let volumes: Vec<f64> = self.areas.iter().zip(&self.lengths).map(|(a, l)| a * l).collect();
        self.laws.iter().map(|(law, range)| law.energy(&states.stretches[range.clone()], &volumes[range.clone()])).sum()
    }
}

impl FiberStates {
    fn resize(&mut self, fibers: usize) {
        self.directions.resize(fibers, [0.0; 3]);
        self.stretches.resize(fibers, 0.0);
        self.forces.resize(fibers, 0.0);
        self.material_stiffness.resize(fibers, 0.0);
        self.geometric_stiffness.resize(fibers, 0.0);
    }

    /// The 3x3 stiffness block `k n (x) n + (f / l) I` of a fiber, row-major.
    #[inline(always)]
    #[must_use]
    pub fn block(&self, fiber: usize) -> [f64; 9] {
        let n = &self.directions[fiber];
        let k = self.material_stiffness[fiber];
        let g = self.geometric_stiffness[fiber];
        let (xx, yy, zz) = (k * n[0] * n[0] + g, k * n[1] * n[1] + g, k * n[2] * n[2] + g);
        let (xy, xz, yz) = (k * n[0] * n[1], k * n[0] * n[2], k * n[1] * n[2]);
        [xx, xy, xz, xy, yy, yz, xz, yz, zz]
    }
}
