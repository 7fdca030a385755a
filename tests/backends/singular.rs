//! The stiffness of floating bodies is reported as singular; that of supported but ill-conditioned bodies is not.

use std::sync::Arc;

use biotissue::backends::dense::Dense;
use biotissue::backends::sparse::Sparse;
use biotissue::fem::assembly::{Assembler, Unknowns, geometry};
use biotissue::fem::material::{Material, NeoHookean};
use biotissue::fem::mesh::{Mesh, shapes};
use biotissue::fem::point_field::PointResponses;
use biotissue::las::{FactorReport, MatrixOps, RealBackend, SolveError, Solver, SolverParams, Sparsity, Symmetry};
use nalgebra::Matrix3;

/// Factors the stiffness at rest of a body. `stiffness` scales the stiffness of each element as a function of its
/// center; `prescribed` selects the prescribed components of each node by its position.
fn factored<B: RealBackend<Context = ()>>(
    mesh: &Mesh,
    stiffness: impl Fn([f64; 3]) -> f64,
    prescribed: impl Fn([f64; 3]) -> [bool; 3],
    symmetry: Symmetry,
) -> Result<FactorReport, SolveError<B::Error>> {
    let unknowns =
        Unknowns::new(mesh.nodes().len(), |node, component| prescribed(mesh.nodes()[node])[component]).unwrap();
    let pattern = Arc::new(unknowns.pattern(mesh).unwrap());
    let mut matrix = B::matrix(&(), &pattern).unwrap();
    let assembler = Assembler::<B>::new(geometry(mesh).unwrap(), &unknowns, &matrix).unwrap();
    let at_rest = NeoHookean { mu: 3.0, lambda: 5.0 }.evaluate(&Matrix3::identity()).unwrap().tangent;
    let mut responses = PointResponses::zeros(mesh.elements().len());
    for (element, tangent) in responses.tangent.iter_mut().enumerate() {
        *tangent = at_rest * stiffness(mesh.center(element));
    }
    assembler.stiffness(&vec![[0.0; 3]; mesh.nodes().len()], &[], &responses, &mut matrix).unwrap();
    matrix.finish().unwrap();
    let mut solver = B::solver(&B::analyze(&(), &pattern, &SolverParams::new(symmetry)).unwrap()).unwrap();
    solver.factor(&matrix)
}

const BOTH: [Symmetry; 2] = [Symmetry::Definite, Symmetry::Symmetric];

fn assert_singular<B: RealBackend<Context = ()>>(
    what: &str,
    mesh: &Mesh,
    stiffness: impl Fn([f64; 3]) -> f64,
    prescribed: impl Fn([f64; 3]) -> [bool; 3],
) {
    for symmetry in BOTH {
        let found = factored::<B>(mesh, &stiffness, &prescribed, symmetry);
        let n = mesh.nodes().len();
        assert!(matches!(found, Err(SolveError::Singular { .. })), "{what}, {n} nodes, {symmetry:?}: {found:?}");
    }
}

fn assert_regular<B: RealBackend<Context = ()>>(
    what: &str,
    mesh: &Mesh,
    stiffness: impl Fn([f64; 3]) -> f64,
    prescribed: impl Fn([f64; 3]) -> [bool; 3],
) {
    for symmetry in BOTH {
        let found = factored::<B>(mesh, &stiffness, &prescribed, symmetry);
        assert!(found.is_ok(), "{what}, {symmetry:?}: {found:?}");
    }
}

fn free_bodies<B: RealBackend<Context = ()>>(sizes: &[usize]) {
    for &side in sizes {
        let mesh = shapes::cuboid([side; 3], [1.0, 0.7, 1.3]).unwrap();
        let one = |_| 1.0;
        assert_singular::<B>("no supports", &mesh, one, |_| [false; 3]);
        assert_singular::<B>("a hinge", &mesh, one, |x| [x[0] == 0.0 && x[1] == 0.0; 3]);
        assert_singular::<B>("an interior hinge", &mesh, one, |x| {
            [(x[0] - 0.5).abs() < 0.5 / side as f64 && x[1] == 0.0; 3]
        });
        assert_singular::<B>("a ball joint", &mesh, one, |x| [x == [1.0, 0.7, 1.3]; 3]);
        assert_singular::<B>("a slide", &mesh, one, |x| [false, x[0] == 0.0, x[0] == 0.0]);
        let layers = |x: [f64; 3]| if x[2] > 0.6 { 1e6 } else { 1.0 };
        assert_singular::<B>("a hinge of two materials", &mesh, layers, |x| [x[0] == 0.0 && x[1] == 0.0; 3]);
    }
}

#[test]
fn floating_bodies_are_singular() {
    free_bodies::<Sparse>(&[1, 3, 8, 12]);
    free_bodies::<Dense>(&[1, 3]);
}

fn well_posed_bodies<B: RealBackend<Context = ()>>(lengths: &[usize]) {
    let clamped = |x: [f64; 3]| [x[0] == 0.0; 3];
    for &length in lengths {
        let mesh = shapes::cuboid([length, 1, 1], [length as f64, 1.0, 1.0]).unwrap();
        assert_regular::<B>("a slender beam", &mesh, |_| 1.0, clamped);
        // A stiff body on a soft base.
        let base = |x: [f64; 3]| if x[0] < 2.0 { 1e-3 } else { 1.0 };
        assert_regular::<B>("a soft base", &mesh, base, clamped);
        let outer = |x: [f64; 3]| if x[0] > length as f64 - 2.0 { 1e-12 } else { 1.0 };
        assert_regular::<B>("a soft end", &mesh, outer, clamped);
    }
    let mesh = shapes::cuboid([4; 3], [1.0; 3]).unwrap();
    let minimal = |x: [f64; 3]| match x {
        [0.0, 0.0, 0.0] => [true; 3],
        [1.0, 0.0, 0.0] => [false, true, true],
        [0.0, 1.0, 0.0] => [false, false, true],
        _ => [false; 3],
    };
    assert_regular::<B>("six prescribed components", &mesh, |_| 1.0, minimal);
}

#[test]
fn supported_bodies_are_regular_even_if_slender_or_soft() {
    well_posed_bodies::<Sparse>(&[10, 100, 400]);
    well_posed_bodies::<Dense>(&[10, 30]);
}

/// Factors the stiffness of a chain of springs with scaled rows and columns, as after a change of units. `last` is the
/// last diagonal entry: 1 for a free chain, more for a supported one.
fn scaled_chain<B: RealBackend<Context = (), Index = i32>>(
    rows: [f64; 4],
    columns: [f64; 4],
    last: f64,
    symmetry: Symmetry,
) -> Result<FactorReport, SolveError<B::Error>> {
    let pattern = Arc::new(Sparsity::from_elements(4, [[0, 1], [1, 2], [2, 3]]).unwrap());
    let mut a = B::matrix(&(), &pattern).unwrap();
    for i in 0..4_usize {
        for j in [i.wrapping_sub(1), i, i + 1].into_iter().filter(|&j| j < 4) {
            let entry = if i != j { -1.0 } else { [1.0, 2.0, 2.0, last][i] };
            a.set(&[i as i32], &[j as i32], &[entry * rows[i] * columns[j]]).unwrap();
        }
    }
    a.finish().unwrap();
    let symbolic = B::analyze(&(), &pattern, &SolverParams::new(symmetry)).unwrap();
    B::solver(&symbolic).unwrap().factor(&a)
}

/// Scale factors: powers of two, so that the scaling is exact and a free chain remains exactly singular.
const UNITS: [f64; 4] = [1.0 / (1_u64 << 60) as f64, 1.0, (1_u64 << 60) as f64, 1.0 / (1_u64 << 20) as f64];

#[test]
fn scaling_does_not_make_a_matrix_singular() {
    fn check<B: RealBackend<Context = (), Index = i32>>() {
        for symmetry in [Symmetry::Definite, Symmetry::Symmetric, Symmetry::None] {
            let found = scaled_chain::<B>(UNITS, UNITS, 2.0, symmetry);
            assert!(found.is_ok(), "{} {symmetry:?}: {found:?}", B::NAME);
        }
        let one = [1.0; 4];
        for (rows, columns) in [(UNITS, one), (one, UNITS)] {
            let found = scaled_chain::<B>(rows, columns, 2.0, Symmetry::None);
            assert!(found.is_ok(), "{} rows {rows:?}, columns {columns:?}: {found:?}", B::NAME);
        }
    }
    check::<Sparse>();
    check::<Dense>();
}

#[test]
fn scaling_does_not_hide_a_singular_matrix() {
    fn check<B: RealBackend<Context = (), Index = i32>>() {
        let one = [1.0; 4];
        for symmetry in [Symmetry::Definite, Symmetry::Symmetric, Symmetry::None] {
            for (rows, columns) in [(UNITS, UNITS), (UNITS, one), (one, UNITS)] {
                if rows == columns || symmetry == Symmetry::None {
                    let found = scaled_chain::<B>(rows, columns, 1.0, symmetry);
                    let is_refused = matches!(found, Err(SolveError::Singular { .. }));
                    assert!(is_refused, "{} {symmetry:?}, rows {rows:?}, columns {columns:?}: {found:?}", B::NAME);
                }
            }
        }
    }
    check::<Sparse>();
    check::<Dense>();
}

/// In elimination with the pivot 10, the largest entry of the first column, rounding changes the second row completely:
/// the matrix is regular, but the computed factors are those of another matrix.
#[test]
fn factors_that_rounding_made_wrong_are_rejected() {
    fn check<B: RealBackend<Context = (), Index = i32>>() {
        let pattern = Arc::new(Sparsity::from_elements(2, [[0, 1]]).unwrap());
        let mut a = B::matrix(&(), &pattern).unwrap();
        a.set(&[0, 1], &[0, 1], &[10.0, 1e30, 1.0, 1.0]).unwrap();
        a.finish().unwrap();
        let symbolic = B::analyze(&(), &pattern, &SolverParams::new(Symmetry::None)).unwrap();
        let found = B::solver(&symbolic).unwrap().factor(&a);
        assert!(matches!(found, Err(SolveError::Singular { .. })), "{}: {found:?}", B::NAME);
    }
    check::<Sparse>();
    check::<Dense>();
}
