//! The faces of tetrahedra: which element owns which, and on which side of it the element lies.

use super::{MeshError, Surface};

/// A face with the element that has it.
struct Face {
    /// Its nodes, ascending.
    nodes: [u32; 3],
    element: u32,
    /// Whether the ascending order is an even permutation of the order whose normal leaves the element.
    even: bool,
}

/// The four faces of an element of positive volume, normals outward; face `k` is opposite to node `k`.
pub(super) fn outward([a, b, c, d]: [u32; 4]) -> [[u32; 3]; 4] {
    [[b, c, d], [a, d, c], [a, b, d], [a, c, b]]
}

/// A triangle's nodes ascending, and whether that takes an even permutation.
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

/// All faces of a mesh, sorted by their nodes.
pub(super) struct Faces(Vec<Face>);

impl Faces {
    /// The faces of these elements.
    ///
    /// # Errors
    /// [`MeshError::Overlap`] if two elements lie on the same side of a face. Three elements at a face, and an element
    /// given twice, are such cases.
    pub fn of(elements: &[[u32; 4]]) -> Result<Self, MeshError> {
        let mut faces = Vec::with_capacity(4 * elements.len());
        for (element, &nodes) in (0_u32..).zip(elements) {
            for face in outward(nodes) {
                let (nodes, even) = ascending(face);
                faces.push(Face { nodes, element, even });
            }
        }
        faces.sort_unstable_by_key(|face| (face.nodes, face.even, face.element));
        for pair in faces.windows(2) {
            let [first, second] = pair else { continue };
            if first.nodes == second.nodes && first.even == second.even {
                let (first, second, face) = (first.element as usize, second.element as usize, first.nodes);
                return Err(MeshError::Overlap { first, second, face });
            }
        }
        Ok(Self(faces))
    }

    /// Turns the triangles that lie on the boundary outward.
    ///
    /// # Errors
    /// [`MeshError::NotAFace`] or [`MeshError::DuplicateTriangle`].
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

    /// The elements at a face: none, one at the boundary, or two.
    fn owners(&self, key: [u32; 3]) -> &[Face] {
        let start = self.0.partition_point(|face| face.nodes < key);
        let count = self.0[start..].iter().take_while(|face| face.nodes == key).count();
        &self.0[start..start + count]
    }
}

/// The elements that share a face with each of these, ascending.
pub(super) fn neighbors(elements: &[[u32; 4]]) -> Vec<Vec<u32>> {
    let mut faces: Vec<([u32; 3], u32)> = Vec::with_capacity(4 * elements.len());
    for (element, &nodes) in (0_u32..).zip(elements) {
        faces.extend(outward(nodes).map(|face| (ascending(face).0, element)));
    }
    faces.sort_unstable();
    let mut near = vec![Vec::new(); elements.len()];
    for pair in faces.windows(2) {
        if let [(face, a), (other, b)] = pair
            && face == other
        {
            near[*a as usize].push(*b);
            near[*b as usize].push(*a);
        }
    }
    near.iter_mut().for_each(|near| near.sort_unstable());
    near
}
