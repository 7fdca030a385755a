//! Arrays: arguments of any type that NumPy converts, and results.

use biotissue::nalgebra::Matrix3;
use numpy::ndarray::{ArrayD, IxDyn};
use numpy::{AllowTypeChange, Element, IntoPyArray, PyArrayDyn, PyArrayLikeDyn};
use pyo3::prelude::*;

use crate::errors::value_error;

/// The numbers of an argument, row by row, and its shape.
pub struct Numbers {
    /// The numbers.
    pub values: Vec<f64>,
    /// The shape.
    pub shape: Vec<usize>,
}

impl Numbers {
    /// Converts an argument as `numpy.asarray(argument, float)` does.
    pub fn of(argument: &Bound<'_, PyAny>) -> PyResult<Self> {
        let array: PyArrayLikeDyn<'_, f64, AllowTypeChange> = argument.extract()?;
        let view = array.as_array();
        Ok(Self { values: view.iter().copied().collect(), shape: view.shape().to_vec() })
    }

    /// Returns the rows of an array of shape (n, `N`); `name` and `columns` describe it in the error.
    pub fn rows<const N: usize>(&self, name: &str, columns: &str) -> PyResult<Vec<[f64; N]>> {
        if let [_, columns] = self.shape[..]
            && columns == N
        {
            return Ok(self.values.as_chunks::<N>().0.to_vec());
        }
        Err(value_error(format!("{name} has the shape {}; expected (n, {N}): {columns}", self.shown_shape())))
    }

    /// Returns the numbers of an array of one axis.
    pub fn column(self, name: &str) -> PyResult<Vec<f64>> {
        if self.shape.len() == 1 {
            return Ok(self.values);
        }
        Err(value_error(format!("{name} has the shape {}; expected one axis", self.shown_shape())))
    }

    /// Formats the shape as Python does.
    fn shown_shape(&self) -> String {
        match &self.shape[..] {
            [one] => format!("({one},)"),
            axes => format!("({})", axes.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")),
        }
    }
}

/// Deformation gradients.
pub struct Gradients {
    /// The gradients.
    pub all: Vec<Matrix3<f64>>,
    /// Whether the argument was one gradient, without an axis for several.
    is_single: bool,
}

impl Gradients {
    /// Converts an argument of shape (3, 3) or (n, 3, 3), with finite numbers and positive determinants.
    pub fn of(argument: &Bound<'_, PyAny>) -> PyResult<Self> {
        let numbers = Numbers::of(argument)?;
        let is_single = match numbers.shape[..] {
            [3, 3] => true,
            [_, 3, 3] => false,
            _ => {
                let shape = numbers.shown_shape();
                return Err(value_error(format!("F has the shape {shape}; expected (3, 3) or (n, 3, 3)")));
            }
        };
        let all: Vec<Matrix3<f64>> =
            numbers.values.as_chunks::<9>().0.iter().map(|f| Matrix3::from_row_slice(f)).collect();
        for (index, f) in all.iter().enumerate() {
            let name = if is_single { "F".to_owned() } else { format!("F[{index}]") };
            if f.iter().any(|component| !component.is_finite()) {
                return Err(value_error(format!("{name} has a component that is not finite")));
            }
            let determinant = f.determinant();
            // The condition is negated, so that NaN, which follows from overflow, is rejected too.
            if !(determinant > 0.0 && determinant.is_finite()) {
                return Err(value_error(format!(
                    "{name} has the determinant {determinant:e}; that of a deformation gradient is positive and finite"
                )));
            }
        }
        Ok(Self { all, is_single })
    }

    /// Returns an array with one item of shape `item` for each gradient.
    pub fn array<'py>(
        &self,
        py: Python<'py>,
        values: Vec<f64>,
        item: &[usize],
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let count = if self.is_single { None } else { Some(self.all.len()) };
        let shape: Vec<usize> = count.into_iter().chain(item.iter().copied()).collect();
        array(py, values, &shape)
    }
}

/// Returns a new array of this shape with these values, row by row.
pub fn array<'py, T: Element>(py: Python<'py>, values: Vec<T>, shape: &[usize]) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    Ok(ArrayD::from_shape_vec(IxDyn(shape), values).map_err(value_error)?.into_pyarray(py))
}

/// Returns a new array of shape (n, `N`).
pub fn array_of_rows<'py, T: Element + Copy, const N: usize>(
    py: Python<'py>,
    rows: &[[T; N]],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    array(py, rows.as_flattened().to_vec(), &[rows.len(), N])
}

/// Returns a new array of indices.
pub fn indices<'py>(py: Python<'py>, of: impl IntoIterator<Item = u32>) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
    let values: Vec<i64> = of.into_iter().map(i64::from).collect();
    let shape = [values.len()];
    array(py, values, &shape)
}

/// Returns the components of a matrix, row by row.
pub fn rows_of(matrix: &Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|k| matrix[(k / 3, k % 3)])
}
