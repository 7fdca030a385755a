//! A network of trusses: lengths, forces and stiffness of the fibers at given node positions.
//!
//! A fiber from node `a` to node `b` with `d = x_b - x_a`, length `l = |d|`, direction `n = d / l` and axial force `f`
//! pulls with `T_b = f n = -T_a` (Tobin 2018, eqs. B.3 to B.5). Its stiffness is the block `k n (x) n + (f / l) I` with
//! `k = df/dl - f / l` (B.13, B.14), positive on the two nodes and negative between them.

use std::ops::Range;
use std::sync::Arc;

use super::law::{FiberLaw, FiberMaterial, FiberMaterialError, Law};
use super::network::Network;
use super::simd::{Kernel, vectorized};
use thiserror::Error;

/// Fibers whose intermediate numbers stay in the first-level cache from one loop to the next.
const BATCH: usize = 128;

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
    /// Area times reference length of every fiber.
    volumes: Vec<f64>,
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
    #[error(
        "the network {network} comes without fiber materials (no .params file, no [law] in its .toml), and none was given"
    )]
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
        let of_one = material.is_some();
        let materials = material.map_or_else(|| network.materials().to_vec(), |m| vec![m]);
        if materials.is_empty() {
            return Err(TrussError::NoMaterial { network: network.name().to_owned() });
        }
        for material in &materials {
            material.check()?;
        }
        let material_of = |fiber: u32| if of_one { 0 } else { usize::from(network.reaction_of()[fiber as usize]) };
        let mut original: Vec<u32> = (0..network.fibers().len() as u32).collect();
        original.sort_by_key(|&fiber| material_of(fiber));

        let areas: Vec<f64> = original.iter().map(|&f| materials[material_of(f)].area()).collect();
        let lengths: Vec<f64> = original.iter().map(|&f| network.lengths()[f as usize]).collect();
        let mut laws: Vec<(Law, Range<usize>)> = Vec::new();
        let mut start = 0;
        for (number, material) in materials.into_iter().enumerate() {
            let count = original[start..].iter().take_while(|&&f| material_of(f) == number).count();
            if count > 0 {
                laws.push((material.law, start..start + count));
            }
            start += count;
        }
        Ok(Self {
            ends: original.iter().map(|&f| network.fibers()[f as usize]).collect(),
            area_per_length: areas.iter().zip(&lengths).map(|(a, l)| a / l).collect(),
            volumes: areas.iter().zip(&lengths).map(|(a, l)| a * l).collect(),
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
        self.volumes.iter().sum()
    }

    /// `sum_f E_f A_f L_f` with the moduli at rest: the stiffness of the unit cube if all fibers lay along one direction and
    /// followed it, Pa once scaled as stresses are.
    #[must_use]
    pub fn volume_of_moduli(&self) -> f64 {
        let of_law =
            |(law, range): &(Law, Range<usize>)| law.youngs_modulus() * self.volumes[range.clone()].iter().sum::<f64>();
        self.laws.iter().map(of_law).sum()
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
        self.pass(positions, states, &mut |_, _| ());
    }

    /// The same, and the internal force at every node, `sum_f T`, in N: one pass instead of [`Truss::evaluate`] and
    /// [`Truss::nodal_forces`], with the same result bit for bit.
    pub fn evaluate_with_forces(&self, positions: &[[f64; 3]], states: &mut FiberStates, forces: &mut [[f64; 3]]) {
        forces.fill([0.0; 3]);
        self.pass(positions, states, &mut |batch, states| self.add_forces(batch, states, forces));
    }

    /// Batch by batch: geometry, law, force and stiffness, and then what `after` does with them.
    fn pass(
        &self,
        positions: &[[f64; 3]],
        states: &mut FiberStates,
        after: &mut dyn FnMut(Range<usize>, &FiberStates),
    ) {
        states.resize(self.ends.len());
        for (law, range) in &self.laws {
            law.with(&mut |law| {
                for start in range.clone().step_by(BATCH) {
                    let batch = start..range.end.min(start + BATCH);
                    self.evaluate_batch(law, batch.clone(), positions, states);
                    after(batch, states);
                }
            });
        }
    }

    /// At most [`BATCH`] fibers of one law.
    fn evaluate_batch(
        &self,
        law: &dyn FiberLaw,
        batch: Range<usize>,
        positions: &[[f64; 3]],
        states: &mut FiberStates,
    ) {
        let mut differences = [[0.0; BATCH]; 3];
        for (k, &[a, b]) in self.ends[batch.clone()].iter().enumerate() {
            let (xa, xb) = (&positions[a as usize], &positions[b as usize]);
            for i in 0..3 {
                differences[i][k] = xb[i] - xa[i];
            }
        }
        let mut inverse_lengths = [0.0; BATCH];
        let count = batch.len();
        let FiberStates { directions, stretches, forces, material_stiffness, geometric_stiffness } = states;
        vectorized(Geometry {
            differences: &differences,
            rest_lengths: &self.lengths[batch.clone()],
            inverse_lengths: &mut inverse_lengths[..count],
            stretches: &mut stretches[batch.clone()],
            directions: &mut directions[batch.clone()],
        });
        // Nominal stress and slope, turned into force and stiffness where they stand.
        let forces = &mut forces[batch.clone()];
        let material = &mut material_stiffness[batch.clone()];
        law.stresses(&stretches[batch.clone()], forces, material);
        vectorized(Mechanics {
            areas: &self.areas[batch.clone()],
            area_per_length: &self.area_per_length[batch.clone()],
            inverse_lengths: &inverse_lengths[..count],
            forces,
            material,
            geometric: &mut geometric_stiffness[batch],
        });
    }

    /// The fiber whose force is the largest multiple of its own stiffness at rest, `|f| / (E A)`: its law, its stretch, and
    /// that multiple, infinite where the force is not a number.
    #[must_use]
    pub fn most_strained(&self, states: &FiberStates) -> Option<(&Law, f64, f64)> {
        let of_law = |(law, range): &'_ (Law, Range<usize>)| {
            let stress = |fiber: usize| {
                let multiple = (states.forces[fiber] / (law.youngs_modulus() * self.areas[fiber])).abs();
                (fiber, if multiple.is_nan() { f64::INFINITY } else { multiple })
            };
            range.clone().map(stress).max_by(|a, b| a.1.total_cmp(&b.1))
        };
        let worst = self.laws.iter().filter_map(|laws| of_law(laws).map(|worst| (&laws.0, worst)));
        let (law, (fiber, multiple)) = worst.max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
        Some((law, states.stretches[fiber], multiple))
    }

    /// The internal force at every node, `sum_f T`, in N.
    pub fn nodal_forces(&self, states: &FiberStates, forces: &mut [[f64; 3]]) {
        forces.fill([0.0; 3]);
        self.add_forces(0..self.ends.len(), states, forces);
    }

    fn add_forces(&self, batch: Range<usize>, states: &FiberStates, forces: &mut [[f64; 3]]) {
        let fibers = self.ends[batch.clone()].iter().zip(&states.directions[batch.clone()]).zip(&states.forces[batch]);
        for ((&[a, b], n), &f) in fibers {
            let pull = n.map(|n| f * n);
            let at_a = &mut forces[a as usize];
            (0..3).for_each(|i| at_a[i] -= pull[i]);
            let at_b = &mut forces[b as usize];
            (0..3).for_each(|i| at_b[i] += pull[i]);
        }
    }

    /// `sum_f A L integral_1^lambda s`: the energy of all fibers in J per (unit-cube length times area).
    #[must_use]
    pub fn energy(&self, states: &FiberStates) -> f64 {
        self.laws
            .iter()
            .map(|(law, range)| law.total_energy(&states.stretches[range.clone()], &self.volumes[range.clone()]))
            .sum()
    }
}

/// From `x_b - x_a` to length, stretch and direction.
struct Geometry<'a> {
    differences: &'a [[f64; BATCH]; 3],
    rest_lengths: &'a [f64],
    inverse_lengths: &'a mut [f64],
    stretches: &'a mut [f64],
    directions: &'a mut [[f64; 3]],
}

impl Kernel for Geometry<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Self { differences: [dx, dy, dz], rest_lengths, inverse_lengths, stretches, directions } = self;
        let fibers = dx.iter().zip(dy).zip(dz).zip(rest_lengths).zip(inverse_lengths).zip(stretches).zip(directions);
        for ((((((&x, &y), &z), &rest), inverse), stretch), direction) in fibers {
            // The same operations in the same order as for the reference lengths, none of them fused: at rest the
            // stretch is exactly 1.
            let length = (x * x + y * y + z * z).sqrt();
            *stretch = length / rest;
            *inverse = 1.0 / length;
            *direction = [x * *inverse, y * *inverse, z * *inverse];
        }
    }
}

/// From nominal stress and slope, in `forces` and `material`, to force and stiffness.
struct Mechanics<'a> {
    areas: &'a [f64],
    area_per_length: &'a [f64],
    inverse_lengths: &'a [f64],
    forces: &'a mut [f64],
    material: &'a mut [f64],
    geometric: &'a mut [f64],
}

impl Kernel for Mechanics<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Self { areas, area_per_length, inverse_lengths, forces, material, geometric } = self;
        let fibers = areas.iter().zip(area_per_length).zip(inverse_lengths).zip(forces).zip(material).zip(geometric);
        for (((((&area, &per_length), &inverse), force), material), geometric) in fibers {
            *force *= area;
            *geometric = *force * inverse;
            *material = *material * per_length - *geometric;
        }
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
