//! Error messages about a mesh in terms of the tags and lines of its file.

use std::collections::BTreeSet;
use std::path::Path;

use super::cursor::DAMAGED;
use super::raw::{Cell, Raw};
use crate::fem::element::ElementType;
use crate::fem::mesh::MeshError;
use crate::fem::mesh::parts::GroupFaces;
use crate::input::InputError;

const IMPROVE: &str = "improve the mesh (in Gmsh: Optimize 3D) or mesh again";

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
    pub fn in_two_groups(&self, cell: &Cell<ElementType>, first: &str, second: &str) -> InputError {
        let [noun, _] = cell.cell_type.nouns();
        let problem = format!("{noun} {} is in two physical volume groups, `{first}` and `{second}`", cell.tag);
        let cure = "remove its volume from one of the groups";
        self.error(cell.line, problem, "every element in one physical volume group", cure)
    }

    /// Translates a mesh error into an error with the tags and lines of the file.
    pub fn explain(&self, error: &MeshError, surfaces: &[(String, GroupFaces)]) -> InputError {
        let face = |surface: &str, index: usize| {
            let (_, group) = surfaces.iter().find(|(name, _)| name == surface)?;
            group.get(index).and_then(|&(_, _, cell)| self.raw.faces.get(cell))
        };
        let volume = |index: usize| self.raw.volumes.get(index);
        let explained = match error {
            MeshError::Flat { element, volume: found, longest_edge } => volume(*element).map(|cell| {
                let [noun, nouns] = cell.cell_type.nouns();
                let problem =
                    format!("{noun} {} is flat: its volume is {found:e}, its longest edge {longest_edge:e}", cell.tag);
                self.error(cell.line, problem, &format!("{nouns} with a volume"), IMPROVE)
            }),
            MeshError::Distorted { element, point, volume: found } => volume(*element).map(|cell| {
                let ([noun, nouns], order) = (cell.cell_type.nouns(), "or export it with element order 1");
                let problem = format!(
                    "{noun} {} is distorted: the volume of its integration point {point} is {found:e}",
                    cell.tag
                );
                let expected = format!("{nouns} with a positive volume everywhere");
                self.error(cell.line, problem, &expected, &format!("{IMPROVE}, {order}"))
            }),
            MeshError::Overlap { first, second, .. } => {
                volume(*first).zip(volume(*second)).map(|(first, second)| self.overlap(first, second))
            }
            MeshError::Nonconforming { first, second, .. } => {
                volume(*first).zip(volume(*second)).map(|(first, second)| {
                    let problem = format!(
                        "elements {} and {} have different nodes on the face they share",
                        first.tag, second.tag
                    );
                    let cure = "export all elements with one order (in Gmsh: Mesh.ElementOrder)";
                    self.error(second.line, problem, "equal nodes on both sides of a face", cure)
                })
            }
            MeshError::NotAFace { surface, face: index, .. } => face(surface, *index).map(|cell| {
                let noun = cell.cell_type.nouns()[0];
                let problem = format!("{noun} {} of surface `{surface}` is not a face of any element", cell.tag);
                let cure = "remove the surface from the physical group, or export also the volume that it belongs to";
                self.error(cell.line, problem, "surfaces that bound the body or lie in it", cure)
            }),
            MeshError::DuplicateFace { surface, first, second } => {
                face(surface, *first).zip(face(surface, *second)).map(|(first, second)| {
                    let nouns = second.cell_type.nouns()[1];
                    let problem =
                        format!("{nouns} {} and {} of surface `{surface}` are the same", first.tag, second.tag);
                    let cure = "remove duplicate elements (in Gmsh: Coherence Mesh) and export again";
                    self.error(second.line, problem, "each face of a surface once", cure)
                })
            }
            _ => None,
        };
        explained.unwrap_or_else(|| self.error(0, error.to_string(), "a valid mesh", DAMAGED))
    }

    /// Creates the error for two elements on the same side of a face: a duplicate, possibly in two groups, or an
    /// overlap.
    fn overlap(&self, first: &Cell<ElementType>, second: &Cell<ElementType>) -> InputError {
        let nodes = |cell| self.raw.tags(cell).iter().collect::<BTreeSet<_>>();
        let noun = match first.cell_type.nouns() == second.cell_type.nouns() {
            true => first.cell_type.nouns()[1],
            false => "elements",
        };
        let group = |cell| self.raw.groups(3, cell).first().map(|&group| self.raw.group_name(3, group));
        if nodes(first) == nodes(second) {
            if let (Some(one), Some(other)) = (group(first), group(second))
                && one != other
            {
                return self.in_two_groups(second, &one, &other);
            }
            let problem = format!("{noun} {} and {} are the same", first.tag, second.tag);
            let cure = "remove duplicate elements (in Gmsh: Coherence Mesh) and export again";
            return self.error(second.line, problem, "each element once", cure);
        }
        let problem =
            format!("{noun} {} and {} overlap: they lie on the same side of a face they share", first.tag, second.tag);
        let cure = "check the mesh for inverted and overlapping elements and mesh again";
        self.error(second.line, problem, "a body that does not overlap itself", cure)
    }
}
