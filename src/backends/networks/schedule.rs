//! The operations of a Cholesky factorization of matrices of 3x3 blocks, as data: the same for every matrix with a
//! pattern, so that many matrices are factored side by side.

use std::ops::Range;

/// The index that denotes no block, no edge.
pub(in crate::backends) const NONE: u32 = u32::MAX;

/// How a factorization is divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::backends) struct TileShape {
    /// The columns of a tile, and the rows below it whose sums are in registers at the same time.
    pub columns: usize,
    pub rows: usize,
    /// Panels, if there are any.
    pub panels: Option<PanelShape>,
}

/// The panels of a factorization.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::backends) struct PanelShape {
    /// The most tiles of a panel.
    pub tiles: usize,
    /// The earlier columns that update a panel at the same time.
    pub depth: usize,
    /// The least number of earlier columns with entries in its rows for which a panel is updated before its tiles are
    /// factored. With fewer, it takes longer to load and store the sums.
    pub least: usize,
}

/// The operations of one factorization and of its solves. Nodes are numbered by their place in the elimination order;
/// blocks of the factor below the diagonal are numbered column after column, and a last block is zero. A tile is a run
/// of columns of which each has an entry in the row of the next. Each list has the tiles one after the other; a tile
/// has fewer columns than its shape if the run is shorter, and the zero block takes the place of blocks that do not
/// exist. A panel is a run of tiles of one run of columns: the columns before it update all its tiles, a few columns at
/// a time, whose blocks stay in the cache, before the tiles are factored one after the other. The order of the sums is
/// the same as without panels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::backends) struct Schedule {
    /// The number of tiles.
    pub tiles: usize,
    /// By tile: its first column and the number of its columns; for each pair of its columns, the block and its edge
    /// ([`NONE`] for a block that does not exist or that starts as zero); the number of earlier columns with entries in
    /// its rows, and for each of them, the column and the blocks in these rows. Then the number of groups of rows below
    /// it. For each group: for each of its blocks, row by row, the block and its edge; the number of updates; for each
    /// update, the blocks of an earlier column in the rows of the tile, and those in the rows of the group. Without the
    /// updates that are in `updates`.
    pub factor: Vec<u32>,
    /// The number of panels.
    pub panels: usize,
    /// By panel: the number of its tiles, and the number of its steps, 0 if all updates are in `factor`. For each step:
    /// by tile, the head as in `factor` down to the earlier columns, of which there are those of this step; the number
    /// of groups of all tiles, and the groups as in `factor`, row by row. The first step has all groups, the others
    /// only those with updates.
    pub updates: Vec<u32>,
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

    /// Returns the panels of at most this number of tiles.
    fn panels(&self, tiles: &[Tile], most: usize) -> Vec<Range<usize>> {
        let mut panels: Vec<Range<usize>> = Vec::new();
        for (number, tile) in tiles.iter().enumerate() {
            let continues = tile.start > 0 && self.columns[tile.start as usize - 1].first() == Some(&tile.start);
            match panels.last_mut() {
                Some(panel) if continues && panel.len() < most => panel.end += 1,
                _ => panels.push(number..number + 1),
            }
        }
        panels
    }
}

/// Returns the ascending union of lists.
fn union<'a>(lists: impl Iterator<Item = &'a Vec<u32>>, keep: impl Fn(u32) -> bool) -> Vec<u32> {
    let mut all: Vec<u32> = lists.flatten().copied().filter(|&k| keep(k)).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// A tile of a schedule that is being made.
struct Tile {
    /// Its columns, and after the last one.
    start: u32,
    end: u32,
    /// The rows below it.
    below: Vec<u32>,
}

impl Tile {
    fn new(blocks: &Blocks, start: u32, end: u32) -> Self {
        let below = union((start..end).map(|j| &blocks.columns[j as usize]), |i| i >= end);
        Self { start, end, below }
    }

    fn column(&self, k: usize) -> Option<u32> {
        (self.start..self.end).nth(k)
    }

    /// The blocks of the pairs of columns.
    fn pairs(&self, blocks: &Blocks, shape: TileShape) -> Vec<Option<u32>> {
        let pairs = (0..shape.columns).flat_map(|p| (0..p).map(move |q| (p, q)));
        pairs.map(|(p, q)| blocks.find(self.column(p)?, self.column(q)?)).collect()
    }

    /// The blocks of an earlier column in the rows of the tile.
    fn blocks_of(&self, blocks: &Blocks, shape: TileShape, before: u32) -> Vec<u32> {
        (0..shape.columns).map(|k| blocks.find_or_zero(self.column(k), before)).collect()
    }

    /// The columns with entries in the rows of the tile, of which `keep` is true.
    fn before(&self, blocks: &Blocks, keep: impl Fn(u32) -> bool) -> Vec<u32> {
        union((self.start..self.end).map(|j| &blocks.rows[j as usize]), keep)
    }
}

/// The lists of operations while they are made.
struct Writer<'a> {
    blocks: &'a Blocks,
    shape: TileShape,
    reads: usize,
}

impl Writer<'_> {
    fn count_reads(&mut self, of_blocks: &[u32]) {
        self.reads += of_blocks.iter().filter(|&&block| block != self.blocks.count()).count();
    }

    /// Writes the head of a tile, with updates by the columns `before`.
    fn head(&mut self, to: &mut Vec<u32>, tile: &Tile, before: &[u32]) {
        to.extend([tile.start, tile.end - tile.start]);
        to.extend(tile.pairs(self.blocks, self.shape).iter().flat_map(|&pair| block_and_edge(self.blocks, pair)));
        to.push(before.len() as u32);
        for &k in before {
            let of_column = tile.blocks_of(self.blocks, self.shape, k);
            self.count_reads(&of_column);
            to.push(k);
            to.extend(of_column);
        }
    }

    /// Writes a group of rows below a tile, with updates by those of the columns `before` that have entries there.
    /// Returns the number of updates.
    fn group(&mut self, to: &mut Vec<u32>, tile: &Tile, group: &[u32], before: &[u32]) -> u32 {
        let (blocks, shape) = (self.blocks, self.shape);
        let row = |r: usize| group.get(r).copied();
        for r in 0..shape.rows {
            let of_row = (0..shape.columns).map(|q| blocks.find(row(r)?, tile.column(q)?));
            to.extend(of_row.flat_map(|block| block_and_edge(blocks, block)));
        }
        let count = to.len();
        to.push(0);
        for &k in before {
            let of_rows: Vec<u32> = (0..shape.rows).map(|r| blocks.find_or_zero(row(r), k)).collect();
            if of_rows.iter().any(|&block| block != blocks.count()) {
                let of_column = tile.blocks_of(blocks, shape, k);
                self.count_reads(&of_column);
                self.count_reads(&of_rows);
                to.extend(of_column.iter().chain(&of_rows));
                to[count] += 1;
            }
        }
        to[count]
    }

    /// Writes the updates of a panel by the columns before it. Returns false if there are too few of them, or
    /// a single tile.
    fn panel(&mut self, to: &mut Vec<u32>, tiles: &[Tile], shape: PanelShape) -> bool {
        let Some(start) = tiles.first().map(|tile| tile.start) else { return false };
        let before_tile: Vec<Vec<u32>> = tiles.iter().map(|tile| tile.before(self.blocks, |k| k < start)).collect();
        let before = union(before_tile.iter(), |_| true);
        let below = union(tiles.iter().map(|tile| &tile.below), |_| true);
        if tiles.len() == 1 || before.len() < shape.least {
            to.extend([tiles.len() as u32, 0]);
            return false;
        }
        to.extend([tiles.len() as u32, before.len().div_ceil(shape.depth) as u32]);
        for (step, columns) in before.chunks(shape.depth).enumerate() {
            let of_step = |before: &Vec<u32>| before.iter().copied().filter(|k| columns.contains(k)).collect();
            let before: Vec<Vec<u32>> = before_tile.iter().map(of_step).collect();
            tiles.iter().zip(&before).for_each(|(tile, before)| self.head(to, tile, before));
            let groups = to.len();
            to.push(0);
            for &row in &below {
                for (tile, before) in tiles.iter().zip(&before).filter(|(tile, _)| tile.below.contains(&row)) {
                    let length = to.len();
                    if self.group(to, tile, &[row], before) > 0 || step == 0 {
                        to[groups] += 1;
                    } else {
                        to.truncate(length);
                    }
                }
            }
        }
        true
    }
}

impl Schedule {
    /// Makes the schedule of a matrix with a diagonal block for each of `nodes` and a pair of blocks for each edge,
    /// whose nodes are numbered in the order of their elimination.
    ///
    /// # Panics
    /// Panics if there are panels and groups of more than one row.
    pub fn new(nodes: usize, edges: &[[u32; 2]], shape: TileShape) -> Self {
        assert!(shape.panels.is_none() || shape.rows == 1, "panels have groups of one row");
        let blocks = Blocks::new(nodes, edges);
        let tiles: Vec<Tile> =
            blocks.tiles(shape.columns).windows(2).map(|ends| Tile::new(&blocks, ends[0], ends[1])).collect();
        let mut writer = Writer { blocks: &blocks, shape, reads: 0 };
        let (mut factor, mut updates, mut panels) = (Vec::new(), Vec::new(), 0);
        // Of each tile, the column from which on the updates are in `factor`.
        let mut first = vec![0; tiles.len()];
        if let Some(shape) = shape.panels {
            for panel in blocks.panels(&tiles, shape.tiles) {
                if writer.panel(&mut updates, &tiles[panel.clone()], shape) {
                    first[panel.clone()].fill(tiles[panel.start].start);
                }
                panels += 1;
            }
        }
        for (tile, &first) in tiles.iter().zip(&first) {
            let before = tile.before(&blocks, |k| (first..tile.start).contains(&k));
            writer.head(&mut factor, tile, &before);
            factor.push(tile.below.len().div_ceil(shape.rows) as u32);
            for group in tile.below.chunks(shape.rows) {
                writer.group(&mut factor, tile, group, &before);
            }
        }
        let reads = writer.reads;
        let forward = tiles.iter().flat_map(|tile| forward(&blocks, shape, tile)).collect();
        let backward = tiles.iter().rev().flat_map(|tile| backward(&blocks, shape, tile)).collect();
        Self { tiles: tiles.len(), factor, panels, updates, forward, backward, columns: blocks.columns, reads }
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
        operations_of(&self.columns)
    }
}

/// Returns [`Schedule::operations`] without making the schedule.
pub(in crate::backends) fn operations(nodes: usize, edges: &[[u32; 2]]) -> f64 {
    operations_of(&eliminate(nodes, edges))
}

fn operations_of(columns: &[Vec<u32>]) -> f64 {
    let of_column = |rows: &Vec<u32>| {
        let below = rows.len() as f64;
        // The factor of the diagonal block and its inverse, the blocks of the column, and the updates by them.
        24.0 + 27.0 * below + 27.0 * below * (below + 1.0)
    };
    columns.iter().map(of_column).sum()
}

/// Returns the operations of the solution with a tile, as in [`Schedule::forward`].
fn forward(blocks: &Blocks, shape: TileShape, tile: &Tile) -> Vec<u32> {
    let before = tile.before(blocks, |k| k < tile.start);
    let mut list = vec![tile.start, tile.end - tile.start];
    list.extend(tile.pairs(blocks, shape).iter().map(|pair| pair.unwrap_or(blocks.count())));
    list.push(before.len() as u32);
    for k in before {
        list.push(k);
        list.extend(tile.blocks_of(blocks, shape, k));
    }
    list
}

/// Returns the operations of the solution with the transpose of a tile, as in [`Schedule::backward`].
fn backward(blocks: &Blocks, shape: TileShape, tile: &Tile) -> Vec<u32> {
    let mut list = vec![tile.start, tile.end - tile.start];
    list.extend(tile.pairs(blocks, shape).iter().map(|pair| pair.unwrap_or(blocks.count())));
    list.push(tile.below.len() as u32);
    // Descending, so that the order of the sums does not depend on the tiles.
    for &i in tile.below.iter().rev() {
        let of_column = |q| tile.column(q).map_or(blocks.count(), |q| blocks.find_or_zero(Some(i), q));
        list.push(i);
        list.extend((0..shape.columns).map(of_column));
    }
    list
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
        let star = Schedule::new(4, &[[0, 1], [0, 2], [0, 3]], TileShape { columns: 2, rows: 2, panels: None });
        assert_eq!((star.blocks(), star.tiles), (6, 2));
        assert_eq!(star.operations(), operations(4, &[[0, 1], [0, 2], [0, 3]]));
        let of_first = [0, 2, 0, 0, 0, 1, 1, 1, 3, NONE, 2, 2, 4, NONE, 0];
        let of_second = [2, 2, 5, NONE, 2, 0, 1, 2, 1, 3, 4, 0];
        assert_eq!(star.factor, [&of_first[..], &of_second[..]].concat());
        assert_eq!(star.forward, [0, 2, 0, 0, 2, 2, 5, 2, 0, 1, 2, 1, 3, 4]);
        assert_eq!(star.backward, [2, 2, 5, 0, 0, 2, 0, 2, 3, 2, 4, 2, 1, 3]);
        assert_eq!(star.reads(), 4);
    }

    /// The columns 2 and 3 are a panel, which both columns before it update first.
    #[test]
    fn panels_are_updated_first() {
        let panels = Some(PanelShape { tiles: 2, depth: 1, least: 2 });
        let shape = TileShape { columns: 1, rows: 1, panels };
        let schedule = Schedule::new(4, &[[0, 2], [0, 3], [1, 3]], shape);
        assert_eq!((schedule.panels, schedule.tiles, schedule.blocks()), (3, 4, 4));
        let no_steps = [1, 0, 1, 0];
        let of_column_0 = [2, 1, 1, 0, 0, 3, 1, 1, 0, 1, 1, 3, NONE, 1, 0, 1];
        let of_column_1 = [2, 1, 0, 3, 1, 1, 1, 2, 0];
        assert_eq!(schedule.updates, [&no_steps[..], &[2, 2], &of_column_0, &of_column_1].concat());
        let last_two = [2, 1, 0, 1, 3, NONE, 0, 3, 1, 1, 2, 3, 0];
        assert_eq!(schedule.factor[schedule.factor.len() - last_two.len()..], last_two);
    }

    #[test]
    fn a_path_has_no_fill() {
        let path = Schedule::new(3, &[[0, 1], [2, 1]], TileShape { columns: 3, rows: 1, panels: None });
        assert_eq!((path.blocks(), path.tiles), (2, 1));
        assert_eq!(path.factor, [0, 3, 0, 0, NONE, NONE, 1, 1, 0, 0]);
        assert_eq!(Schedule::new(0, &[], TileShape { columns: 3, rows: 1, panels: None }).tiles, 0);
    }
}
