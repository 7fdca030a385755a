//! Mesh files of all formats, told apart by the endings of their names.
//!
//! | file | regions | surfaces |
//! |---|---|---|
//! | `.msh` of Gmsh ([`gmsh`]) | physical volumes | physical surfaces |
//! | `.vtu` of VTK ([`vtu`]) | `region_1`, ..., by an array of the cells | `surface_1`, ... |
//! | `.inp` of Abaqus | element sets of solid sections; otherwise element sets | surfaces, sets of shell or membrane elements, and node sets that contain whole faces of the boundary |
//! | `.mesh` of Medit | `region_1`, ..., by the references of volumes | `surface_1`, ..., by those of triangles and quadrilaterals |
//! | `.feb` of FEBio | names of `Elements`; otherwise `material_1`, ... | names of `Surface`, and of `NodeSet`s that contain whole faces of the boundary |
//!
//! Tetrahedra and hexahedra of order 1 and 2 (20 nodes) and linear wedges of the last three are read. The nodes between the
//! corners of a tetrahedron follow the edges 12, 23, 31, 14, 24, 34 in files of Abaqus, FEBio and VTK; Gmsh exchanges the
//! last two. The format of Medit leaves their order to the programs: the reader takes that of both in which the nodes lie
//! nearer to the centers of their edges.

mod abaqus;
mod assemble;
mod febio;
mod medit;
#[cfg(test)]
mod tests;

use std::path::Path;

use super::vtu;
use crate::fem::mesh::gmsh::{self, MeshFile};
use crate::input::InputError;

/// The endings of the names of mesh files, without the dot.
pub const ENDINGS: [&str; 5] = ["msh", "vtu", "inp", "mesh", "feb"];

/// Reads a mesh, in the units of the file.
///
/// # Errors
/// Returns [`InputError`] if the file cannot be read, is damaged, or contains unsupported data.
pub fn read(path: &Path) -> Result<MeshFile, InputError> {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match ending.as_str() {
        "vtu" => vtu::read(path),
        "inp" => abaqus::read(path),
        "mesh" => medit::read(path),
        "feb" => febio::read(path),
        "msh" => gmsh::read(path),
        other => match std::fs::File::open(path).map(|mut file| is_gmsh(&mut file)) {
            Ok(false) => {
                let problem = format!("the format of the mesh is not read (`.{other}`)");
                Err(InputError::in_file(path, problem, FORMATS, cure_of(other)))
            }
            Ok(true) | Err(_) => gmsh::read(path),
        },
    }
}

const FORMATS: &str = "a mesh of Gmsh (.msh), VTK (.vtu), Abaqus (.inp), Medit (.mesh) or FEBio (.feb)";

/// Returns true if a file begins as one of Gmsh does.
fn is_gmsh(file: &mut std::fs::File) -> bool {
    let mut start = [0; 16];
    let length = std::io::Read::read(file, &mut start).unwrap_or(0);
    crate::input::without_byte_order_mark(&start[..length]).trim_ascii_start().starts_with(b"$")
}

/// Returns the way to a file of another format.
fn cure_of(ending: &str) -> &'static str {
    match ending {
        "toml" => "if it is a case, `biotissue check` reads it",
        "txt" => "if it is a fiber network, `biotissue network check` reads it",
        "stl" | "obj" | "ply" | "off" => "it holds a surface: mesh its inside, for example with Gmsh or TetGen",
        "step" | "stp" | "iges" | "igs" | "brep" | "geo" => {
            "it holds a geometry: mesh it with Gmsh, and save it as .msh"
        }
        "vtk" => "save it as .vtu (in ParaView: Save Data; or `meshio convert a.vtk a.vtu`)",
        "meshb" => "save it as text, .mesh",
        _ => "convert it, for example by `meshio convert`, or give the file the ending of its format",
    }
}

/// Reads a file as text.
fn text_of(path: &Path, expected: &str) -> Result<String, InputError> {
    let bytes = std::fs::read(path).map_err(|error| InputError::unreadable(path, &error))?;
    let bytes = crate::input::without_byte_order_mark(&bytes);
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok(text.to_owned()),
        // Comments may be in another encoding; binary files have zeros.
        Err(_) if !bytes.contains(&0) => Ok(bytes.iter().map(|&byte| char::from(byte)).collect()),
        Err(_) => Err(InputError::in_file(path, "the file is not text", expected, "export the mesh as text")),
    }
}
