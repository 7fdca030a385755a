//! The data of the sections of a mesh file, before the mesh is assembled.

use std::collections::{BTreeMap, HashMap};

use super::Version;
use super::cursor::Cursor;
use super::element_type::{ElementTreatment, GmshType, treatment};
use crate::fem::element::{CellType, ElementType, FaceType};
use crate::fem::mesh::check::is_name;
use crate::input::{InputError, excerpt};

/// A node as stored in the file.
pub(super) struct RawNode {
    pub tag: u64,
    pub position: [f64; 3],
    /// Line of the node; 0 in a binary file.
    pub line: u32,
}

/// An element as stored in the file, a volume or a face.
pub(super) struct Cell<T> {
    pub cell_type: T,
    pub tag: u64,
    /// The start of its nodes in [`Raw::node_tags`].
    start: usize,
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
    pub volumes: Vec<Cell<ElementType>>,
    pub faces: Vec<Cell<FaceType>>,
    /// The nodes of all cells, in the order of the crate.
    pub node_tags: Vec<u64>,
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
    pub fn groups<'a, T>(&'a self, dimension: i32, cell: &'a Cell<T>) -> &'a [i32] {
        match self.version {
            Version::V2_2 if cell.group == 0 => &[],
            Version::V2_2 => std::slice::from_ref(&cell.group),
            Version::V4_1 => self.entities.get(&(dimension, cell.group)).map_or(&[], Vec::as_slice),
        }
    }

    /// Returns the node tags of a cell, in the order of the crate.
    pub fn tags<T: CellType>(&self, cell: &Cell<T>) -> &[u64] {
        &self.node_tags[cell.start..cell.start + cell.cell_type.nodes()]
    }

    /// Returns the nouns of the volumes in the file, singular and plural: `tetrahedron`, or `element` for several types.
    pub fn volume_nouns(&self) -> [&'static str; 2] {
        let mut nouns = self.volumes.iter().map(|cell| cell.cell_type.nouns());
        nouns.next().filter(|first| nouns.all(|other| other == *first)).unwrap_or(["element", "elements"])
    }

    /// Returns the name of a physical group, or its number if it has no name.
    pub fn group_name(&self, dimension: i32, number: i32) -> String {
        self.names.get(&(dimension, number)).cloned().unwrap_or_else(|| number.to_string())
    }

    /// Groups volumes and faces by their types; the order within a type does not change.
    pub fn group_by_type(&mut self) {
        self.volumes.sort_by_key(|cell| cell.cell_type);
        self.faces.sort_by_key(|cell| cell.cell_type);
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

    /// Reads the nodes of an element and stores faces and volumes.
    pub fn element(
        &mut self,
        cursor: &mut Cursor<'_>,
        (treatment, group, tag): (ElementTreatment, i32, u64),
    ) -> Result<(), InputError> {
        match treatment {
            ElementTreatment::Ignored(count) => {
                for _ in 0..count {
                    self.node(cursor, "a node of a point or line")?;
                }
            }
            ElementTreatment::Face(face_type) => {
                let cell = self.cell(cursor, face_type, group, tag)?;
                self.faces.push(cell);
            }
            ElementTreatment::Volume(element_type) => {
                let cell = self.cell(cursor, element_type, group, tag)?;
                self.volumes.push(cell);
            }
        }
        Ok(())
    }

    fn node(&self, cursor: &mut Cursor<'_>, expected: &str) -> Result<u64, InputError> {
        match self.version {
            Version::V2_2 => cursor.small_size(expected),
            Version::V4_1 => cursor.size(expected),
        }
    }

    /// Reads the nodes of a cell.
    fn cell<T: GmshType>(
        &mut self,
        cursor: &mut Cursor<'_>,
        cell_type: T,
        group: i32,
        tag: u64,
    ) -> Result<Cell<T>, InputError> {
        let (line, start, count) = (cursor.line(), self.node_tags.len(), cell_type.nodes());
        let mut tags = [0; MAX_NODES];
        for slot in &mut tags[..count] {
            *slot = self.node(cursor, cell_type.expected())?;
        }
        match cell_type.places() {
            None => self.node_tags.extend_from_slice(&tags[..count]),
            Some(places) => self.node_tags.extend(places.iter().map(|&place| tags[place])),
        }
        Ok(Cell { cell_type, tag, start, group, line })
    }
}

/// Nodes of the element type with most nodes.
const MAX_NODES: usize = 27;

/// Returns the treatment of the element type just read.
pub(super) fn element_treatment(cursor: &Cursor<'_>, number: i32) -> Result<ElementTreatment, InputError> {
    treatment(number).map_err(|(name, cure)| {
        let problem = format!("the mesh has {name}");
        let expected = "tetrahedra and hexahedra of order 1 or 2, wedges of order 1, and their faces (points and lines \
                        are ignored)";
        cursor.error(problem, expected, cure)
    })
}
