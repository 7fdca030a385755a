//! The description of the materials of a body: the material of every region, and how its RVEs are solved.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::point_values::PointValues;
use crate::fiber::equilibrium::Stages;
use crate::fiber::law::FiberMaterial;
use crate::fiber::rve::StressScale;
use crate::las::{Method, splitmix64};

pub use super::formula::{CustomMaterial, Formula, Formulas, PointFormulaError, PointFormulas, TransverseFormula};

/// The name that stands for every region of a mesh without a material under its own name.
pub const OTHER_REGIONS: &str = "*";

/// The materials of a body by region, and the solver of its RVEs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Materials {
    /// The regions, in the order that numbers them.
    pub regions: Vec<Region>,
    /// The solver of the RVEs.
    pub rve: RveParams,
}

/// A region and its material.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// The region of the mesh, or [`OTHER_REGIONS`].
    pub name: String,
    /// The material.
    pub material: RegionMaterial,
}

/// The material of a region. `F` gives its formulas, `N` the networks and `V` the fiber volume fractions that vary over
/// the body: those of the points of a mesh or, before there is a mesh, what they are computed from.
#[derive(Clone, Debug, PartialEq)]
pub enum RegionMaterial<F = Formulas, N = PointNetworks, V = PointFractions> {
    /// A formula.
    Formula(F),
    /// A fiber network at every integration point.
    FiberRve(FiberRve<F, N, V>),
}

impl<F, N, V> RegionMaterial<F, N, V> {
    /// Returns the formula of the region, or the matrix of its RVEs.
    pub fn formula(&self) -> Option<&F> {
        match self {
            Self::Formula(formula) => Some(formula),
            Self::FiberRve(rve) => rve.matrix.as_ref(),
        }
    }
}

/// A fiber network at every integration point.
#[derive(Clone, Debug, PartialEq)]
pub struct FiberRve<F = Formulas, N = PointNetworks, V = PointFractions> {
    /// The network files. If empty, the material is its matrix alone, which must exist.
    pub networks: Vec<PathBuf>,
    /// The rule that assigns a network to each integration point.
    pub assignment: NetworkAssignment<N>,
    /// Seed of the random assignment.
    pub seed: u64,
    /// The conversion of forces to stresses.
    pub scale: RveScale<V>,
    /// The law of all fibers; if `None`, the parameter files beside each network define it.
    pub law: Option<FiberMaterial>,
    /// A matrix in parallel with the network.
    pub matrix: Option<F>,
    /// The conditions under which RVEs are created, sleep, and are deleted.
    pub lifecycle: RveLifecycle,
}

impl RegionMaterial {
    /// Returns the material with the values of these points of the mesh, ascending, and no others.
    pub fn on_points(&self, points: &[usize]) -> Self {
        match self {
            Self::Formula(formulas) => Self::Formula(formulas.on_points(points)),
            Self::FiberRve(rve) => Self::FiberRve(rve.on_points(points)),
        }
    }
}

impl FiberRve {
    fn on_points(&self, points: &[usize]) -> Self {
        let assignment = match &self.assignment {
            NetworkAssignment::Random => NetworkAssignment::Random,
            NetworkAssignment::Cycle => NetworkAssignment::Cycle,
            NetworkAssignment::Field(networks) => NetworkAssignment::Field(networks.on_points(points)),
        };
        let scale = match &self.scale {
            RveScale::Uniform(scale) => RveScale::Uniform(*scale),
            RveScale::Fractions(fractions) => RveScale::Fractions(fractions.on_points(points)),
        };
        let matrix = self.matrix.as_ref().map(|formulas| formulas.on_points(points));
        self.with_fields((self.networks.clone(), assignment), scale, matrix)
    }
}

impl<F, N, V> FiberRve<F, N, V> {
    /// Returns the material with another matrix; `None` if its networks or fractions are given by fields.
    pub fn without_fields<G, M, W>(&self, matrix: Option<G>) -> Option<FiberRve<G, M, W>> {
        let assignment = match self.assignment {
            NetworkAssignment::Random => NetworkAssignment::Random,
            NetworkAssignment::Cycle => NetworkAssignment::Cycle,
            NetworkAssignment::Field(_) => return None,
        };
        let RveScale::Uniform(scale) = self.scale else { return None };
        Some(self.with_fields((self.networks.clone(), assignment), scale.into(), matrix))
    }

    /// Returns the material with these networks, with this conversion to stresses and with this matrix.
    pub fn with_fields<G, M, W>(
        &self,
        (networks, assignment): (Vec<PathBuf>, NetworkAssignment<M>),
        scale: RveScale<W>,
        matrix: Option<G>,
    ) -> FiberRve<G, M, W> {
        let Self { seed, law, lifecycle, .. } = self;
        FiberRve { networks, assignment, seed: *seed, scale, law: law.clone(), matrix, lifecycle: *lifecycle }
    }
}

/// The rule that assigns a network to each integration point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NetworkAssignment<N = PointNetworks> {
    /// By a hash of the seed and the number of the point.
    Random,
    /// By the number of the point modulo the number of networks.
    Cycle,
    /// By a field.
    Field(N),
}

/// The network of every point of a mesh: its index in [`FiberRve::networks`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointNetworks(PointValues<u32>);

impl PointNetworks {
    /// The index of points in other regions.
    pub const NONE: u32 = u32::MAX;

    /// Gives each point of the mesh the index of its network, or [`PointNetworks::NONE`].
    pub fn new(of_point: Vec<u32>) -> Self {
        Self(PointValues::new(of_point))
    }

    /// Returns the index of the network of each point that has a value here, in the order of the points.
    pub fn of_point(&self) -> &[u32] {
        self.0.values()
    }

    /// Returns the index of the network of a point; `None` if none was given to it.
    pub fn at(&self, point: usize) -> Option<u32> {
        self.0.get(point).filter(|&network| network != Self::NONE)
    }

    /// Returns the networks of these points of the mesh, ascending, and no others.
    pub fn on_points(&self, points: &[usize]) -> Self {
        Self(self.0.on_points(points, |network| network != Self::NONE))
    }
}

/// How forces in RVEs become stresses.
#[derive(Clone, Debug, PartialEq)]
pub enum RveScale<V = PointFractions> {
    /// In the same way at all points.
    Uniform(StressScale),
    /// By fiber volume fractions that vary over the body.
    Fractions(V),
}

impl<V> From<StressScale> for RveScale<V> {
    fn from(scale: StressScale) -> Self {
        Self::Uniform(scale)
    }
}

/// The fiber volume fraction of every point of a mesh.
///
/// Points with different fractions share the model of a network, which has the greatest fraction: the stress of an RVE is
/// proportional to its fraction, which does not change its equilibrium.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointFractions {
    of_point: PointValues<f64>,
    greatest: f64,
}

impl PointFractions {
    /// Gives each point of the mesh its fraction, above 0 and at most 1; NaN to points of other regions.
    pub fn new(of_point: Vec<f64>) -> Self {
        let greatest = of_point.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Self { greatest: if greatest > 0.0 { greatest } else { 1.0 }, of_point: PointValues::new(of_point) }
    }

    /// Returns the fraction of each point that has a value here, in the order of the points.
    pub fn of_point(&self) -> &[f64] {
        self.of_point.values()
    }

    /// Returns the fractions of these points of the mesh, ascending, and no others; the greatest is that of all points.
    pub fn on_points(&self, points: &[usize]) -> Self {
        Self { of_point: self.of_point.on_points(points, |fraction| !fraction.is_nan()), greatest: self.greatest }
    }

    /// Returns the greatest fraction; 1 if no point has one.
    pub fn greatest(&self) -> f64 {
        self.greatest
    }
}

impl RveScale {
    /// Returns the conversion of the models that the points share.
    pub fn of_models(&self) -> StressScale {
        match self {
            Self::Uniform(scale) => *scale,
            Self::Fractions(fractions) => StressScale::FiberVolumeFraction(fractions.greatest),
        }
    }

    /// Returns the stress at a point over that of the model; `None` if the point has no fraction.
    pub fn factor(&self, point: usize) -> Option<f64> {
        match self {
            Self::Uniform(_) => Some(1.0),
            Self::Fractions(fractions) => {
                let fraction = fractions.of_point.get(point)?;
                (!fraction.is_nan()).then(|| fraction / fractions.greatest)
            }
        }
    }
}

/// The conditions under which the RVE of an element is created, sleeps, and is deleted. By default it exists and is
/// awake throughout the run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RveLifecycle {
    /// The RVE is created once the strain of its element, `|E|` with `E = (F^T F - I) / 2`, exceeds this value.
    pub created_at: f64,
    /// The response before creation.
    pub before: BeforeCreation,
    /// The RVE falls asleep after a step in which every component of `F` changes by less than this value, and wakes
    /// once a component has changed by more since.
    pub asleep_below: f64,
    /// The RVE is deleted once the strain exceeds this value; from then on its matrix alone responds.
    pub deleted_at: f64,
}

/// The response that replaces an RVE before it is created.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BeforeCreation {
    /// The linear response of its network at rest, plus its matrix if it has one.
    Linear,
    /// Its matrix alone.
    Matrix,
}

/// How RVEs are solved; by default with tolerance 1e-10, at most 50 iterations, at most 6 cuts, all stages, from a
/// prediction, with a direct solver, and on the processor, in lanes where that is faster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RveParams {
    /// Tolerance of the relative residual.
    pub tolerance: f64,
    /// Maximum number of iterations per RVE.
    pub max_iterations: usize,
    /// Maximum number of times that a failed increment is halved.
    pub max_cuts: u32,
    /// The solution stages that are allowed.
    pub stages: Stages,
    /// Whether each RVE stores the sensitivity of its node positions to the strain and starts from that prediction.
    pub predictor: bool,
    /// The linear solver.
    pub solver: Method,
    /// The device that solves most RVEs, many at once; `None`: the processor solves all.
    pub device: Option<RveDevice>,
    /// Whether the processor solves RVEs of one network side by side.
    pub lanes: LaneUse,
}

/// Whether the processor solves RVEs of one network side by side in the lanes of its vector registers, where that is faster.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LaneUse {
    /// One by one.
    Off,
    /// Side by side. Results differ from those one by one by rounding errors.
    #[default]
    Auto,
    /// Side by side, and on processors with AVX-512, all factors but the last of an equilibrium have single precision.
    /// Results differ from those one by one within the tolerance of equilibria, and between processors with and without
    /// AVX-512.
    Mixed,
}

impl LaneUse {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Auto, Self::Mixed, Self::Off];

    /// The name in the case file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Auto => "auto",
            Self::Mixed => "mixed",
        }
    }
}

/// A device that solves RVEs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RveDevice {
    /// A graphics processor of NVIDIA.
    Cuda,
}

impl RveDevice {
    /// The name in the case file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cuda => "cuda",
        }
    }
}

/// A choice of elements.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ElementSelection {
    /// No element.
    None,
    /// All elements.
    All,
    /// The elements with these indices in the mesh, from 0; ascending, without repeats.
    Elements(Vec<usize>),
}

impl Default for RveLifecycle {
    fn default() -> Self {
        Self { created_at: 0.0, before: BeforeCreation::Linear, asleep_below: 0.0, deleted_at: f64::INFINITY }
    }
}

impl Default for RveParams {
    fn default() -> Self {
        Self {
            tolerance: 1e-10,
            max_iterations: 50,
            max_cuts: 6,
            stages: Stages::default(),
            predictor: true,
            solver: Method::Direct,
            device: None,
            lanes: LaneUse::default(),
        }
    }
}

impl ElementSelection {
    /// Returns true if an element is chosen.
    pub fn contains(&self, element: usize) -> bool {
        match self {
            Self::None => false,
            Self::All => true,
            Self::Elements(elements) => elements.binary_search(&element).is_ok(),
        }
    }
}

/// Returns the index of the region with this name, or else that of [`OTHER_REGIONS`].
pub fn find_region<'a>(mut regions: impl Iterator<Item = &'a str> + Clone, name: &str) -> Option<usize> {
    regions.clone().position(|region| region == name).or_else(|| regions.position(|region| region == OTHER_REGIONS))
}

/// Returns one of `count` networks for a point, by a hash of the seed and the number of the point.
pub(crate) fn random_network(seed: u64, point: usize, count: usize) -> usize {
    let scramble = |mut value: u64| splitmix64(&mut value);
    // The remainder's bias is below count / 2^64.
    (scramble(seed ^ scramble(point as u64)) % count as u64) as usize
}
