//! A fiber network as a truss: lengths, forces and stiffness of the fibers at given node positions.
//!
//! A fiber from node `a` to node `b` with `d = x_b - x_a`, length `l = |d|`, direction `n = d / l` and axial force `f`
//! has nodal forces `T_b = f n = -T_a` (Tobin 2018, eqs. B.3 to B.5). Its stiffness is the block
//! `k n (x) n + (f / l) I` with `k = df/dl - f / l` (B.13, B.14), positive on the diagonal blocks of the two nodes and
//! negative off the diagonal.

use std::ops::Range;
use std::sync::Arc;

use super::law::{FiberLaw, FiberMaterial, FiberMaterialError, Law};
use super::network::Network;
use super::simd::{Kernel, vectorized};
use thiserror::Error;

/// Number of fibers per batch, chosen such that their intermediate values stay in the first-level cache.
const BATCH: usize = 128;

/// The mechanics of a network: fibers grouped by law, with their areas. Immutable and shared.
#[derive(Clone, Debug)]
pub struct Truss {
    network: Arc<Network>,
    /// Ends of the fibers, ordered by law.
    ends: Vec<[u32; 2]>,
    /// Reference lengths, unit-cube units.
    lengths: Vec<f64>,
    /// Area over reference length of every fiber.
    area_per_length: Vec<f64>,
    /// Cross-sectional area of every fiber.
    areas: Vec<f64>,
    /// Area times reference length of every fiber.
    volumes: Vec<f64>,
    /// The laws, each with the range of fibers that follow it.
    laws: Vec<(Law, Range<usize>)>,
    /// The number that every fiber has in the network.
    fiber_numbers: Vec<u32>,
}

/// Fiber states at given node positions, one entry per fiber; allocated once and overwritten by every evaluation.
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
    /// `f / l`: the geometric part of the stiffness.
    pub geometric_stiffness: Vec<f64>,
}

/// Error in the construction of a [`Truss`].
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TrussError {
    /// Neither the caller nor the network's files give a fiber material. Holds the name of the network.
    #[error(
        "the network {0} has no fiber materials (no .params file, no [law] or [[fiber_type]] in its .toml), and no law was given"
    )]
    NoMaterial(String),
    /// A material parameter is invalid.
    #[error(transparent)]
    Material(#[from] FiberMaterialError),
}

impl Truss {
    /// Makes the truss of a network whose fibers all have one `material`, or the materials of the network's own files
    /// if `material` is `None`.
    ///
    /// # Errors
    /// Returns [`TrussError`] if there is no material or a material parameter is invalid.
    pub fn new(network: Arc<Network>, material: Option<FiberMaterial>) -> Result<Self, TrussError> {
        let of_one = material.is_some();
        let materials = material.map_or_else(|| network.materials().to_vec(), |m| vec![m]);
        if materials.is_empty() {
            return Err(TrussError::NoMaterial(network.name().to_owned()));
        }
        for material in &materials {
            material.check()?;
        }
        let material_of = |fiber: u32| if of_one { 0 } else { usize::from(network.material_of()[fiber as usize]) };
        let mut fiber_numbers: Vec<u32> = (0..network.fibers().len() as u32).collect();
        fiber_numbers.sort_by_key(|&fiber| material_of(fiber));

        let areas: Vec<f64> = fiber_numbers.iter().map(|&f| materials[material_of(f)].area()).collect();
        let lengths: Vec<f64> = fiber_numbers.iter().map(|&f| network.lengths()[f as usize]).collect();
        let mut laws: Vec<(Law, Range<usize>)> = Vec::new();
        let mut start = 0;
        for (number, material) in materials.into_iter().enumerate() {
            let count = fiber_numbers[start..].iter().take_while(|&&f| material_of(f) == number).count();
            if count > 0 {
                laws.push((material.law, start..start + count));
            }
            start += count;
        }
        Ok(Self {
            ends: fiber_numbers.iter().map(|&f| network.fibers()[f as usize]).collect(),
            area_per_length: areas.iter().zip(&lengths).map(|(a, l)| a / l).collect(),
            volumes: areas.iter().zip(&lengths).map(|(a, l)| a * l).collect(),
            areas,
            lengths,
            laws,
            fiber_numbers,
            network,
        })
    }

    /// The geometry of the network.
    pub fn network(&self) -> &Arc<Network> {
        &self.network
    }

    /// The two nodes of every fiber, in the order of this truss (by law).
    pub fn ends(&self) -> &[[u32; 2]] {
        &self.ends
    }

    /// The number in the network of every fiber of this truss.
    pub fn fiber_numbers(&self) -> &[u32] {
        &self.fiber_numbers
    }

    /// Reference lengths in the order of this truss, unit-cube units.
    pub fn lengths(&self) -> &[f64] {
        &self.lengths
    }

    /// Cross-sectional areas in the order of this truss, in the squared unit of the radii.
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// The laws, each with the range of fibers that follow it.
    pub fn laws(&self) -> impl ExactSizeIterator<Item = (&Law, Range<usize>)> {
        self.laws.iter().map(|(law, range)| (law, range.clone()))
    }

    /// `sum_f A_f L_f`: fiber volume in the unit cube, with areas in the squared units of the radii.
    pub fn volume(&self) -> f64 {
        self.volumes.iter().sum()
    }

    /// `sum_f E_f A_f L_f` with the moduli at rest: times the stress scale, the stiffness of the unit cube in Pa if all
    /// fibers were aligned with the load and deformed affinely.
    pub fn volume_of_moduli(&self) -> f64 {
        let of_law =
            |(law, range): &(Law, Range<usize>)| law.youngs_modulus() * self.volumes[range.clone()].iter().sum::<f64>();
        self.laws.iter().map(of_law).sum()
    }

    /// The rounding error of a residual: `8 eps sqrt(sum_f (E A / (2 L))^2)`, in N.
    ///
    /// Coordinates of size 1/2 have an error of `eps / 2`, and a fiber multiplies it by `E A / L`.
    pub fn rounding_floor(&self) -> f64 {
        let squares: f64 = self
            .laws
            .iter()
            .flat_map(|(law, range)| self.area_per_length[range.clone()].iter().map(|a| 0.5 * law.youngs_modulus() * a))
            .map(|stiffness| stiffness * stiffness)
            .sum();
        8.0 * f64::EPSILON * squares.sqrt()
    }

    /// Computes stretches, forces and stiffness of all fibers at the given node positions.
    pub fn evaluate(&self, positions: &[[f64; 3]], states: &mut FiberStates) {
        self.evaluate_batches(positions, states, &mut |_, _| ());
    }

    /// Like [`Truss::evaluate`], and also computes the internal force `sum_f T` at every node, in N. This single pass
    /// gives bitwise the same result as [`Truss::evaluate`] followed by [`Truss::nodal_forces`].
    pub fn evaluate_with_forces(&self, positions: &[[f64; 3]], states: &mut FiberStates, forces: &mut [[f64; 3]]) {
        forces.fill([0.0; 3]);
        self.evaluate_batches(positions, states, &mut |batch, states| self.add_forces(batch, states, forces));
    }

    /// Evaluates batch by batch geometry, law, force and stiffness, and calls `after` for each batch.
    fn evaluate_batches(
        &self,
        positions: &[[f64; 3]],
        states: &mut FiberStates,
        after: &mut dyn FnMut(Range<usize>, &FiberStates),
    ) {
        states.resize(self.ends.len());
        for (law, range) in &self.laws {
            law.dispatch(&mut |law| {
                for start in range.clone().step_by(BATCH) {
                    let batch = start..range.end.min(start + BATCH);
                    self.evaluate_batch(law, batch.clone(), positions, states);
                    after(batch, states);
                }
            });
        }
    }

    /// Evaluates at most [`BATCH`] fibers of one law.
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
        // The law writes nominal stress and slope; `Mechanics` converts them in place to force and stiffness.
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

    /// Returns the law and the stretch of the fiber with the largest force relative to its stiffness at rest,
    /// `|f| / (E A)`, and that ratio, which is infinite if the force is not a number.
    pub fn max_relative_force(&self, states: &FiberStates) -> Option<(&Law, f64, f64)> {
        let of_law = |(law, range): &'_ (Law, Range<usize>)| {
            let stress = |fiber: usize| {
                let force_ratio = (states.forces[fiber] / (law.youngs_modulus() * self.areas[fiber])).abs();
                (fiber, if force_ratio.is_nan() { f64::INFINITY } else { force_ratio })
            };
            range.clone().map(stress).max_by(|a, b| a.1.total_cmp(&b.1))
        };
        let worst = self.laws.iter().filter_map(|laws| of_law(laws).map(|worst| (&laws.0, worst)));
        let (law, (fiber, force_ratio)) = worst.max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
        Some((law, states.stretches[fiber], force_ratio))
    }

    /// Computes the internal force at every node, `sum_f T`, in N.
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

    /// The energy of all fibers, `sum_f A L integral_1^lambda s`, in J for a cube with an edge of 1 m (areas are in
    /// m^2, lengths in unit-cube units).
    pub fn energy(&self, states: &FiberStates) -> f64 {
        self.laws
            .iter()
            .map(|(law, range)| law.total_energy(&states.stretches[range.clone()], &self.volumes[range.clone()]))
            .sum()
    }
}

/// Computes length, stretch and direction from `x_b - x_a`.
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
            // Same operations in the same order as for the reference lengths, none of them fused: the stretch at rest
            // is exactly 1.
            let length = (x * x + y * y + z * z).sqrt();
            *stretch = length / rest;
            *inverse = 1.0 / length;
            *direction = [x * *inverse, y * *inverse, z * *inverse];
        }
    }
}

/// Converts nominal stress and slope, in `forces` and `material`, to force and stiffness.
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
    pub fn block(&self, fiber: usize) -> [f64; 9] {
        let n = &self.directions[fiber];
        let k = self.material_stiffness[fiber];
        let g = self.geometric_stiffness[fiber];
        let (xx, yy, zz) = (k * n[0] * n[0] + g, k * n[1] * n[1] + g, k * n[2] * n[2] + g);
        let (xy, xz, yz) = (k * n[0] * n[1], k * n[0] * n[2], k * n[1] * n[2]);
        [xx, xy, xz, xy, yy, yz, xz, yz, zz]
    }
}
