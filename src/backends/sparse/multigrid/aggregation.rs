//! Aggregates of strongly coupled nodes (P. Vanek, J. Mandel, M. Brezina, *Algebraic multigrid by smoothed aggregation
//! for second and fourth order elliptic problems*, Computing 56, 1996, section 4).

use super::blocks::{BlockMatrix, Entry};

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
    let norms = square_norms(a);
    let mut diagonal = vec![0.0; a.rows()];
    for (row, diagonal) in diagonal.iter_mut().enumerate() {
        let of_row = a.range(row).find(|&at| a.columns[at] as usize == row);
        *diagonal = of_row.map_or(0.0, |at| norms[at].sqrt());
    }
    let mut strong = vec![false; norms.len()];
    for row in 0..a.rows() {
        for at in a.range(row) {
            let column = a.columns[at] as usize;
            strong[at] = column != row && norms[at] > threshold * threshold * diagonal[row] * diagonal[column];
        }
    }
    strong
}

fn square_norms<T: Entry>(a: &BlockMatrix<T>) -> Vec<f64> {
    let norm = |block: &[T]| block.iter().map(|value| value.as_f64() * value.as_f64()).sum();
    a.values.chunks_exact(a.size.0 * a.size.1).map(norm).collect()
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
