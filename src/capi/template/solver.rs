// Solvers: a part of the template of one backend; see `vector.rs`.

/// Creates a solver for matrices with a pattern, which may be freed afterward.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_create_solver_BACKEND(
    las: *const las_BACKEND,
    pattern: *const las_pattern,
    params: *const las_params,
    solver: *mut *mut las_solver_BACKEND,
) -> i32 {
    create(solver, "solver", || {
        let (las, pattern) = (shared(las, "las")?, shared(pattern, "pattern")?);
        let params = shared(params, "params")?.checked(<B as Backend>::NAME)?;
        let symbolic = <B as Backend>::analyze(&las.0, &pattern.0, &params).map_err(solve_error)?;
        Ok(las_solver_BACKEND(<B as Backend>::solver(&symbolic).map_err(solve_error)?))
    })
}

/// Frees a solver. Null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_destroy_solver_BACKEND(solver: *mut las_solver_BACKEND) -> i32 {
    guarded(|| free(solver))
}

/// Factors a matrix with the solver's pattern, or computes the preconditioner of an iterative method. If it fails, the
/// solver has no factorization, not even that of an earlier matrix.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_factor_BACKEND(solver: *mut las_solver_BACKEND, mat: *const las_mat_BACKEND) -> i32 {
    guarded(|| {
        let solver = &mut exclusive(solver, "solver")?.0;
        las::Solver::<B>::factor(solver, &shared(mat, "mat")?.0).map(drop).map_err(solve_error)
    })
}

/// Does the same as las_factor_BACKEND, but an iterative method may keep the preconditioner of an earlier matrix while it
/// serves: the next solutions take hardly more iterations.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_update_BACKEND(solver: *mut las_solver_BACKEND, mat: *const las_mat_BACKEND) -> i32 {
    guarded(|| {
        let solver = &mut exclusive(solver, "solver")?.0;
        las::Solver::<B>::update(solver, &shared(mat, "mat")?.0).map(drop).map_err(solve_error)
    })
}

/// Sets the norm of the residual over that of the right-hand side at which an iterative method stops in the next
/// solutions, which return LAS_ARGUMENT if it is not above 0 and below 1. A direct method ignores it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_set_tolerance_BACKEND(solver: *mut las_solver_BACKEND, tolerance: f64) -> i32 {
    guarded(|| {
        las::Solver::<B>::set_tolerance(&mut exclusive(solver, "solver")?.0, tolerance);
        Ok(())
    })
}

/// Passes vectors on which the matrix is almost zero to LAS_MULTIGRID, for the next factorization: for elasticity, the six
/// rigid motions, without which it takes many iterations. The vectors may be freed afterward. Other methods ignore them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_set_near_null_space_BACKEND(
    solver: *mut las_solver_BACKEND,
    vec_count: i32,
    vec: *const *const las_vec_BACKEND,
) -> i32 {
    guarded(|| {
        let vectors = array(vec, count(vec_count, "vec_count")?, "vec")?;
        let values = |&vec: &*const las_vec_BACKEND| {
            shared(vec, "vec[k]")?.0.with_local(<[Scalar]>::to_vec).map_err(backend_error)
        };
        let vectors = vectors.iter().map(values).collect::<Result<Vec<_>, Failure>>()?;
        las::Solver::<B>::set_near_null_space(&mut exclusive(solver, "solver")?.0, &vectors).map_err(solve_error)
    })
}

/// Factors a matrix with the solver's pattern if it is positive definite. Returns LAS_SINGULAR if it is not,
/// LAS_UNSUPPORTED if it is declared LAS_UNSYMMETRIC.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_factor_definite_BACKEND(
    solver: *mut las_solver_BACKEND,
    mat: *const las_mat_BACKEND,
) -> i32 {
    guarded(|| {
        let solver = &mut exclusive(solver, "solver")?.0;
        las::Solver::<B>::factor_definite(solver, &shared(mat, "mat")?.0).map(drop).map_err(solve_error)
    })
}

/// Solves A x = b with the matrix factored last; b and x must not be the same vector. Returns the number of iterations
/// of an iterative method and the norm of its final residual over that of the right-hand side (both 0 for a direct
/// method, which does not compute the residual); these two pointers may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_solve_BACKEND(
    solver: *mut las_solver_BACKEND,
    b: *const las_vec_BACKEND,
    x: *mut las_vec_BACKEND,
    iterations: *mut i32,
    residual: *mut f64,
) -> i32 {
    guarded(|| {
        check_distinct(b, x, "b and x")?;
        let (solver, x) = (&mut exclusive(solver, "solver")?.0, &mut exclusive(x, "x")?.0);
        let report = las::Solver::<B>::solve(solver, &shared(b, "b")?.0, x).map_err(solve_error)?;
        if let Some(iterations) = iterations.as_mut() {
            *iterations = report.iterations as i32;
        }
        if let Some(residual) = residual.as_mut() {
            *residual = report.residual;
        }
        Ok(())
    })
}

/// Solves A x[k] = b[k] for several right-hand sides at once; if one fails, those before it are solved. No vector may
/// occur twice in x, or in both b and x.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_solve_many_BACKEND(
    solver: *mut las_solver_BACKEND,
    rhs_count: i32,
    b: *const *const las_vec_BACKEND,
    x: *const *mut las_vec_BACKEND,
) -> i32 {
    guarded(|| {
        let solver = &mut exclusive(solver, "solver")?.0;
        let count = count(rhs_count, "rhs_count")?;
        let (b, x) = (array(b, count, "b")?, array(x, count, "x")?);
        check_all_distinct(b, x)?;
        let b = Borrowed::new(b.iter().map(|&vec| Ok(&raw const shared(vec, "b[k]")?.0)))?;
        let mut x = BorrowedMut::new(x.iter().map(|&vec| Ok(&raw mut exclusive(vec, "x[k]")?.0)))?;
        las::Solver::<B>::solve_many(solver, b.as_slice(), x.as_mut_slice()).map(drop).map_err(solve_error)
    })
}
