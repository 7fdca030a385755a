//! Aggregates of strongly coupled nodes (P. Vanek, J. Mandel, M. Brezina, *Algebraic multigrid by smoothed aggregation
//! for second and fourth order elliptic problems*, Computing 56, 1996, section 4).

use super::blocks::BlockMatrix;
use super::for_each_row;
use crate::parallel;

/// The number that marks a node without aggregate.
pub(super) const NONE: u32 = u32::MAX;

/// The aggregate of each node; a node that is not strongly coupled to any other has [`NONE`].
pub(super) struct Aggregates {
    pub of_node: Vec<u32>,
    pub count: usize,
}

/// Returns for each block of `a` whether its two nodes are strongly coupled: `|A_ij|^2 > threshold^2 |A_ii| |A_jj|` in
/// Frobenius norms. Blocks on the diagonal are not.
pub(super) fn strong_couplings(a: &BlockMatrix<f64>, threshold: f64) -> Vec<bool> {
    let len = a.size.0 * a.size.1;
    let norm = |at: usize| a.values[at * len..(at + 1) * len].iter().map(|value| value * value).sum::<f64>();
    let of_diagonal = |row: usize| a.range(row).find(|&at| a.columns[at] as usize == row).map_or(0.0, norm).sqrt();
    let diagonal = parallel::collect(a.rows(), of_diagonal);
    let mut strong = parallel::filled(false, a.columns.len());
    for_each_row(&a.offsets, 1, &mut strong, |row, strong| {
        for (at, strong) in a.range(row).zip(strong) {
            let column = a.columns[at] as usize;
            *strong = column != row && norm(at) > threshold * threshold * diagonal[row] * diagonal[column];
        }
    });
    strong
}

/// Groups nodes into aggregates of a node and its strong neighbors.
pub(super) fn aggregate(a: &BlockMatrix<f64>, strong: &[bool]) -> Aggregates {
    let neighbors = |node: usize| a.range(node).filter(|&at| strong[at]).map(|at| a.columns[at] as usize);
    let mut of_node = vec![NONE; a.rows()];
    let mut count = 0;
    // Nodes whose neighbors are all free become the roots of aggregates.
    for node in 0..a.rows() {
        let is_free = of_node[node] == NONE && neighbors(node).all(|other| of_node[other] == NONE);
        if is_free && neighbors(node).next().is_some() {
            of_node[node] = count;
            neighbors(node).for_each(|other| of_node[other] = count);
            count += 1;
        }
    }
    // The others join the aggregate to which most of their neighbors belong.
    let roots = of_node.clone();
    let mut found: Vec<u32> = Vec::new();
    for node in (0..a.rows()).filter(|&node| roots[node] == NONE) {
        found.clear();
        found.extend(neighbors(node).map(|other| roots[other]).filter(|&aggregate| aggregate != NONE));
        found.sort_unstable();
        let most = found.chunk_by(|one, other| one == other).max_by(|one, other| one.len().cmp(&other.len()));
        if let Some(&[aggregate, ..]) = most {
            of_node[node] = aggregate;
        }
    }
    // What remains has no neighbor in an aggregate of the first pass.
    for node in 0..a.rows() {
        let mut free = neighbors(node).filter(|&other| of_node[other] == NONE).peekable();
        if of_node[node] != NONE || free.peek().is_none() {
            continue;
        }
        let free: Vec<usize> = free.collect();
        free.into_iter().for_each(|other| of_node[other] = count);
        of_node[node] = count;
        count += 1;
    }
    join_leftovers(a, strong, &mut of_node);
    Aggregates { of_node, count: count as usize }
}

/// Puts nodes whose strong neighbors all joined other aggregates in the last pass into one of these.
fn join_leftovers(a: &BlockMatrix<f64>, strong: &[bool], of_node: &mut [u32]) {
    for node in 0..a.rows() {
        if of_node[node] == NONE {
            let neighbors = a.range(node).filter(|&at| strong[at]).map(|at| a.columns[at] as usize);
            of_node[node] = neighbors.map(|other| of_node[other]).find(|&found| found != NONE).unwrap_or(NONE);
        }
    }
}
