//! Error messages about a mesh in terms of the tags and lines of its file.

use std::collections::BTreeSet;
use std::path::Path;

use super::assemble::Triangles;
use super::cursor::DAMAGED;
use super::raw::{Cell, Raw};
use crate::fem::mesh::MeshError;
use crate::input::InputError;

/// A parsed file with its path, for error messages.
pub(super) struct ParsedFile<'a> {
    pub raw: &'a Raw,
    pub path: &'a Path,
}

impl ParsedFile<'_> {
    /// Creates an error at a line; line 0 means the whole file.
    pub fn error(&self, line: u32, problem: String, expected: &str, cure: &str) -> InputError {
        match line {
            0 => InputError::in_file(self.path, problem, expected, cure),
            line => InputError::at_line(self.path, line as usize, problem, expected, cure),
        }
    }

    /// Creates the error for an element in two regions.
    pub fn in_two_groups(&self, cell: &Cell<4>, first: &str, second: &str) -> InputError {
        let problem = format!("tetrahedron {} is in two physical volume groups, `{first}` and `{second}`", cell.tag);
        let cure = "remove its volume from one of the groups";
        self.error(cell.line, problem, "every tetrahedron in one physical volume group", cure)
    }

    /// Translates a mesh error into an error with the tags and lines of the file.
    pub fn explain(&self, error: &MeshError, surfaces: &[(String, Triangles)]) -> InputError {
        let triangle = |surface: &str, index: usize| {
            let (_, group) = surfaces.iter().find(|(name, _)| name == surface)?;
            group.get(index).and_then(|&(_, cell)| self.raw.triangles.get(cell))
        };
        let tetrahedron = |index: usize| self.raw.tetrahedra.get(index);
        let explained = match error {
            MeshError::Flat { element, volume, longest_edge } => tetrahedron(*element).map(|cell| {
                let problem = format!(
                    "tetrahedron {} is flat: its volume is {volume:e}, its longest edge {longest_edge:e}",
                    cell.tag
                );
                let cure = "improve the mesh (in Gmsh: Optimize 3D) or mesh again";
                self.error(cell.line, problem, "tetrahedra with a volume", cure)
            }),
            MeshError::Overlap { first, second, .. } => {
                tetrahedron(*first).zip(tetrahedron(*second)).map(|(first, second)| self.overlap(first, second))
            }
            MeshError::NotAFace { surface, triangle: index, .. } => triangle(surface, *index).map(|cell| {
                let problem = format!("triangle {} of surface `{surface}` is not a face of any tetrahedron", cell.tag);
                let cure = "remove the surface from the physical group, or export also the volume that it belongs to";
                self.error(cell.line, problem, "surfaces that bound the body or lie in it", cure)
            }),
            MeshError::DuplicateTriangle { surface, first, second } => {
                triangle(surface, *first).zip(triangle(surface, *second)).map(|(first, second)| {
                    let problem =
                        format!("triangles {} and {} of surface `{surface}` are the same", first.tag, second.tag);
                    let cure = "remove duplicate elements (in Gmsh: Coherence Mesh) and export again";
                    self.error(second.line, problem, "each triangle of a surface once", cure)
                })
            }
            _ => None,
        };
        explained.unwrap_or_else(|| self.error(0, error.to_string(), "a valid mesh", DAMAGED))
    }

    /// Creates the error for two tetrahedra on the same side of a face: a duplicate, possibly in two groups, or an
    /// overlap.
    fn overlap(&self, first: &Cell<4>, second: &Cell<4>) -> InputError {
        let nodes = |cell: &Cell<4>| BTreeSet::from(cell.nodes);
        let group = |cell| self.raw.groups(3, cell).first().map(|&group| self.raw.group_name(3, group));
        if nodes(first) == nodes(second) {
            if let (Some(one), Some(other)) = (group(first), group(second))
                && one != other
            {
                return self.in_two_groups(second, &one, &other);
            }
            let problem = format!("tetrahedra {} and {} are the same", first.tag, second.tag);
            let cure = "remove duplicate elements (in Gmsh: Coherence Mesh) and export again";
            return self.error(second.line, problem, "each tetrahedron once", cure);
        }
        let problem = format!(
            "tetrahedra {} and {} overlap: they lie on the same side of a face they share",
            first.tag, second.tag
        );
        let cure = "check the mesh for inverted and overlapping elements and mesh again";
        self.error(second.line, problem, "a body that does not overlap itself", cure)
    }
}
