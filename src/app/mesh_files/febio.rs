//! Models of FEBio (`.feb`, `febio_spec` 2.5 to 4.0): their meshes.

use std::collections::HashMap;
use std::path::Path;

use quick_xml::events::{BytesStart, Event};

use super::assemble::{Contents, Face, Volume};
use super::text_of;
use crate::app::results::attribute;
use crate::fem::element::{CellType, ElementType, FaceType};
use crate::fem::mesh::gmsh::MeshFile;
use crate::input::{InputError, excerpt};

const EXPECTED: &str = "a model of FEBio (.feb, febio_spec 2.5 or newer) with <Mesh> or <Geometry>";
const DAMAGED: &str = "correct the model, or save it again in FEBio Studio (febio_spec 4.0)";

fn solid(name: &str) -> Option<ElementType> {
    Some(match name.to_ascii_lowercase().as_str() {
        "tet4" => ElementType::Tet4,
        // The types differ in their integration points.
        "tet10" | "tet10g1" | "tet10g4" | "tet10g8" | "tet10g4ri1" | "tet10g8ri4" | "tet10gl11" => ElementType::Tet10,
        "hex8" => ElementType::Hex8,
        "hex20" | "hex20g8" => ElementType::Hex20,
        "penta6" => ElementType::Wedge6,
        _ => return None,
    })
}

fn facet(name: &str) -> Option<FaceType> {
    Some(match name {
        "tri3" => FaceType::Tri3,
        "tri6" => FaceType::Tri6,
        "quad4" => FaceType::Quad4,
        "quad8" => FaceType::Quad8,
        "quad9" => FaceType::Quad9,
        _ => return None,
    })
}

/// Where the reader is.
enum Section {
    Nodes,
    Elements(ElementType, String),
    Surface(String),
    NodeSet(usize),
}

/// An element of XML whose text is read.
struct Open {
    name: String,
    id: Option<i64>,
    line: usize,
    text: String,
}

struct Reader<'a> {
    path: &'a Path,
    contents: Contents,
    node_of: HashMap<i64, u32>,
    section: Option<Section>,
    /// The name of each set of nodes, their numbers in the file, and its line.
    node_sets: Vec<(String, Vec<i64>, usize)>,
    faces: Vec<(String, FaceType, Vec<i64>, usize)>,
    volumes: Vec<(ElementType, String, Vec<i64>, i64, usize)>,
}

/// Reads a mesh.
pub(super) fn read(path: &Path) -> Result<MeshFile, InputError> {
    let text = text_of(path, EXPECTED)?;
    let mut reader = Reader {
        path,
        contents: Contents::default(),
        node_of: HashMap::new(),
        section: None,
        node_sets: Vec::new(),
        faces: Vec::new(),
        volumes: Vec::new(),
    };
    reader.read(&text)?;
    reader.finish()
}

impl Reader<'_> {
    fn error(&self, line: usize, problem: impl Into<String>) -> InputError {
        InputError::at_line(self.path, line, problem, EXPECTED, DAMAGED)
    }

    fn read(&mut self, text: &str) -> Result<(), InputError> {
        let mut xml = quick_xml::Reader::from_str(text);
        let (mut line, mut counted) = (1, 0);
        let mut open: Option<Open> = None;
        // Whether the reader is in the mesh: sections of the same names lie elsewhere too.
        let mut is_mesh = false;
        loop {
            let event = xml.read_event();
            let at = usize::try_from(xml.buffer_position()).unwrap_or(usize::MAX).min(text.len());
            line += text.as_bytes()[counted..at].iter().filter(|&&byte| byte == b'\n').count();
            counted = at;
            match event.map_err(|error| self.error(line, format!("not XML: {error}")))? {
                Event::Start(tag) if matches!(tag.name().as_ref(), "Mesh" | "Geometry") => is_mesh = true,
                Event::End(tag) if matches!(tag.name().as_ref(), "Mesh" | "Geometry") => is_mesh = false,
                Event::Start(tag) if is_mesh && self.section.is_none() => self.begin(&tag, line, &mut open)?,
                Event::Start(tag) if is_mesh => open = Some(self.open(&tag, line)?),
                Event::Empty(tag) if is_mesh => {
                    let entry = self.open(&tag, line)?;
                    self.close(entry)?;
                }
                Event::Text(part) => {
                    if let Some(open) = &mut open {
                        open.text.push_str(&part);
                    }
                }
                Event::End(tag) if is_mesh => match tag.name().as_ref() {
                    "Nodes" | "Elements" | "Surface" | "NodeSet" => {
                        if let Some(open) = open.take() {
                            self.close(open)?;
                        }
                        self.section = None;
                    }
                    _ => {
                        if let Some(open) = open.take() {
                            self.close(open)?;
                        }
                    }
                },
                Event::Eof => return Ok(()),
                _ => {}
            }
        }
    }

    fn value(&self, tag: &BytesStart<'_>, name: &str, line: usize) -> Result<Option<String>, InputError> {
        attribute(tag, name).map_err(|error| self.error(line, error))
    }

    fn open(&self, tag: &BytesStart<'_>, line: usize) -> Result<Open, InputError> {
        let id = self.value(tag, "id", line)?.and_then(|id| id.trim().parse().ok());
        Ok(Open { name: tag.name().as_ref().to_owned(), id, line, text: String::new() })
    }

    /// Begins a section of the mesh.
    fn begin(&mut self, tag: &BytesStart<'_>, line: usize, open: &mut Option<Open>) -> Result<(), InputError> {
        let name = self.value(tag, "name", line)?.unwrap_or_default();
        self.section = match tag.name().as_ref() {
            "Nodes" => Some(Section::Nodes),
            "Elements" => {
                let kind = self.value(tag, "type", line)?.unwrap_or_default();
                let of = solid(&kind).ok_or_else(|| {
                    let problem = format!("elements of type `{}`", excerpt(&kind));
                    let expected = "tet4, tet10, hex8, hex20 and penta6";
                    let cure = "mesh the body with these elements (in FEBio Studio), without shells";
                    InputError::at_line(self.path, line, problem, expected, cure)
                })?;
                let material = self.value(tag, "mat", line)?.map(|material| format!("material_{}", material.trim()));
                let name = if name.is_empty() { material.unwrap_or_else(|| "body".into()) } else { name };
                Some(Section::Elements(of, name))
            }
            "Surface" if name.is_empty() => return Err(self.error(line, "the surface has no `name`")),
            "Surface" => Some(Section::Surface(name)),
            "NodeSet" => {
                self.node_sets.push((name, Vec::new(), line));
                // Since version 4, the text of the set lists its nodes.
                *open = Some(self.open(tag, line)?);
                Some(Section::NodeSet(self.node_sets.len() - 1))
            }
            _ => None,
        };
        Ok(())
    }

    /// Takes an entry of a section.
    fn close(&mut self, Open { name, id, line, text }: Open) -> Result<(), InputError> {
        let words = || text.split(|c: char| c == ',' || c.is_ascii_whitespace()).filter(|word| !word.is_empty());
        let invalid = |word: &str| self.error(line, format!("`{}` is not a number", excerpt(word)));
        let integers = || -> Result<Vec<i64>, InputError> {
            words().map(|word| word.parse().map_err(|_| invalid(word))).collect()
        };
        match &self.section {
            Some(Section::Nodes) => {
                let reals: Vec<f64> =
                    words().map(|word| word.parse().map_err(|_| invalid(word))).collect::<Result<_, _>>()?;
                let id = id.ok_or_else(|| self.error(line, "the node has no `id`"))?;
                let position = <[f64; 3]>::try_from(reals)
                    .map_err(|reals| self.error(line, format!("node {id} has {} coordinates", reals.len())))?;
                if self.node_of.insert(id, self.contents.nodes.len() as u32).is_some() {
                    return Err(self.error(line, format!("node {id} occurs twice")));
                }
                self.contents.nodes.push(position);
            }
            Some(Section::Elements(of, region)) => {
                let id = id.ok_or_else(|| self.error(line, "the element has no `id`"))?;
                let nodes = integers()?;
                if nodes.len() != of.nodes() {
                    let problem = format!("element {id} has {} nodes, not {}", nodes.len(), of.nodes());
                    return Err(self.error(line, problem));
                }
                self.volumes.push((*of, region.clone(), nodes, id, line));
            }
            Some(Section::Surface(surface)) => {
                let of = facet(&name).ok_or_else(|| {
                    self.error(
                        line,
                        format!("the surface `{}` has faces of type `{}`", excerpt(surface), excerpt(&name)),
                    )
                })?;
                let nodes = integers()?;
                if nodes.len() != of.nodes() {
                    return Err(self.error(line, format!("the face has {} nodes, not {}", nodes.len(), of.nodes())));
                }
                self.faces.push((surface.clone(), of, nodes, line));
            }
            Some(Section::NodeSet(set)) => {
                let numbers = integers()?;
                self.node_sets[*set].1.extend(id.into_iter().filter(|_| name != "NodeSet").chain(numbers));
            }
            None => {}
        }
        Ok(())
    }

    fn finish(self) -> Result<MeshFile, InputError> {
        let Self { path, mut contents, node_of, node_sets, faces, volumes, .. } = self;
        let nodes_of = |ids: &[i64], line: usize| {
            let node = |id: &i64| {
                node_of
                    .get(id)
                    .copied()
                    .ok_or_else(|| InputError::at_line(path, line, format!("there is no node {id}"), EXPECTED, DAMAGED))
            };
            ids.iter().map(node).collect::<Result<Vec<u32>, _>>()
        };
        for (element_type, region, ids, id, line) in volumes {
            let region = contents.region(&region);
            contents.volumes.push(Volume { element_type, nodes: nodes_of(&ids, line)?, id, line, region });
        }
        for (name, face_type, ids, line) in faces {
            contents.add_face(&name, Face { face_type, nodes: nodes_of(&ids, line)?, line });
        }
        let sets = node_sets.into_iter().map(|(name, ids, line)| Ok((name, nodes_of(&ids, line)?, line)));
        let sets = sets.collect::<Result<Vec<_>, InputError>>()?;
        contents.add_node_sets(&sets);
        contents.into_mesh(path)
    }
}
