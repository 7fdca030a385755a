//! A forecast of the memory that a run takes.

use serde::Serialize;

use crate::fem::mesh::Mesh;
use crate::fem::stepping::LinearSystem;
use crate::fiber::rve::RveModel;
use crate::fiber::workspace::Workspace;
use crate::las::{Method, RealBackend};
use crate::tissue::micro_scale::{Library, TissueMaterial};

/// Bytes that a run in one process takes, by part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct MemoryForecast {
    /// States and last responses of all RVEs.
    pub rves: usize,
    /// Networks with their analyses, and the memory in which each thread solves RVEs.
    pub networks: usize,
    /// Deformation gradients, stresses and tangents of the body: two sets, of the converged and of the trial state.
    pub points: usize,
    /// Mesh and linear system of the body.
    pub system: usize,
    /// All of them, and the program itself.
    pub total: usize,
    /// What the factor of a direct solver takes in addition if the solver replaces an iterative one that fails.
    pub fallback: usize,
}

/// Bytes of the program with the default features before it reads a case, and what the allocator holds for small arrays.
const PROGRAM: usize = 12_000_000;

/// Bytes for each unknown of the body: mesh, unknowns, positions of entries, vectors and matrix; with multigrid also its levels.
/// Measured for boxes of tetrahedra with 1 700 to 68 000 unknowns.
const DIRECT: f64 = 1600.0;
const WITH_MULTIGRID: f64 = 2650.0;

/// Bytes of a factor with `n` unknowns and `w` operations, over `sqrt(n w)`. In a band of constant width, the number of entries is
/// this root; in the same boxes, it was 1.0 to 1.3 times as large.
const FACTOR: f64 = 8.8;

/// What networks and the memory of threads take beyond their arrays: other storage, and what the allocator holds. Measured for 20
/// networks of a ligament and for generated ones, with lanes and without.
const OVERHEAD: f64 = 1.2;

/// Bytes of the values at an integration point: energy, gradient, stress, tangent.
const POINT: usize = (1 + 9 + 9 + 81) * size_of::<f64>();

impl MemoryForecast {
    /// Forecasts the memory of a body with this material and linear system, on this number of threads.
    pub(super) fn new(field: &impl TissueMaterial, mesh: &Mesh, system: &LinearSystem, threads: usize) -> Self {
        let unknowns = system.unknowns.free() as f64;
        let factor = FACTOR * (unknowns * system.operations).sqrt();
        let (of_system, fallback) = match system.solver.method {
            Method::Direct => (DIRECT * unknowns + factor, 0.0),
            Method::Iterative(_) => (WITH_MULTIGRID * unknowns, if system.solver.fallback { factor } else { 0.0 }),
        };
        let (rves, networks) = (field.rve_bytes(), of_networks(field.library(), threads));
        let (points, system) = (2 * POINT * mesh.whole().points, of_system as usize);
        let total = PROGRAM + rves + networks + points + system;
        Self { rves, networks, points, system, total, fallback: fallback as usize }
    }
}

fn of_networks<B: RealBackend>(library: &Library<B>, threads: usize) -> usize {
    let of_model = |model: &RveModel<B>| threads * Workspace::bytes_for(model) + model.bytes();
    let arrays = library.models().iter().map(of_model).sum::<usize>() + threads * library.batch_bytes_per_thread();
    (OVERHEAD * arrays as f64) as usize
}
