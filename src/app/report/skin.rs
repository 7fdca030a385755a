//! The boundary of a mesh: faces, their neighbors, and edges joined to polylines.

use std::collections::HashMap;

use nalgebra::Vector3;

use crate::fem::element::{CellType, FaceNodes};
use crate::fem::mesh::Elements;

/// A boundary face.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Face {
    /// The points on the edges of the face, counterclockwise when seen from outside.
    pub(super) points: Vec<u32>,
    /// The element behind the face.
    pub(super) element: usize,
}

/// An edge of the boundary and the faces on its two sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Edge {
    /// The end points of the edge.
    pub(super) points: [u32; 2],
    /// The faces that share the edge.
    pub(super) faces: [usize; 2],
}

/// The boundary of a body.
#[derive(Clone, Debug, Default)]
pub(super) struct BoundaryMesh {
    pub(super) faces: Vec<Face>,
    pub(super) edges: Vec<Edge>,
}

impl BoundaryMesh {
    /// Finds the faces that belong to only one element.
    pub(super) fn of(elements: &Elements) -> Self {
        // Of each face, the number of elements, the last of them, and its number there.
        let mut owners: HashMap<[u32; 4], (u32, usize, usize)> = HashMap::new();
        for (element, (element_type, nodes)) in elements.typed().enumerate() {
            for (number, FaceNodes { face_type, nodes: local }) in element_type.faces().iter().enumerate() {
                let mut key = [u32::MAX; 4];
                key.iter_mut().zip(&local[..face_type.corners()]).for_each(|(slot, &node)| *slot = nodes[node]);
                key.sort_unstable();
                let owner = owners.entry(key).or_default();
                *owner = (owner.0 + 1, element, number);
            }
        }
        let face = |(_, element, number): (u32, usize, usize)| {
            let (element_type, nodes) = elements.get(element)?;
            let FaceNodes { face_type, nodes: local } = &element_type.faces()[number];
            Some(Face { points: face_type.outline().iter().map(|&node| nodes[local[node]]).collect(), element })
        };
        let boundary = owners.into_values().filter(|(count, ..)| *count == 1);
        let mut faces: Vec<Face> = boundary.filter_map(face).collect();
        // A hash map has no defined order, but the same results must give the same file.
        faces.sort_unstable_by(|a, b| (a.element, &a.points).cmp(&(b.element, &b.points)));
        let edges = edges(&faces);
        Self { faces, edges }
    }
}

/// Returns the edges that two faces share.
fn edges(faces: &[Face]) -> Vec<Edge> {
    let mut first: HashMap<[u32; 2], usize> = HashMap::new();
    let mut edges = Vec::new();
    for (k, Face { points, .. }) in faces.iter().enumerate() {
        for (from, to) in points.iter().zip(points.iter().cycle().skip(1)) {
            let points = [*from.min(to), *from.max(to)];
            match first.remove(&points) {
                Some(other) => edges.push(Edge { points, faces: [other, k] }),
                None => {
                    first.insert(points, k);
                }
            }
        }
    }
    edges
}

/// Returns the outward normal of a face, scaled by twice its area.
pub(super) fn normal(face: &Face, points: &[Vector3<f64>]) -> Vector3<f64> {
    let at = |k: usize| points[face.points[k] as usize];
    (1..face.points.len() - 1).map(|k| (at(k) - at(0)).cross(&(at(k + 1) - at(0)))).sum()
}

/// Joins edges that meet into polylines, each drawn in one stroke.
pub(super) fn lines(edges: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut at: HashMap<u32, Vec<usize>> = HashMap::new();
    for (k, edge) in edges.iter().enumerate() {
        for point in edge {
            at.entry(*point).or_default().push(k);
        }
    }
    let mut used = vec![false; edges.len()];
    let mut lines = Vec::new();
    // The lines that start at open ends and branches come first, then the remaining closed loops.
    let ends = (0..edges.len()).filter(|&k| edges[k].iter().any(|point| at[point].len() != 2));
    for start in ends.chain(0..edges.len()).collect::<Vec<_>>() {
        if used[start] {
            continue;
        }
        let [a, b] = edges[start];
        let (mut line, mut next) =
            if at[&b].len() == 2 || at[&a].len() != 2 { (vec![a, b], b) } else { (vec![b, a], a) };
        used[start] = true;
        while let Some(&k) = at[&next].iter().find(|&&k| at[&next].len() == 2 && !used[k]) {
            used[k] = true;
            next = if edges[k][0] == next { edges[k][1] } else { edges[k][0] };
            line.push(next);
        }
        lines.push(line);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> (Vec<Vector3<f64>>, Elements) {
        let points = (0..8).map(|k| Vector3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64)).collect();
        let elements = vec![[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];
        (points, elements.into())
    }

    #[test]
    fn the_skin_of_a_cube_is_closed_and_faces_outward() {
        let (points, elements) = cube();
        let skin = BoundaryMesh::of(&elements);
        assert_eq!((skin.faces.len(), skin.edges.len()), (12, 18));
        let mut total = Vector3::zeros();
        for face in &skin.faces {
            let normal = normal(face, &points);
            let middle = face.points.iter().map(|&p| points[p as usize]).sum::<Vector3<f64>>() / 3.0;
            assert!(normal.dot(&(middle - Vector3::repeat(0.5))) > 0.0);
            total += normal;
        }
        assert!(total.norm() < 1e-15);
    }

    #[test]
    fn edges_are_joined_to_polylines() {
        let mut closed = lines(&[[2, 3], [0, 1], [3, 0], [1, 2]]);
        assert_eq!((closed.len(), closed[0].len()), (1, 5));
        closed[0].dedup();
        assert_eq!(closed[0].first(), closed[0].last());
        let branched = lines(&[[0, 1], [1, 2], [2, 3], [2, 4]]);
        assert_eq!(branched.iter().map(Vec::len).sum::<usize>(), 4 + branched.len());
        assert_eq!(branched.len(), 3);
        assert!(lines(&[]).is_empty());
    }
}
