//! The operations of a Cholesky factorization of matrices of 3x3 blocks, as data: the same for every matrix with a
//! pattern, so that many matrices are factored side by side.

/// The index that denotes no block, no edge.
pub(super) const NONE: u32 = u32::MAX;

/// The number of rows of a column whose sums are in registers at the same time.
pub(super) const ROWS: usize = 4;

/// The operations of one factorization and of its solves. Nodes are numbered by their place in the elimination order;
/// blocks of the factor below the diagonal are numbered column after column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Schedule {
    /// By node: the number of groups of at most [`ROWS`] blocks of its column; for each group, the number of each block
    /// and the edge that it starts from ([`NONE`] for fill), then the number of updates; for each update, the block of
    /// the row of the node and those of the rows of the group, which are multiplied by it.
    pub factor: Vec<u32>,
    /// The blocks of each row left of the diagonal, with their columns.
    pub row_start: Vec<u32>,
    pub row_blocks: Vec<u32>,
    /// The blocks of each column below the diagonal: their rows.
    pub column_start: Vec<u32>,
    pub column_rows: Vec<u32>,
}

impl Schedule {
    /// Makes the schedule of a matrix with a diagonal block for each of `nodes` and a pair of blocks for each edge, whose
    /// nodes are numbered in the order of their elimination.
    pub fn new(nodes: usize, edges: &[[u32; 2]]) -> Self {
        let columns = eliminate(nodes, edges);
        let (column_start, column_rows) = flattened(&columns);
        let mut rows: Vec<Vec<[u32; 2]>> = vec![Vec::new(); nodes];
        for (column, below) in columns.iter().enumerate() {
            for (block, &row) in (column_start[column]..).zip(below) {
                rows[row as usize].push([block, column as u32]);
            }
        }
        let mut edge_of = vec![NONE; column_rows.len()];
        let place =
            |column: usize, row: u32| columns[column].binary_search(&row).map(|k| column_start[column] as usize + k);
        for (number, &[a, b]) in edges.iter().enumerate() {
            if let Ok(block) = place(a.min(b) as usize, a.max(b)) {
                edge_of[block] = number as u32;
            }
        }
        let mut factor = Vec::new();
        for (column, below) in columns.iter().enumerate() {
            factor.push(below.len().div_ceil(ROWS) as u32);
            let blocks: Vec<(u32, u32)> = (column_start[column]..).zip(below.iter().copied()).collect();
            for group in blocks.chunks(ROWS) {
                for k in 0..ROWS {
                    let block = group.get(k).map_or(NONE, |&(block, _)| block);
                    factor.extend([block, edge_of.get(block as usize).copied().unwrap_or(NONE)]);
                }
                let count = factor.len();
                factor.push(0);
                for &[block, before] in &rows[column] {
                    let of_group = |k: usize| {
                        let &(_, row) = group.get(k)?;
                        place(before as usize, row).ok().map(|block| block as u32)
                    };
                    let update: [u32; ROWS] = std::array::from_fn(|k| of_group(k).unwrap_or(NONE));
                    if update.iter().any(|&block| block != NONE) {
                        factor.push(block);
                        factor.extend(update);
                        factor[count] += 1;
                    }
                }
            }
        }
        let (row_start, row_blocks) = flattened(&rows);
        let row_blocks = row_blocks.into_iter().flatten().collect();
        Self { factor, row_start, row_blocks, column_start, column_rows }
    }

    /// The number of blocks below the diagonal.
    pub fn blocks(&self) -> usize {
        self.column_rows.len()
    }

    /// The number of blocks that the updates of the columns below the diagonal read.
    pub fn reads(&self) -> usize {
        let mut ops = self.factor.iter().copied();
        let mut reads = 0;
        while let Some(groups) = ops.next() {
            for _ in 0..groups {
                let updates = ops.by_ref().skip(2 * ROWS).next().unwrap_or(0);
                let blocks = ops.by_ref().take((1 + ROWS) * updates as usize);
                reads += blocks.filter(|&block| block != NONE).count();
            }
        }
        reads
    }

    /// The number of floating-point operations of one factorization, one for each multiplication and each addition.
    pub fn operations(&self) -> f64 {
        let of_column = |rows: &[u32]| {
            let below = rows.len() as f64;
            // The factor of the diagonal block and its inverse, the blocks of the column, and the updates by them.
            24.0 + 27.0 * below + 27.0 * below * (below + 1.0)
        };
        let columns = self.column_start.windows(2).map(|ends| &self.column_rows[ends[0] as usize..ends[1] as usize]);
        columns.map(of_column).sum()
    }
}

/// Returns the rows of each column of the factor below the diagonal, ascending.
fn eliminate(nodes: usize, edges: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut columns: Vec<Vec<u32>> = vec![Vec::new(); nodes];
    for &[a, b] in edges {
        columns[a.min(b) as usize].push(a.max(b));
    }
    for node in 0..nodes {
        columns[node].sort_unstable();
        columns[node].dedup();
        // The rows of a column, without the first, are rows of the first one's column too.
        if let Some((&parent, rest)) = columns[node].split_first() {
            let rest = rest.to_vec();
            columns[parent as usize].extend(rest);
        }
    }
    columns
}

/// Returns where each list begins in the second return value, which holds all of them.
pub(super) fn flattened<T: Copy>(lists: &[Vec<T>]) -> (Vec<u32>, Vec<T>) {
    let mut start = vec![0];
    start.extend(lists.iter().scan(0, |sum, list| {
        *sum += list.len() as u32;
        Some(*sum)
    }));
    (start, lists.concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_has_no_fill_and_a_star_fills_up() {
        let path = Schedule::new(4, &[[0, 1], [2, 1], [2, 3]]);
        assert_eq!((path.column_start, path.column_rows), (vec![0, 1, 2, 3, 3], vec![1, 2, 3]));
        assert_eq!(path.row_blocks, [0, 0, 1, 1, 2, 2]);
        // The center is eliminated first and couples all others.
        let star = Schedule::new(4, &[[0, 1], [0, 2], [0, 3]]);
        assert_eq!(star.blocks(), 6);
        assert_eq!(star.factor[..10], [1, 0, 0, 1, 1, 2, 2, NONE, NONE, 0]);
        assert_eq!(star.factor[10..20], [1, 3, NONE, 4, NONE, NONE, NONE, NONE, NONE, 1]);
        assert_eq!(star.factor[20..25], [0, 1, 2, NONE, NONE]);
        assert_eq!(star.reads(), 3 + 2);
    }
}
