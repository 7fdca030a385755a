//! The description of the materials of a body: the material of every region, and how its RVEs are solved.

use std::path::PathBuf;

use crate::fiber::equilibrium::Stages;
use crate::fiber::law::FiberMaterial;
use crate::fiber::rve::StressScale;
use crate::las::Method;

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

/// The material of a region, whose formulas are given by `F`: those of the points of a mesh or, before there is a mesh,
/// their parameters.
#[derive(Clone, Debug, PartialEq)]
pub enum RegionMaterial<F = Formulas> {
    /// A formula.
    Formula(F),
    /// A fiber network at every integration point.
    FiberRve(FiberRve<F>),
}

impl<F> RegionMaterial<F> {
    /// Returns the formula of the region, or the matrix of its RVEs.
    pub fn formula(&self) -> Option<&F> {
        match self {
            Self::Formula(formula) => Some(formula),
            Self::FiberRve(rve) => rve.matrix.as_ref(),
        }
    }

    /// Returns the material with other formulas, those that `with` returns for these.
    ///
    /// # Errors
    /// Returns the error of `with`.
    pub fn try_map<G, E>(&self, with: impl FnOnce(&F) -> Result<G, E>) -> Result<RegionMaterial<G>, E> {
        Ok(match self {
            Self::Formula(formula) => RegionMaterial::Formula(with(formula)?),
            Self::FiberRve(rve) => RegionMaterial::FiberRve(FiberRve {
                matrix: rve.matrix.as_ref().map(with).transpose()?,
                networks: rve.networks.clone(),
                assignment: rve.assignment,
                seed: rve.seed,
                scale: rve.scale,
                law: rve.law.clone(),
                lifecycle: rve.lifecycle,
            }),
        })
    }
}

/// A fiber network at every integration point.
#[derive(Clone, Debug, PartialEq)]
pub struct FiberRve<F = Formulas> {
    /// The network files. If empty, the material is its matrix alone, which must exist.
    pub networks: Vec<PathBuf>,
    /// The rule that assigns a network to each integration point.
    pub assignment: NetworkAssignment,
    /// Seed of the random assignment.
    pub seed: u64,
    /// The conversion of forces to stresses.
    pub scale: StressScale,
    /// The law of all fibers; if `None`, the parameter files beside each network define it.
    pub law: Option<FiberMaterial>,
    /// A matrix in parallel with the network.
    pub matrix: Option<F>,
    /// The conditions under which RVEs are created, sleep, and are deleted.
    pub lifecycle: RveLifecycle,
}

/// The rule that assigns a network to each integration point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NetworkAssignment {
    /// By a hash of the seed and the number of the point.
    Random,
    /// By the number of the point modulo the number of networks.
    Cycle,
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
    /// Whether the processor solves RVEs of one network side by side in the lanes of its vector registers where that is
    /// faster.
    pub lanes: bool,
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
            lanes: true,
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
