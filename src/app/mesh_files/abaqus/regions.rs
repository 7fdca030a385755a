//! Regions and surfaces: sets and surfaces of the file that have elements.

use std::collections::HashSet;
use std::path::Path;

use super::{EXPECTED, Element, ElementSurface, Member, Model, Set};
use crate::app::mesh_files::assemble::{Boundary, Face, Volume, face_with_corners};
use crate::fem::element::{CellType, ElementType};
use crate::input::{InputError, excerpt};

/// The corners of the sides of solid elements in Abaqus, from 1; side `S1` is the first one.
const TETRAHEDRON: &[&[usize]] = &[&[1, 2, 3], &[1, 4, 2], &[2, 4, 3], &[3, 4, 1]];
const HEXAHEDRON: &[&[usize]] =
    &[&[1, 2, 3, 4], &[5, 8, 7, 6], &[1, 5, 6, 2], &[2, 6, 7, 3], &[3, 7, 8, 4], &[4, 8, 5, 1]];
const WEDGE: &[&[usize]] = &[&[1, 2, 3], &[4, 6, 5], &[1, 4, 5, 2], &[2, 5, 6, 3], &[3, 6, 4, 1]];

fn sides(element_type: ElementType) -> &'static [&'static [usize]] {
    match element_type {
        ElementType::Tet4 | ElementType::Tet10 => TETRAHEDRON,
        ElementType::Hex8 | ElementType::Hex20 | ElementType::Hex27 => HEXAHEDRON,
        ElementType::Wedge6 => WEDGE,
    }
}

/// The volumes and faces of a set of elements.
struct Selected {
    volumes: Vec<usize>,
    faces: Vec<usize>,
}

/// Returns the numbers in a set, also those of the sets in it.
fn numbers(path: &Path, sets: &[Set<'_>], member: &Member<'_>, line: usize) -> Result<Vec<i64>, InputError> {
    let (mut numbers, mut known) = (Vec::new(), HashSet::new());
    let mut open = vec![(line, member)];
    while let Some((line, member)) = open.pop() {
        match member {
            Member::Number(number) => numbers.push(*number),
            Member::Set(name) => {
                let set = sets.iter().find(|set| set.name.eq_ignore_ascii_case(name)).ok_or_else(|| {
                    let problem = format!("there is no set `{}`", excerpt(name));
                    InputError::at_line(path, line, problem, EXPECTED, "correct the name, or export the set too")
                })?;
                if known.insert(set.name) {
                    open.extend(set.members.iter().rev().map(|(line, member)| (*line, member)));
                }
            }
        }
    }
    Ok(numbers)
}

impl Model<'_> {
    fn selected(&self, path: &Path, member: &Member<'_>, line: usize) -> Result<Selected, InputError> {
        let mut selected = Selected { volumes: Vec::new(), faces: Vec::new() };
        for number in numbers(path, &self.element_sets, member, line)? {
            match self.elements.get(&number) {
                Some(Element::Volume(volume)) => selected.volumes.push(*volume),
                Some(Element::Face(face)) => selected.faces.push(*face),
                // Sets may name elements that the file does not have.
                Some(Element::Ignored) | None => {}
            }
        }
        Ok(selected)
    }

    /// Gives every element a region: the element set of its solid section; without sections, the set given by `*ELSET`
    /// that contains it, if these divide the body, or else that given by `*ELEMENT`.
    pub fn assign_regions(&mut self, path: &Path) -> Result<(), InputError> {
        if !self.sections.is_empty() {
            let sections: Vec<_> = self.sections.iter().map(|&(line, name)| (line, super::local_name(name))).collect();
            let regions = self.assigned(path, &sections)?.map_err(|error| *error)?;
            self.set_regions(&sections, &regions);
            return Ok(());
        }
        let of = |is_of_elements: bool| -> Vec<(usize, &str)> {
            let sets = self.element_sets.iter().filter(|set| set.is_of_elements == is_of_elements);
            sets.map(|set| (set.line, set.name)).collect()
        };
        for is_of_elements in [false, true] {
            let names = of(is_of_elements);
            if let Ok(regions) = self.assigned(path, &names)?
                && (is_of_elements || regions.iter().all(Option::is_some))
            {
                let names: Vec<(usize, String)> =
                    names.iter().map(|(line, name)| (*line, (*name).to_owned())).collect();
                let names: Vec<(usize, &str)> = names.iter().map(|(line, name)| (*line, name.as_str())).collect();
                self.set_regions(&names, &regions);
                return Ok(());
            }
        }
        self.set_regions(&[], &vec![None; self.contents.volumes.len()]);
        Ok(())
    }

    /// Returns the index of the set of each element; the inner error names an element in two sets.
    fn assigned(
        &self,
        path: &Path,
        sets: &[(usize, &str)],
    ) -> Result<Result<Vec<Option<usize>>, Box<InputError>>, InputError> {
        let mut regions = vec![None; self.contents.volumes.len()];
        for (number, &(line, name)) in sets.iter().enumerate() {
            for volume in self.selected(path, &Member::Set(name), line)?.volumes {
                match regions[volume].replace(number) {
                    Some(other) if other != number && sets[other].1 != name => {
                        let id = self.contents.volumes[volume].id;
                        let problem = format!("element {id} is in two sections, of `{}` and `{name}`", sets[other].1);
                        let cure = "remove it from one of the sets";
                        return Ok(Err(Box::new(InputError::at_line(path, line, problem, EXPECTED, cure))));
                    }
                    _ => {}
                }
            }
        }
        Ok(Ok(regions))
    }

    fn set_regions(&mut self, sets: &[(usize, &str)], regions: &[Option<usize>]) {
        let names: Vec<String> = sets.iter().map(|(_, name)| (*name).to_owned()).collect();
        for (volume, region) in regions.iter().enumerate() {
            let region = self.contents.region(region.map_or("body", |region| &names[region]));
            self.contents.volumes[volume].region = region;
        }
    }

    /// Adds the surfaces of elements, the sets of shells and membranes, and the sets of nodes.
    pub fn add_surfaces(&mut self, path: &Path) -> Result<(), InputError> {
        let surfaces = std::mem::take(&mut self.surfaces);
        let mut added = Vec::new();
        for surface in &surfaces {
            added.push((surface.name.to_owned(), self.faces_of(path, surface)?));
        }
        // Sets of `*ELEMENT` count only where no other set contains faces.
        for is_of_elements in [false, true] {
            for set in self.element_sets.iter().filter(|set| set.is_of_elements == is_of_elements) {
                let faces = self.selected(path, &Member::Set(set.name), set.line)?.faces;
                let faces: Vec<Face> = faces.into_iter().map(|face| self.faces[face].1.clone()).collect();
                if !faces.is_empty() && !added.iter().any(|(name, _)| name.eq_ignore_ascii_case(set.name)) {
                    added.push((set.name.to_owned(), faces));
                }
            }
            if added.len() > surfaces.len() {
                break;
            }
        }
        self.contents.surfaces = added.into_iter().filter(|(_, faces)| !faces.is_empty()).collect();
        let mut sets = Vec::new();
        for set in &self.node_sets {
            let nodes = numbers(path, &self.node_sets, &Member::Set(set.name), set.line)?;
            let nodes = nodes.iter().filter_map(|id| self.node_of.get(id).copied()).collect();
            sets.push((set.name.to_owned(), nodes, set.line));
        }
        self.contents.add_node_sets(&sets);
        Ok(())
    }

    fn faces_of(&self, path: &Path, surface: &ElementSurface<'_>) -> Result<Vec<Face>, InputError> {
        let mut faces = Vec::new();
        for (line, member, side) in &surface.sides {
            let Selected { volumes, faces: flat } = self.selected(path, member, *line)?;
            faces.extend(flat.into_iter().map(|face| Face { line: *line, ..self.faces[face].1.clone() }));
            if side.is_empty() {
                let chosen: HashSet<usize> = volumes.into_iter().collect();
                let boundary = Boundary::of(&self.contents.volumes);
                let of_chosen = boundary.faces.into_iter().zip(boundary.volume_of);
                let of_chosen = of_chosen.filter(|(_, volume)| chosen.contains(volume));
                faces.extend(of_chosen.map(|((face_type, nodes), _)| Face { face_type, nodes, line: *line }));
                continue;
            }
            for volume in volumes {
                let volume = &self.contents.volumes[volume];
                let (face_type, nodes) = side_of(volume, side).ok_or_else(|| {
                    let problem = format!("element {} has no side `{}`", volume.id, excerpt(side));
                    InputError::at_line(path, *line, problem, EXPECTED, "name a side S1, S2, ... of its elements")
                })?;
                faces.push(Face { face_type, nodes, line: *line });
            }
        }
        Ok(faces)
    }
}

fn side_of(volume: &Volume, side: &str) -> Option<(crate::fem::element::FaceType, Vec<u32>)> {
    let number: usize = side.trim_start_matches(['S', 's']).parse().ok()?;
    let corners = sides(volume.element_type).get(number.checked_sub(1)?)?;
    let nodes: Vec<u32> = corners.iter().map(|&corner| volume.nodes[corner - 1]).collect();
    debug_assert!(nodes.len() <= volume.element_type.corners());
    face_with_corners(volume, &nodes)
}
