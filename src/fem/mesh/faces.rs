//! Faces of tetrahedra: the adjacent elements of each face and the side on which they lie.

use super::{MeshError, Surface};

/// A face of an element.
struct Face {
    /// Nodes of the face, ascending.
    nodes: [u32; 3],
    element: u32,
    /// True if the ascending order is an even permutation of the order with outward normal.
    even: bool,
}

/// Returns the four faces of an element of positive volume, with outward normals; face `k` is opposite to node `k`.
pub(super) fn outward([a, b, c, d]: [u32; 4]) -> [[u32; 3]; 4] {
    [[b, c, d], [a, d, c], [a, b, d], [a, c, b]]
}

/// Sorts the nodes of a triangle and returns whether the permutation is even.
pub(super) fn ascending([mut a, mut b, mut c]: [u32; 3]) -> ([u32; 3], bool) {
    let mut even = true;
    for _ in 0..2 {
        if a > b {
            (a, b, even) = (b, a, !even);
        }
        if b > c {
            (b, c, even) = (c, b, !even);
        }
    }
    ([a, b, c], even)
}

/// Returns the faces of these elements, sorted by their nodes.
fn sorted_faces(elements: &[[u32; 4]]) -> Vec<Face> {
    let mut faces = Vec::with_capacity(4 * elements.len());
    for (element, &nodes) in (0_u32..).zip(elements) {
        for face in outward(nodes) {
            let (nodes, even) = ascending(face);
            faces.push(Face { nodes, element, even });
        }
    }
    faces.sort_unstable_by_key(|face| (face.nodes, face.even, face.element));
    faces
}

/// All faces of a mesh, sorted by their nodes.
pub(super) struct Faces(Vec<Face>);

impl Faces {
    /// Collects the faces of these elements.
    ///
    /// # Errors
    /// Returns [`MeshError::Overlap`] if two elements lie on the same side of a face, which includes three elements at
    /// one face and duplicate elements.
    pub fn of(elements: &[[u32; 4]]) -> Result<Self, MeshError> {
        let faces = sorted_faces(elements);
        for pair in faces.windows(2) {
            let [first, second] = pair else { continue };
            if first.nodes == second.nodes && first.even == second.even {
                let (first, second, face) = (first.element as usize, second.element as usize, first.nodes);
                return Err(MeshError::Overlap { first, second, face });
            }
        }
        Ok(Self(faces))
    }

    /// Orients the triangles on the boundary outward.
    ///
    /// # Errors
    /// Returns [`MeshError::NotAFace`] if a triangle is not a face of an element, or [`MeshError::DuplicateTriangle`]
    /// if a surface contains a triangle twice.
    pub fn orient(&self, surfaces: &mut [Surface]) -> Result<(), MeshError> {
        for surface in surfaces {
            let Surface { name, triangles } = surface;
            let mut order = Vec::with_capacity(triangles.len());
            for (triangle, nodes) in triangles.iter_mut().enumerate() {
                let (key, even) = ascending(*nodes);
                match self.owners(key) {
                    [] => return Err(MeshError::NotAFace { surface: name.clone(), triangle, nodes: *nodes }),
                    [owner] if owner.even != even => nodes.swap(1, 2),
                    _ => {}
                }
                order.push((key, triangle));
            }
            order.sort_unstable();
            if let Some(pair) = order.windows(2).find(|pair| pair[0].0 == pair[1].0) {
                let (first, second) = (pair[0].1, pair[1].1);
                return Err(MeshError::DuplicateTriangle { surface: name.clone(), first, second });
            }
        }
        Ok(())
    }

    /// Returns the faces with these nodes: none, one at the boundary, or two between elements.
    fn owners(&self, key: [u32; 3]) -> &[Face] {
        let start = self.0.partition_point(|face| face.nodes < key);
        let count = self.0[start..].iter().take_while(|face| face.nodes == key).count();
        &self.0[start..start + count]
    }
}

/// For each element, returns the elements that share a face with it, ascending.
pub(super) fn neighbors(elements: &[[u32; 4]]) -> Vec<Vec<u32>> {
    let mut near = vec![Vec::new(); elements.len()];
    for pair in sorted_faces(elements).windows(2) {
        if let [a, b] = pair
            && a.nodes == b.nodes
        {
            near[a.element as usize].push(b.element);
            near[b.element as usize].push(a.element);
        }
    }
    near.iter_mut().for_each(|near| near.sort_unstable());
    near
}
