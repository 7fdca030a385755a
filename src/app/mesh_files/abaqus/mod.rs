//! Input files of Abaqus (`.inp`), as Abaqus, Gmsh, HyperMesh, Coreform Cubit and meshio write them: their meshes.

mod keywords;
mod regions;

use std::collections::HashMap;
use std::path::Path;

use super::assemble::{Contents, Face, Volume};
use super::text_of;
use crate::fem::element::{CellType, ElementType, FaceType};
use crate::fem::mesh::gmsh::MeshFile;
use crate::input::{InputError, excerpt};
use keywords::{Block, blocks};

const EXPECTED: &str = "an input file of Abaqus (.inp) with *NODE, *ELEMENT, sets and surfaces";
const DAMAGED: &str = "correct the line, or export the mesh again";

/// Keywords that make nodes or elements, which this reader does not.
const GENERATORS: [&str; 10] = [
    "INCLUDE",
    "SYSTEM",
    "NGEN",
    "NFILL",
    "NCOPY",
    "NMAP",
    "ELGEN",
    "ELCOPY",
    "SUBMODEL",
    "SYMMETRIC MODEL GENERATION",
];

/// What an element of the file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Volume(ElementType),
    Face(FaceType),
    /// A truss, a mass or the like.
    Ignored,
}

/// Returns the kind of a type of elements; `None` for solids that are not supported.
fn kind(name: &str) -> Option<Kind> {
    // Acoustic, thermal and other elements of the same form.
    let solid = name.find("C3D").filter(|&at| at <= 2).map(|at| &name[at + 3..]);
    if let Some(form) = solid {
        let nodes: String = form.chars().take_while(char::is_ascii_digit).collect();
        return Some(Kind::Volume(match nodes.as_str() {
            "4" => ElementType::Tet4,
            "6" => ElementType::Wedge6,
            "8" => ElementType::Hex8,
            "10" => ElementType::Tet10,
            "20" => ElementType::Hex20,
            _ => return None,
        }));
    }
    let flat = ["CPS", "CPE", "CPEG", "STRI", "SFM3D", "M3D", "DS", "S", "SC", "R3D"];
    let digits = name.find(|c: char| c.is_ascii_digit()).unwrap_or(name.len());
    let (prefix, nodes) = match name.strip_prefix("SFM3D").or(name.strip_prefix("M3D")).or(name.strip_prefix("R3D")) {
        Some(nodes) => ("M3D", nodes),
        None => name.split_at(digits),
    };
    if prefix == "SC" {
        return None;
    }
    let face = match nodes.trim_end_matches(|c: char| c.is_ascii_alphabetic()) {
        "3" => FaceType::Tri3,
        "6" | "65" => FaceType::Tri6,
        "4" => FaceType::Quad4,
        "8" => FaceType::Quad8,
        "9" => FaceType::Quad9,
        _ => return Some(Kind::Ignored),
    };
    Some(if flat.contains(&prefix) { Kind::Face(face) } else { Kind::Ignored })
}

/// An element of the file, by its number.
#[derive(Clone, Copy, Debug)]
enum Element {
    Volume(usize),
    Face(usize),
    Ignored,
}

/// A member of a set.
enum Member<'a> {
    Number(i64),
    Set(&'a str),
}

/// A set of nodes or elements, with the line that names it first.
struct Set<'a> {
    name: &'a str,
    line: usize,
    members: Vec<(usize, Member<'a>)>,
    /// Whether it is given by `*ELEMENT` alone.
    is_of_elements: bool,
}

/// A surface of parts of elements: `*SURFACE`.
struct ElementSurface<'a> {
    name: &'a str,
    /// Elements, and the name of a side.
    sides: Vec<(usize, Member<'a>, &'a str)>,
}

/// What was read so far.
#[derive(Default)]
struct Model<'a> {
    contents: Contents,
    node_of: HashMap<i64, u32>,
    elements: HashMap<i64, Element>,
    /// The numbers of the volumes and faces in `contents` and `faces`.
    faces: Vec<(i64, Face)>,
    node_sets: Vec<Set<'a>>,
    element_sets: Vec<Set<'a>>,
    surfaces: Vec<ElementSurface<'a>>,
    /// The element sets of solid sections.
    sections: Vec<(usize, &'a str)>,
    instances: usize,
    /// The name of the part with the nodes.
    part: Option<&'a str>,
}

/// Reads a mesh.
pub(super) fn read(path: &Path) -> Result<MeshFile, InputError> {
    let text = text_of(path, EXPECTED)?;
    let mut model = Model::default();
    let mut part = "";
    for block in blocks(&text) {
        let error = |line: usize, problem: String, cure: &str| InputError::at_line(path, line, problem, EXPECTED, cure);
        match block.keyword.as_str() {
            "NODE" => {
                if *model.part.get_or_insert(part) != part {
                    let cure = "merge the parts, or write the file without parts and assemblies";
                    return Err(error(block.line, "several parts have nodes".into(), cure));
                }
                model.read_nodes(path, &block)?;
            }
            "ELEMENT" => model.read_elements(path, &block)?,
            "NSET" => read_set(path, &block, "NSET", &mut model.node_sets)?,
            "ELSET" => read_set(path, &block, "ELSET", &mut model.element_sets)?,
            "SURFACE" => model.read_surface(&block),
            "SOLID SECTION" => model.sections.extend(block.parameter("ELSET").map(|set| (block.line, set))),
            "PART" => part = block.parameter("NAME").unwrap_or_default(),
            "INSTANCE" => {
                model.instances += 1;
                if model.instances > 1 {
                    let cure = "merge the instances into one part in Abaqus/CAE, and mesh that";
                    return Err(error(block.line, "the assembly has several instances".into(), cure));
                }
                if let Some((line, _)) = block.data.first() {
                    let cure = "move the part instead of its instance, or remove the line";
                    return Err(error(*line, "the instance is translated or rotated".into(), cure));
                }
            }
            keyword if GENERATORS.contains(&keyword) => {
                let cure = "write all nodes and elements in this file, in Cartesian coordinates";
                return Err(error(block.line, format!("*{keyword} is not read"), cure));
            }
            _ => {}
        }
    }
    model.assign_regions(path)?;
    model.add_surfaces(path)?;
    model.contents.into_mesh(path)
}

impl<'a> Model<'a> {
    fn read_nodes(&mut self, path: &Path, block: &Block<'a>) -> Result<(), InputError> {
        let mut members = Vec::new();
        for (line, words) in &block.data {
            let invalid = |problem: String| InputError::at_line(path, *line, problem, EXPECTED, DAMAGED);
            let id = words.first().and_then(|word| word.parse::<i64>().ok());
            let id = id.ok_or_else(|| invalid("the number of a node is missing".into()))?;
            // Missing coordinates are zero.
            let mut position = [0.0; 3];
            for (x, word) in position.iter_mut().zip(&words[1..]).filter(|(_, word)| !word.is_empty()) {
                // Fortran's exponent.
                let number = word.replace(['d', 'D'], "e").parse::<f64>().ok().filter(|number| number.is_finite());
                *x = number.ok_or_else(|| invalid(format!("`{}` is not a coordinate", excerpt(word))))?;
            }
            let index = self.contents.nodes.len() as u32;
            if self.node_of.insert(id, index).is_some() {
                return Err(invalid(format!("node {id} occurs twice")));
            }
            self.contents.nodes.push(position);
            members.push((*line, Member::Number(id)));
        }
        if let Some(name) = block.parameter("NSET") {
            set_of(&mut self.node_sets, name, block.line).members.extend(members);
        }
        Ok(())
    }

    fn read_elements(&mut self, path: &Path, block: &Block<'a>) -> Result<(), InputError> {
        let name = block.parameter("TYPE").unwrap_or_default().to_ascii_uppercase();
        let kind = kind(&name).ok_or_else(|| {
            let expected = "C3D4, C3D10, C3D8, C3D20 and C3D6 (also R, H, M, ...), and shells or membranes as surfaces";
            let problem = format!("elements of type {}", excerpt(&name));
            InputError::at_line(path, block.line, problem, expected, "mesh the body with these elements")
        })?;
        let count = match kind {
            Kind::Volume(of) => Some(of.nodes()),
            Kind::Face(of) => Some(of.nodes()),
            Kind::Ignored => None,
        };
        let (mut pending, mut line_of): (Vec<&str>, usize) = (Vec::new(), 0);
        let mut members = Vec::new();
        for (line, words) in &block.data {
            if pending.is_empty() {
                line_of = *line;
            }
            pending.extend(words.iter().filter(|word| !word.is_empty()));
            let Some(count) = count else {
                let id = pending.first().and_then(|word| word.parse().ok());
                self.elements.extend(id.map(|id: i64| (id, Element::Ignored)));
                pending.clear();
                continue;
            };
            if pending.len() <= count {
                continue;
            }
            let id = self.add_element(path, kind, line_of, &pending)?;
            members.push((line_of, Member::Number(id)));
            pending.clear();
        }
        if !pending.is_empty() {
            let problem = format!("the element has {} of {} nodes", pending.len() - 1, count.unwrap_or(0));
            return Err(InputError::at_line(path, line_of, problem, EXPECTED, DAMAGED));
        }
        if let Some(name) = block.parameter("ELSET") {
            let is_new = !self.element_sets.iter().any(|set| set.name.eq_ignore_ascii_case(name));
            let set = set_of(&mut self.element_sets, name, block.line);
            set.is_of_elements |= is_new;
            set.members.extend(members);
        }
        Ok(())
    }

    /// Adds an element, given its number and its nodes.
    fn add_element(&mut self, path: &Path, kind: Kind, line: usize, words: &[&str]) -> Result<i64, InputError> {
        let invalid = |problem: String| InputError::at_line(path, line, problem, EXPECTED, DAMAGED);
        let number =
            |word: &&str| word.parse::<i64>().map_err(|_| invalid(format!("`{}` is not a number", excerpt(word))));
        let numbers = words.iter().map(number).collect::<Result<Vec<i64>, _>>()?;
        let (id, of) = numbers.split_first().ok_or_else(|| invalid("an element without number".into()))?;
        let node = |id: &i64| self.node_of.get(id).copied().ok_or_else(|| invalid(format!("there is no node {id}")));
        let nodes = of.iter().map(node).collect::<Result<Vec<u32>, _>>()?;
        let expected = match kind {
            Kind::Volume(of) => of.nodes(),
            Kind::Face(of) => of.nodes(),
            Kind::Ignored => nodes.len(),
        };
        if nodes.len() != expected {
            return Err(invalid(format!("the element has {} nodes, not {expected}", nodes.len())));
        }
        let element = match kind {
            Kind::Volume(element_type) => {
                self.contents.volumes.push(Volume { element_type, nodes, id: *id, line, region: 0 });
                Element::Volume(self.contents.volumes.len() - 1)
            }
            Kind::Face(face_type) => {
                self.faces.push((*id, Face { face_type, nodes, line }));
                Element::Face(self.faces.len() - 1)
            }
            Kind::Ignored => Element::Ignored,
        };
        match self.elements.insert(*id, element) {
            Some(_) => Err(invalid(format!("element {id} occurs twice"))),
            None => Ok(*id),
        }
    }

    fn read_surface(&mut self, block: &Block<'a>) {
        let Some(name) = block.parameter("NAME") else { return };
        if block.parameter("TYPE").is_some_and(|of| of.eq_ignore_ascii_case("NODE")) {
            let members = block.data.iter().filter_map(|(line, words)| Some((*line, member(words.first()?))));
            let members: Vec<_> = members.collect();
            set_of(&mut self.node_sets, name, block.line).members.extend(members);
            return;
        }
        let side = |(line, words): &(usize, Vec<&'a str>)| {
            Some((*line, member(words.first()?), words.get(1).copied().unwrap_or_default()))
        };
        self.surfaces.push(ElementSurface { name, sides: block.data.iter().filter_map(side).collect() });
    }
}

/// Returns the set of this name, which is added if there is none.
fn set_of<'a, 'b>(sets: &'b mut Vec<Set<'a>>, name: &'a str, line: usize) -> &'b mut Set<'a> {
    let known = sets.iter().position(|set| set.name.eq_ignore_ascii_case(name)).unwrap_or_else(|| {
        sets.push(Set { name, line, members: Vec::new(), is_of_elements: false });
        sets.len() - 1
    });
    &mut sets[known]
}

fn member<'a>(word: &&'a str) -> Member<'a> {
    word.parse().map_or_else(|_| Member::Set(local_name(word)), Member::Number)
}

/// Returns a name without that of its instance.
fn local_name(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(_, local)| local)
}

fn read_set<'a>(path: &Path, block: &Block<'a>, key: &str, sets: &mut Vec<Set<'a>>) -> Result<(), InputError> {
    let Some(name) = block.parameter(key) else { return Ok(()) };
    let is_generated = block.has("GENERATE");
    let mut members = Vec::new();
    for (line, words) in &block.data {
        let words = words.iter().filter(|word| !word.is_empty());
        if !is_generated {
            members.extend(words.map(|word| (*line, member(word))));
            continue;
        }
        let numbers: Option<Vec<i64>> = words.map(|word| word.parse().ok()).collect();
        let (first, last, step) = match numbers.as_deref() {
            Some([first, last]) => (*first, *last, 1),
            Some([first, last, step]) if *step > 0 => (*first, *last, *step),
            _ => {
                let problem = "a generated set needs a first number, a last one and a step";
                return Err(InputError::at_line(path, *line, problem, EXPECTED, DAMAGED));
            }
        };
        let numbers = std::iter::successors(Some(first), |number| number.checked_add(step));
        // As many as a mesh can have.
        let numbers = numbers.take_while(|number| *number <= last).take(u32::MAX as usize);
        members.extend(numbers.map(|number| (*line, Member::Number(number))));
    }
    let set = set_of(sets, name, block.line);
    set.is_of_elements = false;
    set.members.extend(members);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_of_elements() {
        for (name, expected) in [
            ("C3D4", Some(Kind::Volume(ElementType::Tet4))),
            ("C3D10MH", Some(Kind::Volume(ElementType::Tet10))),
            ("DC3D8", Some(Kind::Volume(ElementType::Hex8))),
            ("C3D20R", Some(Kind::Volume(ElementType::Hex20))),
            ("C3D6", Some(Kind::Volume(ElementType::Wedge6))),
            ("C3D15", None),
            ("SC8R", None),
            ("S3", Some(Kind::Face(FaceType::Tri3))),
            ("S4R", Some(Kind::Face(FaceType::Quad4))),
            ("STRI65", Some(Kind::Face(FaceType::Tri6))),
            ("CPS6", Some(Kind::Face(FaceType::Tri6))),
            ("M3D8R", Some(Kind::Face(FaceType::Quad8))),
            ("SFM3D3", Some(Kind::Face(FaceType::Tri3))),
            ("T3D2", Some(Kind::Ignored)),
            ("MASS", Some(Kind::Ignored)),
        ] {
            assert_eq!(kind(name), expected, "{name}");
        }
    }
}
