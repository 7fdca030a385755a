//! The partition of the nodes into supernodes.

use crate::backends::sparse::order::{Graph, NONE, Tree};

/// The largest number of nodes in a supernode. With this width, three rows of a panel and the rows of a diagonal block
/// fit into the first-level cache.
const WIDEST: usize = 16;

/// Runs of positions that are eliminated together, and the positions below each run in which its columns have entries.
pub(super) struct Supernodes {
    /// The first position of each supernode; one entry more than there are supernodes.
    first: Vec<u32>,
    /// The positions below each supernode, ascending.
    rows: Vec<u32>,
    row_offsets: Vec<u32>,
    /// The supernode of each position.
    owner: Vec<u32>,
}

impl Supernodes {
    pub(super) fn new(graph: &Graph, tree: &Tree) -> Self {
        let runs = merged(tree);
        let below = rows_below(graph, tree, &runs);
        let mut supernodes =
            Self { first: vec![0], rows: Vec::new(), row_offsets: vec![0], owner: vec![0; graph.nodes()] };
        for (run, below) in runs.iter().zip(below) {
            let pieces = run.width().div_ceil(WIDEST);
            for piece in 0..pieces {
                let begin = run.first + run.width() * piece / pieces;
                let end = run.first + run.width() * (piece + 1) / pieces;
                let number = supernodes.count() as u32;
                supernodes.owner[begin..end].fill(number);
                // A piece couples to the rest of its run.
                supernodes.rows.extend((end..run.end).map(|row| row as u32));
                supernodes.rows.extend_from_slice(&below);
                supernodes.row_offsets.push(supernodes.rows.len() as u32);
                supernodes.first.push(end as u32);
            }
        }
        supernodes
    }

    pub(super) fn count(&self) -> usize {
        self.first.len() - 1
    }

    /// Returns the first position of a supernode.
    #[inline(always)]
    pub(super) fn first(&self, s: usize) -> usize {
        self.first[s] as usize
    }

    /// Returns the number of nodes in a supernode.
    #[inline(always)]
    pub(super) fn width(&self, s: usize) -> usize {
        (self.first[s + 1] - self.first[s]) as usize
    }

    /// Returns the positions below a supernode, ascending.
    #[inline(always)]
    pub(super) fn rows(&self, s: usize) -> &[u32] {
        &self.rows[self.row_offsets[s] as usize..self.row_offsets[s + 1] as usize]
    }

    /// Returns the number of nodes in a supernode and below it.
    pub(super) fn height(&self, s: usize) -> usize {
        self.width(s) + self.rows(s).len()
    }

    /// Returns the supernode of a position.
    pub(super) fn of_position(&self, position: usize) -> u32 {
        self.owner[position]
    }

    /// Returns the panel row of a position, which must belong to the panel.
    pub(super) fn row_of(&self, s: usize, position: usize) -> usize {
        match position.checked_sub(self.first(s)) {
            Some(own) if own < self.width(s) => own,
            _ => self.width(s) + self.rows(s).partition_point(|&row| (row as usize) < position),
        }
    }

    /// Returns the panel column of a position, counted in nodes.
    pub(super) fn column_of(&self, s: usize, position: usize) -> usize {
        position - self.first(s)
    }
}

/// A run of positions, and the explicit zeros caused by merging.
#[derive(Clone, Copy)]
struct Run {
    first: usize,
    end: usize,
    /// The number of stored blocks that are zero.
    zeros: usize,
}

impl Run {
    fn width(&self) -> usize {
        self.end - self.first
    }
}

/// Returns the runs of positions with (nearly) the same rows below: a few explicit zeros cost less than another
/// supernode.
fn merged(tree: &Tree) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for position in 0..tree.counts.len() {
        let mut run = Run { first: position, end: position + 1, zeros: 0 };
        while let Some(before) = runs.last() {
            let parent = tree.parent[before.end - 1];
            if parent == NONE || parent as usize >= run.end || !worth_merging(tree, before, &run) {
                break;
            }
            run.zeros += before.zeros + added_zeros(tree, before, &run);
            run.first = before.first;
            runs.pop();
        }
        runs.push(run);
    }
    runs
}

/// Returns the number of blocks of `before` that are stored only because `run` has entries in their rows.
fn added_zeros(tree: &Tree, before: &Run, run: &Run) -> usize {
    let below = |run: &Run| tree.counts[run.end - 1] as usize - 1;
    before.width() * (run.width() + below(run) - below(before))
}

fn worth_merging(tree: &Tree, before: &Run, run: &Run) -> bool {
    let zeros = before.zeros + run.zeros + added_zeros(tree, before, run);
    let width = before.width() + run.width();
    let blocks = width * (width + 1) / 2 + width * (tree.counts[run.end - 1] as usize - 1);
    let share = zeros as f64 / blocks as f64;
    zeros == 0 || width <= 4 && share < 0.3 || width <= 16 && share < 0.1 || share < 0.03
}

/// Returns the positions below each run: all positions of a run have entries in the same rows as its last position,
/// some of them explicit zeros.
fn rows_below(graph: &Graph, tree: &Tree, runs: &[Run]) -> Vec<Vec<u32>> {
    let mut run_that_ends_at = vec![NONE; graph.nodes()];
    for (k, run) in runs.iter().enumerate() {
        run_that_ends_at[run.end - 1] = k as u32;
    }
    let mut below: Vec<Vec<u32>> =
        runs.iter().map(|run| Vec::with_capacity(tree.counts[run.end - 1] as usize - 1)).collect();
    tree.for_each_entry(graph, |row, column| {
        if let Some(below) = below.get_mut(run_that_ends_at[column] as usize) {
            below.push(row as u32);
        }
    });
    below
}
