//! The data of the sections of a mesh file, before the mesh is assembled.

use std::collections::{BTreeMap, HashMap};

use super::Version;
use super::cursor::Cursor;
use super::element_type::{ElementTreatment, treatment};
use crate::fem::mesh::check::is_name;
use crate::input::{InputError, excerpt};

/// A node as stored in the file.
pub(super) struct RawNode {
    pub tag: u64,
    pub position: [f64; 3],
    /// Line of the node; 0 in a binary file.
    pub line: u32,
}

/// An element as stored in the file.
pub(super) struct Cell<const N: usize> {
    pub tag: u64,
    pub nodes: [u64; N],
    /// Version 2: the physical group, 0 for none. Version 4: the entity that contains the element.
    pub group: i32,
    /// Line of the element; 0 in a binary file.
    pub line: u32,
}

/// All data read from a file.
#[derive(Default)]
pub(super) struct Raw {
    pub version: Version,
    pub nodes: Vec<RawNode>,
    pub tetrahedra: Vec<Cell<4>>,
    pub triangles: Vec<Cell<3>>,
    /// Names of physical groups by dimension and number.
    pub names: BTreeMap<(i32, i32), String>,
    /// The physical groups of an entity, by dimension and tag (version 4).
    pub entities: HashMap<(i32, i32), Vec<i32>>,
    pub warnings: Vec<String>,
    /// The sections found so far.
    pub seen: Vec<&'static str>,
}

impl Raw {
    /// Records that a section has been found.
    ///
    /// # Errors
    /// Returns an error if the section was found before.
    pub fn once(&mut self, cursor: &Cursor<'_>, section: &'static str) -> Result<(), InputError> {
        if self.seen.contains(&section) {
            let cure = "the file contains several meshes or is damaged: export one mesh per file";
            return Err(cursor.error(format!("a second ${section}"), format!("one ${section} in a file"), cure));
        }
        self.seen.push(section);
        Ok(())
    }

    pub fn has(&self, section: &str) -> bool {
        self.seen.contains(&section)
    }

    /// Returns the physical groups of a cell of this dimension; empty if it has none.
    pub fn groups<'a, const N: usize>(&'a self, dimension: i32, cell: &'a Cell<N>) -> &'a [i32] {
        match self.version {
            Version::V2_2 if cell.group == 0 => &[],
            Version::V2_2 => std::slice::from_ref(&cell.group),
            Version::V4_1 => self.entities.get(&(dimension, cell.group)).map_or(&[], Vec::as_slice),
        }
    }

    /// Returns the name of a physical group, or its number if it has no name.
    pub fn group_name(&self, dimension: i32, number: i32) -> String {
        self.names.get(&(dimension, number)).cloned().unwrap_or_else(|| number.to_string())
    }

    /// Reads `$PhysicalNames`, which is text in binary files too.
    pub fn physical_names(&mut self, cursor: &mut Cursor<'_>) -> Result<(), InputError> {
        const ROW: &str = "a dimension, a number and a name between double quotes, as in `3 1 \"gauge\"`";
        self.once(cursor, "PhysicalNames")?;
        let count = cursor.text_count("the number of physical names")?;
        cursor.expect_count("physical names", count);
        for _ in 0..count {
            let dimension = cursor.text_integer(ROW)?;
            let number = cursor.text_integer(ROW)?;
            let quoted = cursor.rest_of_line();
            let name = quoted.strip_prefix('"').and_then(|rest| rest.strip_suffix('"'));
            let Some(name) = name else {
                let quoted = excerpt(&quoted);
                let problem = format!("the name of physical group {number} is `{quoted}`: not between double quotes");
                return Err(cursor.error(problem, ROW, "put the name between double quotes"));
            };
            if !is_name(name) || name.contains(char::REPLACEMENT_CHARACTER) {
                let problem = format!("physical group {number} is called `{}`", excerpt(name));
                let cure = "rename the physical group and export the mesh again";
                return Err(cursor.error(problem, "a name of printable characters without quotes", cure));
            }
            if let Some(first) = self.names.insert((dimension, number.saturating_abs()), name.to_owned()) {
                let problem =
                    format!("physical group {number} of dimension {dimension} is called both `{first}` and `{name}`");
                return Err(cursor.error(problem, "one name per group", "remove one of the two lines"));
            }
            cursor.count_one();
        }
        Ok(())
    }

    /// Reads the nodes of an element and stores triangles and tetrahedra.
    pub fn element(
        &mut self,
        cursor: &mut Cursor<'_>,
        (treatment, group, tag): (ElementTreatment, i32, u64),
    ) -> Result<(), InputError> {
        let line = cursor.line();
        let version = self.version;
        let node = |cursor: &mut Cursor<'_>, expected| match version {
            Version::V2_2 => cursor.small_size(expected),
            Version::V4_1 => cursor.size(expected),
        };
        match treatment {
            ElementTreatment::Ignored(count) => {
                for _ in 0..count {
                    node(cursor, "a node of a point or line")?;
                }
            }
            ElementTreatment::Triangle => {
                let mut nodes = [0; 3];
                for slot in &mut nodes {
                    *slot = node(cursor, "the three nodes of a triangle")?;
                }
                self.triangles.push(Cell { tag, nodes, group, line });
            }
            ElementTreatment::Tetrahedron => {
                let mut nodes = [0; 4];
                for slot in &mut nodes {
                    *slot = node(cursor, "the four nodes of a tetrahedron")?;
                }
                self.tetrahedra.push(Cell { tag, nodes, group, line });
            }
        }
        Ok(())
    }
}

/// Returns the treatment of the element type just read.
pub(super) fn element_treatment(cursor: &Cursor<'_>, number: i32) -> Result<ElementTreatment, InputError> {
    treatment(number).map_err(|(name, cure)| {
        let problem = format!("the mesh has {name}");
        cursor.error(problem, "4-node tetrahedra and 3-node triangles (points and lines are ignored)", cure)
    })
}
