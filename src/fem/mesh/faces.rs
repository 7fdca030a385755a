//! Faces of elements: the adjacent elements of each face and the side on which they lie.

use super::{Elements, Faces, MeshError, Surface};
use crate::fem::element::{CellType, FaceNodes, FaceType};

/// The corners of a face, independent of the corner that comes first and of the side from which the face is seen: the
/// lowest corner first, then in the direction of its lower neighbor. A triangle has [`NO_CORNER`] in place of a fourth.
type Key = [u32; 4];

const NO_CORNER: u32 = u32::MAX;

/// Returns the key of a face, given its corners in order, and whether the order of the key is that of the corners.
pub(super) fn key(corners: &[u32]) -> (Key, bool) {
    let n = corners.len();
    let lowest = (0..n).min_by_key(|&k| corners[k]).unwrap_or(0);
    let forward = corners[(lowest + 1) % n] < corners[(lowest + n - 1) % n];
    let mut key = [NO_CORNER; 4];
    for (k, slot) in key.iter_mut().enumerate().take(n) {
        *slot = corners[(lowest + if forward { k } else { n - k }) % n];
    }
    (key, forward)
}

/// A face of an element.
struct Face {
    key: Key,
    element: u32,
    /// Number of the face within its element.
    local: u8,
    /// Whether the order of the key is the one with outward normal.
    forward: bool,
}

/// The faces of elements by their lowest corners, of which only the numbers are kept: a mesh has about twice as many faces
/// as elements, and each is the face of two elements.
struct FacesByCorner<'a> {
    elements: &'a Elements,
    /// By node: the place of the first of its faces in the lists, and after the last node, their number.
    first: Vec<usize>,
    /// The element of each face, and the number of the face within its element.
    element_of: Vec<u32>,
    local_of: Vec<u8>,
}

impl<'a> FacesByCorner<'a> {
    fn new(elements: &'a Elements) -> Self {
        let nodes = elements.iter().flatten().max().map_or(0, |&node| node as usize + 1);
        let mut first = vec![0; nodes + 1];
        for_each_face(elements, |_, _, lowest| first[lowest as usize + 1] += 1);
        (0..nodes).for_each(|node| first[node + 1] += first[node]);
        let count = first[nodes];
        let (mut element_of, mut local_of, mut next) = (vec![0; count], vec![0; count], first.clone());
        for_each_face(elements, |element, local, lowest| {
            let place = next[lowest as usize];
            (element_of[place], local_of[place]) = (element, local);
            next[lowest as usize] += 1;
        });
        Self { elements, first, element_of, local_of }
    }

    /// The faces with this lowest corner, in the order of their elements.
    fn at(&self, lowest: usize) -> impl Iterator<Item = Face> {
        let numbers = match self.first.get(lowest..lowest + 2) {
            Some(&[start, end]) => start..end,
            _ => 0..0,
        };
        let of = self.element_of[numbers.clone()].iter().zip(&self.local_of[numbers]);
        of.map(|(&element, &local)| self.face(element, local))
    }

    fn face(&self, element: u32, local: u8) -> Face {
        let nodes = &self.elements[element as usize];
        let corners = self.elements.cell_type(element as usize).face_corners()[usize::from(local)];
        let mut of_face = [0; 4];
        let of_face = &mut of_face[..corners.len()];
        of_face.iter_mut().zip(corners).for_each(|(slot, &corner)| *slot = nodes[corner]);
        let (key, forward) = key(of_face);
        Face { key, element, local, forward }
    }

    /// Calls `action` with the faces of each lowest corner, sorted by their keys, in the order of the keys.
    fn try_each<E>(&self, mut action: impl FnMut(&[Face]) -> Result<(), E>) -> Result<(), E> {
        let mut faces = Vec::new();
        for lowest in 0..self.first.len() - 1 {
            faces.clear();
            faces.extend(self.at(lowest));
            faces.sort_unstable_by_key(|face: &Face| (face.key, face.forward, face.element));
            action(&faces)?;
        }
        Ok(())
    }

    /// Returns the faces with this key: none, one at the boundary, or two between elements.
    fn owners(&self, key: Key) -> Vec<Face> {
        self.at(key[0] as usize).filter(|face| face.key == key).collect()
    }

    /// Calls `action` with the two elements of each face between elements.
    fn each_pair(&self, mut action: impl FnMut(u32, u32)) {
        let _: Result<(), std::convert::Infallible> = self.try_each(|faces| {
            let pairs = faces.windows(2).filter(|pair| pair[0].key == pair[1].key);
            pairs.for_each(|pair| action(pair[0].element, pair[1].element));
            Ok(())
        });
    }
}

/// Calls `action` with the element of each face, its number within the element, and its lowest corner.
fn for_each_face(elements: &Elements, mut action: impl FnMut(u32, u8, u32)) {
    for block in elements.blocks() {
        let corners = block.cell_type().face_corners();
        for (element, nodes) in (block.range().start as u32..).zip(block.iter()) {
            for (local, corners) in (0..).zip(corners) {
                let lowest = corners.iter().map(|&corner| nodes[corner]).min().unwrap_or_default();
                action(element, local, lowest);
            }
        }
    }
}

/// All faces of the elements of a mesh.
pub(super) struct ElementFaces<'a> {
    elements: &'a Elements,
    faces: FacesByCorner<'a>,
}

impl<'a> ElementFaces<'a> {
    /// Collects the faces of these elements.
    ///
    /// # Errors
    /// Returns [`MeshError::Overlap`] if two elements lie on the same side of a face, which includes three elements at
    /// one face and duplicate elements, and [`MeshError::Nonconforming`] if two elements have different nodes on a face.
    pub fn of(elements: &'a Elements) -> Result<Self, MeshError> {
        let all = Self { elements, faces: FacesByCorner::new(elements) };
        let is_quadratic = all.is_quadratic();
        all.faces.try_each(|faces| {
            for pair in faces.windows(2) {
                let [first, second] = pair else { continue };
                if first.key != second.key {
                    continue;
                }
                let (one, other) = (first.element as usize, second.element as usize);
                let face = || first.key.into_iter().filter(|&corner| corner != NO_CORNER).collect();
                if first.forward == second.forward {
                    return Err(MeshError::Overlap { first: one, second: other, face: face() });
                }
                if is_quadratic && all.sorted_nodes(first) != all.sorted_nodes(second) {
                    let (one, other) = (one.min(other), one.max(other));
                    return Err(MeshError::Nonconforming { first: one, second: other, face: face() });
                }
            }
            Ok(())
        })?;
        Ok(all)
    }

    /// Returns true if any element has nodes that are not corners.
    fn is_quadratic(&self) -> bool {
        self.elements.blocks().iter().any(|block| block.cell_type().nodes() > block.cell_type().corners())
    }

    /// Returns type and nodes of a face, with outward normal.
    fn nodes(&self, face: &Face) -> (FaceType, Vec<u32>) {
        let (element_type, nodes) =
            (self.elements.cell_type(face.element as usize), &self.elements[face.element as usize]);
        let FaceNodes { face_type, nodes: local } = &element_type.faces()[usize::from(face.local)];
        (*face_type, local.iter().map(|&node| nodes[node]).collect())
    }

    fn sorted_nodes(&self, face: &Face) -> Vec<u32> {
        let mut nodes = self.nodes(face).1;
        nodes.sort_unstable();
        nodes
    }

    /// Orients the faces of surfaces on the boundary outward.
    ///
    /// # Errors
    /// Returns [`MeshError::NotAFace`] if a face is not one of an element, with the same nodes, or
    /// [`MeshError::DuplicateFace`] if a surface contains a face twice.
    pub fn orient(&self, surfaces: &mut [Surface]) -> Result<(), MeshError> {
        for Surface { name, faces } in surfaces {
            let mut order = Vec::with_capacity(faces.len());
            let mut inward = Vec::new();
            for (number, (face_type, nodes)) in faces.typed().enumerate() {
                let (key, forward) = key(&nodes[..face_type.corners()]);
                let owners = self.faces.owners(key);
                if !owners.iter().any(|owner| self.has_nodes(owner, face_type, nodes)) {
                    return Err(MeshError::NotAFace { surface: name.clone(), face: number, nodes: nodes.to_vec() });
                }
                if matches!(&owners[..], [owner] if owner.forward != forward) {
                    inward.push((number, face_type));
                }
                order.push((key, number));
            }
            for (number, face_type) in inward {
                let given = faces[number].to_vec();
                faces[number].iter_mut().zip(face_type.reversed()).for_each(|(node, &from)| *node = given[from]);
            }
            order.sort_unstable();
            if let Some(pair) = order.windows(2).find(|pair| pair[0].0 == pair[1].0) {
                return Err(MeshError::DuplicateFace { surface: name.clone(), first: pair[0].1, second: pair[1].1 });
            }
        }
        Ok(())
    }

    /// Returns true if a face of an element has the type and the nodes of a face of a surface: those between the corners
    /// in the same order.
    fn has_nodes(&self, owner: &Face, face_type: FaceType, nodes: &[u32]) -> bool {
        if nodes.len() == face_type.corners() {
            let element_type = self.elements.cell_type(owner.element as usize);
            return element_type.nodes() == element_type.corners();
        }
        let (own_type, own) = self.nodes(owner);
        if own_type != face_type {
            return false;
        }
        let corners = face_type.corners();
        let matches_from = |order: &[usize], start: usize| {
            // Corners and nodes on edges rotate together; a node inside the face stays.
            (0..nodes.len()).all(|k| {
                let rotated = match k / corners {
                    0 => (k + start) % corners,
                    1 => corners + (k - corners + start) % corners,
                    _ => k,
                };
                nodes[k] == own[order[rotated]]
            })
        };
        let forward: Vec<usize> = (0..nodes.len()).collect();
        [&forward[..], face_type.reversed()].iter().any(|order| (0..corners).any(|start| matches_from(order, start)))
    }
}

/// Returns true if all these faces lie between two elements.
pub(super) fn lie_between(elements: &Elements, faces: &Faces) -> bool {
    let all = FacesByCorner::new(elements);
    faces.typed().all(|(face_type, nodes)| all.owners(key(&nodes[..face_type.corners()]).0).len() == 2)
}

/// The elements that share a face with each element.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Neighbors {
    /// By element: the place of the first of its neighbors, and after the last element, their number.
    first: Vec<usize>,
    near: Vec<u32>,
}

impl Neighbors {
    pub(super) fn new(elements: &Elements) -> Self {
        let faces = FacesByCorner::new(elements);
        let mut first = vec![0; elements.len() + 1];
        faces.each_pair(|a, b| [a, b].into_iter().for_each(|element| first[element as usize + 1] += 1));
        (0..elements.len()).for_each(|element| first[element + 1] += first[element]);
        let (mut near, mut next) = (vec![0; first[elements.len()]], first.clone());
        faces.each_pair(|a, b| {
            for [element, neighbor] in [[a, b], [b, a]] {
                near[next[element as usize]] = neighbor;
                next[element as usize] += 1;
            }
        });
        first.windows(2).for_each(|of_element| near[of_element[0]..of_element[1]].sort_unstable());
        Self { first, near }
    }

    /// The number of elements.
    pub fn elements(&self) -> usize {
        self.first.len() - 1
    }

    /// Returns the neighbors of an element, ascending.
    ///
    /// # Panics
    /// Panics if there is no such element.
    pub fn of(&self, element: usize) -> &[u32] {
        &self.near[self.first[element]..self.first[element + 1]]
    }
}

#[cfg(feature = "metis")]
impl crate::backends::metis::Graph for Neighbors {
    fn nodes(&self) -> usize {
        self.elements()
    }

    fn near(&self, element: usize) -> &[u32] {
        self.of(element)
    }
}
