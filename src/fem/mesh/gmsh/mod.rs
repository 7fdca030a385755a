//! Gmsh `.msh` files, versions 2.2 and 4.1, text and binary.
//!
//! Physical groups of volumes become regions and physical groups of surfaces become surfaces; a group without a name is
//! named by its number. A file without volume groups has one region, `body`. The reader ignores points, lines, and
//! sections that do not describe the mesh. Tetrahedra and hexahedra of order 1 and 2 and wedges of order 1 are supported; the mesh has them grouped by type. Other
//! element types, and anything else that would silently change the results, cause an error with its position and a cure.
//!
//! The format is described in the [Gmsh reference manual](https://gmsh.info/doc/texinfo/gmsh.html#MSH-file-format).

mod assemble;
mod cursor;
mod element_type;
mod explain;
mod numbering;
mod numbers;
mod raw;
mod version2;
mod version4;
mod write;

use std::path::Path;

use super::Mesh;
use crate::input::{InputError, without_byte_order_mark};
use cursor::{Cursor, Encoding};
use raw::Raw;
pub use write::{Version, WriteOptions, to_writer, write, write_with};

/// The contents of a mesh file.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshFile {
    /// The mesh, with coordinates as in the file.
    pub mesh: Mesh,
    /// Messages to the user about omitted or corrected data, one sentence each.
    pub warnings: Vec<String>,
}

/// Reads a mesh file.
///
/// # Errors
/// Returns [`InputError`] if the file cannot be read, is damaged, or contains unsupported data.
pub fn read(path: &Path) -> Result<MeshFile, InputError> {
    let bytes = std::fs::read(path).map_err(|error| InputError::unreadable(path, &error))?;
    let raw = sections(&bytes, path)?;
    // A large file takes as much memory as the mesh.
    drop(bytes);
    assemble::assemble(raw, path)
}

/// Parses the contents of a mesh file; `path` is the file name in error messages.
///
/// # Errors
/// As for [`read`].
pub fn parse(bytes: &[u8], path: &Path) -> Result<MeshFile, InputError> {
    assemble::assemble(sections(bytes, path)?, path)
}

/// Reads the sections of a file.
fn sections(bytes: &[u8], path: &Path) -> Result<Raw, InputError> {
    let mut cursor = Cursor::new(without_byte_order_mark(bytes), path);
    let version = header(&mut cursor)?;
    let mut raw = Raw { version, ..Raw::default() };
    while let Some(section) = cursor.next_section()? {
        match (section.as_str(), version) {
            ("PhysicalNames", _) => raw.physical_names(&mut cursor)?,
            ("Nodes", Version::V2_2) => version2::nodes(&mut cursor, &mut raw)?,
            ("Elements", Version::V2_2) => version2::elements(&mut cursor, &mut raw)?,
            ("Entities", Version::V4_1) => version4::entities(&mut cursor, &mut raw)?,
            ("Nodes", Version::V4_1) => version4::nodes(&mut cursor, &mut raw)?,
            ("Elements", Version::V4_1) => version4::elements(&mut cursor, &mut raw)?,
            ("PartitionedEntities", Version::V4_1) => {
                let cure = "undo the partition in Gmsh (Unpartition) and export it again; \
                 elements are distributed when a run starts";
                return Err(cursor.error("the mesh is partitioned", "a mesh in one piece", cure));
            }
            _ => {
                cursor.skip_section()?;
                continue;
            }
        }
        cursor.end_section()?;
    }
    cursor.finish(&mut raw);
    Ok(raw)
}

/// Reads `$MeshFormat` and sets the encoding of the cursor.
fn header(cursor: &mut Cursor<'_>) -> Result<Version, InputError> {
    const EXPECTED: &str = "a Gmsh mesh file: its first line is `$MeshFormat`";
    const HINT: &str = "export the mesh as Gmsh `.msh`, version 4.1 or 2.2";
    let found = match cursor.opening() {
        None => Some("is empty".to_owned()),
        Some("$MeshFormat") => None,
        Some("$NOD") => Some("is a Gmsh file of version 1".to_owned()),
        Some(other) => Some(format!("begins with `{other}`: it is not a Gmsh mesh file")),
    };
    if let Some(problem) = found {
        return Err(InputError::in_file(cursor.path, problem, EXPECTED, HINT));
    }
    cursor.next_section()?;
    cursor.begin_row();
    let number = cursor.finite("the version of the format, 4.1 or 2.2")?;
    let version = match number {
        2.2 => Version::V2_2,
        4.1 => Version::V4_1,
        _ => {
            let cure =
                "open the file in Gmsh and export it as version 4.1 (`gmsh old.msh -save -format msh41 -o new.msh`)";
            return Err(cursor.error(format!("Gmsh format {number:?} is not supported"), "version 4.1 or 2.2", cure));
        }
    };
    let binary = match cursor.size("0 for text or 1 for binary")? {
        0 => false,
        1 => true,
        other => {
            let cure = "the file is damaged: export it again";
            return Err(cursor.error(format!("the file type is {other}"), "0 for text or 1 for binary", cure));
        }
    };
    let width = cursor.size("the size of the file's numbers in bytes, 8")?;
    if !(width == 8 || width == 4 && version == Version::V4_1) {
        let expected = if version == Version::V4_1 { "8 or 4" } else { "8" };
        let cure = "export the mesh again from Gmsh";
        return Err(cursor.error(format!("the data size is {width}"), format!("{expected} bytes"), cure));
    }
    cursor.end_row()?;
    if binary {
        let big_endian = cursor.byte_order()?;
        cursor.encoding = Encoding::Binary { big_endian, eight_byte_sizes: width == 8 };
    }
    cursor.end_section()?;
    Ok(version)
}

#[cfg(test)]
mod tests;
