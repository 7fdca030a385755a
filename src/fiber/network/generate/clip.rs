//! Clipping of a network at the faces of the cube.

/// A network before it is clipped.
#[derive(Clone, Debug)]
pub(super) struct Graph {
    /// Positions of the nodes; the nodes in the cube come first.
    pub(super) places: Vec<[f64; 3]>,
    /// Number of nodes in the cube.
    pub(super) inner: usize,
    /// The edges, ascending, each with its lower node first; the lower node is in the cube.
    pub(super) edges: Vec<[usize; 2]>,
}

/// A network that ends at the faces of the cube.
#[derive(Clone, Debug)]
pub(super) struct Clipped {
    /// Positions of the nodes.
    pub(super) nodes: Vec<[f64; 3]>,
    /// The two nodes of every fiber.
    pub(super) fibers: Vec<[u32; 2]>,
    /// True for every node that lies on a face (a boundary node).
    pub(super) on_face: Vec<bool>,
}

impl Graph {
    /// Clips the edges at the faces of the unit cube. The nodes in the cube come first, then those on the faces.
    pub(super) fn clip(&self) -> Clipped {
        let mut nodes: Vec<[f64; 3]> = self.places[..self.inner].to_vec();
        let mut fibers = Vec::with_capacity(self.edges.len());
        for &[a, b] in &self.edges {
            let end = if b < self.inner {
                b
            } else {
                nodes.push(crossing(self.places[a], self.places[b]));
                nodes.len() - 1
            };
            fibers.push([a as u32, end as u32]);
        }
        let on_face = (0..nodes.len()).map(|node| node >= self.inner).collect();
        Clipped { nodes, fibers, on_face }
    }
}

/// Returns the point, exactly on a face, where the segment from a point inside to one outside leaves the unit cube.
pub(super) fn crossing(inside: [f64; 3], outside: [f64; 3]) -> [f64; 3] {
    let mut first = (f64::INFINITY, 0, 0.5);
    for k in 0..3 {
        if outside[k].abs() > 0.5 {
            let face = 0.5f64.copysign(outside[k]);
            let t = (face - inside[k]) / (outside[k] - inside[k]);
            if t < first.0 {
                first = (t, k, face);
            }
        }
    }
    let (t, axis, face) = first;
    let mut point = [0, 1, 2].map(|k| (inside[k] + t * (outside[k] - inside[k])).clamp(-0.5, 0.5));
    point[axis] = face;
    point
}
