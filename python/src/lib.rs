//! The extension module of the Python package `biotissue`.
//!
//! | module | contents |
//! |---|---|
//! | `network` | `Network`: files and generators |
//! | `law`, `matrix` | `Law` and `NeoHookean`: what an RVE is made of |
//! | `rve` | `Rve`: responses at arrays of deformation gradients |
//! | `run`, `results` | `run_case` and `Results` |
//! | `arrays`, `errors` | conversion of arguments, arrays and errors |
//!
//! All computations release the interpreter for other threads.
#![warn(missing_docs)]
// Every failure that a user, a file or a library can cause is a Python exception.
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::todo,
    clippy::unimplemented,
    clippy::unreachable
)]

mod arrays;
mod errors;
mod law;
mod matrix;
mod network;
mod results;
mod run;
mod rve;

use pyo3::prelude::*;

/// The compiled part of the package `biotissue`, which re-exports it.
#[pymodule]
fn _biotissue(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("EquilibriumError", py.get_type::<errors::EquilibriumError>())?;
    module.add("ConvergenceError", py.get_type::<errors::ConvergenceError>())?;
    module.add_class::<network::PyNetwork>()?;
    module.add_class::<law::PyLaw>()?;
    module.add_class::<matrix::PyNeoHookean>()?;
    module.add_class::<rve::PyRve>()?;
    module.add_class::<results::PyResults>()?;
    module.add_function(wrap_pyfunction!(run::run_case, module)?)
}
