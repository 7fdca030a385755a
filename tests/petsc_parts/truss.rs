//! A truss on a grid of points, and its division into the parts of the ranks.

use std::collections::BTreeSet;
use std::sync::Arc;

use biotissue::backends::petsc::{Context, Distribution, Petsc};
use biotissue::las::{Backend, MatrixOps, RankRows, Sparsity, VectorOps};
use mpi::topology::{Color, Communicator, SimpleCommunicator};

pub type Matrix = <Petsc as Backend>::Matrix;
pub type Vector = <Petsc as Backend>::Vector;

/// Bars between neighboring points, also along diagonals, so that only rigid motions need no force.
pub struct Truss {
    /// The points with unknowns.
    points: Vec<[f64; 3]>,
    bars: Vec<Bar>,
}

/// Two ends (`None`: supported) and the product `k n n^T` of stiffness and direction.
type Bar = ([Option<usize>; 2], [[f64; 3]; 3]);

impl Truss {
    /// Returns a truss of `size` points along each axis; with supports, those at one end are fixed.
    pub fn new(size: [usize; 3], is_supported: bool) -> Self {
        let (mut points, mut numbers) = (Vec::new(), Vec::new());
        let all: Vec<[usize; 3]> =
            (0..size.iter().product()).map(|k| [k / (size[1] * size[2]), k / size[2] % size[1], k % size[2]]).collect();
        for at in &all {
            let is_free = !is_supported || at[0] > 0;
            numbers.push(is_free.then_some(points.len()));
            if is_free {
                points.push(at.map(|k| k as f64));
            }
        }
        let mut bars = Vec::new();
        for (k, a) in all.iter().enumerate() {
            for (l, b) in all.iter().enumerate().skip(k + 1) {
                let n: [f64; 3] = std::array::from_fn(|i| b[i] as f64 - a[i] as f64);
                if n.iter().all(|n| n.abs() <= 1.0) && (numbers[k].is_some() || numbers[l].is_some()) {
                    let squares: f64 = n.iter().map(|n| n * n).sum();
                    let stiffness = (1.0 + (k % 7) as f64) / squares.powf(1.5);
                    bars.push(([numbers[k], numbers[l]], n.map(|row| n.map(|column| stiffness * row * column))));
                }
            }
        }
        Self { points, bars }
    }

    pub fn unknowns(&self) -> usize {
        3 * self.points.len()
    }

    /// Returns the six rigid motions of the unknowns in a range.
    pub fn rigid_motions(&self, rows: std::ops::Range<usize>) -> Vec<Vec<f64>> {
        let motion = |motion: usize, row: usize| {
            let (x, component, axis) = (self.points[row / 3], row % 3, motion % 3);
            match (motion < 3, (component + 3 - axis) % 3) {
                (true, 0) => 1.0,
                (false, 1) => -x[(axis + 2) % 3],
                (false, 2) => x[(axis + 1) % 3],
                _ => 0.0,
            }
        };
        (0..6).map(|k| rows.clone().map(|row| motion(k, row)).collect()).collect()
    }

    fn unknowns_of(&self, bar: usize) -> [Option<usize>; 6] {
        let ends = self.bars[bar].0;
        std::array::from_fn(|k| ends[k / 3].map(|point| 3 * point + k % 3))
    }

    /// Adds the stiffness of the bars with unknowns of this rank; `number` gives the number of an unknown there.
    fn add_to(&self, a: &mut Matrix, number: impl Fn(usize) -> i32) {
        let mut slots = Vec::new();
        for (k, (_, product)) in self.bars.iter().enumerate() {
            let numbers = self.unknowns_of(k).map(|unknown| unknown.map_or(-1, &number));
            if !a.owns_any_row(&numbers) {
                continue;
            }
            let sign = |i: usize, j: usize| if i / 3 == j / 3 { 1.0 } else { -1.0 };
            let block: Vec<f64> =
                (0..36).map(|k| (k / 6, k % 6)).map(|(i, j)| sign(i, j) * product[i % 3][j % 3]).collect();
            if k % 2 == 0 {
                a.add(&numbers, &numbers, &block).unwrap();
            } else {
                slots.clear();
                a.locate(&numbers, &numbers, &mut slots).unwrap();
                a.add_at(&slots, &block).unwrap();
            }
        }
        a.finish().unwrap();
    }
}

/// The same system as copies and in parts.
pub struct Both {
    pub name: String,
    pub truss: Truss,
    pub copies: Context,
    pub whole_pattern: Arc<Sparsity>,
    pub parts: Context,
    pub pattern: Arc<Sparsity>,
    pub rows: RankRows,
}

/// How the unknowns are divided.
#[derive(Clone, Copy, Debug)]
pub enum Division {
    /// The later a rank, the more points it owns.
    Uneven,
    /// The last but one of several ranks owns nothing.
    EmptyRank,
    /// The first of several ranks owns nothing, not even ghosts.
    EmptyFirst,
    /// Unevenly, and between the unknowns of a point.
    WithinPoints,
}

impl Division {
    pub const ALL: [Self; 4] = [Self::Uneven, Self::EmptyRank, Self::EmptyFirst, Self::WithinPoints];

    /// Returns the own rows of a rank.
    pub fn own(self, unknowns: usize, rank: usize, ranks: usize) -> std::ops::Range<usize> {
        let weight = |rank: usize| match self {
            Self::EmptyRank if ranks > 1 && rank == ranks - 2 => 0,
            Self::EmptyFirst if ranks > 1 && rank == 0 => 0,
            _ => rank + 1,
        };
        let sum = |to: usize| (0..to).map(weight).sum::<usize>();
        let unit = if matches!(self, Self::WithinPoints) { 1 } else { 3 };
        let bound = |to: usize| unknowns / unit * sum(to) / sum(ranks) * unit;
        bound(rank)..bound(rank + 1)
    }
}

/// Calls a check with the communicator of all ranks and, for four ranks, with those of three ranks and of one.
pub fn on_communicators(context: &Context, mut check: impl FnMut(&Context)) {
    check(context);
    if context.ranks() > 2 {
        let color = Color::with_value(i32::from(context.rank() > 2));
        let some = SimpleCommunicator::world().split_by_color(color).expect("of one color");
        check(&Context::new(context.session(), &some));
    }
}

/// Calls a check with the same truss in all divisions on all communicators.
pub fn on_all(context: &Context, size: [usize; 3], is_supported: bool, mut check: impl FnMut(&Both)) {
    on_communicators(context, |context| {
        for division in Division::ALL {
            check(&Both::new(context, Truss::new(size, is_supported), division));
        }
    });
}

impl Both {
    pub fn new(context: &Context, truss: Truss, division: Division) -> Self {
        let total = truss.unknowns();
        let own = division.own(total, context.rank(), context.ranks());
        let mut columns = vec![BTreeSet::new(); own.len()];
        let mut ghosts = BTreeSet::new();
        let elements: Vec<[i32; 6]> =
            (0..truss.bars.len()).map(|bar| truss.unknowns_of(bar).map(|k| k.map_or(-1, |k| k as i32))).collect();
        for bar in 0..truss.bars.len() {
            let unknowns: Vec<usize> = truss.unknowns_of(bar).into_iter().flatten().collect();
            for row in unknowns.iter().filter(|row| own.contains(*row)) {
                columns[row - own.start].extend(unknowns.iter().copied());
                ghosts.extend(unknowns.iter().filter(|row| !own.contains(*row)).map(|&row| row as u32));
            }
        }
        let rows = RankRows { own, ghosts: ghosts.into_iter().collect(), total };
        let mut starts = vec![0];
        let mut local = Vec::new();
        for columns in columns {
            let mut columns: Vec<u32> = columns.into_iter().map(|c| rows.local_number(c).unwrap() as u32).collect();
            columns.sort_unstable();
            local.extend(columns);
            starts.push(local.len() as u32);
        }
        let pattern = Arc::new(Sparsity::from_rows(rows.local(), starts, local).unwrap());
        let parts = Petsc::with_rows(context, rows.clone()).unwrap().expect("PETSc distributes systems");
        assert_eq!((parts.distribution(), context.distribution()), (Distribution::Parts, Distribution::Copies));
        assert_eq!(parts.rows().map(|of_context| &**of_context), Some(&rows));
        let whole_pattern = Arc::new(Sparsity::from_elements(total, elements).unwrap());
        let name = format!("{division:?}, rank {} of {}", context.rank(), context.ranks());
        Self { name, truss, copies: context.clone(), whole_pattern, parts, pattern, rows }
    }

    /// Returns the stiffness as copies and in parts.
    pub fn matrices(&self) -> [Matrix; 2] {
        let mut whole = Petsc::matrix(&self.copies, &self.whole_pattern).unwrap();
        self.truss.add_to(&mut whole, |unknown| unknown as i32);
        let mut part = Petsc::matrix(&self.parts, &self.pattern).unwrap();
        self.truss.add_to(&mut part, |unknown| self.rows.local_number(unknown).map_or(-1, |k| k as i32));
        [whole, part]
    }

    /// Returns vectors as copies and in parts, with values by their global rows.
    pub fn vectors(&self, value: impl Fn(usize) -> f64) -> [Vector; 2] {
        let mut whole = Petsc::vector(&self.copies, self.rows.total).unwrap();
        whole.as_mut_slice().iter_mut().enumerate().for_each(|(row, entry)| *entry = value(row));
        let mut part = Petsc::vector(&self.parts, self.rows.own.len()).unwrap();
        self.rows.own.clone().zip(part.as_mut_slice()).for_each(|(row, entry)| *entry = value(row));
        part.finish().unwrap();
        [whole, part]
    }

    /// Fails unless both vectors are equal, with the ghosts of the second.
    pub fn assert_equal(&self, [whole, part]: &[Vector; 2], tolerance: f64, what: &str) {
        let size = whole.as_slice().iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        let numbers: Vec<i32> = (0..self.rows.local() as i32).collect();
        let mut held = vec![f64::NAN; numbers.len()];
        part.get(&numbers, &mut held).unwrap();
        for (local, held) in held.into_iter().enumerate() {
            let row = self.rows.global_row(local);
            let expected = whole.as_slice()[row];
            let error = (held - expected).abs();
            assert!(error <= tolerance * size, "{what}, {}: row {row} is {held}, not {expected}", self.name);
        }
    }

    /// Fails unless all ranks have the same bits.
    pub fn assert_same_on_all(&self, value: f64, what: &str) {
        same_on_all(&self.parts, value, &format!("{what}, {}", self.name));
    }
}

/// Fails unless all ranks of a context have the same bits.
pub fn same_on_all(parts: &Context, value: f64, what: &str) {
    let mut extremes = [value, -value];
    Petsc::max(parts, &mut extremes).unwrap();
    assert!(extremes[0].to_bits() == value.to_bits() && extremes[1] == -value, "{what}: {value} and {extremes:?}");
}
