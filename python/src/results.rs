//! `Results`: a result directory as arrays.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use biotissue::app::report::ReportError;
use biotissue::app::report::directory::Directory;
use biotissue::app::results::collection::Entry;
use biotissue::app::results::{Event, Fields, LOG_FILE, log};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{array, array_of_rows};
use crate::errors::{report_error, value_error};

/// The results of a run.
///
/// The tables and the log are read once; open the directory again to see later steps of a run in progress.
///
/// Parameters
/// ----------
/// directory : str or os.PathLike
///     The result directory.
///
/// Raises
/// ------
/// FileNotFoundError
///     If the directory has no results.
/// ValueError
///     If a file is damaged.
#[pyclass(frozen, name = "Results", module = "biotissue")]
pub struct PyResults {
    directory: Directory,
    events: Vec<Event>,
    /// The first field file, for the mesh.
    first: OnceLock<Fields>,
}

impl PyResults {
    /// Reads the tables and the log of a result directory.
    pub fn open(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let read = || {
            let directory = Directory::open(&path)?;
            let file = path.join(LOG_FILE);
            let events = if file.is_file() { log::read(&file)? } else { Vec::new() };
            Ok(Self { directory, events, first: OnceLock::new() })
        };
        py.detach(read).map_err(|error: ReportError| report_error(&error))
    }

    /// Returns the first fields.
    fn first(&self, py: Python<'_>) -> PyResult<&Fields> {
        if let Some(fields) = self.first.get() {
            return Ok(fields);
        }
        let none = || report_error(&ReportError::NoFields(self.directory.path.clone()));
        let fields = self.read(py, self.directory.fields.first().ok_or_else(none)?)?;
        Ok(self.first.get_or_init(|| fields))
    }

    fn read(&self, py: Python<'_>, entry: &Entry) -> PyResult<Fields> {
        py.detach(|| self.directory.read_fields(entry)).map_err(|error| report_error(&error))
    }

    /// Returns the field files of whole load steps.
    fn whole_steps(&self) -> impl Iterator<Item = (usize, f64)> {
        self.directory.fields.iter().filter_map(|entry| Some((entry.step()?, entry.time)))
    }
}

#[pymethods]
impl PyResults {
    #[new]
    fn new(py: Python<'_>, directory: PathBuf) -> PyResult<Self> {
        Self::open(py, directory)
    }

    /// pathlib.Path: The result directory.
    #[getter]
    fn directory(&self) -> &Path {
        &self.directory.path
    }

    /// str: The title of the case.
    #[getter]
    fn title(&self) -> String {
        self.directory.title()
    }

    /// bool or None: Whether all load steps converged; None if the run has not ended.
    #[getter]
    fn converged(&self) -> Option<bool> {
        self.directory.end.as_ref().map(|end| end.converged)
    }

    /// dict[str, numpy.ndarray]: The columns of ``loads.csv``, with one value for each converged step.
    ///
    /// ``step`` (int64), ``t`` (pseudo-time), then for every surface ``NAME.area`` (m^2), ``NAME.fx``, ``.fy``, ``.fz``
    /// (the force on the body through it, N), ``NAME.ux``, ``.uy``, ``.uz`` (mean displacement, m), for every rigid
    /// surface ``NAME.mx`` (N m), ``NAME.rx`` (rad), ``NAME.dx`` (m) and so on, for every region ``NAME.volume`` (m^3),
    /// and for every volume constraint ``NAME.pressure`` (Pa). Empty if no table was written.
    #[getter]
    fn loads<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let columns = PyDict::new(py);
        let Some(loads) = &self.directory.loads else { return Ok(columns) };
        let steps: Vec<i64> = loads.rows.iter().map(|row| row.step as i64).collect();
        let rows = [steps.len()];
        columns.set_item("step", array(py, steps, &rows)?)?;
        for (name, values) in loads.columns() {
            columns.set_item(name, array(py, values, &rows)?)?;
        }
        Ok(columns)
    }

    /// numpy.ndarray: The load steps that have fields; int64.
    #[getter]
    fn steps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        let steps: Vec<i64> = self.whole_steps().map(|(step, _)| step as i64).collect();
        let shape = [steps.len()];
        array(py, steps, &shape)
    }

    /// numpy.ndarray: The pseudo-times of these load steps; float64.
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let times: Vec<f64> = self.whole_steps().map(|(_, time)| time).collect();
        let shape = [times.len()];
        array(py, times, &shape)
    }

    /// numpy.ndarray: Reference positions of the nodes of the body, m; shape (n, 3).
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        array_of_rows(py, &self.first(py)?.points)
    }

    /// list[tuple[str, numpy.ndarray]]: The elements in blocks of one type, in the order of the fields.
    ///
    /// The type is ``tet4``, ``tet10``, ``hex8``, ``hex20``, ``hex27`` or ``wedge6``; the array has the nodes of every
    /// element, int64, in the order of VTK (of a ``wedge6`` the nodes of each triangle run in the opposite order).
    #[getter]
    fn cells<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let blocks = PyList::empty(py);
        for block in self.first(py)?.elements.blocks() {
            let nodes: Vec<i64> = block.nodes().iter().copied().map(i64::from).collect();
            let shape = [block.len(), nodes.len() / block.len().max(1)];
            blocks.append((block.cell_type().name(), array(py, nodes, &shape)?))?;
        }
        Ok(blocks)
    }

    /// Return the fields of a load step.
    ///
    /// Parameters
    /// ----------
    /// step : int, optional
    ///     The load step; by default the last state that was written, which may lie within a step that failed.
    ///
    /// Returns
    /// -------
    /// dict[str, numpy.ndarray]
    ///     ``displacement`` at the nodes, m, shape (n, 3); and the fields of the m elements in the order of `cells`:
    ///     scalars of shape (m,), vectors of shape (m, 3), tensors of shape (m, 3, 3).
    ///
    /// Raises
    /// ------
    /// KeyError
    ///     If the step has no fields.
    /// FileNotFoundError
    ///     If there are no fields.
    #[pyo3(signature = (step = None))]
    fn fields<'py>(&self, py: Python<'py>, step: Option<usize>) -> PyResult<Bound<'py, PyDict>> {
        let entry = self.directory.field_file(step).map_err(|error| report_error(&error))?;
        let Fields {
            point_scalars,
            point_vectors,
            point_tensors,
            cell_scalars,
            cell_integers,
            cell_vectors,
            cell_tensors,
            ..
        } = self.read(py, entry)?;
        let fields = PyDict::new(py);
        for (name, values) in point_vectors.iter().chain(&cell_vectors) {
            fields.set_item(name, array_of_rows(py, values)?)?;
        }
        for (name, values) in point_scalars.into_iter().chain(cell_scalars) {
            let shape = [values.len()];
            fields.set_item(name, array(py, values, &shape)?)?;
        }
        for (name, values) in cell_integers {
            let shape = [values.len()];
            fields.set_item(name, array(py, values, &shape)?)?;
        }
        for (name, values) in point_tensors.into_iter().chain(cell_tensors) {
            let shape = [values.len(), 3, 3];
            fields.set_item(name, array(py, values.into_flattened(), &shape)?)?;
        }
        Ok(fields)
    }

    /// list[dict[str, Any]]: The events of ``log.jsonl``; the value of ``event`` is the kind of event.
    #[getter]
    fn log<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let loads = py.import("json")?.getattr("loads")?;
        let list = PyList::empty(py);
        for event in self.events.iter().filter(|event| !matches!(event, Event::Unknown)) {
            let text = serde_json::to_string(event).map_err(value_error)?;
            list.append(loads.call1((text,))?)?;
        }
        Ok(list)
    }

    fn __repr__(&self) -> String {
        let steps = self.directory.loads.as_ref().map_or(0, |loads| loads.rows.len());
        format!("<biotissue.Results of {}: {steps} load steps>", self.directory.path.display())
    }
}
