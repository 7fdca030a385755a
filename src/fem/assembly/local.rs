//! Integrals over one element, on stack arrays.

use nalgebra::{Matrix3, SMatrix};

use crate::fem::element::PointGeometry;

/// The stiffness of an element of `N` nodes: `K[a][i][b][k]` is the derivative of component `i` of the force on node `a`
/// by component `k` of the displacement of node `b`, N/m. Flattened, it is row-major.
pub type ElementStiffness<const N: usize> = [[[[f64; 3]; N]; 3]; N];

/// Returns the entries of an element stiffness, row-major.
#[inline(always)]
pub fn entries<const N: usize>(stiffness: &ElementStiffness<N>) -> &[f64] {
    stiffness.as_flattened().as_flattened().as_flattened()
}

/// Returns the entries of an array as an element stiffness, row-major; `None` if there are too few.
#[inline(always)]
pub(super) fn from_entries<const N: usize>(entries: &mut [f64]) -> Option<&mut ElementStiffness<N>> {
    entries.as_chunks_mut().0.as_chunks_mut().0.as_chunks_mut().0.first_chunk_mut()
}

/// Computes the contribution of a point to `f_a = integral P grad N_a dV`, N, for every node.
#[inline(always)]
pub fn internal_force<const N: usize>(point: &PointGeometry<N>, pk1: &Matrix3<f64>) -> [[f64; 3]; N] {
    let vp = pk1 * point.volume;
    // Closures of arrays are not always inlined.
    let mut forces = [[0.0; 3]; N];
    for (force, g) in forces.iter_mut().zip(&point.gradients) {
        for (i, force) in force.iter_mut().enumerate() {
            *force = vp[(i, 0)] * g[0] + vp[(i, 1)] * g[1] + vp[(i, 2)] * g[2];
        }
    }
    forces
}

/// Computes `K[a][i][b][k] = sum_q V_q sum_JL g_a[J] A_iJkL g_b[L]` over the integration points of an element.
///
/// The kernel contracts `A` with `g_b` first, then with `g_a`, for all nodes but the first. It computes the blocks with
/// `a <= b`; the others are transposes because `A` is symmetric. The gradients sum to zero, so the blocks of node 0 are
/// minus the sum of the others; a rigid translation therefore causes no force.
#[inline(always)]
pub fn stiffness<const N: usize, const Q: usize>(
    points: &[PointGeometry<N>; Q],
    tangents: &[SMatrix<f64, 9, 9>; Q],
) -> ElementStiffness<N> {
    let mut block = [[[[0.0; 3]; N]; 3]; N];
    write_stiffness(points, tangents, &mut block);
    block
}

/// Writes the stiffness of [`stiffness`] to `block`.
#[inline(never)]
pub(super) fn write_stiffness<const N: usize, const Q: usize>(
    points: &[PointGeometry<N>; Q],
    tangents: &[SMatrix<f64, 9, 9>; Q],
    block: &mut ElementStiffness<N>,
) {
    for (q, (point, tangent)) in points.iter().zip(tangents).enumerate() {
        if q == 0 {
            add_upper_blocks::<N, true>(point, &tangent.data.0, block);
        } else {
            add_upper_blocks::<N, false>(point, &tangent.data.0, block);
        }
    }
    mirror(block);
    fill_node_zero(block);
}

/// Computes the stiffness of [`stiffness`] from tangents without major symmetry.
pub fn unsymmetric_stiffness<const N: usize, const Q: usize>(
    points: &[PointGeometry<N>; Q],
    tangents: &[SMatrix<f64, 9, 9>; Q],
) -> ElementStiffness<N> {
    let mut block = [[[[0.0; 3]; N]; 3]; N];
    for (point, tangent) in points.iter().zip(tangents) {
        for (b, g) in point.gradients.iter().enumerate() {
            for k in 0..3 {
                let column = |l: usize| tangent.column(3 * k + l) * (g[l] * point.volume);
                let w = column(0) + column(1) + column(2);
                for (rows, g) in block.iter_mut().zip(&point.gradients) {
                    for (i, row) in rows.iter_mut().enumerate() {
                        row[b][k] += w[3 * i] * g[0] + w[3 * i + 1] * g[1] + w[3 * i + 2] * g[2];
                    }
                }
            }
        }
    }
    block
}

/// Adds the contribution of a point to the blocks of nodes `1 <= a <= b`. `w[iJ] = V A_iJkL g_b[L]` belongs to column
/// `(b, k)`; the node `a` of the row is `c` here. The contribution of the first point replaces the zeros of the block.
#[inline(always)]
fn add_upper_blocks<const N: usize, const IS_FIRST: bool>(
    point: &PointGeometry<N>,
    a: &[[f64; 9]; 9],
    block: &mut ElementStiffness<N>,
) {
    let gradients = &point.gradients;
    for b in 1..N {
        let g = gradients[b].map(|g| g * point.volume);
        for k in 0..3 {
            let w: [f64; 9] =
                std::array::from_fn(|r| a[3 * k][r] * g[0] + a[3 * k + 1][r] * g[1] + a[3 * k + 2][r] * g[2]);
            for c in 1..=b {
                let g = &gradients[c];
                for i in 0..3 {
                    let value = w[3 * i] * g[0] + w[3 * i + 1] * g[1] + w[3 * i + 2] * g[2];
                    let entry = &mut block[c][i][b][k];
                    *entry = if IS_FIRST { value } else { *entry + value };
                }
            }
        }
    }
}

/// Copies the upper blocks of all nodes but the first to the lower triangle.
#[expect(clippy::needless_range_loop, reason = "the indices are those of the formula")]
#[inline(always)]
fn mirror<const N: usize>(block: &mut ElementStiffness<N>) {
    for a in 2..N {
        for b in 1..a {
            for i in 0..3 {
                for k in 0..3 {
                    block[a][i][b][k] = block[b][k][a][i];
                }
            }
        }
    }
}

/// Computes the blocks of node 0 from the others: rows and columns sum to zero.
#[expect(clippy::needless_range_loop, reason = "the indices are those of the formula")]
#[inline(always)]
fn fill_node_zero<const N: usize>(block: &mut ElementStiffness<N>) {
    for i in 0..3 {
        for b in 1..N {
            for k in 0..3 {
                let mut sum = block[1][i][b][k];
                for other in &block[2..] {
                    sum += other[i][b][k];
                }
                block[0][i][b][k] = -sum;
            }
        }
        for k in 0..3 {
            let mut sum = block[0][i][1][k];
            for other in &block[0][i][2..] {
                sum += other[k];
            }
            block[0][i][0][k] = -sum;
        }
        for b in 1..N {
            for k in 0..3 {
                block[b][k][0][i] = block[0][i][b][k];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::element::geometry;
    use crate::fem::element::reference::{Element, Hex8, Hex20, Hex27, Tet4, Tet10, Wedge6};
    use crate::fem::material::{Material, NeoHookean};

    fn the_fast_kernel_equals_the_plain_sum<E: Element<3, N, Q>, const N: usize, const Q: usize>() {
        let nodes = E::nodes().map(|[x, y, z]| [x + 0.05 * y * z + 3.0, y - 0.03 * x * x, 1.2 * z + 0.04 * x * y]);
        let points = geometry::<E, N, Q>(&nodes).unwrap();
        let tangents: [SMatrix<f64, 9, 9>; Q] = std::array::from_fn(|q| {
            let f = Matrix3::new(1.2, 0.3, -0.1, 0.05, 0.9, 0.2, -0.2, 0.01 * q as f64, 1.1);
            NeoHookean { mu: 2.0, lambda: 3.0 }.evaluate(&f).unwrap().tangent
        });
        let (fast, general) = (stiffness(&points, &tangents), unsymmetric_stiffness(&points, &tangents));
        let scale = entries(&fast).iter().fold(0.0, |most: f64, entry| most.max(entry.abs()));
        for row in 0..3 * N {
            for col in 0..3 * N {
                let mut plain = 0.0;
                for (point, tangent) in points.iter().zip(&tangents) {
                    for (j, l) in (0..9).map(|n| (n / 3, n % 3)) {
                        plain += point.volume
                            * point.gradients[row / 3][j]
                            * tangent[(3 * (row % 3) + j, 3 * (col % 3) + l)]
                            * point.gradients[col / 3][l];
                    }
                }
                for kernel in [&fast, &general] {
                    assert!((plain - entries(kernel)[3 * N * row + col]).abs() < 1e-13 * scale, "({row}, {col})");
                }
            }
        }
    }

    #[test]
    fn the_fast_kernels_equal_the_plain_sums() {
        the_fast_kernel_equals_the_plain_sum::<Tet4, _, _>();
        the_fast_kernel_equals_the_plain_sum::<Tet10, _, _>();
        the_fast_kernel_equals_the_plain_sum::<Hex8, _, _>();
        the_fast_kernel_equals_the_plain_sum::<Hex20, _, _>();
        the_fast_kernel_equals_the_plain_sum::<Hex27, _, _>();
        the_fast_kernel_equals_the_plain_sum::<Wedge6, _, _>();
    }
}
