use super::*;

/// Returns the pattern of the nodes of a grid, each coupled to its neighbors and those on the diagonals.
fn grid([x, y, z]: [u32; 3]) -> Sparsity {
    let near = |at: u32, size: u32| at.saturating_sub(1)..(at + 2).min(size);
    let (mut ends, mut columns) = (vec![0], Vec::new());
    for at in (0..x * y * z).map(|node| [node / (y * z), node / z % y, node % z]) {
        for i in near(at[0], x) {
            columns.extend(near(at[1], y).flat_map(|j| near(at[2], z).map(move |k| (i * y + j) * z + k)));
        }
        ends.push(columns.len() as u32);
    }
    Sparsity::from_rows((x * y * z) as usize, ends, columns).unwrap()
}

/// The choice for a body of such a grid, three unknowns per node, on a backend with multigrid.
fn choice(nodes: [u32; 3], symmetry: Symmetry, right_hand_sides: usize) -> SolverChoice {
    let first: Vec<u32> = (0..=nodes.iter().product()).map(|node| 3 * node).collect();
    SolverChoice::by_blocks((&grid(nodes), &first), symmetry, right_hand_sides, true)
}

fn krylov(choice: &SolverChoice) -> Option<Krylov> {
    match choice.method {
        Method::Direct => None,
        Method::Iterative(Iterative { krylov, preconditioner, .. }) => {
            assert_eq!(preconditioner, Preconditioner::Multigrid);
            Some(krylov)
        }
    }
}

const GMRES: Krylov = Krylov::Gmres { restart: 30 };

#[test]
fn small_bodies_are_solved_directly_and_large_ones_by_multigrid() {
    let mut previous = 0.0;
    for (cells, iterates) in [(4, false), (8, false), (20, true), (30, true)] {
        let choice = choice([cells; 3], Symmetry::Definite, 1);
        let [direct, iterative] = choice.seconds;
        assert_eq!(choice.unknowns, 3 * (cells as usize).pow(3));
        assert_eq!(krylov(&choice), iterates.then_some(Krylov::Cg), "{cells}: {choice}");
        assert_eq!(direct > ADVANTAGE * iterative, iterates, "{choice:?}");
        assert!(choice.operations > previous, "{choice:?}");
        previous = choice.operations;
    }
}

/// The factors of a long body are narrow.
#[test]
fn a_long_body_is_solved_directly_where_a_cube_of_as_many_unknowns_is_not() {
    let (cube, long) = (choice([20; 3], Symmetry::Definite, 1), choice([2000, 2, 2], Symmetry::Definite, 1));
    assert_eq!(cube.unknowns, long.unknowns);
    assert_eq!((krylov(&cube), krylov(&long)), (Some(Krylov::Cg), None), "{cube} {long}");
    assert!(long.operations < 0.01 * cube.operations, "{long:?} {cube:?}");
}

/// A factorization serves all right-hand sides, an iteration only one.
#[test]
fn many_right_hand_sides_are_solved_directly() {
    let choices = [0, 1, 2, 100].map(|count| choice([20; 3], Symmetry::Symmetric, count));
    let [none, one, two, many] = choices;
    assert_eq!([krylov(&one), krylov(&many)], [Some(GMRES), None], "{one} {many}");
    assert_eq!(none.seconds, one.seconds);
    assert_eq!(many.seconds[0], one.seconds[0]);
    let per_solution = two.seconds[1] - one.seconds[1];
    assert!((many.seconds[1] - one.seconds[1] - 99.0 * per_solution).abs() < 1e-9 * many.seconds[1]);
}

#[test]
fn only_a_definite_matrix_gets_conjugate_gradients() {
    let by_symmetry = |cells, symmetry| choice([cells; 3], symmetry, 1);
    assert_eq!(krylov(&by_symmetry(20, Symmetry::Definite)), Some(Krylov::Cg));
    for symmetry in [Symmetry::Symmetric, Symmetry::None] {
        let choice = by_symmetry(20, symmetry);
        assert_eq!(krylov(&choice), Some(GMRES), "{choice}");
        assert!(choice.to_string().starts_with("GMRES with multigrid: estimated "), "{choice}");
        let params = choice.params(symmetry);
        assert_eq!((params.method, params.symmetry, params.fallback), (choice.method, symmetry, true));
    }
    // LU takes longer than Cholesky, so that multigrid replaces it earlier.
    let [symmetric, unsymmetric] = [Symmetry::Symmetric, Symmetry::None].map(|symmetry| by_symmetry(11, symmetry));
    assert_eq!(unsymmetric.seconds, [UNSYMMETRIC * symmetric.seconds[0], symmetric.seconds[1]]);
    assert_eq!((krylov(&symmetric), krylov(&unsymmetric)), (None, Some(GMRES)), "{symmetric} {unsymmetric}");
}

#[test]
fn a_backend_without_multigrid_solves_directly() {
    let choice = SolverChoice::new(&grid([40; 3]), Symmetry::Definite, 1, true);
    assert_eq!(krylov(&choice), Some(Krylov::Cg), "{choice}");
    let choice = SolverChoice::new(&grid([40; 3]), Symmetry::Definite, 1, false);
    assert_eq!(choice.method, Method::Direct);
    assert!(choice.to_string().ends_with("; this backend has no multigrid"), "{choice}");
    assert!(choice.seconds[0] > ADVANTAGE * choice.seconds[1], "{choice:?}");
}

#[test]
fn times_are_printed_with_one_or_two_digits() {
    let printed = [5e-4, 0.0123, 1.26, 123.4].map(seconds);
    assert_eq!(printed, ["less than 1 ms", "12 ms", "1.3 s", "123 s"]);
}

#[test]
fn an_empty_system_is_solved_directly() {
    let choice = SolverChoice::new(&Sparsity::full(0, 0), Symmetry::Definite, 1, true);
    assert_eq!((choice.method, choice.unknowns, choice.operations), (Method::Direct, 0, 0.0));
}
