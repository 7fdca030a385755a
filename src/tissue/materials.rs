//! The description of the materials of a body: the material of every region, and how its RVEs are solved.

use std::path::PathBuf;

use nalgebra::Matrix3;

use crate::fem::material::{
    Guccione, HolmesMow, HolzapfelGasserOgden, LinearElastic, Material, MaterialError, NeoHookean, Response,
    TransverseModuli, TransverselyIsotropic,
};
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
    /// Transversely isotropic, of Bonet and Burton.
    TransverselyIsotropic(TransverseFormula),
    /// Of Holmes and Mow.
    HolmesMow(HolmesMow),
    /// Of Holzapfel, Gasser and Ogden.
    HolzapfelGasserOgden(HolzapfelGasserOgden),
    /// Of Guccione.
    Guccione(Guccione),
}

/// A transversely isotropic material with the constants that it was made from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransverseFormula {
    moduli: TransverseModuli,
    axis: [f64; 3],
    material: TransverselyIsotropic,
}

impl TransverseFormula {
    /// Creates the material; `None` as in [`TransverselyIsotropic::new`].
    pub fn new(moduli: TransverseModuli, axis: [f64; 3]) -> Option<Self> {
        TransverselyIsotropic::new(&moduli, axis).map(|material| Self { moduli, axis, material })
    }

    /// Returns the elastic constants at small strain.
    pub fn moduli(&self) -> &TransverseModuli {
        &self.moduli
    }

    /// Returns the axis, of the length that it was given with.
    pub fn axis(&self) -> [f64; 3] {
        self.axis
    }
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
    /// Returns [`MaterialError::Inverted`] from a formula of finite strain if the determinant is not positive.
    pub fn respond(&self, f: &Matrix3<f64>) -> Result<Response, MaterialError> {
        match self {
            Self::NeoHookean(material) => material.evaluate(f),
            Self::LinearElastic(material) => material.evaluate(f),
            Self::TransverselyIsotropic(formula) => formula.material.evaluate(f),
            Self::HolmesMow(material) => material.evaluate(f),
            Self::HolzapfelGasserOgden(material) => material.evaluate(f),
            Self::Guccione(material) => material.evaluate(f),
        }
    }

    /// Returns the shear modulus and the bulk modulus at rest, Pa; of an anisotropic formula, those of the isotropic
    /// tensor nearest to its stiffness `A` (W. Voigt, 1889): `K = A_iijj / 9` and `mu = (A_ijij - 3 K) / 10`, with the
    /// minor symmetry that a state without stress has.
    pub fn mean_moduli(&self) -> [f64; 2] {
        let Ok(Response { tangent, .. }) = self.respond(&Matrix3::identity()) else { return [0.0; 2] };
        let (mut traces, mut whole) = (0.0, 0.0);
        for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
            traces += tangent[(4 * i, 4 * j)];
            whole += 0.5 * (tangent[(3 * i + j, 3 * i + j)] + tangent[(3 * i + j, 3 * j + i)]);
        }
        let bulk = traces / 9.0;
        [(whole - 3.0 * bulk) / 10.0, bulk]
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_moduli_are_those_of_isotropic_formulas() {
        let (mu, lambda) = (3.0e3, 5.0e3);
        let isotropic = [
            Formula::NeoHookean(NeoHookean { mu, lambda }),
            Formula::LinearElastic(LinearElastic { mu, lambda }),
            Formula::HolmesMow(HolmesMow { mu, lambda, beta: 0.7 }),
        ];
        for formula in isotropic {
            let [shear, bulk] = formula.mean_moduli();
            assert!((shear / mu - 1.0).abs() < 1e-12, "{formula:?}: {shear}");
            assert!((bulk / (lambda + 2.0 / 3.0 * mu) - 1.0).abs() < 1e-12, "{formula:?}: {bulk}");
        }
        // Equal constants along the axis and across it.
        let moduli = TransverseModuli {
            youngs_modulus: 2.5e3,
            poisson_ratio: 0.25,
            axial_youngs_modulus: 2.5e3,
            axial_shear_modulus: 1.0e3,
        };
        let [shear, bulk] =
            Formula::TransverselyIsotropic(TransverseFormula::new(moduli, [1.0, 2.0, 0.5]).unwrap()).mean_moduli();
        assert!((shear / 1.0e3 - 1.0).abs() < 1e-12 && (bulk / (2.5e3 / 1.5) - 1.0).abs() < 1e-12, "{shear} {bulk}");
    }
}
