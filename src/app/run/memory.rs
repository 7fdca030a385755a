//! A forecast of the memory that a run takes.

use serde::Serialize;

use crate::app::case::{Case, NODAL, components};
use crate::fem::mesh::Mesh;
use crate::fem::stepping::LinearSystem;
use crate::fiber::rve::RveModel;
use crate::fiber::workspace::Workspace;
use crate::las::{Method, Sparsity, SparsityError, Symmetry};
#[cfg(feature = "cuda")]
use crate::rve_batch::DeviceBatch;
use crate::tissue::micro_scale::TissueMaterial;

/// Bytes that a run in one process takes, by part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct MemoryForecast {
    /// States and last responses of all RVEs.
    pub rves: usize,
    /// Networks with their analyses, the memory in which each thread solves RVEs, and that through which RVEs get to a device
    /// and back.
    pub networks: usize,
    /// Integration points: gradients of the shape functions, and deformation gradients, stresses and tangents of the converged
    /// and of the trial state.
    pub points: usize,
    /// Mesh and linear system of the body.
    pub system: usize,
    /// The fields of the body while they are written.
    pub fields: usize,
    /// All of them, and the program itself.
    pub total: usize,
    /// What the factor of a direct solver takes in addition if the solver replaces an iterative one that fails.
    pub fallback: usize,
}

/// Bytes of the program with the default features before it reads a case (12 MB), and what the allocator holds.
const PROGRAM: usize = 20_000_000;

/// Bytes for each entry of the matrix: its value, its column, positions of the entries of elements; with multigrid also those
/// of the coarse levels. These figures and the following ones are least-squares fits to the peaks of 30 boxes of tetrahedra
/// and hexahedra of order 1 and 2 with 5 600 to 200 000 unknowns and definite matrices. The worst deviates by 4 % if the size of
/// the program is another unknown of the fit; `docs/speed.md` says how good the forecast is.
const ENTRY: f64 = 22.0;
const ENTRY_WITH_MULTIGRID: f64 = 32.0;
/// Bytes for each unknown: vectors of multigrid and of the Krylov method.
const UNKNOWN_WITH_MULTIGRID: f64 = 770.0;
/// The most unknowns for which a forecast computes an order of elimination: that takes about 2 s on one core then.
const MOST_ORDERED: usize = 200_000;
/// Bytes for each entry of a factor, with explicit zeros and the analysis.
const FACTOR_ENTRY: f64 = 8.0 * 1.35;

/// What networks and the memory of threads take beyond their arrays: other storage, and what the allocator holds. Measured for 20
/// networks of a ligament and for generated ones, with lanes and without.
const OVERHEAD: f64 = 1.2;

/// Bytes for each integration point: energy, gradient, stress, tangent, of the converged and of the trial state; gradients of
/// the shape functions.
const POINT: usize = 2 * (1 + 9 + 9 + 81) * size_of::<f64>() + 210;
/// Bytes for each element: its nodes and places in lists.
const ELEMENT: usize = 32;

impl MemoryForecast {
    /// Forecasts the memory of a case with this material, mesh and linear system, on this number of threads.
    ///
    /// # Errors
    /// Returns [`SparsityError::TooLarge`] if the matrix exceeds the range of 32-bit indices.
    pub(super) fn new(
        case: &Case,
        field: &impl TissueMaterial,
        mesh: &Mesh,
        system: &LinearSystem,
        threads: usize,
    ) -> Result<Self, SparsityError> {
        let pattern = system.pattern.expanded()?;
        let (entries, unknowns) = (pattern.nnz() as f64, pattern.rows() as f64);
        let factor = || FACTOR_ENTRY * factor_entries(&pattern, system);
        let (of_system, fallback) = match system.solver.method {
            Method::Direct => (ENTRY * entries + factor(), 0.0),
            Method::Iterative(_) => (
                ENTRY_WITH_MULTIGRID * entries + UNKNOWN_WITH_MULTIGRID * unknowns,
                if system.solver.fallback { factor() } else { 0.0 },
            ),
        };
        let (rves, networks) = (field.rve_bytes(), of_networks(case, field, threads));
        let whole = mesh.whole();
        let (points, system) = (POINT * whole.points, of_system as usize + ELEMENT * whole.elements);
        let fields = of_fields(case, mesh);
        let total = PROGRAM + rves + networks + points + system + fields;
        Ok(Self { rves, networks, points, system, fields, total, fallback: fallback as usize })
    }
}

/// Returns the number of entries of the factor of a direct solver. An unsymmetric matrix has two factors, which pivoting may
/// fill more than this.
fn factor_entries(pattern: &Sparsity, system: &LinearSystem) -> f64 {
    let factors = if system.solver.symmetry == Symmetry::None { 2.0 } else { 1.0 };
    let unknowns = pattern.rows();
    let exact = (unknowns <= MOST_ORDERED).then(|| cholesky_entries(pattern)).flatten();
    // As in a band of constant width: in boxes of linear tetrahedra, 1.1 to 1.3 times the exact number, and more for others.
    factors * exact.unwrap_or_else(|| (unknowns as f64 * system.operations).sqrt())
}

/// Returns the number of entries of a Cholesky factor, if an order of elimination is found.
#[cfg(feature = "sparse")]
fn cholesky_entries(pattern: &Sparsity) -> Option<f64> {
    crate::backends::sparse::cholesky_entries(pattern).ok()
}

#[cfg(not(feature = "sparse"))]
fn cholesky_entries(_: &Sparsity) -> Option<f64> {
    None
}

/// Returns what the fields take while they are written: their values at the points and in the elements, and the cells of the
/// file.
fn of_fields(case: &Case, mesh: &Mesh) -> usize {
    /// Numbers of the fields that every body has, and of those of fibers and RVEs with what they are collected from.
    const OF_BODY: usize = 1 + 9 + 9 + 1 + 3;
    const OF_FIBERS: usize = 9 + 3 + 3 + 19;
    /// Numbers of a file of integration points.
    const OF_POINTS: usize = 56;
    if case.output.every == 0 {
        return 0;
    }
    let whole = mesh.whole();
    let numbers = OF_BODY + if case.has_fiber_fields() { OF_FIBERS } else { 0 };
    let at_points = numbers + if case.output.points { OF_POINTS } else { 0 };
    // The fields of elements with one point are those of the points.
    let in_elements = if whole.points > whole.elements { numbers } else { 0 };
    // The fields on request follow from others; a mean is in a table of all means and in an array of its own.
    let names = case.fields();
    let (means, fields): (Vec<&str>, Vec<&str>) = names.into_iter().partition(|name| name.starts_with(NODAL));
    let derived = fields.iter().filter(|name| name.starts_with("principal") || name.starts_with("green"));
    let derived: usize = derived.map(|name| components(name)).sum();
    let at_nodes = 2 * means.iter().map(|name| components(name)).sum::<usize>();
    let connectivity = mesh.elements().iter().map(<[u32]>::len).sum::<usize>();
    let of_elements = (in_elements + derived + 9) * whole.elements + connectivity;
    size_of::<f64>() * (at_points * whole.points + of_elements + at_nodes * whole.nodes)
}

fn of_networks(case: &Case, field: &impl TissueMaterial, threads: usize) -> usize {
    let library = field.library();
    let of_model = |model| threads * Workspace::bytes_for(model) + RveModel::bytes(model);
    let transfers = of_transfers(case, field);
    // A device takes the place of lanes.
    let has_lanes = transfers.is_empty() || transfers.contains(&0);
    let of_lanes = if has_lanes { threads * library.batch_bytes_per_thread() } else { 0 };
    let arrays = library.models().iter().map(of_model).sum::<usize>() + of_lanes;
    (OVERHEAD * arrays as f64) as usize + transfers.iter().sum::<usize>()
}

/// Returns the memory through which the RVEs of each model get to a device and back; nothing without a device.
#[cfg(feature = "cuda")]
fn of_transfers(case: &Case, field: &impl TissueMaterial) -> Vec<usize> {
    if case.micro.device.is_none() {
        return Vec::new();
    }
    let (library, counts) = (field.library(), field.rve_counts().per_model);
    let of_model = |(model, rves)| DeviceBatch::host_bytes(model, rves, library.predicts());
    library.models().iter().zip(counts).map(of_model).collect()
}

#[cfg(not(feature = "cuda"))]
fn of_transfers(_: &Case, _: &impl TissueMaterial) -> Vec<usize> {
    Vec::new()
}
