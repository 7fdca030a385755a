//! `NeoHookean`: a matrix in parallel with the network of an RVE.

use biotissue::fem::material::NeoHookean;
use pyo3::prelude::*;

use crate::errors::value_error;

/// A compressible neo-Hookean matrix between the fibers.
///
/// The energy is ``W = mu/2 (F : F - 3) - mu ln J + lambda/2 (ln J)**2`` with ``J = det F``, the shear modulus ``mu`` and
/// Lame's first constant ``lambda = 2 mu nu / (1 - 2 nu)``.
///
/// Parameters
/// ----------
/// shear_modulus : float
///     ``mu``, Pa; positive.
/// poisson_ratio : float
///     ``nu``, without dimension; above -1 and below 0.5.
///
/// Raises
/// ------
/// ValueError
///     If a parameter is out of range.
#[pyclass(frozen, name = "NeoHookean", module = "biotissue")]
pub struct PyNeoHookean {
    pub material: NeoHookean,
    poisson_ratio: f64,
}

#[pymethods]
impl PyNeoHookean {
    #[new]
    fn new(shear_modulus: f64, poisson_ratio: f64) -> PyResult<Self> {
        if !(shear_modulus > 0.0 && shear_modulus.is_finite()) {
            return Err(value_error(format!("the shear modulus is {shear_modulus}; it must be positive and finite")));
        }
        if !(poisson_ratio > -1.0 && poisson_ratio < 0.5) {
            return Err(value_error(format!("Poisson's ratio is {poisson_ratio}; it must be above -1 and below 0.5")));
        }
        let lambda = 2.0 * shear_modulus * poisson_ratio / (1.0 - 2.0 * poisson_ratio);
        Ok(Self { material: NeoHookean { mu: shear_modulus, lambda }, poisson_ratio })
    }

    /// float: Shear modulus, Pa.
    #[getter]
    fn shear_modulus(&self) -> f64 {
        self.material.mu
    }

    /// float: Poisson's ratio.
    #[getter]
    fn poisson_ratio(&self) -> f64 {
        self.poisson_ratio
    }

    fn __repr__(&self) -> String {
        format!("NeoHookean(shear_modulus={:?}, poisson_ratio={:?})", self.material.mu, self.poisson_ratio)
    }
}
