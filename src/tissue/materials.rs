//! The description of the materials of a body: the material of every region, and how its RVEs are solved.

use std::path::PathBuf;

use nalgebra::Matrix3;

use crate::fem::material::{LinearElastic, Material, MaterialError, NeoHookean, Response};
use crate::fiber::equilibrium::Stages;
use crate::fiber::law::FiberMaterial;
use crate::fiber::rve::StressScale;
use crate::las::Method;

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

/// The material of a region.
#[derive(Clone, Debug, PartialEq)]
pub enum RegionMaterial {
    /// A formula.
    Formula(Formula),
    /// A fiber network at every integration point.
    FiberRve(FiberRve),
}

/// A material given by a formula.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Formula {
    /// Neo-Hookean.
    NeoHookean(NeoHookean),
    /// Linear elasticity at small strain.
    LinearElastic(LinearElastic),
}

/// A fiber network at every integration point.
#[derive(Clone, Debug, PartialEq)]
pub struct FiberRve {
    /// The network files. If empty, the material is its matrix alone, which must exist.
    pub networks: Vec<PathBuf>,
    /// The rule that assigns a network to each element.
    pub assignment: NetworkAssignment,
    /// Seed of the random assignment.
    pub seed: u64,
    /// The conversion of forces to stresses.
    pub scale: StressScale,
    /// The law of all fibers; if `None`, the parameter files beside each network define it.
    pub law: Option<FiberMaterial>,
    /// A matrix in parallel with the network.
    pub matrix: Option<Formula>,
    /// The conditions under which RVEs are created, sleep, and are deleted.
    pub lifecycle: RveLifecycle,
}

/// The rule that assigns a network to each element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NetworkAssignment {
    /// By a hash of seed and element number.
    Random,
    /// By the element number modulo the number of networks.
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
/// prediction, and with a direct solver.
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
        }
    }
}

impl Formula {
    /// Returns energy, stress and tangent at a deformation gradient.
    ///
    /// # Errors
    /// Returns [`MaterialError::Inverted`] from the neo-Hookean formula if the determinant is not positive.
    pub fn respond(&self, f: &Matrix3<f64>) -> Result<Response, MaterialError> {
        match self {
            Self::NeoHookean(material) => material.evaluate(f),
            Self::LinearElastic(material) => material.evaluate(f),
        }
    }

    /// Returns the shear modulus `mu` and Lame's first constant `lambda`, Pa.
    pub fn lame_constants(&self) -> [f64; 2] {
        match *self {
            Self::NeoHookean(NeoHookean { mu, lambda }) | Self::LinearElastic(LinearElastic { mu, lambda }) => {
                [mu, lambda]
            }
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
