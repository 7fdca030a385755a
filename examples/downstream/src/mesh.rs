//! The unit square, divided into right triangles. This module does not use matrices.

/// Nodes and triangles of a mesh.
pub struct Mesh {
    pub nodes: Vec<[f64; 2]>,
    pub triangles: Vec<[usize; 3]>,
}

/// A triangle with linear shape functions.
pub struct Shape {
    pub area: f64,
    /// `area * grad N_i . grad N_j`, row by row.
    pub stiffness: [f64; 9],
}

impl Mesh {
    /// Creates a square of `cells` by `cells` squares, each divided along its rising diagonal.
    pub fn square(cells: usize) -> Self {
        let side = cells + 1;
        let place = |k: usize| k as f64 / cells as f64;
        let nodes = (0..side * side).map(|node| [place(node / side), place(node % side)]).collect();
        let corners = (0..cells).flat_map(|i| (0..cells).map(move |j| i * side + j));
        let halves = |k: usize| [[k, k + side, k + side + 1], [k, k + side + 1, k + 1]];
        Self { nodes, triangles: corners.flat_map(halves).collect() }
    }

    /// Returns the area and the stiffness of a triangle.
    pub fn shape(&self, triangle: &[usize; 3]) -> Shape {
        let [a, b, c] = triangle.map(|node| self.nodes[node]);
        // The edge opposite to each corner; the gradient of the shape function is perpendicular to it.
        let edges = [[c[0] - b[0], c[1] - b[1]], [a[0] - c[0], a[1] - c[1]], [b[0] - a[0], b[1] - a[1]]];
        let area = 0.5 * (edges[1][1] * edges[2][0] - edges[1][0] * edges[2][1]).abs();
        let entry = |k: usize| {
            let (p, q) = (edges[k / 3], edges[k % 3]);
            (p[0] * q[0] + p[1] * q[1]) / (4.0 * area)
        };
        Shape { area, stiffness: std::array::from_fn(entry) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_fill_the_square_and_rows_of_the_stiffness_sum_to_zero() {
        let mesh = Mesh::square(3);
        let shapes: Vec<_> = mesh.triangles.iter().map(|triangle| mesh.shape(triangle)).collect();
        assert!((shapes.iter().map(|shape| shape.area).sum::<f64>() - 1.0).abs() < 1e-15);
        for shape in &shapes {
            assert!(shape.stiffness.chunks(3).all(|row| row.iter().sum::<f64>().abs() < 1e-15));
        }
    }

    /// The energy of `2 x - y` is the square of its gradient, 5.
    #[test]
    fn the_energy_of_a_linear_field_is_exact() {
        let mesh = Mesh::square(4);
        let mut energy = 0.0;
        for triangle in &mesh.triangles {
            let u = triangle.map(|node| 2.0 * mesh.nodes[node][0] - mesh.nodes[node][1]);
            let stiffness = mesh.shape(triangle).stiffness;
            energy += (0..9).map(|k| u[k / 3] * stiffness[k] * u[k % 3]).sum::<f64>();
        }
        assert!((energy - 5.0).abs() < 1e-13, "{energy}");
    }
}
