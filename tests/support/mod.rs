//! Networks and a solver of one RVE, shared by several test files.
#![allow(dead_code, reason = "every test file uses only a part of this module")]

#[path = "networks.rs"]
mod networks;
#[path = "skip.rs"]
mod skip;

use std::path::PathBuf;
use std::sync::Arc;

use biotissue::fiber::equilibrium::{EquilibriumParams, EquilibriumReport, EquilibriumState, RveError, equilibrate};
use biotissue::fiber::homogenize::Tangent;
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::{Network, file};
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::workspace::Workspace;
use biotissue::las::{Backend, RealBackend, SolverParams};
use nalgebra::Matrix3;

pub use networks::published_file;

/// Returns a published network; `None` if it is not on this machine (see [`published_file`]).
pub fn published(name: &str) -> Option<Arc<Network>> {
    published_file(name).map(network)
}

/// Returns the network in the folder `tests/networks`.
pub fn frozen() -> Arc<Network> {
    network(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/networks/frozen.txt"))
}

/// Returns the networks of the dogbone example.
pub fn dogbone_library() -> Vec<Arc<Network>> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("examples/dogbone/networks");
    (1..=8).map(|k| network(folder.join(format!("delaunay_{k}.txt")))).collect()
}

fn network(path: PathBuf) -> Arc<Network> {
    match file::read(&path) {
        Ok(read) => Arc::new(read.network),
        Err(error) => panic!("{error}"),
    }
}

/// Returns the three laws, with the same stiffness at rest.
pub fn laws() -> [FiberMaterial; 3] {
    let (youngs_modulus, nonlinearity) = (1.0e8, 1.2);
    [
        Law::Linear { youngs_modulus },
        Law::Exponential { youngs_modulus, nonlinearity },
        Law::ExponentialStretch { youngs_modulus, nonlinearity, transition: 1.1 },
    ]
    .map(|law| FiberMaterial { law, radius: 5.0e-5, density: None })
}

/// A model of an RVE with its workspace and parameters.
pub struct Bench<B: Backend> {
    pub model: RveModel<B>,
    pub workspace: Workspace<B>,
    pub params: EquilibriumParams,
    /// Stress and energy of the last RVE that was solved.
    solution: (Matrix3<f64>, f64),
}

impl<B: RealBackend<Context = ()>> Bench<B> {
    /// Creates a model with `material`, or else with the materials of the network, that does not scale the stress.
    pub fn new(network: &Arc<Network>, material: Option<FiberMaterial>) -> Self {
        Self::within(&(), network, material)
    }
}

impl<B: RealBackend> Bench<B> {
    /// Like [`Bench::new`], in a context of the backend.
    pub fn within(context: &B::Context, network: &Arc<Network>, material: Option<FiberMaterial>) -> Self {
        Self::solved_by(context, network, material, &SolverParams::default())
    }

    /// Like [`Bench::within`], with the parameters of the linear solver.
    pub fn solved_by(
        context: &B::Context,
        network: &Arc<Network>,
        material: Option<FiberMaterial>,
        solver: &SolverParams,
    ) -> Self {
        let network = Arc::clone(network);
        let model = RveModel::with_solver(context, network, material, StressScale::Raw, solver).unwrap();
        let workspace = Workspace::new(context, &model).unwrap();
        Self { model, workspace, params: EquilibriumParams::default(), solution: (Matrix3::zeros(), 0.0) }
    }

    pub fn at_rest(&self) -> Rve {
        Rve::at_rest(self.model.network())
    }

    pub fn solve(&mut self, rve: &mut Rve, f: &Matrix3<f64>) -> Result<EquilibriumReport, RveError<B::Error>> {
        let solved = equilibrate(&self.model, rve, f, &self.params, &mut self.workspace)?;
        self.solution = (solved.pk1(), solved.energy());
        Ok(solved.into_report())
    }

    pub fn pk1(&self) -> Matrix3<f64> {
        self.solution.0
    }

    pub fn energy(&self) -> f64 {
        self.solution.1
    }

    pub fn tangent(&mut self, rve: &Rve) -> Tangent {
        self.solve_again(&mut rve.clone()).tangent().unwrap()
    }

    /// Stores the sensitivities of an RVE in equilibrium.
    pub fn keep_sensitivities(&mut self, rve: &mut Rve) {
        self.solve_again(rve).keep_sensitivities().unwrap();
    }

    /// Solves an RVE that is already in equilibrium.
    fn solve_again<'a>(&'a mut self, rve: &'a mut Rve) -> EquilibriumState<'a, B> {
        let gradient = *rve.gradient();
        let solved = equilibrate(&self.model, rve, &gradient, &self.params, &mut self.workspace).unwrap();
        assert_eq!(solved.report().iterations, 0);
        solved
    }
}
