//! The files of the fields of a case, each of which is read once.

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::columns;
use super::grid::Grid;
use crate::app::material_fields::Body;
use crate::app::vtu::{self, CellData};
use crate::fem::element::{CellType, ElementType};
use crate::input::{InputError, Row};

/// Centers of cells are equal if they differ by less than this part of the longest edge of the body: files may hold
/// positions in single precision.
const SAME_PLACE: f64 = 1e-5;

/// The files read so far.
#[derive(Default)]
pub(in crate::app::material_fields) struct Files {
    cells: RefCell<HashMap<PathBuf, Rc<CellData>>>,
    rows: RefCell<HashMap<PathBuf, Rc<Vec<Row>>>>,
    grids: RefCell<HashMap<PathBuf, Rc<Grid>>>,
}

impl Files {
    /// Returns the cells of a `.vtu` file.
    pub fn cells(&self, file: &Path) -> Result<Rc<CellData>, InputError> {
        once(&self.cells, file, vtu::read_cells)
    }

    /// Returns the rows of a CSV file.
    pub fn rows(&self, file: &Path) -> Result<Rc<Vec<Row>>, InputError> {
        once(&self.rows, file, columns::read)
    }

    /// Returns a regular grid.
    pub fn grid(&self, file: &Path) -> Result<Rc<Grid>, InputError> {
        once(&self.grids, file, Grid::read)
    }
}

fn once<T>(
    known: &RefCell<HashMap<PathBuf, Rc<T>>>,
    file: &Path,
    read: impl FnOnce(&Path) -> Result<T, InputError>,
) -> Result<Rc<T>, InputError> {
    if let Some(known) = known.borrow().get(file) {
        return Ok(Rc::clone(known));
    }
    let new = Rc::new(read(file)?);
    known.borrow_mut().insert(file.into(), Rc::clone(&new));
    Ok(new)
}

/// Checks that the elements of a file, as many as those of the mesh, lie where those lie, in mesh units or in meters.
pub(super) fn check_cells(body: &Body<'_>, file: &Path, data: &CellData) -> Result<(), InputError> {
    let mesh = body.mesh;
    let corners = |(of, nodes): (ElementType, &[u32])| vtu::center(mesh.nodes(), &nodes[..of.corners()]);
    let of_mesh: Vec<[f64; 3]> = mesh.elements().typed().map(corners).collect();
    let of_file = data.centers();
    let [low, high] = mesh.bounding_box();
    let tolerance = SAME_PLACE * (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    let first_apart = |scale: f64| {
        let is_apart = |(a, b): (&[f64; 3], &[f64; 3])| !(0..3).all(|k| (scale * a[k] - b[k]).abs() <= tolerance);
        of_file.iter().zip(&of_mesh).position(is_apart)
    };
    // The unit of the file is that in which more elements agree.
    let (Some(in_meters), Some(in_mesh_units)) = (first_apart(1.0), first_apart(body.case.mesh_scale)) else {
        return Ok(());
    };
    let (element, scale) =
        if in_meters > in_mesh_units { (in_meters, 1.0) } else { (in_mesh_units, body.case.mesh_scale) };
    let [there, here] = [of_file[element].map(|x| scale * x), of_mesh[element]]
        .map(|[x, y, z]| format!("x = {x:.6e}, y = {y:.6e}, z = {z:.6e} m"));
    let cell = data.cell_of(element).unwrap_or(element);
    Err(InputError::at_line(
        file,
        data.line_of_positions(),
        format!("the center of cell {cell} lies at {there}, that of element {element} of the mesh at {here}"),
        "the cells of the mesh in the same order, in mesh units or in meters",
        "write the array on the mesh of this case, or give a CSV file with a column `element`",
    ))
}
