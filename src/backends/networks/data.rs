//! What a batch is made of: the network, its laws, the states, and the parameters of a solution.

/// The law of a fiber: the nominal stress as a function of the stretch, see `fiber::law`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LawData {
    /// The law in tension, and in compression if there is no buckling.
    pub formula: LawFormula,
    /// The fraction of the stiffness at rest that remains in compression, and the buckling strain.
    pub buckling: Option<(f64, f64)>,
}

/// The formula of a law; moduli in Pa.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "the parameters are those of the laws of the same name")]
pub enum LawFormula {
    /// See `fiber::law::Linear`.
    Linear { youngs_modulus: f64 },
    /// See `fiber::law::Exponential`.
    Exponential { youngs_modulus: f64, nonlinearity: f64 },
    /// See `fiber::law::ExponentialStretch`.
    ExponentialStretch { youngs_modulus: f64, nonlinearity: f64, transition: f64 },
}

/// Numbers of a law.
const LAW_LEN: usize = 10;

impl LawData {
    /// The number of the formula in the kernels.
    fn kind(&self) -> u32 {
        match self.formula {
            LawFormula::Linear { .. } => 0,
            LawFormula::Exponential { .. } => 1,
            LawFormula::ExponentialStretch { .. } => 2,
        }
    }

    /// Returns the kind of the formula, modulus, nonlinearity, transition; then whether it buckles, residual stiffness,
    /// strain; modulus over nonlinearity, and the inverses of modulus and strain.
    pub(in crate::backends) fn numbers(&self) -> [f64; LAW_LEN] {
        let (e, b, transition) = match self.formula {
            LawFormula::Linear { youngs_modulus } => (youngs_modulus, 1.0, 1.0),
            LawFormula::Exponential { youngs_modulus, nonlinearity } => (youngs_modulus, nonlinearity, 1.0),
            LawFormula::ExponentialStretch { youngs_modulus, nonlinearity, transition } => {
                (youngs_modulus, nonlinearity, transition)
            }
        };
        let (residual, strain) = self.buckling.unwrap_or((1.0, 1.0));
        let buckles = f64::from(u8::from(self.buckling.is_some()));
        [f64::from(self.kind()), e, b, transition, buckles, residual, strain, e / b, 1.0 / e, 1.0 / strain]
    }

    /// Returns the kind of all laws, if it is the same and none of them buckles.
    #[cfg(feature = "cuda")]
    pub(in crate::backends) fn only(laws: &[Self]) -> Option<u32> {
        let kind = laws.first()?.kind();
        laws.iter().all(|law| law.kind() == kind && law.buckling.is_none()).then_some(kind)
    }
}

/// The network that all members of a batch share.
#[derive(Clone, Debug)]
pub struct NetworkData {
    /// Number of interior nodes, which move; they have the first numbers.
    pub interior: usize,
    /// Reference positions of the boundary nodes, which follow the deformation gradient; in edges of the unit cube.
    pub boundary: Vec<[f64; 3]>,
    /// The two nodes of each fiber.
    pub ends: Vec<[u32; 2]>,
    /// The reference length of each fiber, in edges of the unit cube.
    pub lengths: Vec<f64>,
    /// The cross-sectional area of each fiber, m^2.
    pub areas: Vec<f64>,
    /// The law of each fiber, an index into `laws`.
    pub law_of: Vec<u32>,
    /// The laws.
    pub laws: Vec<LawData>,
}

/// Tolerances and limits of a solution; see [`NewtonParams`](crate::las::NewtonParams).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatchParams {
    /// Residual norm relative to the forces of all nodes at convergence.
    pub tolerance: f64,
    /// Residual norm, in N, at which a network has converged in any case.
    pub floor: f64,
    /// Most iterations.
    pub max_iterations: u32,
    /// Most further steps of an iteration with its factor; in mixed precision any number, if not 0. The kernels for devices
    /// take none.
    pub chord_steps: u32,
    /// Most reductions of the step length.
    pub max_backtracks: u32,
    /// The constant of the sufficient-decrease condition.
    pub sufficient_decrease: f64,
    /// Iterates in the sufficient-decrease condition, 1 to 8.
    pub memory: u32,
    /// Ratio of the nominal stress of a fiber and its modulus at which the solution stops.
    pub excessive_force: f64,
    /// Whether the results have the form of the tangent.
    pub wants_tangent: bool,
}

/// The states of networks, one after the other, in memory of the host that the device accesses.
#[derive(Debug)]
pub struct NetworkStates<'a> {
    /// The deformation gradient of each state, row by row.
    pub gradients: &'a mut [[f64; 9]],
    /// The positions of the interior nodes, three numbers each.
    pub positions: &'a mut [f64],
    /// Eighteen numbers for each interior node: the sensitivities of its position to the six unit strains, minus those of
    /// the affine motion. Empty if the batch keeps none.
    pub sensitivities: &'a mut [f32],
    /// 1 for each network whose next start is predicted from its sensitivities, else 0. Empty if the batch keeps none.
    pub predicts: &'a mut [f64],
}
