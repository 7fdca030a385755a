//! Representative volume elements: the immutable model shared by all RVEs of a network, and the state of each RVE.

use std::num::NonZeroU64;
use std::sync::Arc;

use nalgebra::Matrix3;
use thiserror::Error;

use super::homogenize::strain;
use super::law::FiberMaterial;
use super::network::Network;
use super::stiffness::{self, StiffnessSlots};
use super::truss::{Truss, TrussError};
use super::workspace::{MODES, Workspace};
use crate::las::{Backend, Method, RealBackend, SolveError, SolverParams, Sparsity, SparsityError, Symmetry};

/// The factor `kappa` that converts forces of the unit-cube network to stresses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StressScale {
    /// `kappa = 1`: forces in the unit cube, for comparison with other codes. Every network is scaled to the unit cube,
    /// whatever the edge of the cube in its file, but the radii of the fibers are not: the result is in N per square of
    /// the edge. For a cube of edge `a`, in the unit of length of the radius, the stress in Pa is the result divided by
    /// `a^2`; a radius in units of the edge (`radius / a`) gives the same.
    Raw,
    /// `kappa = phi / sum_f (A_f L_f)` for this fiber volume fraction `phi`: stresses in Pa, which do not depend on the
    /// edge of the cube or on a common factor of the radii.
    FiberVolumeFraction(f64),
}

/// The data shared by all RVEs of one network: geometry, laws, sparsity pattern and symbolic factorization of the
/// stiffness.
#[derive(Debug)]
pub struct RveModel<B: Backend> {
    pub(super) truss: Truss,
    pub(super) pattern: Arc<Sparsity>,
    pub(super) symbolic: Arc<B::Symbolic>,
    pub(super) slots: StiffnessSlots<B>,
    material: Option<FiberMaterial>,
    stress_scale: StressScale,
    scale: f64,
    rounding_floor: f64,
    masses: Vec<f64>,
    chord_steps: usize,
    pub(super) fingerprint: Option<NonZeroU64>,
}

/// Error in the construction of an [`RveModel`].
#[derive(Debug, Error)]
pub enum RveModelError<F: std::error::Error> {
    /// The fibers have no valid material.
    #[error(transparent)]
    Truss(#[from] TrussError),
    /// The volume fraction is not above 0 and at most 1.
    #[error("the fiber volume fraction is {0}; it must be above 0 and at most 1")]
    VolumeFraction(f64),
    /// The fibers are so thin or so thick that the stress scale is not a positive finite number.
    #[error(
        "a fiber volume of {volume:e} in the unit cube gives the stress scale {scale:e}: check the radius and its unit"
    )]
    Scale {
        /// `kappa`.
        scale: f64,
        /// `sum_f (A_f L_f)`.
        volume: f64,
    },
    /// The network is too large for the index type.
    #[error("the stiffness has no valid pattern: {0}")]
    Pattern(#[from] SparsityError),
    /// The backend cannot analyze the stiffness.
    #[error("the stiffness cannot be analyzed: {0}")]
    Analysis(#[from] SolveError<F>),
}

/// Returns the chord steps of an iteration that serve a network with this number of unknowns. RVEs have the same
/// iterates alone and beside others, so that nothing else may decide.
fn chord_steps(unknowns: usize, solver: &SolverParams) -> usize {
    /// From here on a factorization was measured to cost more than the steps that replace it: see `docs/kernel.md`.
    const LEAST_UNKNOWNS: usize = 256;
    if solver.method == Method::Direct && unknowns >= LEAST_UNKNOWNS { 3 } else { 0 }
}

impl<B: RealBackend> RveModel<B> {
    /// Makes the model of a network whose fibers all have one `material`, or the materials of the network's own files
    /// if `material` is `None`.
    ///
    /// # Errors
    /// Returns [`RveModelError`] if a material or the volume fraction is invalid, if the stress scale overflows, or if
    /// the stiffness cannot be analyzed.
    pub fn new(
        context: &B::Context,
        network: Arc<Network>,
        material: Option<FiberMaterial>,
        scale: StressScale,
    ) -> Result<Self, RveModelError<B::Error>> {
        Self::with_solver(context, network, material, scale, &SolverParams::new(Symmetry::Definite))
    }

    /// Like [`RveModel::new`], with the given solver instead of a direct one. The accuracy of the tangent is that of
    /// the solver.
    ///
    /// # Errors
    /// As for [`RveModel::new`].
    pub fn with_solver(
        context: &B::Context,
        network: Arc<Network>,
        material: Option<FiberMaterial>,
        scale: StressScale,
        solver: &SolverParams,
    ) -> Result<Self, RveModelError<B::Error>> {
        let masses = lumped_masses(&network, material.as_ref());
        let truss = Truss::new(network, material.clone())?;
        let stress_scale = scale;
        let scale = match scale {
            StressScale::Raw => 1.0,
            StressScale::FiberVolumeFraction(phi) if phi > 0.0 && phi <= 1.0 => phi / truss.volume(),
            StressScale::FiberVolumeFraction(phi) => return Err(RveModelError::VolumeFraction(phi)),
        };
        let pattern = Arc::new(stiffness::pattern(truss.network())?);
        let symbolic = B::analyze(context, &pattern, solver)?;
        if !(scale.is_finite() && scale > 0.0) {
            return Err(RveModelError::Scale { scale, volume: truss.volume() });
        }
        let slots = StiffnessSlots::locate(context, &truss, &pattern).map_err(SolveError::Backend)?;
        Ok(Self {
            chord_steps: chord_steps(pattern.rows(), solver),
            rounding_floor: truss.rounding_floor(),
            fingerprint: fingerprint(truss.network()),
            truss,
            pattern,
            symbolic,
            slots,
            material,
            stress_scale,
            scale,
            masses,
        })
    }

    /// The geometry of the network.
    pub fn network(&self) -> &Arc<Network> {
        self.truss.network()
    }

    /// The truss: the fibers with their laws.
    pub fn truss(&self) -> &Truss {
        &self.truss
    }

    /// The material of all fibers, if it replaces the materials of the network's own files.
    pub fn material(&self) -> Option<&FiberMaterial> {
        self.material.as_ref()
    }

    /// The conversion of forces to stresses.
    pub fn stress_scale(&self) -> StressScale {
        self.stress_scale
    }

    /// `kappa`: the factor from forces in the unit cube to stresses.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// Bytes of the network, its pattern and its analysis, estimated.
    pub fn bytes(&self) -> usize {
        60 * self.truss.network().nodes().len() + 100 * self.truss.network().fibers().len() + 12 * self.pattern.nnz()
    }

    /// Number of unknowns: three per interior node.
    pub fn unknowns(&self) -> usize {
        self.pattern.rows()
    }

    /// The chord steps of an iteration ([`EquilibriumParams::chord_steps`](super::equilibrium::EquilibriumParams)) if
    /// nothing else is asked for.
    pub(crate) fn chord_steps(&self) -> usize {
        self.chord_steps
    }

    /// Lumped nodal masses, in kg with `L` in unit-cube units: half of `rho A L` of every fiber at each of its ends.
    /// Fibers without a density get that of water.
    pub fn masses(&self) -> &[f64] {
        &self.masses
    }

    /// The rounding error of a residual, in N.
    pub fn rounding_floor(&self) -> f64 {
        self.rounding_floor
    }
}

fn lumped_masses(network: &Network, material: Option<&FiberMaterial>) -> Vec<f64> {
    const WATER: f64 = 1000.0;
    let mut masses = vec![0.0; network.nodes().len()];
    let fibers = network.fibers().iter().zip(network.lengths()).zip(network.material_of());
    for ((ends, length), &reaction) in fibers {
        let material = material.or_else(|| network.materials().get(usize::from(reaction)));
        let Some(material) = material else { continue };
        let density = material.density.filter(|&density| density > 0.0).unwrap_or(WATER);
        for &node in ends {
            masses[node as usize] += 0.5 * density * material.area() * length;
        }
    }
    masses
}

/// Hashes the numbers of nodes and fibers and the interior node positions at rest, to distinguish networks.
fn fingerprint(network: &Network) -> Option<NonZeroU64> {
    // Multiplies as in Knuth's MMIX generator, then rotates so that high bits reach the low positions; the result is
    // not 0.
    let mix = |sum: u64, value: u64| (sum ^ value).wrapping_mul(0x5851_f42d_4c95_7f2d).rotate_left(29);
    let counts = [network.nodes().len(), network.fibers().len()];
    let sum = counts.into_iter().fold(1, |sum, count| mix(sum, count as u64));
    let interior = network.interior().iter().flat_map(|&node| network.nodes()[node as usize]);
    NonZeroU64::new(interior.fold(sum, |sum, x| mix(sum, x.to_bits())) | 1)
}

/// The state of one RVE: the deformation gradient of its equilibrium and its interior node positions.
#[derive(Clone, Debug)]
pub struct Rve {
    /// The deformation gradient of the last equilibrium.
    pub(super) gradient: Matrix3<f64>,
    /// Interior node positions of that equilibrium, unit-cube units, in the order of [`Network::interior`].
    pub(super) interior: Vec<[f64; 3]>,
    /// Sensitivities of these positions to a further strain, if they were kept.
    pub(super) sensitivities: Option<Vec<Sensitivities>>,
    /// The [`fingerprint`] of its network; `None` for a restored state until its first equilibrium.
    pub(super) network: Option<NonZeroU64>,
}

/// Two states are equal if their contents are; the network is not compared.
impl PartialEq for Rve {
    fn eq(&self, other: &Self) -> bool {
        self.gradient == other.gradient && self.interior == other.interior && self.sensitivities == other.sensitivities
    }
}

/// Sensitivity of the position of an interior node to each of the six unit strains of the current state, minus that of
/// the affine motion. Single precision suffices for an initial guess of Newton.
pub type Sensitivities = [f32; 3 * MODES];

/// The reason why a state does not belong to a network.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum RveStateError {
    /// The number of interior nodes differs from that of the network.
    #[error("the state has positions of {found} interior nodes; the network has {expected}")]
    Nodes {
        /// Interior nodes of the state.
        found: usize,
        /// Interior nodes of the network.
        expected: usize,
    },
    /// A position or a sensitivity is not a finite number.
    #[error("the position of interior node {0} is not a finite number")]
    NotFinite(usize),
    /// The state belongs to another network with the same number of interior nodes.
    #[error("the state belongs to another network with the same number of interior nodes")]
    Network,
    /// The determinant of the deformation gradient is not positive and finite.
    #[error("the deformation gradient has determinant {0:.3e}; it must be positive")]
    Inverted(f64),
}

impl Rve {
    /// Restores a state from saved values of [`Rve::gradient`], [`Rve::interior`] and [`Rve::sensitivities`]. The state
    /// is assumed to be in equilibrium; [`Rve::check`] tests whether it can belong to a network.
    pub fn restored(
        gradient: Matrix3<f64>,
        interior: Vec<[f64; 3]>,
        sensitivities: Option<Vec<Sensitivities>>,
    ) -> Self {
        Self { gradient, interior, sensitivities, network: None }
    }

    /// Splits the state into the arguments of [`Rve::restored`].
    #[must_use]
    pub fn into_parts(self) -> (Matrix3<f64>, Vec<[f64; 3]>, Option<Vec<Sensitivities>>) {
        (self.gradient, self.interior, self.sensitivities)
    }

    /// Checks that this can be a state of the given network.
    ///
    /// # Errors
    /// Returns [`RveStateError::Nodes`] if the number of nodes differs, [`RveStateError::NotFinite`] if a position or
    /// sensitivity is not finite, and [`RveStateError::Inverted`] if `det F` is not positive and finite.
    pub fn check(&self, network: &Network) -> Result<(), RveStateError> {
        let expected = network.interior().len();
        for found in [Some(self.interior.len()), self.sensitivities.as_ref().map(Vec::len)].into_iter().flatten() {
            if found != expected {
                return Err(RveStateError::Nodes { found, expected });
            }
        }
        if let Some(node) = self.interior.iter().position(|x| x.iter().any(|x| !x.is_finite())) {
            return Err(RveStateError::NotFinite(node));
        }
        if let Some(node) =
            self.sensitivities.iter().flatten().position(|sensitivities| sensitivities.iter().any(|v| !v.is_finite()))
        {
            return Err(RveStateError::NotFinite(node));
        }
        let determinant = self.gradient.determinant();
        if !(determinant.is_finite() && determinant > 0.0) {
            return Err(RveStateError::Inverted(determinant));
        }
        Ok(())
    }

    /// Checks that the state belongs to the network of this model; a restored state is compared by its number of nodes
    /// alone.
    pub(super) fn belongs_to<B: Backend>(&self, model: &RveModel<B>) -> Result<(), RveStateError> {
        let (found, expected) = (self.interior.len(), model.truss.network().interior().len());
        if found != expected {
            return Err(RveStateError::Nodes { found, expected });
        }
        if self.network.is_some() && self.network != model.fingerprint {
            return Err(RveStateError::Network);
        }
        Ok(())
    }

    /// The undeformed state.
    pub fn at_rest(network: &Network) -> Self {
        let interior = network.interior().iter().map(|&node| network.nodes()[node as usize]).collect();
        Self { gradient: Matrix3::identity(), interior, sensitivities: None, network: fingerprint(network) }
    }

    /// Stores the sensitivities from which the tangent was computed; the workspace holds them.
    pub(super) fn keep_sensitivities<B: Backend>(&mut self, model: &RveModel<B>, workspace: &Workspace<B>) {
        let strains: [Matrix3<f64>; MODES] = std::array::from_fn(strain);
        let sensitivities = self.sensitivities.get_or_insert_with(Vec::new);
        sensitivities.clear();
        sensitivities.extend(model.truss.network().interior().iter().zip(&self.interior).map(|(&node, x)| {
            let mut sensitivities = Sensitivities::default();
            let full = &workspace.sensitivities[node as usize];
            for (mode, s) in strains.iter().enumerate() {
                let affine = transform(s, x);
                for i in 0..3 {
                    sensitivities[3 * mode + i] = (full[3 * mode + i] - affine[i]) as f32;
                }
            }
            sensitivities
        }));
    }

    /// Returns true if both states are the same equilibrium within the accuracy of a converged Newton solve: no
    /// coordinate of an interior node differs by more than `1e-6` of the cube's edge.
    pub fn is_same_equilibrium(&self, other: &Self) -> bool {
        const NEAR: f64 = 1e-6;
        let pairs = self.interior.as_flattened().iter().zip(other.interior.as_flattened());
        self.interior.len() == other.interior.len() && pairs.into_iter().all(|(a, b)| (a - b).abs() <= NEAR)
    }

    /// Replaces the state by an equilibrium of the same network, which was found at `gradient`.
    #[cfg_attr(not(feature = "cuda"), allow(dead_code, reason = "only devices find equilibria elsewhere"))]
    pub(crate) fn replace(
        &mut self,
        gradient: &Matrix3<f64>,
        interior: &[[f64; 3]],
        sensitivities: Option<&[Sensitivities]>,
    ) {
        self.gradient = *gradient;
        self.interior.clear();
        self.interior.extend_from_slice(interior);
        match (sensitivities, &mut self.sensitivities) {
            (Some(new), Some(old)) => {
                old.clear();
                old.extend_from_slice(new);
            }
            (new, old) => *old = new.map(<[Sensitivities]>::to_vec),
        }
    }

    /// Copies the equilibrium of another state of the same network and discards the sensitivities of this one.
    pub fn copy_equilibrium_from(&mut self, other: &Self) {
        self.gradient = other.gradient;
        self.interior.clone_from(&other.interior);
        self.sensitivities = None;
        self.network = other.network;
    }

    /// Bytes of its heap allocations.
    pub fn heap_bytes(&self) -> usize {
        self.interior.capacity() * size_of::<[f64; 3]>()
            + self
                .sensitivities
                .as_ref()
                .map_or(0, |sensitivities| sensitivities.capacity() * size_of::<Sensitivities>())
    }

    /// Returns true if the next equilibrium can start from a first-order prediction.
    pub fn has_sensitivities(&self) -> bool {
        self.sensitivities.is_some()
    }

    /// Discards the sensitivities: the next equilibrium starts from an affine motion.
    pub fn clear_sensitivities(&mut self) {
        self.sensitivities = None;
    }

    /// The deformation gradient of the last equilibrium.
    pub fn gradient(&self) -> &Matrix3<f64> {
        &self.gradient
    }

    /// Positions of all nodes at the last equilibrium, unit-cube units.
    pub fn positions(&self, network: &Network) -> Vec<[f64; 3]> {
        let mut positions: Vec<[f64; 3]> = network.nodes().iter().map(|x| transform(&self.gradient, x)).collect();
        for (&node, x) in network.interior().iter().zip(&self.interior) {
            positions[node as usize] = *x;
        }
        positions
    }

    /// Interior node positions of the last equilibrium, unit-cube units.
    pub fn interior(&self) -> &[[f64; 3]] {
        &self.interior
    }

    /// Sensitivities of the interior nodes to a further strain, if
    /// [`EquilibriumState::keep_sensitivities`](super::equilibrium::EquilibriumState::keep_sensitivities) stored them.
    pub fn sensitivities(&self) -> Option<&[Sensitivities]> {
        self.sensitivities.as_deref()
    }
}

/// Returns `F x`.
#[inline(always)]
pub(super) fn transform(f: &Matrix3<f64>, x: &[f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| f[(i, 0)] * x[0] + f[(i, 1)] * x[1] + f[(i, 2)] * x[2])
}
