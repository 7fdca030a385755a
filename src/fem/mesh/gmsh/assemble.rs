//! Construction of a checked mesh from the sections of a file.

use std::collections::BTreeMap;
use std::path::Path;

use super::MeshFile;
use super::cursor::DAMAGED;
use super::explain::ParsedFile;
use super::numbering::Numbering;
use super::raw::{Cell, Raw};
use crate::fem::element::CellType;
use crate::fem::mesh::parts::{GroupFaces, Parts, make_upright};
use crate::fem::mesh::{Elements, MeshError};
use crate::input::InputError;

/// Assembles the mesh.
pub(super) fn assemble(mut raw: Raw, path: &Path) -> Result<MeshFile, InputError> {
    let mut warnings = std::mem::take(&mut raw.warnings);
    raw.group_by_type();
    let source = ParsedFile { raw: &raw, path };
    source.check_not_empty()?;
    let numbering = source.numbering()?;
    let (elements, reversed) = source.elements(&numbering)?;
    if reversed > 0 {
        let [_, noun] = raw.volume_nouns();
        warnings.push(format!("{reversed} {noun} had a negative volume and have been reversed"));
    }
    let (regions, region_of) = source.regions()?;
    let groups = source.surfaces(&numbering)?;
    warnings.extend(source.empty_groups(&regions, &groups));

    let nodes = raw.nodes.iter().map(|node| node.position).collect();
    let parts = Parts { nodes, elements, region_of, regions, groups };
    parts.into_mesh(warnings, |error, groups| source.explain(error, groups))
}

impl ParsedFile<'_> {
    /// Checks that the file has nodes and elements with a volume.
    fn check_not_empty(&self) -> Result<(), InputError> {
        for section in ["Nodes", "Elements"] {
            if !self.raw.has(section) {
                let problem = format!("${section} is missing");
                return Err(self.error(0, problem, "a file with $Nodes and $Elements", DAMAGED));
            }
        }
        if self.raw.volumes.is_empty() {
            let problem = match self.raw.faces.len() {
                0 => "the mesh has no elements with a volume".to_owned(),
                faces => format!("the mesh has no elements with a volume, only {faces} faces"),
            };
            let cure = "mesh the volume (in Gmsh: Mesh, 3D), put it in a physical group (Gmsh saves nothing else if \
                        there are any groups), and export again";
            return Err(self.error(0, problem, "a body of tetrahedra, hexahedra or wedges", cure));
        }
        Ok(())
    }

    /// Returns the mapping of node tags to indices.
    fn numbering(&self) -> Result<Numbering, InputError> {
        let nodes = &self.raw.nodes;
        if u32::try_from(nodes.len()).is_err() {
            let problem = MeshError::TooLarge(nodes.len()).to_string();
            return Err(self.error(0, problem, "a smaller mesh", "coarsen the mesh"));
        }
        Numbering::new(nodes.iter().map(|node| node.tag)).map_err(|index| {
            let node = &nodes[index];
            let cure = "renumber the mesh in Gmsh (Mesh, Renumber) or export it again";
            self.error(node.line, format!("node {} is defined a second time", node.tag), "each node once", cure)
        })
    }

    /// Resolves the node tags of a cell to indices.
    fn resolve<T: CellType>(&self, numbering: &Numbering, cell: &Cell<T>, noun: &str) -> Result<Vec<u32>, InputError> {
        let tags = self.raw.tags(cell);
        let mut nodes = Vec::with_capacity(tags.len());
        for (k, &tag) in tags.iter().enumerate() {
            nodes.push(numbering.index(tag).ok_or_else(|| {
                let problem = format!("{noun} {} refers to node {tag}, which is not in $Nodes", cell.tag);
                self.error(cell.line, problem, "nodes of this file", DAMAGED)
            })?);
            if tags[..k].contains(&tag) {
                let problem = format!("{noun} {} has node {tag} twice", cell.tag);
                let cure = "remove the collapsed element or mesh again";
                return Err(self.error(cell.line, problem, "different nodes", cure));
            }
        }
        Ok(nodes)
    }

    /// Returns the elements, all with nonnegative volume, and the number of elements that had to be reversed.
    fn elements(&self, numbering: &Numbering) -> Result<(Elements, usize), InputError> {
        let positions: Vec<_> = self.raw.nodes.iter().map(|node| node.position).collect();
        let mut reversed = 0;
        let mut elements = Elements::default();
        for cell in &self.raw.volumes {
            let mut nodes = self.resolve(numbering, cell, cell.cell_type.nouns()[0])?;
            reversed += usize::from(make_upright(cell.cell_type, &mut nodes, &positions));
            elements.push(cell.cell_type, &nodes);
        }
        Ok((elements, reversed))
    }

    /// Returns the regions, in the order of their physical numbers, and the region of each element.
    fn regions(&self) -> Result<(Vec<String>, Vec<u32>), InputError> {
        let mut names = GroupNames::default();
        let mut of = Vec::with_capacity(self.raw.volumes.len());
        let mut without = 0;
        for cell in &self.raw.volumes {
            match self.raw.groups(3, cell) {
                [] => without += 1,
                [first, others @ ..] => {
                    let name = names.index(self.raw, 3, *first);
                    // Two groups of the same name form one region.
                    if let Some(other) = others.iter().find(|&&other| names.index(self.raw, 3, other) != name) {
                        let (one, other) = (self.raw.group_name(3, *first), self.raw.group_name(3, *other));
                        return Err(self.in_two_groups(cell, &one, &other));
                    }
                    of.push(name);
                }
            }
        }
        let total = self.raw.volumes.len();
        if without == total && !self.has_volume_groups() {
            return Ok((vec!["body".into()], vec![0; total]));
        }
        if without > 0 {
            let [_, noun] = self.raw.volume_nouns();
            let problem = format!("{without} of {total} {noun} are in no physical volume group");
            let expected = "every element in one physical volume group (or no such group at all)";
            let cure = "add the volumes left out to a physical group (and export with Mesh.SaveAll = 0: \
                 version 2.2 loses the groups otherwise), or remove all physical volume groups and their names";
            return Err(self.error(0, problem, expected, cure));
        }
        let (order, names) = names.in_order();
        Ok((names, of.into_iter().map(|name: u32| order[name as usize]).collect()))
    }

    /// Returns true if the file names a physical volume group or assigns a volume to one.
    fn has_volume_groups(&self) -> bool {
        self.raw.names.keys().any(|&(dimension, _)| dimension == 3)
            || self.raw.entities.iter().any(|(&(dimension, _), groups)| dimension == 3 && !groups.is_empty())
    }

    /// Returns the faces of each physical surface group, in the order of their numbers.
    fn surfaces(&self, numbering: &Numbering) -> Result<Vec<(String, GroupFaces)>, InputError> {
        let mut names = GroupNames::default();
        let mut surfaces: Vec<GroupFaces> = Vec::new();
        for (index, cell) in self.raw.faces.iter().enumerate() {
            let groups = self.raw.groups(2, cell);
            if groups.is_empty() {
                continue;
            }
            let nodes = self.resolve(numbering, cell, cell.cell_type.nouns()[0])?;
            for &group in groups {
                let name = names.index(self.raw, 2, group) as usize;
                surfaces.resize_with(surfaces.len().max(name + 1), Vec::new);
                // Two groups of the same name form one surface.
                if surfaces[name].last().is_none_or(|&(_, _, last)| last != index) {
                    surfaces[name].push((cell.cell_type, nodes.clone(), index));
                }
            }
        }
        let (order, names) = names.in_order();
        let mut sorted: Vec<(String, GroupFaces)> = names.into_iter().map(|name| (name, Vec::new())).collect();
        for (surface, index) in surfaces.into_iter().zip(order) {
            sorted[index as usize].1 = surface;
        }
        Ok(sorted)
    }

    /// Returns warnings about named physical groups without elements.
    fn empty_groups(&self, regions: &[String], surfaces: &[(String, GroupFaces)]) -> Vec<String> {
        let empty = self.raw.names.iter().filter(|&(&(dimension, _), name)| match dimension {
            2 => surfaces.iter().all(|(surface, _)| surface != name),
            3 => !regions.contains(name),
            _ => false,
        });
        let noun = |dimension| if dimension == 2 { "surface" } else { "volume" };
        empty
            .map(|(&(dimension, _), name)| {
                format!("the physical {} `{name}` has no elements and is left out", noun(dimension))
            })
            .collect()
    }
}

/// Names of groups, indexed in order of appearance.
#[derive(Default)]
struct GroupNames {
    /// The name index of each group found so far.
    groups: BTreeMap<i32, u32>,
    names: Vec<String>,
}

impl GroupNames {
    /// Returns the index of the name of a group; adds the name if it is new.
    fn index(&mut self, raw: &Raw, dimension: i32, group: i32) -> u32 {
        *self.groups.entry(group).or_insert_with(|| {
            let name = raw.group_name(dimension, group);
            let known = self.names.iter().position(|other| *other == name);
            let index = known.unwrap_or_else(|| {
                self.names.push(name);
                self.names.len() - 1
            });
            index as u32
        })
    }

    /// Sorts the names by their lowest group number; returns the new position of each name, and the sorted names.
    fn in_order(self) -> (Vec<u32>, Vec<String>) {
        let mut order = vec![u32::MAX; self.names.len()];
        let mut sorted = Vec::with_capacity(self.names.len());
        for &index in self.groups.values() {
            if order[index as usize] == u32::MAX {
                order[index as usize] = sorted.len() as u32;
                sorted.push(self.names[index as usize].clone());
            }
        }
        (order, sorted)
    }
}
