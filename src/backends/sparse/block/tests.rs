//! Tests of the block factorization against a dense one, and of the solver that uses it.

use std::sync::Arc;

use super::simd::SimdLevel;
use super::*;
use crate::backends::sparse::order::eliminate;
use crate::backends::sparse::solve::SparseScalar;
use crate::backends::sparse::{Matrix, Solver, Sparse, Symbolic, Vector};
use crate::las::conformance::{DenseReference, Random};
use crate::las::{Backend, Factorization, MatVec, Ordering, Scalar, SolveError, Solver as _, SolverParams, Symmetry};

const ORDERINGS: [Ordering; 3] = [Ordering::Auto, Ordering::MinimumDegree, Ordering::NestedDissection];

fn three(node: usize) -> [i32; 3] {
    [0, 1, 2].map(|k| (3 * node + k) as i32)
}

/// A pattern with full blocks between the nodes of every list.
fn blocks(nodes: usize, lists: &[Vec<usize>]) -> Arc<Sparsity> {
    let own = (0..nodes).map(|node| three(node).to_vec());
    let lists = lists.iter().map(|list| list.iter().flat_map(|&node| three(node)).collect());
    Arc::new(Sparsity::from_elements(3 * nodes, own.chain(lists)).unwrap())
}

/// A pattern with full blocks between the nodes of every list, where `sizes` are the numbers of unknowns of the nodes.
fn blocks_of(sizes: &[usize], lists: &[Vec<usize>]) -> Arc<Sparsity> {
    let first: Vec<usize> = (0..=sizes.len()).map(|node| sizes[..node].iter().sum()).collect();
    let unknowns = |&node: &usize| (first[node]..first[node + 1]).map(|unknown| unknown as i32);
    let own = (0..sizes.len()).map(|node| unknowns(&node).collect());
    let lists = lists.iter().map(|list| list.iter().flat_map(unknowns).collect::<Vec<_>>());
    Arc::new(Sparsity::from_elements(first[sizes.len()], own.chain(lists)).unwrap())
}

/// A truss of which about one node in `one_in` has one or two unknowns.
fn held_truss(random: &mut Random, nodes: usize, bars: usize, one_in: usize) -> Arc<Sparsity> {
    let sizes: Vec<usize> =
        (0..nodes).map(|_| if random.below(one_in) == 0 { 1 + random.below(2) } else { 3 }).collect();
    let mut lists = Vec::new();
    for _ in 0..nodes * bars {
        let first = random.below(nodes);
        let second = if random.below(4) == 0 { random.below(nodes) } else { random.below(5) };
        lists.push(vec![first, (first + second) % nodes]);
    }
    blocks_of(&sizes, &lists)
}

/// Patterns that cover all code paths: no node, one node, no couplings, trees, wide supernodes in pieces, several
/// components, nodes with fewer than three unknowns.
fn patterns(random: &mut Random) -> Vec<Arc<Sparsity>> {
    let band: Vec<Vec<usize>> = (0..70).map(|k| (k..(k + 9).min(70)).collect()).collect();
    let star: Vec<Vec<usize>> = (1..30).map(|k| vec![0, k]).collect();
    let cliques = [(0..25).collect(), (25..62).collect(), vec![3, 30, 63], vec![63, 64]];
    let mut patterns = vec![
        blocks(0, &[]),
        blocks(1, &[]),
        blocks(7, &[]),
        blocks(40, &[(0..40).collect()]),
        blocks(70, &band),
        blocks(30, &star),
        blocks(66, &cliques),
    ];
    for nodes in [2, 3, 5, 11, 24, 50, 90, 130] {
        patterns.extend([1, 3, 6].map(|bars| random.truss(nodes, bars)));
    }
    for nodes in [24, 50, 90, 130] {
        patterns.extend([1, 3, 6].map(|bars| held_truss(random, nodes, bars, 6)));
    }
    patterns
}

fn matrix<T: SparseScalar>(pattern: &Arc<Sparsity>, a: &DenseReference) -> Matrix<T> {
    let mut matrix = Matrix::zeros(pattern);
    let entries =
        (0..a.rows).flat_map(|row| pattern.row(row).iter().map(move |&column| row * a.cols + column as usize));
    for (value, entry) in matrix.values_mut().iter_mut().zip(entries) {
        *value = T::of(a.values[entry]);
    }
    matrix
}

/// Returns `L` by rows of the matrix permuted to the given order, with rows of the identity at padding positions; the
/// error is the position of the first pivot that is not positive.
fn dense_cholesky(a: &DenseReference, order: &[Option<usize>]) -> Result<Vec<Vec<f64>>, usize> {
    let value = |i: usize, j: usize| match (order[i], order[j]) {
        (Some(row), Some(column)) => a.values[row * a.cols + column],
        _ => f64::from(u8::from(i == j)),
    };
    let mut l = vec![vec![0.0; order.len()]; order.len()];
    for i in 0..order.len() {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            let rest = value(i, j) - sum;
            if i == j && rest <= 0.0 {
                return Err(i);
            }
            l[i][j] = if i == j { rest.sqrt() } else { rest / l[j][j] };
        }
    }
    Ok(l)
}

/// Returns the block of `L` at a row and a column as the panels store it, that is, inverted on the diagonal.
fn expected_block(l: &[Vec<f64>], row: usize, column: usize) -> [[f64; 3]; 3] {
    let at = |i: usize, j: usize| l[3 * row + i][3 * column + j];
    if row != column {
        return [0, 1, 2].map(|j| [0, 1, 2].map(|i| at(i, j)));
    }
    let (i00, i11, i22) = (1.0 / at(0, 0), 1.0 / at(1, 1), 1.0 / at(2, 2));
    let (i10, i21) = (-at(1, 0) * i00 * i11, -at(2, 1) * i11 * i22);
    [[i00, i10, -(at(2, 0) * i00 + at(2, 1) * i10) * i22], [0.0, i11, i21], [0.0, 0.0, i22]]
}

struct Analyzed {
    analysis: SymbolicBlockCholesky,
    /// The unknown at each position, three positions per node; `None` for padding.
    order: Vec<Option<usize>>,
}

fn analyze(pattern: &Sparsity, ordering: Ordering) -> Analyzed {
    let graph = Graph::new(pattern);
    let analysis = SymbolicBlockCholesky::new(pattern, &graph, &eliminate(&graph, ordering).unwrap());
    let is_unknown = |position: &usize| position % BLOCK < analysis.nodes[position / BLOCK].size as usize;
    let unknown = |position| Some(position).filter(is_unknown).map(|position| analysis.unknown(position));
    let order = (0..BLOCK * analysis.nodes()).map(unknown).collect();
    Analyzed { analysis, order }
}

#[cfg(target_arch = "x86_64")]
const LEVELS: [SimdLevel; 3] = [SimdLevel::Portable, SimdLevel::Avx2, SimdLevel::Avx512];
#[cfg(not(target_arch = "x86_64"))]
const LEVELS: [SimdLevel; 1] = [SimdLevel::Portable];

/// Returns the levels that this machine supports; records that the tests of the others are skipped.
fn levels() -> impl Iterator<Item = SimdLevel> {
    let (has, has_not) = LEVELS.into_iter().partition::<Vec<_>, _>(|&level| level <= SimdLevel::of_machine());
    if !has_not.is_empty() {
        crate::skip::skip(&format!("this machine does not support {has_not:?}"));
    }
    has.into_iter()
}

/// Every block of the factor agrees with a dense factorization, for all levels that this machine supports.
#[test]
fn factors_are_those_of_a_dense_factorization() {
    let mut random = Random::new(1);
    for pattern in patterns(&mut random) {
        check_factors(&mut random, &pattern);
    }
}

/// Factors agree also for random patterns in which a third to all of the nodes are padded.
#[test]
fn factors_of_padded_nodes_are_those_of_a_dense_factorization() {
    for seed in 0..60 {
        let mut random = Random::new(seed);
        let (nodes, bars) = (1 + random.below(40), random.below(5));
        let one_in = 1 + random.below(3);
        let pattern = held_truss(&mut random, nodes, bars, one_in);
        check_factors(&mut random, &pattern);
    }
}

fn check_factors(random: &mut Random, pattern: &Arc<Sparsity>) {
    let a = DenseReference::dominant(random, pattern, |_| 1.0);
    let values = matrix::<f64>(pattern, &a).values;
    for ordering in ORDERINGS {
        let Analyzed { analysis, order } = analyze(pattern, ordering);
        let l = dense_cholesky(&a, &order).unwrap();
        let pivots = || (0..l.len()).filter(|&k| order[k].is_some()).map(|k| l[k][k] * l[k][k]);
        let expected = pivots().fold(f64::INFINITY, f64::min) / pivots().fold(0.0, f64::max);
        for level in levels() {
            let mut factor = BlockCholesky::new(&analysis);
            let ratio = factor.factor_with(level, &analysis, &values).unwrap().ratio();
            assert!(l.is_empty() || (ratio - expected).abs() < 1e-10, "{ratio} instead of {expected}");
            check_panels(&analysis, &factor.panels, &l, &order);
        }
    }
}

fn check_panels(analysis: &SymbolicBlockCholesky, panels: &[Column<f64>], l: &[Vec<f64>], order: &[Option<usize>]) {
    let supernodes = &analysis.supernodes;
    let mut found = 0;
    for s in 0..supernodes.count() {
        let (first, width) = (supernodes.first(s), supernodes.width(s));
        let rows = (first..first + width).chain(supernodes.rows(s).iter().map(|&row| row as usize));
        for (k, row) in rows.enumerate() {
            for column in first..(first + width).min(row + 1) {
                let at = analysis.panel_start[s] + BLOCK * (k * width + column - first);
                for (have, want) in panels[at..at + BLOCK].iter().zip(expected_block(l, row, column)) {
                    assert!((0..3).all(|i| (have[i] - want[i]).abs() < 1e-12), "{have:?} instead of {want:?}");
                    assert_eq!(have[3], 0.0, "the fourth lane stays empty");
                }
                let [rows, columns] = [row, column].map(|node| order[3 * node..3 * node + 3].iter().flatten().count());
                found += if row == column { rows * (rows + 1) / 2 } else { rows * columns };
            }
        }
    }
    assert_eq!(found, analysis.entries());
}

/// Returns all numbers of the factor, without the scratch above the diagonal blocks.
fn lower<T: Scalar>(analysis: &SymbolicBlockCholesky, panels: &[Column<T>]) -> Vec<T> {
    let mut numbers = Vec::new();
    for s in 0..analysis.supernodes.count() {
        let (width, height) = (analysis.supernodes.width(s), analysis.supernodes.height(s));
        for row in 0..height {
            let at = analysis.panel_start[s] + BLOCK * row * width;
            numbers.extend(panels[at..at + BLOCK * width.min(row + 1)].as_flattened());
        }
    }
    numbers
}

/// All levels agree up to rounding, in both precisions, also in the position where a matrix is not definite; levels
/// with fused multiply-add agree bitwise.
fn levels_agree<T: SparseScalar>() {
    for seed in 0..40 {
        let mut random = Random::new(seed);
        let (nodes, bars) = (1 + random.below(90), 1 + random.below(6));
        let pattern = held_truss(&mut random, nodes, bars, 4);
        let indefinite_at = random.below(2 * pattern.rows());
        let dense = DenseReference::dominant(&mut random, &pattern, |i| if i == indefinite_at { -1.0 } else { 1.0 });
        let values = matrix::<T>(&pattern, &dense).values;
        let Analyzed { analysis, .. } = analyze(&pattern, Ordering::Auto);
        let [mut reference, mut other] = [(); 2].map(|()| BlockCholesky::<T>::new(&analysis));
        let outcome = reference.factor_with(SimdLevel::Portable, &analysis, &values).map(|pivots| pivots.negative());
        assert_eq!(outcome.is_err(), indefinite_at < pattern.rows());
        let mut fused = None;
        for level in levels() {
            let again = other.factor_with(level, &analysis, &values).map(|pivots| pivots.negative());
            assert_eq!(again, outcome, "{level:?}");
            if outcome.is_err() {
                continue;
            }
            let both = lower(&analysis, &reference.panels).into_iter().zip(lower(&analysis, &other.panels));
            let apart = both.map(|(a, b)| (a - b).abs().as_f64()).fold(0.0, f64::max);
            assert!(apart < 50.0 * T::epsilon().as_f64(), "{level:?}: {apart:e}");
            if level > SimdLevel::Portable {
                let bits = lower(&analysis, &other.panels);
                assert_eq!(*fused.get_or_insert_with(|| bits.clone()), bits, "{level:?}, bit for bit");
            }
        }
    }
}

#[test]
fn factors_do_not_depend_on_the_registers() {
    levels_agree::<f64>();
    levels_agree::<f32>();
}

/// Matrices use the block factorization if all but a few nodes have three unknowns, and only then.
#[test]
fn bodies_on_rollers_are_factored_by_blocks_and_scalar_matrices_are_not() {
    let mut random = Random::new(9);
    let by_blocks = |pattern: &Arc<Sparsity>| {
        Sparse::<f64>::analyze(&(), pattern, &SolverParams::new(Symmetry::Definite)).unwrap().blocks.is_some()
    };
    assert!(by_blocks(&held_truss(&mut random, 200, 4, 5)));
    let one_of_three = blocks_of(&[1, 3, 3, 3], &[vec![0, 1], vec![1, 2], vec![2, 3]]);
    assert!(by_blocks(&one_of_three), "one node on a roller");
    let chain: Vec<Vec<usize>> = (1..50).map(|k| vec![k - 1, k]).collect();
    assert!(!by_blocks(&blocks_of(&[1; 50], &chain)));
    assert!(!by_blocks(&blocks_of(&[2; 50], &chain)));
}

fn solver<T: SparseScalar>(pattern: &Arc<Sparsity>, ordering: Ordering) -> (Arc<Symbolic>, Solver<T>) {
    let mut params = SolverParams::new(Symmetry::Definite);
    params.ordering = ordering;
    // The limit is above the rounding errors in the pivots of a singular matrix.
    params.singular_below = Some(1e3 * T::epsilon().as_f64());
    let symbolic = Sparse::<T>::analyze(&(), pattern, &params).unwrap();
    assert!(symbolic.blocks.is_some());
    let solver = Sparse::<T>::solver(&symbolic).unwrap();
    (symbolic, solver)
}

fn right_sides<T: Scalar>(random: &mut Random, unknowns: usize, count: usize) -> Vec<Vector<T>> {
    (0..count).map(|_| (0..unknowns).map(|_| T::of(random.signed())).collect::<Vec<T>>().into()).collect()
}

fn check_solutions<T: SparseScalar>(a: &Matrix<T>, b: &[Vector<T>], x: &[Vector<T>]) {
    let mut product = Vector::from(vec![T::zero(); a.pattern().rows()]);
    for (b, x) in b.iter().zip(x) {
        a.mul(x, &mut product).unwrap();
        let worst = product.values.iter().zip(&b.values).map(|(p, b)| (*p - *b).abs().as_f64()).fold(0.0, f64::max);
        assert!(worst < 400.0 * T::epsilon().as_f64(), "residual {worst:e}, {} unknowns", b.values.len());
    }
}

/// Solves for every number of right-hand sides, in both precisions.
fn solves<T: SparseScalar>() {
    let mut random = Random::new(2);
    for pattern in patterns(&mut random) {
        let a = matrix::<T>(&pattern, &DenseReference::dominant(&mut random, &pattern, |_| 1.0));
        let (_, mut solver) = solver::<T>(&pattern, Ordering::Auto);
        assert_eq!(solver.factor(&a).unwrap().kind, Factorization::Cholesky);
        for count in [1, 9, 2, 4, 5, 6, 8, 17, 3] {
            let b = right_sides(&mut random, pattern.rows(), count);
            let mut x = vec![Vector::from(vec![T::of(f64::NAN); pattern.rows()]); count];
            solver.solve_many(&b, &mut x).unwrap();
            check_solutions(&a, &b, &x);
        }
    }
}

#[test]
fn all_right_hand_sides_are_solved_for() {
    solves::<f64>();
    solves::<f32>();
}

/// The failing pivot is reported, LDL^T replaces Cholesky, and the next definite matrix is factored by blocks again.
#[test]
fn ldlt_factors_an_indefinite_matrix_and_cholesky_the_next_definite_one() {
    let mut random = Random::new(3);
    for pattern in patterns(&mut random).into_iter().filter(|pattern| pattern.rows() > 0) {
        let at = random.below(pattern.rows());
        let definite = matrix::<f64>(&pattern, &DenseReference::dominant(&mut random, &pattern, |_| 1.0));
        let dense = DenseReference::dominant(&mut random, &pattern, |i| if i == at { -1.0 } else { 1.0 });
        let indefinite = matrix::<f64>(&pattern, &dense);
        let Analyzed { analysis, order } = analyze(&pattern, Ordering::Auto);
        let error = BlockCholesky::new(&analysis).factor(&analysis, &indefinite.values).unwrap_err();
        assert_eq!(Err(error.position), dense_cholesky(&dense, &order).map(drop));
        let (_, mut solver) = solver::<f64>(&pattern, Ordering::Auto);
        for a in [&definite, &indefinite, &definite, &indefinite] {
            let report = solver.factor(a).unwrap();
            let expected = if std::ptr::eq(a, &definite) { Factorization::Cholesky } else { Factorization::Ldlt };
            assert_eq!(report.kind, expected);
            assert_eq!(report.indefinite_at, (expected == Factorization::Ldlt).then_some(at));
            let b = right_sides(&mut random, pattern.rows(), 3);
            let mut x = b.clone();
            solver.solve_many(&b, &mut x).unwrap();
            check_solutions(a, &b, &x);
        }
    }
}

/// Springs between neighboring nodes of a row, in all three directions, held at one end by a spring of stiffness
/// `held`.
fn chain(nodes: usize, held: f64) -> (Arc<Sparsity>, Matrix<f64>) {
    let pattern = blocks(nodes, &(1..nodes).map(|k| vec![k - 1, k]).collect::<Vec<_>>());
    let mut a = DenseReference::zeros(3 * nodes, 3 * nodes);
    for k in 0..3 {
        *a.at(k, k) += held;
        for node in 1..nodes {
            let (i, j) = (3 * node - 3 + k, 3 * node + k);
            *a.at(i, i) += 1.0;
            *a.at(j, j) += 1.0;
            *a.at(i, j) -= 1.0;
            *a.at(j, i) -= 1.0;
        }
    }
    let matrix = matrix(&pattern, &a);
    (pattern, matrix)
}

#[test]
fn singular_and_nearly_singular_matrices_are_distinguished() {
    for ordering in ORDERINGS {
        let (pattern, free) = chain(60, 0.0);
        let (_, mut solver) = solver::<f64>(&pattern, ordering);
        assert!(matches!(solver.factor(&free), Err(SolveError::Singular { .. })), "a chain held nowhere");
        let mut x = vec![Vector::from(vec![0.0; 180])];
        assert_eq!(solver.solve_many(&x.clone(), &mut x), Err(SolveError::NotFactored));
        for held in [1e-4, 1e-8, 1e-12] {
            let (_, weak) = chain(60, held);
            let report = solver.factor(&weak).unwrap();
            assert_eq!(report.kind, Factorization::Cholesky);
            // The smallest pivot is of the order of the stiffness of the spring that holds the chain.
            assert!(report.pivot_ratio < 1.5 * held && report.pivot_ratio > 0.01 * held, "{:e}", report.pivot_ratio);
            let pull: Vec<f64> = (0..180).map(|i| if i == 177 { held } else { 0.0 }).collect();
            solver.solve_many(&[pull.into()], &mut x).unwrap();
            let end = x[0].values[177];
            assert!((end - 1.0 - 59.0 * held).abs() < 1e-14 / held, "the end moves by {end}");
        }
        assert_eq!(solver.factor(&chain(60, 1.0).1).unwrap().kind, Factorization::Cholesky);
    }
}

/// Threads share the analysis, including that of LDL^T, which the first thread that needs it makes.
#[test]
fn results_repeat_bit_for_bit_on_any_number_of_threads() {
    let mut random = Random::new(4);
    let pattern = random.truss(120, 5);
    let systems = [1.0, -1.0].map(|last| {
        let a = DenseReference::dominant(&mut random, &pattern, |i| if i == 100 { last } else { 1.0 });
        matrix::<f64>(&pattern, &a)
    });
    let (symbolic, _) = solver::<f64>(&pattern, Ordering::Auto);
    let b = right_sides(&mut random, pattern.rows(), 6);
    let work = || {
        let mut solver = Sparse::<f64>::solver(&symbolic).unwrap();
        let mut results = Vec::new();
        for a in systems.iter().chain(&systems) {
            solver.factor(a).unwrap();
            let (mut one, mut many) = (b[0].clone(), b.clone());
            solver.solve(&b[0], &mut one).unwrap();
            solver.solve_many(&b, &mut many).unwrap();
            results.extend(many.into_iter().chain([one]).flat_map(Vec::<f64>::from).map(f64::to_bits));
        }
        results
    };
    let results: Vec<Vec<u64>> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..4).map(|_| scope.spawn(work)).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert!(results.windows(2).all(|pair| pair[0] == pair[1]));
    let half = results[0].len() / 2;
    assert_eq!(results[0][..half], results[0][half..], "a factorization leaves nothing behind for the next");
}
