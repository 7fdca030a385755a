//! `Rve`: responses of a network to deformation gradients.

mod solve;

use std::sync::{Arc, Mutex, PoisonError};

use biotissue::fem::material::Response;
use biotissue::fiber::rve::StressScale;
use biotissue::nalgebra::Matrix3;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;

use crate::arrays::{Gradients, array, array_of_rows, rows_of};
use crate::errors::{equilibrium_error, value_error};
use crate::law::PyLaw;
use crate::matrix::PyNeoHookean;
use crate::network::PyNetwork;
use crate::run::pool_of;
use solve::{Failure, Follower, Solver, SolverOptions};

/// A representative volume element: a unit cube with a fiber network, and with a matrix in parallel if one is given.
///
/// Parameters
/// ----------
/// network : Network
///     The network.
/// law : Law, optional
///     The law of all fibers; if absent, those that were read with the network.
/// fiber_volume_fraction : float, optional
///     The fraction of the volume that fibers fill, above 0 and at most 1; stresses are then in Pa, and the radius
///     of the fibers cancels. If absent, stresses are the forces, in N, of the network in the unit cube: for a cube
///     of edge ``a``, in m, divide them by ``a**2``.
/// matrix : NeoHookean, optional
///     A matrix whose stress, in Pa, is added to that of the network.
/// tolerance : float
///     Tolerance of the equilibrium: the norm of the forces at interior nodes over that of the forces at all nodes.
/// threads : int, optional
///     Number of threads of `respond`; by default, all cores. Results do not depend on it.
///
/// Raises
/// ------
/// ValueError
///     If an argument is out of range, or the network has no law and none is given.
#[pyclass(frozen, name = "Rve", module = "biotissue")]
pub struct PyRve {
    solver: Solver,
    /// The RVE that follows paths; `None` at rest.
    follower: Mutex<Option<Follower>>,
}

#[pymethods]
impl PyRve {
    #[new]
    #[pyo3(signature = (
        network, law = None, *, fiber_volume_fraction = None, matrix = None, tolerance = 1e-10, threads = None
    ))]
    fn new(
        py: Python<'_>,
        network: PyRef<'_, PyNetwork>,
        law: Option<PyRef<'_, PyLaw>>,
        fiber_volume_fraction: Option<f64>,
        matrix: Option<PyRef<'_, PyNeoHookean>>,
        tolerance: f64,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        if !(tolerance > 0.0 && tolerance < 1.0) {
            return Err(value_error(format!("the tolerance is {tolerance}; it must be above 0 and below 1")));
        }
        let network = Arc::clone(&network.network);
        if law.is_none() && network.materials().is_empty() {
            return Err(value_error(format!("the network {} was read without a law: give one", network.name())));
        }
        let options = SolverOptions {
            law: law.map(|law| law.material.clone()),
            scale: fiber_volume_fraction.map_or(StressScale::Raw, StressScale::FiberVolumeFraction),
            matrix: matrix.map(|matrix| matrix.material),
            tolerance,
            pool: pool_of(threads)?,
        };
        let solver = py.detach(|| Solver::new(network, options)).map_err(value_error)?;
        Ok(Self { solver, follower: Mutex::new(None) })
    }

    /// Return stress, tangent and energy at independent deformation gradients.
    ///
    /// The equilibrium at each gradient is sought from the network at rest, so that results do not depend on other
    /// gradients or on earlier calls. All threads take part.
    ///
    /// Parameters
    /// ----------
    /// F : array_like, shape (n, 3, 3) or (3, 3)
    ///     Deformation gradients ``F[i, j] = dx[i] / dX[j]`` with positive determinants.
    ///
    /// Returns
    /// -------
    /// Response
    ///     ``P``, shape (n, 3, 3), Pa; ``A``, shape (n, 3, 3, 3, 3), Pa; ``W``, shape (n,), J/m^3. Without the axis of
    ///     length n if `F` has none.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If `F` has another shape, a component that is not finite, or a determinant that is not positive.
    /// EquilibriumError
    ///     If there is no equilibrium at one of the gradients; its attribute `index` is the first of them.
    #[allow(non_snake_case, reason = "the name in formulas")]
    fn respond<'py>(&self, py: Python<'py>, F: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let gradients = Gradients::of(F)?;
        let solved = py.detach(|| self.solver.respond(&gradients.all));
        response(py, &gradients, solved)
    }

    /// Return stress, tangent and energy along a path of deformation gradients.
    ///
    /// The equilibrium at each gradient is sought from the one before, which is faster for a fine path and, if a network
    /// has several equilibria, decides which one is found. The next call continues from the last gradient; `reset` starts
    /// again from rest. If a gradient has no equilibrium, the RVE stays at the one before it.
    ///
    /// Parameters
    /// ----------
    /// F : array_like, shape (n, 3, 3) or (3, 3)
    ///     Deformation gradients ``F[i, j] = dx[i] / dX[j]`` with positive determinants, in the order of the path.
    ///
    /// Returns
    /// -------
    /// Response
    ///     As for `respond`.
    ///
    /// Raises
    /// ------
    /// ValueError, EquilibriumError
    ///     As for `respond`.
    #[allow(non_snake_case, reason = "the name in formulas")]
    fn respond_path<'py>(&self, py: Python<'py>, F: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let gradients = Gradients::of(F)?;
        let solved = py.detach(|| self.follow(&gradients.all));
        response(py, &gradients, solved)
    }

    /// Return the RVE of `respond_path` to rest.
    fn reset(&self, py: Python<'_>) {
        py.detach(|| *self.follower.lock().unwrap_or_else(PoisonError::into_inner) = None);
    }

    /// Network: The network.
    #[getter]
    fn network(&self) -> PyNetwork {
        PyNetwork { network: Arc::clone(self.solver.model().network()) }
    }

    /// numpy.ndarray: The deformation gradient that `respond_path` has reached; the identity at rest; shape (3, 3).
    #[getter]
    fn gradient<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let reached = |follower: &Option<Follower>| follower.as_ref().map(|follower| *follower.gradient());
        let gradient = py.detach(|| self.with_follower(reached)).unwrap_or_else(Matrix3::identity);
        array(py, rows_of(&gradient).to_vec(), &[3, 3])
    }

    /// numpy.ndarray: Positions of the nodes where `respond_path` has arrived, in units of the cube's edge; shape (n, 3).
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let reached = |follower: &Option<Follower>| follower.as_ref().map(|follower| self.solver.positions(follower));
        match py.detach(|| self.with_follower(reached)) {
            Some(positions) => array_of_rows(py, &positions),
            None => array_of_rows(py, self.solver.model().network().nodes()),
        }
    }

    fn __repr__(&self) -> String {
        let network = self.solver.model().network().name();
        let matrix = if self.solver.matrix().is_some() { " in a matrix" } else { "" };
        format!("<biotissue.Rve of network {network}{matrix}>")
    }
}

impl PyRve {
    fn with_follower<R>(&self, read: impl FnOnce(&Option<Follower>) -> R) -> R {
        read(&self.follower.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn follow(&self, targets: &[Matrix3<f64>]) -> Result<Vec<Response>, Failure> {
        let mut follower = self.follower.lock().unwrap_or_else(PoisonError::into_inner);
        let follower = match &mut *follower {
            Some(follower) => follower,
            none => none.insert(self.solver.follower().map_err(|reason| Failure { index: 0, reason })?),
        };
        self.solver.follow(follower, targets)
    }
}

/// Returns the Python object of a response.
fn response<'py>(
    py: Python<'py>,
    gradients: &Gradients,
    solved: Result<Vec<Response>, Failure>,
) -> PyResult<Bound<'py, PyAny>> {
    static RESPONSE: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let solved = solved.map_err(|Failure { index, reason }| equilibrium_error(py, index, &reason))?;
    let stress = solved.iter().flat_map(|response| rows_of(&response.pk1)).collect();
    // Row `3 i + j`, column `3 k + l` of the tangent is `A[i, j, k, l]`; nalgebra stores columns.
    let tangent = solved.iter().flat_map(|response| response.tangent.transpose().data.0).flatten().collect();
    let energy = solved.iter().map(|response| response.energy).collect();
    RESPONSE.import(py, "biotissue._response", "Response")?.call1((
        gradients.array(py, stress, &[3, 3])?,
        gradients.array(py, tangent, &[3, 3, 3, 3])?,
        gradients.array(py, energy, &[])?,
    ))
}
