//! The results of a batch.

/// Strain modes.
pub(in crate::backends) const MODES: usize = 6;

/// Numbers of a result, and where its parts are; `kernels/base.cu` of the backend `cuda` has the same.
pub(in crate::backends) const RESULT_LEN: usize = 71;
pub(super) const STATUS: usize = 0;
pub(super) const ITERATIONS: usize = 1;
pub(super) const BACKTRACKS: usize = 2;
pub(super) const RESIDUAL: usize = 3;
pub(super) const SCALE: usize = 4;
pub(super) const PIVOT_RATIO: usize = 5;
pub(super) const ENERGY: usize = 6;
pub(super) const IMBALANCE: usize = 7;
pub(super) const STRESS: usize = 8;
pub(super) const FORM: usize = 17;

/// The outcome of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Status {
    /// It is in a stable equilibrium.
    Converged,
    /// Newton evidently leads to the given equilibrium.
    Continues,
    /// Its stiffness is not positive definite.
    Indefinite,
    /// No step length satisfies the sufficient-decrease condition.
    LineSearch,
    /// The iterations do not suffice.
    TooManyIterations,
    /// The forces at the start are not finite.
    NotFinite,
    /// A fiber of the equilibrium has a force that is too large relative to its stiffness.
    ExcessiveForce,
    /// The sensitivities of the interior, or the condensed stiffness, are inaccurate.
    InaccurateTangent,
    /// It is not evident that Newton leads to the given equilibrium.
    Inconclusive,
}

impl Status {
    /// All of them, in the order of their numbers in the kernels.
    const ALL: [Self; 9] = [
        Self::Converged,
        Self::Continues,
        Self::Indefinite,
        Self::LineSearch,
        Self::TooManyIterations,
        Self::NotFinite,
        Self::ExcessiveForce,
        Self::InaccurateTangent,
        Self::Inconclusive,
    ];
}

/// The results of a batch, by network.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NetworkResults<'a> {
    values: &'a [f64],
}

impl<'a> NetworkResults<'a> {
    #[cfg(feature = "cuda")]
    pub(in crate::backends) fn new(values: &'a [f64]) -> Self {
        Self { values }
    }

    /// Number of networks.
    pub fn len(&self) -> usize {
        self.values.len() / RESULT_LEN
    }

    /// Returns true if there are no results.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Returns the result of a network.
    ///
    /// # Panics
    /// Panics if the network has none.
    pub fn get(&self, network: usize) -> NetworkResult<'a> {
        NetworkResult::new(&self.values[RESULT_LEN * network..][..RESULT_LEN])
    }

    /// Iterates over the results of all networks.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = NetworkResult<'a>> {
        self.values.chunks_exact(RESULT_LEN).map(NetworkResult::new)
    }
}

/// The result of a network. Stress, energy and form are those of an equilibrium, without the stress scale; they are
/// undefined with any status but [`Status::Converged`].
#[derive(Clone, Copy, Debug)]
pub struct NetworkResult<'a> {
    values: &'a [f64],
}

impl<'a> NetworkResult<'a> {
    pub(super) fn new(values: &'a [f64]) -> Self {
        Self { values }
    }

    /// The outcome.
    pub fn status(&self) -> Status {
        Status::ALL.get(self.values[STATUS] as usize).copied().unwrap_or(Status::NotFinite)
    }

    /// Newton iterations.
    pub fn iterations(&self) -> usize {
        self.values[ITERATIONS] as usize
    }

    /// Step lengths that the line search rejected.
    pub fn backtracks(&self) -> usize {
        self.values[BACKTRACKS] as usize
    }

    /// Residual norm, in N.
    pub fn residual(&self) -> f64 {
        self.values[RESIDUAL]
    }

    /// Norm of the forces at all nodes, in N.
    pub fn scale(&self) -> f64 {
        self.values[SCALE]
    }

    /// The smallest over the largest pivot of the last factorization.
    pub fn pivot_ratio(&self) -> f64 {
        self.values[PIVOT_RATIO]
    }

    /// Energy of all fibers, in J for a cube with an edge of 1 m.
    pub fn energy(&self) -> f64 {
        self.values[ENERGY]
    }

    /// Norm of the force sensitivities at interior nodes, which should vanish, over that at all nodes. In lanes these are
    /// the sensitivities to one strain, and at boundary nodes those of each fiber or group of parallel fibers alone.
    pub fn imbalance(&self) -> f64 {
        self.values[IMBALANCE]
    }

    /// `sum_b T_b,i X_b,J` over boundary nodes, in N, row by row.
    pub fn stress(&self) -> [f64; 9] {
        std::array::from_fn(|k| self.values[STRESS + k])
    }

    /// The products of the sensitivities of all nodes to six unit strains and three unit rotations (rows) with the
    /// sensitivities of the nodal forces to the six strains (columns), in N, as
    /// `fiber::homogenize` orders them.
    pub fn form(&self) -> [[f64; MODES]; 9] {
        std::array::from_fn(|k| std::array::from_fn(|l| self.values[FORM + MODES * k + l]))
    }
}
