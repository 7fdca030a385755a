//! A representative volume element: the immutable model of a network, shared, and the state that each RVE owns.

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
use crate::las::{Backend, SolveError, SolverParams, Sparsity, SparsityError, Symmetry};

/// How the forces of a network become stresses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StressScale {
    /// `kappa = 1`: forces of the unit cube, for comparison with other codes.
    Raw,
    /// `kappa = phi / sum_f (A_f L_f)` for this fiber volume fraction `phi`: stresses in Pa.
    FiberVolumeFraction(f64),
}

/// Everything that RVEs of one network share: geometry, laws, the pattern of the stiffness and its symbolic factor.
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
    pub(super) fingerprint: Option<NonZeroU64>,
}

/// Why a network cannot serve as an RVE.
#[derive(Debug, Error)]
pub enum RveModelError<F: std::error::Error> {
    /// The fibers have no mechanics.
    #[error("{0}")]
    Truss(#[from] TrussError),
    /// The volume fraction is not between 0 and 1.
    #[error("the fiber volume fraction is {0}; it must lie between 0 and 1")]
    VolumeFraction(f64),
    /// The fibers are so thin or so thick that stresses leave the range of numbers.
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
    Analysis(SolveError<F>),
}

impl<B: Backend<Scalar = f64>> RveModel<B> {
    /// The model of a network whose fibers are of one `material`, or of those of its own files.
    ///
    /// # Errors
    /// [`RveModelError`].
    pub fn new(
        context: &B::Context,
        network: Arc<Network>,
        material: Option<FiberMaterial>,
        scale: StressScale,
    ) -> Result<Self, RveModelError<B::Fault>> {
        Self::with_solver(context, network, material, scale, &SolverParams::new(Symmetry::Definite))
    }

    /// The same, with linear systems solved in another way than directly. The tangent is as exact as these solutions.
    ///
    /// # Errors
    /// [`RveModelError`].
    pub fn with_solver(
        context: &B::Context,
        network: Arc<Network>,
        material: Option<FiberMaterial>,
        scale: StressScale,
        solver: &SolverParams,
    ) -> Result<Self, RveModelError<B::Fault>> {
        let masses = lumped_masses(&network, material.as_ref());
        let truss = Truss::new(network, material.clone())?;
        let stress_scale = scale;
        let scale = match scale {
            StressScale::Raw => 1.0,
            StressScale::FiberVolumeFraction(phi) if phi > 0.0 && phi < 1.0 => phi / truss.volume(),
            StressScale::FiberVolumeFraction(phi) => return Err(RveModelError::VolumeFraction(phi)),
        };
        let pattern = Arc::new(stiffness::pattern(truss.network())?);
        let symbolic = B::analyze(context, &pattern, solver).map_err(RveModelError::Analysis)?;
        if !(scale.is_finite() && scale > 0.0) {
            return Err(RveModelError::Scale { scale, volume: truss.volume() });
        }
        let slots = StiffnessSlots::locate(context, &truss, &pattern)
            .map_err(|f| RveModelError::Analysis(SolveError::Fault(f)))?;
        Ok(Self {
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

    /// The geometry.
    #[must_use]
    pub fn network(&self) -> &Arc<Network> {
        self.truss.network()
    }

    /// The mechanics.
    #[must_use]
    pub fn truss(&self) -> &Truss {
        &self.truss
    }

    /// What all fibers are made of, where that is not what the network's own files say.
    #[must_use]
    pub fn material(&self) -> Option<&FiberMaterial> {
        self.material.as_ref()
    }

    /// How forces become stresses.
    #[must_use]
    pub fn stress_scale(&self) -> StressScale {
        self.stress_scale
    }

    /// `kappa`: what forces of the unit cube are multiplied with to give stresses.
    #[must_use]
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// Unknowns: three for every interior node.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.pattern.rows()
    }

    /// Half of `rho A L` of every fiber at each of its ends, kg with `L` in unit-cube units; fibers without a density
    /// get that of water.
    #[must_use]
    pub fn masses(&self) -> &[f64] {
        &self.masses
    }

    /// What rounding alone leaves of a residual, N.
    #[must_use]
    pub fn rounding_floor(&self) -> f64 {
        self.rounding_floor
    }
}

fn lumped_masses(network: &Network, material: Option<&FiberMaterial>) -> Vec<f64> {
    const WATER: f64 = 1000.0;
    let mut masses = vec![0.0; network.nodes().len()];
    let fibers = network.fibers().iter().zip(network.lengths()).zip(network.reaction_of());
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

/// A number that tells networks apart: of how many nodes and fibers there are, and of where the interior nodes are at rest.
fn fingerprint(network: &Network) -> Option<NonZeroU64> {
    // The multiplier of Knuth's MMIX generator, a rotation so that high bits come down, and never zero.
    let mix = |sum: u64, value: u64| (sum ^ value).wrapping_mul(0x5851_f42d_4c95_7f2d).rotate_left(29);
    let counts = [network.nodes().len(), network.fibers().len()];
    let sum = counts.into_iter().fold(1, |sum, count| mix(sum, count as u64));
    let interior = network.interior().iter().flat_map(|&node| network.nodes()[node as usize]);
    NonZeroU64::new(interior.fold(sum, |sum, x| mix(sum, x.to_bits())) | 1)
}

/// The state of one RVE: the deformation gradient it is in equilibrium with and its interior node positions.
#[derive(Clone, Debug)]
pub struct Rve {
    /// The deformation gradient of the last equilibrium.
    pub(super) gradient: Matrix3<f64>,
    /// Interior node positions there, unit-cube units, in the order of [`Network::interior`].
    pub(super) interior: Vec<[f64; 3]>,
    /// How they follow a further strain, where that was kept.
    pub(super) sensitivities: Option<Vec<Sensitivities>>,
    /// The [`fingerprint`] of its network; `None` of a state kept elsewhere, until its first equilibrium.
    pub(super) network: Option<NonZeroU64>,
}

/// States are equal by what is in them, wherever they come from.
impl PartialEq for Rve {
    fn eq(&self, other: &Self) -> bool {
        self.gradient == other.gradient && self.interior == other.interior && self.sensitivities == other.sensitivities
    }
}

/// How an interior node leaves the affine motion, for each of the six unit strains of the current state; single precision,
/// since it only starts a Newton.
pub type Sensitivities = [f32; 3 * MODES];

/// Why a state kept elsewhere is none of a network.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum RveStateError {
    /// It belongs to another network.
    #[error("the state has positions of {found} interior nodes; the network has {expected}")]
    Nodes {
        /// Interior nodes of the state.
        found: usize,
        /// Interior nodes of the network.
        expected: usize,
    },
    /// A position that is no finite number.
    #[error("the position of interior node {0} is no finite number")]
    NotFinite(usize),
    /// It belongs to another network, of as many interior nodes.
    #[error("the state is one of another network, with as many interior nodes")]
    Network,
    /// A deformation gradient that no equilibrium can have.
    #[error("the deformation gradient has determinant {0:.3e}; it must be positive")]
    Inverted(f64),
}

impl Rve {
    /// A state that was read from [`Rve::gradient`], [`Rve::interior`] and [`Rve::sensitivities`] before. It is taken to be in
    /// equilibrium; [`Rve::check`] tells whether it is one of a network.
    #[must_use]
    pub fn restored(
        gradient: Matrix3<f64>,
        interior: Vec<[f64; 3]>,
        sensitivities: Option<Vec<Sensitivities>>,
    ) -> Self {
        Self { gradient, interior, sensitivities, network: None }
    }

    /// What [`Rve::restored`] takes.
    #[must_use]
    pub fn into_parts(self) -> (Matrix3<f64>, Vec<[f64; 3]>, Option<Vec<Sensitivities>>) {
        (self.gradient, self.interior, self.sensitivities)
    }

    /// Whether this can be a state of that network.
    ///
    /// # Errors
    /// [`RveStateError`].
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

    /// Whether it is of the network of this model, as far as that is known of a state.
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
    #[must_use]
    pub fn at_rest(network: &Network) -> Self {
        let interior = network.interior().iter().map(|&node| network.nodes()[node as usize]).collect();
        Self { gradient: Matrix3::identity(), interior, sensitivities: None, network: fingerprint(network) }
    }

    /// Keeps the sensitivities that the tangent was computed from in this workspace.
    pub(super) fn keep_sensitivities<B: Backend>(&mut self, model: &RveModel<B>, workspace: &Workspace<B>) {
        let strains: [Matrix3<f64>; MODES] = std::array::from_fn(strain);
        let sensitivities = self.sensitivities.get_or_insert_with(Vec::new);
        sensitivities.clear();
        sensitivities.extend(model.truss.network().interior().iter().zip(&self.interior).map(|(&node, x)| {
            let mut sensitivities = Sensitivities::default();
            let velocity = &workspace.sensitivities[node as usize];
            for (mode, s) in strains.iter().enumerate() {
                let affine = transform(s, x);
                for i in 0..3 {
                    sensitivities[3 * mode + i] = (velocity[3 * mode + i] - affine[i]) as f32;
                }
            }
            sensitivities
        }));
    }

    /// Whether both are the same equilibrium, as far as a converged Newton tells: no interior node lies further apart than
    /// `1e-6` of the edge of the cube.
    #[must_use]
    pub fn is_near(&self, other: &Self) -> bool {
        const NEAR: f64 = 1e-6;
        let pairs = self.interior.as_flattened().iter().zip(other.interior.as_flattened());
        self.interior.len() == other.interior.len() && pairs.into_iter().all(|(a, b)| (a - b).abs() <= NEAR)
    }

    /// Takes over the equilibrium of another state of the same network; the sensitivities kept are forgotten.
    pub fn take_equilibrium(&mut self, other: &Self) {
        self.gradient = other.gradient;
        self.interior.clone_from(&other.interior);
        self.sensitivities = None;
        self.network = other.network;
    }

    /// Bytes that it owns on the heap.
    #[must_use]
    pub fn heap_bytes(&self) -> usize {
        self.interior.capacity() * size_of::<[f64; 3]>()
            + self
                .sensitivities
                .as_ref()
                .map_or(0, |sensitivities| sensitivities.capacity() * size_of::<Sensitivities>())
    }

    /// Whether the next equilibrium has a prediction to start from.
    #[must_use]
    pub fn has_sensitivities(&self) -> bool {
        self.sensitivities.is_some()
    }

    /// Forgets the sensitivities: the next equilibrium starts from an affine motion.
    pub fn forget_sensitivities(&mut self) {
        self.sensitivities = None;
    }

    /// The deformation gradient of the last equilibrium.
    #[must_use]
    pub fn gradient(&self) -> &Matrix3<f64> {
        &self.gradient
    }

    /// Positions of all nodes at the last equilibrium, unit-cube units.
    #[must_use]
    pub fn positions(&self, network: &Network) -> Vec<[f64; 3]> {
        let mut positions: Vec<[f64; 3]> = network.nodes().iter().map(|x| transform(&self.gradient, x)).collect();
        for (&node, x) in network.interior().iter().zip(&self.interior) {
            positions[node as usize] = *x;
        }
        positions
    }

    /// Interior node positions of the last equilibrium, unit-cube units.
    #[must_use]
    pub fn interior(&self) -> &[[f64; 3]] {
        &self.interior
    }

    /// How the interior nodes follow a further strain, where
    /// [`Solved::keep_sensitivities`](super::equilibrium::Solved::keep_sensitivities) has kept it.
    #[must_use]
    pub fn sensitivities(&self) -> Option<&[Sensitivities]> {
        self.sensitivities.as_deref()
    }
}

/// `F x`.
#[inline(always)]
pub(super) fn transform(f: &Matrix3<f64>, x: &[f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| f[(i, 0)] * x[0] + f[(i, 1)] * x[1] + f[(i, 2)] * x[2])
}
