//! `Law`: the axial behavior of fibers.

use biotissue::fiber::law::{FiberLaw, FiberMaterial, Law, Table};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Numbers, array};
use crate::errors::value_error;

/// The law and the radius of fibers.
///
/// A law is the nominal stress ``s`` of a fiber, in Pa, as a function of its stretch ``lambda``. With the Green strain
/// ``g = (lambda**2 - 1) / 2``, Young's modulus ``E`` and the nonlinearity ``B``:
///
/// ==========================  ==========================================================================
/// `Law.linear`                ``s = E lambda g``
/// `Law.exponential`           ``s = (E / B) (exp(B g) - 1)``
/// `Law.exponential_stretch`   ``s = (E / B) lambda (exp(B g) - 1)`` for stretches from 1 to `transition`,
///                             tangent lines outside
/// `Law.table`                 a monotone curve through measured points
/// ==========================  ==========================================================================
///
/// The radius is that of the circular cross-section, in m. It cancels if an RVE has a fiber volume fraction.
#[pyclass(frozen, name = "Law", module = "biotissue")]
pub struct PyLaw {
    pub material: FiberMaterial,
}

impl PyLaw {
    fn checked(law: Law, radius: f64) -> PyResult<Self> {
        let material = FiberMaterial { law, radius, density: None };
        material.check().map_err(value_error)?;
        Ok(Self { material })
    }
}

#[pymethods]
impl PyLaw {
    /// Return the law ``s = E lambda g``.
    ///
    /// Parameters
    /// ----------
    /// youngs_modulus : float
    ///     ``E``, Pa; positive.
    /// radius : float
    ///     Radius of the fibers, m; positive.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a parameter is out of range.
    #[staticmethod]
    fn linear(youngs_modulus: f64, radius: f64) -> PyResult<Self> {
        Self::checked(Law::Linear { youngs_modulus }, radius)
    }

    /// Return the law ``s = (E / B) (exp(B g) - 1)``.
    ///
    /// Parameters
    /// ----------
    /// youngs_modulus : float
    ///     ``E``, Pa; positive.
    /// nonlinearity : float
    ///     ``B``, without dimension; positive.
    /// radius : float
    ///     Radius of the fibers, m; positive.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a parameter is out of range.
    #[staticmethod]
    fn exponential(youngs_modulus: f64, nonlinearity: f64, radius: f64) -> PyResult<Self> {
        Self::checked(Law::Exponential { youngs_modulus, nonlinearity }, radius)
    }

    /// Return the law ``s = (E / B) lambda (exp(B g) - 1)``, with tangent lines in compression and above `transition`.
    ///
    /// Parameters
    /// ----------
    /// youngs_modulus : float
    ///     ``E``, Pa; positive.
    /// nonlinearity : float
    ///     ``B``, without dimension; positive.
    /// transition : float
    ///     The stretch above which the stress continues along its tangent line; at least 1.
    /// radius : float
    ///     Radius of the fibers, m; positive.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a parameter is out of range.
    #[staticmethod]
    fn exponential_stretch(youngs_modulus: f64, nonlinearity: f64, transition: f64, radius: f64) -> PyResult<Self> {
        Self::checked(Law::ExponentialStretch { youngs_modulus, nonlinearity, transition }, radius)
    }

    /// Return the law through measured points: monotone cubics between them, tangent lines beyond them.
    ///
    /// Parameters
    /// ----------
    /// stretch : array_like, shape (n,)
    ///     Stretches, without dimension; strictly increasing, with one at 1.
    /// stress : array_like, shape (n,)
    ///     Nominal stresses, Pa; nondecreasing, 0 at stretch 1, with a positive slope there.
    /// radius : float
    ///     Radius of the fibers, m; positive.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If the points do not define a law, or the radius is out of range.
    #[staticmethod]
    fn table(stretch: &Bound<'_, PyAny>, stress: &Bound<'_, PyAny>, radius: f64) -> PyResult<Self> {
        let stretch = Numbers::of(stretch)?.column("stretch")?;
        let stress = Numbers::of(stress)?.column("stress")?;
        if stretch.len() != stress.len() {
            return Err(value_error(format!("{} stretches, but {} stresses", stretch.len(), stress.len())));
        }
        let points = stretch.into_iter().zip(stress).map(|(stretch, stress)| [stretch, stress]).collect();
        let table = Table::new(points).map_err(|error| {
            let [expected, _] = error.advice();
            let point = error.point().map(|point| format!("point {point}: ")).unwrap_or_default();
            value_error(format!("{point}{error}; expected {expected}"))
        })?;
        Self::checked(Law::table(table), radius)
    }

    /// Return this law for fibers that buckle in compression.
    ///
    /// Parameters
    /// ----------
    /// compression : float
    ///     The fraction of the stiffness at rest that remains; from 0 to 1.
    /// buckling_strain : float
    ///     The compressive strain over which the stiffness falls to that fraction; positive.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a parameter is out of range.
    #[pyo3(signature = (compression = 1e-3, buckling_strain = 0.01))]
    fn with_buckling(&self, compression: f64, buckling_strain: f64) -> PyResult<Self> {
        // Buckling replaces an earlier one: a law has one behavior in compression.
        let law = match &self.material.law {
            Law::Buckling { law, .. } => (**law).clone(),
            law => law.clone(),
        };
        Self::checked(law.with_buckling(compression, buckling_strain), self.material.radius)
    }

    /// str: The name of the law in case files.
    #[getter]
    fn name(&self) -> String {
        self.material.law.name().to_owned()
    }

    /// float: Radius of the fibers, m.
    #[getter]
    fn radius(&self) -> f64 {
        self.material.radius
    }

    /// dict[str, float]: The parameters of the law in SI units, without the radius.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let parameters = PyDict::new(py);
        for (name, value) in FiberLaw::parameters(&self.material.law) {
            parameters.set_item(name, value)?;
        }
        Ok(parameters)
    }

    /// Return the nominal stress, Pa, at these stretches, in an array of their shape.
    ///
    /// Parameters
    /// ----------
    /// stretch : array_like
    ///     Stretches; positive.
    fn stress<'py>(&self, py: Python<'py>, stretch: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let Numbers { values, shape } = Numbers::of(stretch)?;
        if let Some(value) = values.iter().find(|value| value.is_nan() || **value <= 0.0) {
            return Err(value_error(format!("a stretch is {value}; stretches are positive, 1 at rest")));
        }
        let (mut stress, mut slope) = (vec![0.0; values.len()], vec![0.0; values.len()]);
        self.material.law.stresses(&values, &mut stress, &mut slope);
        array(py, stress, &shape)
    }

    fn __repr__(&self) -> String {
        format!("<biotissue.Law {}>", describe(&self.material))
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| other.get().material == self.material)
    }
}

/// Returns the name and the parameters.
fn describe(FiberMaterial { law, radius, .. }: &FiberMaterial) -> String {
    let parameters: Vec<String> = match law {
        Law::Table(table) => vec![format!("{} points", table.points().len())],
        law => FiberLaw::parameters(law).into_iter().map(|(name, value)| format!("{name}={value:?}")).collect(),
    };
    format!("{} {}, radius={radius:?}", law.name(), parameters.join(", "))
}
