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

/// Returns the faces of these elements, sorted by their keys.
fn sorted_faces(elements: &Elements) -> Vec<Face> {
    let mut faces = Vec::with_capacity(4 * elements.len());
    for block in elements.blocks() {
        let corners = block.cell_type().face_corners();
        for (element, nodes) in (block.range().start as u32..).zip(block.iter()) {
            for (local, corners) in (0..).zip(corners) {
                let mut of_face = [0; 4];
                let of_face = &mut of_face[..corners.len()];
                of_face.iter_mut().zip(*corners).for_each(|(slot, &corner)| *slot = nodes[corner]);
                let (key, forward) = key(of_face);
                faces.push(Face { key, element, local, forward });
            }
        }
    }
    faces.sort_unstable_by_key(|face| (face.key, face.forward, face.element));
    faces
}

/// All faces of the elements of a mesh, sorted by their keys.
pub(super) struct ElementFaces<'a> {
    elements: &'a Elements,
    faces: Vec<Face>,
}

impl<'a> ElementFaces<'a> {
    /// Collects the faces of these elements.
    ///
    /// # Errors
    /// Returns [`MeshError::Overlap`] if two elements lie on the same side of a face, which includes three elements at
    /// one face and duplicate elements, and [`MeshError::Nonconforming`] if two elements have different nodes on a face.
    pub fn of(elements: &'a Elements) -> Result<Self, MeshError> {
        let all = Self { elements, faces: sorted_faces(elements) };
        for pair in all.faces.windows(2) {
            let [first, second] = pair else { continue };
            if first.key == second.key {
                let (one, other) = (first.element as usize, second.element as usize);
                let face = || first.key.into_iter().filter(|&corner| corner != NO_CORNER).collect();
                if first.forward == second.forward {
                    return Err(MeshError::Overlap { first: one, second: other, face: face() });
                }
                if all.is_quadratic() && all.sorted_nodes(first) != all.sorted_nodes(second) {
                    let (one, other) = (one.min(other), one.max(other));
                    return Err(MeshError::Nonconforming { first: one, second: other, face: face() });
                }
            }
        }
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
                let owners = self.owners(key);
                if !owners.iter().any(|owner| self.has_nodes(owner, face_type, nodes)) {
                    return Err(MeshError::NotAFace { surface: name.clone(), face: number, nodes: nodes.to_vec() });
                }
                if matches!(owners, [owner] if owner.forward != forward) {
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

    /// Returns the faces with this key: none, one at the boundary, or two between elements.
    fn owners(&self, key: Key) -> &[Face] {
        let start = self.faces.partition_point(|face| face.key < key);
        let count = self.faces[start..].iter().take_while(|face| face.key == key).count();
        &self.faces[start..start + count]
    }
}

/// Returns true if all these faces lie between two elements.
pub(super) fn lie_between(elements: &Elements, faces: &Faces) -> bool {
    let all = sorted_faces(elements);
    faces.typed().all(|(face_type, nodes)| {
        let (key, _) = key(&nodes[..face_type.corners()]);
        let start = all.partition_point(|face| face.key < key);
        all[start..].iter().take_while(|face| face.key == key).count() == 2
    })
}

/// For each element, returns the elements that share a face with it, ascending.
pub(super) fn neighbors(elements: &Elements) -> Vec<Vec<u32>> {
    let mut near = vec![Vec::new(); elements.len()];
    for pair in sorted_faces(elements).windows(2) {
        if let [a, b] = pair
            && a.key == b.key
        {
            near[a.element as usize].push(b.element);
            near[b.element as usize].push(a.element);
        }
    }
    near.iter_mut().for_each(|near| near.sort_unstable());
    near
}
