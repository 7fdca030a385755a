//! A mesh from the volumes and the faces of a file.

use std::collections::HashMap;
use std::path::Path;

use crate::fem::element::{CellType, ElementType, FaceType};
use crate::fem::mesh::gmsh::MeshFile;
use crate::fem::mesh::parts::{GroupFaces, Parts, make_upright, reversed_warning};
use crate::fem::mesh::{Elements, MeshError};
use crate::input::InputError;

/// An element as in the file.
#[derive(Clone, Debug)]
pub(super) struct Volume {
    pub element_type: ElementType,
    /// Its nodes, from 0, in the order of the reference element.
    pub nodes: Vec<u32>,
    /// Its number in the file.
    pub id: i64,
    pub line: usize,
    /// Index of its region.
    pub region: u32,
}

/// A face of a surface.
#[derive(Clone, Debug)]
pub(super) struct Face {
    pub face_type: FaceType,
    pub nodes: Vec<u32>,
    /// The line that names it.
    pub line: usize,
}

/// The contents of a file.
#[derive(Default)]
pub(super) struct Contents {
    pub nodes: Vec<[f64; 3]>,
    pub volumes: Vec<Volume>,
    pub regions: Vec<String>,
    pub surfaces: Vec<(String, Vec<Face>)>,
    pub warnings: Vec<String>,
}

impl Contents {
    /// Returns the index of a region of this name, which is added if there is none.
    pub fn region(&mut self, name: &str) -> u32 {
        let known = self.regions.iter().position(|region| region == name);
        known.unwrap_or_else(|| {
            self.regions.push(name.to_owned());
            self.regions.len() - 1
        }) as u32
    }

    /// Adds a face to the surface of this name.
    pub fn add_face(&mut self, name: &str, face: Face) {
        match self.surfaces.iter_mut().find(|(surface, _)| surface == name) {
            Some((_, faces)) => faces.push(face),
            None => self.surfaces.push((name.to_owned(), vec![face])),
        }
    }

    /// Returns true if a surface has this name, in any case of letters.
    pub fn has_surface(&self, name: &str) -> bool {
        self.surfaces.iter().any(|(surface, _)| surface.eq_ignore_ascii_case(name))
    }

    /// Adds a surface for each set of nodes that contains whole faces of the boundary and has no name of a surface. `sets`
    /// has the name, the nodes and the line of each.
    pub fn add_node_sets(&mut self, sets: &[(String, Vec<u32>, usize)]) {
        if sets.is_empty() {
            return;
        }
        let boundary = Boundary::of(&self.volumes);
        for (name, nodes, line) in sets {
            if self.has_surface(name) {
                continue;
            }
            let mut is_in = vec![false; self.nodes.len()];
            nodes.iter().for_each(|&node| is_in[node as usize] = true);
            let is_whole = |face: &&(FaceType, Vec<u32>)| face.1.iter().all(|&node| is_in[node as usize]);
            let of_set = boundary.faces.iter().filter(is_whole);
            let faces: Vec<Face> = of_set
                .map(|(face_type, nodes)| Face { face_type: *face_type, nodes: nodes.clone(), line: *line })
                .collect();
            if !faces.is_empty() {
                self.surfaces.push((name.clone(), faces));
            }
        }
    }

    /// Creates the mesh, whose elements are grouped by type; `file` names the file in messages.
    pub fn into_mesh(self, path: &Path) -> Result<MeshFile, InputError> {
        let Self { nodes, mut volumes, regions, surfaces, mut warnings } = self;
        if volumes.is_empty() {
            let cure = "mesh the volume and export it; a surface alone is no body";
            let expected = "a body of tetrahedra, hexahedra or wedges";
            return Err(InputError::in_file(path, "the file has no elements with a volume", expected, cure));
        }
        // The order within a type does not change.
        volumes.sort_by_key(|volume| volume.element_type);
        let (mut elements, mut reversed) = (Elements::default(), 0);
        for Volume { element_type, nodes: of_volume, .. } in &mut volumes {
            reversed += usize::from(make_upright(*element_type, of_volume, &nodes));
            elements.push(*element_type, of_volume);
        }
        warnings.extend(reversed_warning(reversed));
        let mut lines = Vec::new();
        let mut groups = Vec::with_capacity(surfaces.len());
        for (name, faces) in surfaces {
            let mut group = GroupFaces::new();
            for face in faces {
                group.push((face.face_type, face.nodes, lines.len()));
                lines.push(face.line);
            }
            groups.push((name, group));
        }
        let region_of = volumes.iter().map(|volume| volume.region).collect();
        let parts = Parts { nodes, elements, region_of, regions, groups };
        parts.into_mesh(warnings, |error, groups| explain(path, error, &volumes, groups, &lines))
    }
}

/// Translates an error of a mesh to the numbers and lines of the file.
fn explain(
    path: &Path,
    error: &MeshError,
    volumes: &[Volume],
    groups: &[(String, GroupFaces)],
    lines: &[usize],
) -> InputError {
    let expected = "elements that form a body, and surfaces of faces of them";
    let cure = "correct the mesh where it was made, and export it again";
    let (element, line) = match error {
        MeshError::NotAFace { surface, face, .. } | MeshError::DuplicateFace { surface, second: face, .. } => {
            let group = groups.iter().find(|(name, _)| name == surface);
            let of_file = group.and_then(|(_, faces)| faces.get(*face)).and_then(|&(_, _, index)| lines.get(index));
            (None, of_file.copied())
        }
        MeshError::RepeatedNode { element, .. }
        | MeshError::Flat { element, .. }
        | MeshError::Inverted { element, .. }
        | MeshError::Distorted { element, .. }
        | MeshError::Overlap { first: element, .. }
        | MeshError::Nonconforming { first: element, .. } => {
            let volume = volumes.get(*element);
            (volume.map(|volume| volume.id), volume.map(|volume| volume.line))
        }
        _ => (None, None),
    };
    let of_file = element.map(|id| format!(" (element {id} of the file)")).unwrap_or_default();
    InputError { line, ..InputError::in_file(path, format!("{error}{of_file}"), expected, cure) }
}

/// Returns the face of an element that has these corners, which are numbers of nodes, with all its nodes.
pub(super) fn face_with_corners(volume: &Volume, corners: &[u32]) -> Option<(FaceType, Vec<u32>)> {
    let faces = volume.element_type.faces().iter().map(|face| {
        let nodes: Vec<u32> = face.nodes.iter().map(|&node| volume.nodes[node]).collect();
        (face.face_type, nodes)
    });
    let sorted = |nodes: &[u32]| {
        let mut nodes = nodes.to_vec();
        nodes.sort_unstable();
        nodes
    };
    let expected = sorted(corners);
    faces.into_iter().find(|(face_type, nodes)| sorted(&nodes[..face_type.corners()]) == expected)
}

/// The faces of elements that no other element has.
pub(super) struct Boundary {
    pub faces: Vec<(FaceType, Vec<u32>)>,
    /// The element of each face.
    pub volume_of: Vec<usize>,
}

impl Boundary {
    pub fn of(volumes: &[Volume]) -> Self {
        let mut seen = HashMap::<Vec<u32>, usize>::new();
        let key = |volume: &Volume, nodes: &[usize], corners: usize| {
            let mut key: Vec<u32> = nodes[..corners].iter().map(|&node| volume.nodes[node]).collect();
            key.sort_unstable();
            key
        };
        for volume in volumes {
            for face in volume.element_type.faces() {
                *seen.entry(key(volume, &face.nodes, face.face_type.corners())).or_default() += 1;
            }
        }
        let mut boundary = Self { faces: Vec::new(), volume_of: Vec::new() };
        for (number, volume) in volumes.iter().enumerate() {
            for face in volume.element_type.faces() {
                if seen.get(&key(volume, &face.nodes, face.face_type.corners())) == Some(&1) {
                    let nodes = face.nodes.iter().map(|&node| volume.nodes[node]).collect();
                    boundary.faces.push((face.face_type, nodes));
                    boundary.volume_of.push(number);
                }
            }
        }
        boundary
    }
}

/// Returns the point in the middle of two nodes.
fn middle(nodes: &[[f64; 3]], [a, b]: [u32; 2]) -> [f64; 3] {
    std::array::from_fn(|k| 0.5 * (nodes[a as usize][k] + nodes[b as usize][k]))
}

/// Exchanges the last two nodes of all tetrahedra of order 2 if they lie nearer to the centers of their edges then.
pub(super) fn order_by_edges(volumes: &mut [Volume], nodes: &[[f64; 3]]) {
    let distance = |node: u32, edge: [u32; 2]| {
        let (position, middle) = (nodes[node as usize], middle(nodes, edge));
        (0..3).map(|k| (position[k] - middle[k]).powi(2)).sum::<f64>()
    };
    let mut sums = [0.0; 2];
    for Volume { nodes: of, .. } in volumes.iter().filter(|volume| volume.element_type == ElementType::Tet10) {
        let (first, second) = ([of[1], of[3]], [of[2], of[3]]);
        sums[0] += distance(of[8], first) + distance(of[9], second);
        sums[1] += distance(of[9], first) + distance(of[8], second);
    }
    if sums[1] < sums[0] {
        let quadratic = volumes.iter_mut().filter(|volume| volume.element_type == ElementType::Tet10);
        quadratic.for_each(|volume| volume.nodes.swap(8, 9));
    }
}
