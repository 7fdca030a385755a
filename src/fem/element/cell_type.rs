//! What elements and faces have in common.

use super::reference::Element;

/// The type of a cell, an element or a face, which determines its number of nodes.
pub trait CellType: Copy + Eq + std::fmt::Debug {
    /// Number of nodes.
    fn nodes(self) -> usize;

    /// Number of corners, which are the first nodes.
    fn corners(self) -> usize;
}

/// Returns the numbers of nodes, corners and integration points.
pub(super) fn counts<E: Element<DIM, N, Q>, const DIM: usize, const N: usize, const Q: usize>() -> [usize; 3] {
    [N, E::CORNERS, Q]
}

/// Returns the tangent vectors `dX / dxi_j = sum_a X_a dN_a/dxi_j`.
pub(super) fn jacobian<const DIM: usize, const N: usize>(
    nodes: &[[f64; 3]],
    gradients: &[[f64; DIM]; N],
) -> [[f64; 3]; DIM] {
    let mut tangents = [[0.0; 3]; DIM];
    for (x, gradient) in nodes.iter().zip(gradients) {
        for (tangent, slope) in tangents.iter_mut().zip(gradient) {
            for (sum, x) in tangent.iter_mut().zip(x) {
                *sum += x * slope;
            }
        }
    }
    tangents
}

/// Returns, for each node, the corners with nonzero linear shape functions there.
pub(super) fn corners_around<const DIM: usize>(
    nodes: &[[f64; DIM]],
    values: impl Fn([f64; DIM]) -> Vec<f64>,
) -> Vec<Vec<usize>> {
    let around = |&xi: &[f64; DIM]| {
        let values = values(xi).into_iter().enumerate();
        values.filter(|&(_, value)| value > 0.0).map(|(corner, _)| corner).collect()
    };
    nodes.iter().map(around).collect()
}
