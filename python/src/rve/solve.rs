//! Equilibria of one model at many deformation gradients, without Python.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::material::{Material, NeoHookean, Response};
use biotissue::fiber::batch::BatchEquilibrium;
use biotissue::fiber::equilibrium::{EquilibriumParams, equilibrate};
use biotissue::fiber::law::FiberMaterial;
use biotissue::fiber::network::Network;
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::workspace::Workspace;
use biotissue::nalgebra::Matrix3;
use biotissue::rve_batch::LaneBatch;
use rayon::ThreadPool;
use rayon::prelude::*;

/// The most RVEs whose states are in memory at the same time.
const CHUNK: usize = 4096;

/// A model with everything that its solution needs.
pub struct Solver {
    model: RveModel<Sparse>,
    matrix: Option<NeoHookean>,
    /// Solves RVEs in the lanes of vector registers, if that is faster.
    lanes: Option<LaneBatch>,
    params: EquilibriumParams,
    /// The threads; `None` for those that the process shares.
    pool: Option<ThreadPool>,
}

/// The parameters of a [`Solver`] beside the network.
pub struct SolverOptions {
    pub law: Option<FiberMaterial>,
    pub scale: StressScale,
    pub matrix: Option<NeoHookean>,
    /// Tolerance of the residual, relative to the forces of all nodes.
    pub tolerance: f64,
    pub pool: Option<ThreadPool>,
}

/// A deformation gradient without a response.
pub struct Failure {
    /// Its number, from 0.
    pub index: usize,
    pub reason: String,
}

/// The state of one RVE that follows a path.
pub struct Follower {
    rve: Rve,
    workspace: Workspace<Sparse>,
}

impl Follower {
    /// The deformation gradient of the last equilibrium.
    pub fn gradient(&self) -> &Matrix3<f64> {
        self.rve.gradient()
    }
}

impl Solver {
    /// Makes the model.
    ///
    /// # Errors
    /// Returns the reason why the network, the law and the scale do not make a model.
    pub fn new(network: Arc<Network>, options: SolverOptions) -> Result<Self, String> {
        let SolverOptions { law, scale, matrix, tolerance, pool } = options;
        let model = RveModel::new(&(), network, law, scale).map_err(|error| error.to_string())?;
        let lanes = LaneBatch::new_if_faster(&model, false);
        let mut params = EquilibriumParams::default();
        params.newton.tolerance = tolerance;
        Ok(Self { model, matrix, lanes, params, pool })
    }

    /// The model.
    pub fn model(&self) -> &RveModel<Sparse> {
        &self.model
    }

    /// The matrix in parallel with the network.
    pub fn matrix(&self) -> Option<&NeoHookean> {
        self.matrix.as_ref()
    }

    fn on_threads<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        match &self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }

    /// Brings an RVE from rest to equilibrium at each of these gradients.
    ///
    /// # Errors
    /// Returns the first gradient without a response.
    pub fn respond(&self, targets: &[Matrix3<f64>]) -> Result<Vec<Response>, Failure> {
        let lanes = self.lanes.as_ref().filter(|_| targets.len() >= LaneBatch::LEAST_RVES);
        self.on_threads(|| {
            let mut responses = Vec::with_capacity(targets.len());
            for chunk in targets.chunks(CHUNK) {
                let first = responses.len();
                for (index, response) in self.respond_chunk(chunk, lanes).into_iter().enumerate() {
                    responses.push(response.map_err(|reason| Failure { index: first + index, reason })?);
                }
            }
            Ok(responses)
        })
    }

    fn respond_chunk(&self, targets: &[Matrix3<f64>], lanes: Option<&LaneBatch>) -> Vec<Result<Response, String>> {
        let in_lanes = match lanes {
            Some(lanes) => {
                let mut rves = vec![Rve::at_rest(self.model.network()); targets.len()];
                lanes.solve(&mut rves.iter_mut().collect::<Vec<_>>(), targets, &self.params)
            }
            None => vec![None; targets.len()],
        };
        // A thread makes a workspace when it first needs one.
        let solve = |workspace: &mut Option<Workspace<Sparse>>, (target, in_lanes): (_, Option<BatchEquilibrium>)| {
            let fibers = match in_lanes {
                Some(BatchEquilibrium { pk1, energy, tangent, .. }) => Response { energy, pk1, tangent },
                None => self.respond_one(target, workspace)?,
            };
            self.with_matrix(fibers, target)
        };
        targets.par_iter().zip(in_lanes).map_init(|| None, solve).collect()
    }

    fn respond_one(
        &self,
        target: &Matrix3<f64>,
        workspace: &mut Option<Workspace<Sparse>>,
    ) -> Result<Response, String> {
        let workspace = match workspace {
            Some(workspace) => workspace,
            None => workspace.insert(self.workspace()?),
        };
        self.equilibrium(&mut Rve::at_rest(self.model.network()), target, workspace, false)
    }

    fn workspace(&self) -> Result<Workspace<Sparse>, String> {
        Workspace::new(&(), &self.model).map_err(|error| error.to_string())
    }

    /// Returns the response of the fibers; with `predicts`, the next equilibrium of this RVE starts from a prediction.
    fn equilibrium(
        &self,
        rve: &mut Rve,
        target: &Matrix3<f64>,
        workspace: &mut Workspace<Sparse>,
        predicts: bool,
    ) -> Result<Response, String> {
        let solved = equilibrate(&self.model, rve, target, &self.params, workspace);
        let mut solved = solved.map_err(|error| error.to_string())?;
        let tangent = solved.tangent().map_err(|error| error.to_string())?;
        if predicts {
            solved.keep_sensitivities().map_err(|error| error.to_string())?;
        }
        Ok(Response { energy: solved.energy(), pk1: solved.pk1(), tangent })
    }

    fn with_matrix(&self, fibers: Response, target: &Matrix3<f64>) -> Result<Response, String> {
        let Some(matrix) = &self.matrix else { return Ok(fibers) };
        let of_matrix = matrix.evaluate(target).map_err(|error| error.to_string())?;
        Ok(Response {
            energy: fibers.energy + of_matrix.energy,
            pk1: fibers.pk1 + of_matrix.pk1,
            tangent: fibers.tangent + of_matrix.tangent,
        })
    }

    /// Returns an RVE at rest.
    ///
    /// # Errors
    /// Returns the reason why its workspace cannot be made.
    pub fn follower(&self) -> Result<Follower, String> {
        Ok(Follower { rve: Rve::at_rest(self.model.network()), workspace: self.workspace()? })
    }

    /// Brings an RVE to equilibrium at these gradients, one after the other; each starts from the one before.
    ///
    /// # Errors
    /// Returns the first gradient without a response; the RVE stays at the one before it.
    pub fn follow(&self, follower: &mut Follower, targets: &[Matrix3<f64>]) -> Result<Vec<Response>, Failure> {
        self.on_threads(|| {
            let mut responses = Vec::with_capacity(targets.len());
            for (index, target) in targets.iter().enumerate() {
                let Follower { rve, workspace } = &mut *follower;
                let before = rve.clone();
                let response = self.equilibrium(rve, target, workspace, true);
                match response.and_then(|fibers| self.with_matrix(fibers, target)) {
                    Ok(response) => responses.push(response),
                    Err(reason) => {
                        *rve = before;
                        return Err(Failure { index, reason });
                    }
                }
            }
            Ok(responses)
        })
    }

    /// Returns the positions of all nodes of an RVE, in units of the cube's edge.
    pub fn positions(&self, follower: &Follower) -> Vec<[f64; 3]> {
        follower.rve.positions(self.model.network())
    }
}
