//! The operations of a Cholesky factorization of matrices of 3x3 blocks, as data: the same for every matrix with a
//! pattern, so that many matrices are factored side by side.

/// The index that denotes no block, no edge.
pub(in crate::backends) const NONE: u32 = u32::MAX;

/// The columns of a tile, and the rows below it whose sums are in registers at the same time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::backends) struct TileShape {
    pub columns: usize,
    pub rows: usize,
}

/// The operations of one factorization and of its solves. Nodes are numbered by their place in the elimination order;
/// blocks of the factor below the diagonal are numbered column after column, and a last block is zero. A tile is a run of
/// columns of which each has an entry in the row of the next. Each list has the tiles one after the other; a tile has
/// fewer columns than its shape if the run is shorter, and the zero block takes the place of blocks that do not exist.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::backends) struct Schedule {
    /// The number of tiles.
    pub tiles: usize,
    /// By tile: its first column and the number of its columns; for each pair of its columns, the block and its edge
    /// ([`NONE`] for a block that does not exist or that starts as zero); the number of earlier columns with entries in
    /// its rows, and for each of them, the column and the blocks in these rows. Then the number of groups of rows below
    /// it. For each group: for each of its blocks, row by row, the block and its edge; the number of updates; for each
    /// update, the blocks of an earlier column in the rows of the tile, and those in the rows of the group.
    pub factor: Vec<u32>,
    /// By tile: its first column and the number of its columns, the blocks of the pairs of its columns, the number of
    /// earlier columns with entries in its rows, and for each of them, the column and these blocks.
    pub forward: Vec<u32>,
    /// By tile, from the last to the first: its first column and the number of its columns, the blocks of the pairs of
    /// its columns, the number of rows below, and for each of them, from the last to the first, the row and its blocks.
    pub backward: Vec<u32>,
    /// The rows of the blocks, by column, ascending.
    columns: Vec<Vec<u32>>,
    /// Blocks that a factorization reads.
    reads: usize,
}

/// What is known while a schedule is made.
struct Blocks {
    /// The rows of each column.
    columns: Vec<Vec<u32>>,
    /// The columns of each row, left of the diagonal.
    rows: Vec<Vec<u32>>,
    /// The number of the first block of each column.
    first: Vec<u32>,
    /// The edge of each block.
    edge_of: Vec<u32>,
}

impl Blocks {
    fn new(nodes: usize, edges: &[[u32; 2]]) -> Self {
        let columns = eliminate(nodes, edges);
        let mut rows: Vec<Vec<u32>> = vec![Vec::new(); nodes];
        let mut first = vec![0];
        for (column, below) in columns.iter().enumerate() {
            below.iter().for_each(|&row| rows[row as usize].push(column as u32));
            first.push(first[column] + below.len() as u32);
        }
        let mut blocks = Self { edge_of: vec![NONE; first[nodes] as usize], columns, rows, first };
        for (number, &[a, b]) in edges.iter().enumerate() {
            if let Some(block) = blocks.find(a.max(b), a.min(b)) {
                blocks.edge_of[block as usize] = number as u32;
            }
        }
        blocks
    }

    fn count(&self) -> u32 {
        self.edge_of.len() as u32
    }

    /// Returns the block in this row and column, if there is one.
    fn find(&self, row: u32, column: u32) -> Option<u32> {
        let place = self.columns[column as usize].binary_search(&row).ok()?;
        Some(self.first[column as usize] + place as u32)
    }

    /// Returns the block in this row and column, or the zero block.
    fn find_or_zero(&self, row: Option<u32>, column: u32) -> u32 {
        row.and_then(|row| self.find(row, column)).unwrap_or(self.count())
    }

    /// Returns the tiles: their first columns, and one after the last.
    fn tiles(&self, most: usize) -> Vec<u32> {
        let mut starts = vec![0];
        let (mut start, nodes) = (0, self.columns.len());
        for column in 1..nodes {
            let continues = self.columns[column - 1].first() == Some(&(column as u32));
            if !continues || column - start == most {
                starts.push(column as u32);
                start = column;
            }
        }
        if nodes > 0 {
            starts.push(nodes as u32);
        }
        starts
    }
}

/// Returns the ascending union of lists.
fn union<'a>(lists: impl Iterator<Item = &'a Vec<u32>>, keep: impl Fn(u32) -> bool) -> Vec<u32> {
    let mut all: Vec<u32> = lists.flatten().copied().filter(|&k| keep(k)).collect();
    all.sort_unstable();
    all.dedup();
    all
}

impl Schedule {
    /// Makes the schedule of a matrix with a diagonal block for each of `nodes` and a pair of blocks for each edge, whose
    /// nodes are numbered in the order of their elimination.
    pub fn new(nodes: usize, edges: &[[u32; 2]], shape: TileShape) -> Self {
        let blocks = Blocks::new(nodes, edges);
        let starts = blocks.tiles(shape.columns);
        let (mut factor, mut forward, mut backward) = (Vec::new(), Vec::new(), Vec::new());
        let mut reads = 0;
        let is_block = |&&block: &&u32| block != blocks.count();
        for ends in starts.windows(2) {
            let tile = ends[0]..ends[1];
            let column = |k: usize| tile.clone().nth(k);
            let pairs: Vec<Option<u32>> = (0..shape.columns)
                .flat_map(|p| (0..p).map(move |q| (p, q)))
                .map(|(p, q)| blocks.find(column(p)?, column(q)?))
                .collect();
            let in_tile = |before: u32| (0..shape.columns).map(move |k| (k, before));
            let blocks_of = |before: u32| -> Vec<u32> {
                in_tile(before).map(|(k, before)| blocks.find_or_zero(column(k), before)).collect()
            };
            let before = union(tile.clone().map(|j| &blocks.rows[j as usize]), |k| k < tile.start);
            let below = union(tile.clone().map(|j| &blocks.columns[j as usize]), |i| i >= tile.end);

            let header = [tile.start, tile.end - tile.start];
            factor.extend(header);
            factor.extend(pairs.iter().flat_map(|&pair| block_and_edge(&blocks, pair)));
            factor.push(before.len() as u32);
            forward.extend(header);
            forward.extend(pairs.iter().map(|pair| pair.unwrap_or(blocks.count())));
            forward.push(before.len() as u32);
            for &k in &before {
                let of_column = blocks_of(k);
                reads += of_column.iter().filter(is_block).count();
                for list in [&mut factor, &mut forward] {
                    list.push(k);
                    list.extend(&of_column);
                }
            }
            factor.push(below.len().div_ceil(shape.rows) as u32);
            for group in below.chunks(shape.rows) {
                let row = |r: usize| group.get(r).copied();
                for r in 0..shape.rows {
                    let of_row = (0..shape.columns).map(|q| blocks.find(row(r)?, column(q)?));
                    factor.extend(of_row.flat_map(|block| block_and_edge(&blocks, block)));
                }
                let count = factor.len();
                factor.push(0);
                for &k in &before {
                    let of_rows: Vec<u32> = (0..shape.rows).map(|r| blocks.find_or_zero(row(r), k)).collect();
                    if of_rows.iter().any(|&block| block != blocks.count()) {
                        let of_column = blocks_of(k);
                        reads += of_column.iter().chain(&of_rows).filter(is_block).count();
                        factor.extend(of_column.iter().chain(&of_rows));
                        factor[count] += 1;
                    }
                }
            }
            let mut reversed = header.to_vec();
            reversed.extend(pairs.iter().map(|pair| pair.unwrap_or(blocks.count())));
            reversed.push(below.len() as u32);
            // Descending, so that the order of the sums does not depend on the tiles.
            for &i in below.iter().rev() {
                reversed.push(i);
                reversed.extend(
                    (0..shape.columns).map(|q| column(q).map_or(blocks.count(), |q| blocks.find_or_zero(Some(i), q))),
                );
            }
            backward.push(reversed);
        }
        backward.reverse();
        let (tiles, backward, columns) = (starts.len() - 1, backward.concat(), blocks.columns);
        Self { tiles, factor, forward, backward, columns, reads }
    }

    /// The number of blocks below the diagonal, without the zero block.
    pub fn blocks(&self) -> usize {
        self.columns.iter().map(Vec::len).sum()
    }

    /// The number of blocks that the updates of a factorization read.
    #[cfg(any(feature = "cuda", test))]
    pub fn reads(&self) -> usize {
        self.reads
    }

    /// The number of floating-point operations of one factorization, one for each multiplication and each addition,
    /// without those on zero blocks.
    pub fn operations(&self) -> f64 {
        let of_column = |rows: &Vec<u32>| {
            let below = rows.len() as f64;
            // The factor of the diagonal block and its inverse, the blocks of the column, and the updates by them.
            24.0 + 27.0 * below + 27.0 * below * (below + 1.0)
        };
        self.columns.iter().map(of_column).sum()
    }
}

fn block_and_edge(blocks: &Blocks, block: Option<u32>) -> [u32; 2] {
    block.map_or([NONE; 2], |block| [block, blocks.edge_of[block as usize]])
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_fills_up() {
        // The center is eliminated first and couples all others.
        let star = Schedule::new(4, &[[0, 1], [0, 2], [0, 3]], TileShape { columns: 2, rows: 2 });
        assert_eq!((star.blocks(), star.tiles), (6, 2));
        let of_first = [0, 2, 0, 0, 0, 1, 1, 1, 3, NONE, 2, 2, 4, NONE, 0];
        let of_second = [2, 2, 5, NONE, 2, 0, 1, 2, 1, 3, 4, 0];
        assert_eq!(star.factor, [&of_first[..], &of_second[..]].concat());
        assert_eq!(star.forward, [0, 2, 0, 0, 2, 2, 5, 2, 0, 1, 2, 1, 3, 4]);
        assert_eq!(star.backward, [2, 2, 5, 0, 0, 2, 0, 2, 3, 2, 4, 2, 1, 3]);
        assert_eq!(star.reads(), 4);
    }

    #[test]
    fn a_path_has_no_fill() {
        let path = Schedule::new(3, &[[0, 1], [2, 1]], TileShape { columns: 3, rows: 1 });
        assert_eq!((path.blocks(), path.tiles), (2, 1));
        assert_eq!(path.factor, [0, 3, 0, 0, NONE, NONE, 1, 1, 0, 0]);
        assert_eq!(Schedule::new(0, &[], TileShape { columns: 3, rows: 1 }).tiles, 0);
    }
}
