//! Exceptions and warnings.

use std::ffi::CString;
use std::path::Path;

use biotissue::app::report::ReportError;
use biotissue::app::results::ResultsError;
use biotissue::input::InputErrors;
use pyo3::create_exception;
use pyo3::exceptions::{
    PyFileExistsError, PyFileNotFoundError, PyKeyError, PyOSError, PyRuntimeError, PyUserWarning, PyValueError,
};
use pyo3::prelude::*;

create_exception!(
    biotissue,
    EquilibriumError,
    PyRuntimeError,
    "An RVE has no equilibrium at a deformation gradient.\n\nAttributes\n----------\nindex : int\n    The number of the \
     deformation gradient in the array, from 0; the message has the reason."
);
create_exception!(
    biotissue,
    ConvergenceError,
    PyRuntimeError,
    "A load step of a case does not converge. The results of the steps before it are in the result directory."
);

/// Returns a `ValueError`.
pub fn value_error(message: impl ToString) -> PyErr {
    PyValueError::new_err(message.to_string())
}

/// Returns the `EquilibriumError` of the deformation gradient with this index.
pub fn equilibrium_error(py: Python<'_>, index: usize, reason: &str) -> PyErr {
    let error = EquilibriumError::new_err(format!("F[{index}]: {reason}"));
    match error.value(py).setattr("index", index) {
        Ok(()) => error,
        Err(other) => other,
    }
}

/// Checks that a file exists; whatever else prevents reading it is left to the readers.
pub fn check_exists(path: &Path) -> PyResult<()> {
    if path.exists() {
        return Ok(());
    }
    Err(PyFileNotFoundError::new_err(format!("{}: there is no such file", path.display())))
}

/// Converts errors in input files.
pub fn input_error(errors: &InputErrors) -> PyErr {
    value_error(errors)
}

/// Converts an error of a result directory.
pub fn results_error(error: &ResultsError) -> PyErr {
    let message = error.to_string();
    match error {
        ResultsError::UnknownOrigin(..) => PyFileExistsError::new_err(message),
        ResultsError::Damaged { .. } | ResultsError::Length { .. } | ResultsError::ElementNode { .. } => {
            PyValueError::new_err(message)
        }
        _ => PyOSError::new_err(message),
    }
}

/// Converts an error of reading a whole result directory.
pub fn report_error(error: &ReportError) -> PyErr {
    match error {
        ReportError::Results(error) => results_error(error),
        ReportError::NoResults(_) | ReportError::NoFields(_) => PyFileNotFoundError::new_err(error.to_string()),
        ReportError::NoStep(..) => PyKeyError::new_err(error.to_string()),
        ReportError::EmptyMesh(_) | ReportError::NoField(..) => value_error(error),
    }
}

/// Issues each message as a `UserWarning` of the caller.
pub fn warn(py: Python<'_>, messages: &[String]) -> PyResult<()> {
    for message in messages {
        // A C string ends at its first zero byte.
        let text = CString::new(message.replace('\0', "")).map_err(value_error)?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
    }
    Ok(())
}
