//! Integrals over one element, on stack arrays. One-point quadrature is exact because `F`, `P` and `A` are constant
//! over a linear tetrahedron.

use nalgebra::{Matrix3, SMatrix};

use crate::fem::element::{NODES, Tetrahedron, UNKNOWNS};

/// Computes `f_a = V P grad N_a`, N, for every node.
#[inline(always)]
pub fn internal_force(element: &Tetrahedron, pk1: &Matrix3<f64>) -> [[f64; 3]; NODES] {
    let vp = pk1 * element.volume;
    element.gradients.map(|g| std::array::from_fn(|i| vp[(i, 0)] * g[0] + vp[(i, 1)] * g[1] + vp[(i, 2)] * g[2]))
}

/// Computes `K[3 a + i, 3 b + k] = V sum_JL g_a[J] A_iJkL g_b[L]`, N/m, row-major.
///
/// The kernel contracts `A` with `g_b` first, then with `g_a`, for nodes 1 to 3 only. Of their nine blocks it computes
/// the six with `a <= b`; the others are transposes because `A` is symmetric. The gradients sum to zero, so the blocks
/// of node 0 are minus the sum of the others; a rigid translation therefore causes no force.
#[inline(always)]
pub fn stiffness(element: &Tetrahedron, tangent: &SMatrix<f64, 9, 9>) -> [f64; UNKNOWNS * UNKNOWNS] {
    // Column (b, k) of K; w[iJ] = V A_iJkL g_b[L]; the row node a is `c` here.
    let mut block = [[0.0; UNKNOWNS]; UNKNOWNS];
    let a: &[[f64; 9]; 9] = &tangent.data.0;
    let gradients = &element.gradients;
    for b in 1..NODES {
        let g = gradients[b].map(|g| g * element.volume);
        for k in 0..3 {
            let w: [f64; 9] =
                std::array::from_fn(|r| a[3 * k][r] * g[0] + a[3 * k + 1][r] * g[1] + a[3 * k + 2][r] * g[2]);
            for c in 1..=b {
                let g = &gradients[c];
                for i in 0..3 {
                    block[3 * c + i][3 * b + k] = w[3 * i] * g[0] + w[3 * i + 1] * g[1] + w[3 * i + 2] * g[2];
                }
            }
        }
    }
    mirror(&mut block);
    fill_node_zero(&mut block);
    std::array::from_fn(|n| block[n / UNKNOWNS][n % UNKNOWNS])
}

/// Copies the upper blocks of nodes 1 to 3 to the lower triangle.
#[inline(always)]
fn mirror(block: &mut [[f64; UNKNOWNS]; UNKNOWNS]) {
    for a in 2..NODES {
        for b in 1..a {
            for i in 0..3 {
                for k in 0..3 {
                    block[3 * a + i][3 * b + k] = block[3 * b + k][3 * a + i];
                }
            }
        }
    }
}

/// Computes the blocks of node 0 from the others: rows and columns sum to zero.
#[inline(always)]
fn fill_node_zero(block: &mut [[f64; UNKNOWNS]; UNKNOWNS]) {
    let (zero, others) = block.split_at_mut(3);
    for (i, row) in zero.iter_mut().enumerate() {
        for n in 3..UNKNOWNS {
            row[n] = -(others[i][n] + others[3 + i][n] + others[6 + i][n]);
        }
        for k in 0..3 {
            row[k] = -(row[3 + k] + row[6 + k] + row[9 + k]);
        }
        for (other, &value) in others.iter_mut().zip(&row[3..]) {
            other[i] = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::material::{Material, NeoHookean};

    fn element() -> Tetrahedron {
        Tetrahedron::new(&[[0.1, 0.0, 0.2], [1.0, 0.1, 0.0], [0.2, 0.9, 0.1], [0.0, 0.3, 1.2]]).unwrap()
    }

    #[test]
    fn the_fast_kernel_equals_the_plain_sum() {
        let f = Matrix3::new(1.2, 0.3, -0.1, 0.05, 0.9, 0.2, -0.2, 0.1, 1.1);
        let response = NeoHookean { mu: 2.0, lambda: 3.0 }.evaluate(&f).unwrap();
        let (e, fast) = (element(), stiffness(&element(), &response.tangent));
        for row in 0..UNKNOWNS {
            for col in 0..UNKNOWNS {
                let mut plain = 0.0;
                for j in 0..3 {
                    for l in 0..3 {
                        plain += e.volume
                            * e.gradients[row / 3][j]
                            * response.tangent[(3 * (row % 3) + j, 3 * (col % 3) + l)]
                            * e.gradients[col / 3][l];
                    }
                }
                assert!((plain - fast[UNKNOWNS * row + col]).abs() < 1e-14 * response.tangent.norm(), "({row}, {col})");
            }
        }
    }
}
