// The C interface of one backend: the word BACKEND stands for its name. `build.rs` makes one copy of this file for each
// backend that is compiled in; `tools/headers` makes the C header and the Fortran module of it.

/// The backend: what vectors, matrices and solvers are made with.
pub struct las_BACKEND(Context);

/// A vector.
pub struct las_vec_BACKEND(Vector);

/// A matrix with a fixed pattern.
pub struct las_mat_BACKEND(Matrix);

/// Positions in matrices of one pattern, located once.
pub struct las_slots_BACKEND(Vec<Slot>);

/// A solver for matrices of one pattern.
pub struct las_solver_BACKEND(Solver);

/// Makes the backend. Free it after all that was made with it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_create_BACKEND(las: *mut *mut las_BACKEND) -> i32 {
    // SAFETY: of the pointers the caller promises what the header says; so below.
    guarded(|| unsafe { give(las, "las", || Ok(las_BACKEND(<B as Exported>::context()?))) })
}

/// Frees the backend. Null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_destroy_BACKEND(las: *mut las_BACKEND) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe { free(las) })
}

/// Makes a vector of `len` zeros.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_create_vec_BACKEND(
    las: *const las_BACKEND,
    len: i32,
    vec: *mut *mut las_vec_BACKEND,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        give(vec, "vec", || {
            let (las, len) = (shared(las, "las")?, count(len, "len")?);
            Ok(las_vec_BACKEND(<B as Backend>::vector(&las.0, len).map_err(fault)?))
        })
    })
}

/// Frees a vector. Null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_destroy_vec_BACKEND(vec: *mut las_vec_BACKEND) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe { free(vec) })
}

/// Tells the number of entries of a vector.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_len_vec_BACKEND(vec: *const las_vec_BACKEND, len: *mut i32) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        *exclusive(len, "len")? = length(&shared(vec, "vec")?.0) as i32;
        Ok(())
    })
}

/// y = 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_zero_vec_BACKEND(vec: *mut las_vec_BACKEND) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe { VectorOps::<B>::zero(&mut exclusive(vec, "vec")?.0).map_err(fault) })
}

/// y[rows[i]] += values[i]; a negative row is dropped.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_add_vec_BACKEND(
    vec: *mut las_vec_BACKEND,
    count: i32,
    rows: *const i32,
    values: *const f64,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let vec = &mut exclusive(vec, "vec")?.0;
        let rows = indices(rows, count, length(vec), "rows")?;
        VectorOps::<B>::add(vec, rows, scalars(values, rows.len(), "values")?).map_err(fault)
    })
}

/// y[rows[i]] = values[i]; a negative row is dropped.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_set_vec_BACKEND(
    vec: *mut las_vec_BACKEND,
    count: i32,
    rows: *const i32,
    values: *const f64,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let vec = &mut exclusive(vec, "vec")?.0;
        let rows = indices(rows, count, length(vec), "rows")?;
        VectorOps::<B>::set(vec, rows, scalars(values, rows.len(), "values")?).map_err(fault)
    })
}

/// values[i] = y[rows[i]]; where a row is negative, the value stays what it was.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_get_vec_BACKEND(
    vec: *const las_vec_BACKEND,
    count: i32,
    rows: *const i32,
    values: *mut f64,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let vec = &shared(vec, "vec")?.0;
        let rows = indices(rows, count, length(vec), "rows")?;
        VectorOps::<B>::get(vec, rows, scalars_mut(values, rows.len(), "values")?).map_err(fault)
    })
}

/// Lends the array of the entries, until the vector is next used.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_local_vec_BACKEND(vec: *mut las_vec_BACKEND, values: *mut *mut f64) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let vec = &mut exclusive(vec, "vec")?.0;
        *exclusive(values, "values")? =
            VectorOps::<B>::with_local_mut(vec, |local| local.as_mut_ptr().cast()).map_err(fault)?;
        Ok(())
    })
}

/// The Euclidean norm: one number, on `batched` one for each of the four lanes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_norm_BACKEND(vec: *const las_vec_BACKEND, norm: *mut f64) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe { reduced(norm, VectorOps::<B>::norm(&shared(vec, "vec")?.0).map_err(fault)?, "norm") })
}

/// The sum of x[i] y[i]: one number, on `batched` one for each of the four lanes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_dot_BACKEND(
    x: *const las_vec_BACKEND,
    y: *const las_vec_BACKEND,
    dot: *mut f64,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let (x, y) = (&shared(x, "x")?.0, &shared(y, "y")?.0);
        same("the vectors", length(x), length(y))?;
        reduced(dot, VectorOps::<B>::dot(x, y).map_err(fault)?, "dot")
    })
}

/// y += a x; x and y must not be the same vector.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_axpy_BACKEND(a: f64, x: *const las_vec_BACKEND, y: *mut las_vec_BACKEND) -> i32 {
    // SAFETY: as above; the two differ.
    guarded(|| unsafe {
        apart(x, y, "x and y")?;
        let (x, y) = (&shared(x, "x")?.0, &mut exclusive(y, "y")?.0);
        same("the vectors", length(x), length(y))?;
        VectorOps::<B>::axpy(y, splat(a), x).map_err(fault)
    })
}

/// Completes pending writes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_finish_vec_BACKEND(vec: *mut las_vec_BACKEND) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe { VectorOps::<B>::finish(&mut exclusive(vec, "vec")?.0).map_err(fault) })
}

/// Makes a matrix of zeros with a pattern, which may be freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_create_mat_BACKEND(
    las: *const las_BACKEND,
    pattern: *const las_pattern,
    mat: *mut *mut las_mat_BACKEND,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        give(mat, "mat", || {
            let (las, pattern) = (shared(las, "las")?, shared(pattern, "pattern")?);
            Ok(las_mat_BACKEND(<B as Backend>::matrix(&las.0, &pattern.0).map_err(fault)?))
        })
    })
}

/// Frees a matrix. Null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_destroy_mat_BACKEND(mat: *mut las_mat_BACKEND) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe { free(mat) })
}

/// Tells the numbers of rows and columns of a matrix.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_shape_mat_BACKEND(mat: *const las_mat_BACKEND, rows: *mut i32, cols: *mut i32) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let shape = shape(&shared(mat, "mat")?.0);
        *exclusive(rows, "rows")? = shape.0 as i32;
        *exclusive(cols, "cols")? = shape.1 as i32;
        Ok(())
    })
}

/// A = 0; the pattern stays.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_zero_mat_BACKEND(mat: *mut las_mat_BACKEND) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe { MatrixOps::<B>::zero(&mut exclusive(mat, "mat")?.0).map_err(fault) })
}

/// Zeroes whole rows; the pattern stays.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_zero_rows_BACKEND(mat: *mut las_mat_BACKEND, count: i32, rows: *const i32) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let mat = &mut exclusive(mat, "mat")?.0;
        let rows = indices(rows, count, shape(mat).0, "rows")?;
        MatrixOps::<B>::zero_rows(mat, rows).map_err(fault)
    })
}

/// A[rows[i], cols[j]] += block[i * cols_count + j]; negative rows and columns are dropped, and so is what is not in the
/// pattern (a library that is built with checks says LAS_INDEX).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_add_mat_BACKEND(
    mat: *mut las_mat_BACKEND,
    rows_count: i32,
    rows: *const i32,
    cols_count: i32,
    cols: *const i32,
    block: *const f64,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let mat = &mut exclusive(mat, "mat")?.0;
        let rows = indices(rows, rows_count, shape(mat).0, "rows")?;
        let cols = indices(cols, cols_count, shape(mat).1, "cols")?;
        inside(mat, rows, cols)?;
        MatrixOps::<B>::add(mat, rows, cols, scalars(block, rows.len() * cols.len(), "block")?).map_err(fault)
    })
}

/// A[rows[i], cols[j]] = block[i * cols_count + j]; negative rows and columns are dropped, and so is what is not in the
/// pattern (a library that is built with checks says LAS_INDEX).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_set_mat_BACKEND(
    mat: *mut las_mat_BACKEND,
    rows_count: i32,
    rows: *const i32,
    cols_count: i32,
    cols: *const i32,
    block: *const f64,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let mat = &mut exclusive(mat, "mat")?.0;
        let rows = indices(rows, rows_count, shape(mat).0, "rows")?;
        let cols = indices(cols, cols_count, shape(mat).1, "cols")?;
        inside(mat, rows, cols)?;
        MatrixOps::<B>::set(mat, rows, cols, scalars(block, rows.len() * cols.len(), "block")?).map_err(fault)
    })
}

/// block[i * cols_count + j] = A[rows[i], cols[j]], zero outside the pattern; where a row or column is negative, the value
/// stays what it was.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_get_mat_BACKEND(
    mat: *const las_mat_BACKEND,
    rows_count: i32,
    rows: *const i32,
    cols_count: i32,
    cols: *const i32,
    block: *mut f64,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let mat = &shared(mat, "mat")?.0;
        let rows = indices(rows, rows_count, shape(mat).0, "rows")?;
        let cols = indices(cols, cols_count, shape(mat).1, "cols")?;
        MatrixOps::<B>::get(mat, rows, cols, scalars_mut(block, rows.len() * cols.len(), "block")?).map_err(fault)
    })
}

/// Makes an empty list of positions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_create_slots_BACKEND(slots: *mut *mut las_slots_BACKEND) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe { give(slots, "slots", || Ok(las_slots_BACKEND(Vec::new()))) })
}

/// Frees a list of positions. Null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_destroy_slots_BACKEND(slots: *mut las_slots_BACKEND) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe { free(slots) })
}

/// Appends the positions of a block, row by row, to a list; for what is negative or not in the pattern, a position of
/// nothing (a library that is built with checks says LAS_INDEX for the latter).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_locate_BACKEND(
    mat: *const las_mat_BACKEND,
    rows_count: i32,
    rows: *const i32,
    cols_count: i32,
    cols: *const i32,
    slots: *mut las_slots_BACKEND,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let mat = &shared(mat, "mat")?.0;
        let rows = indices(rows, rows_count, shape(mat).0, "rows")?;
        let cols = indices(cols, cols_count, shape(mat).1, "cols")?;
        inside(mat, rows, cols)?;
        MatrixOps::<B>::locate(mat, rows, cols, &mut exclusive(slots, "slots")?.0).map_err(fault)
    })
}

/// A[slots[first + k]] += values[k] for as many values as there are; the positions come from a matrix of the same pattern.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_add_at_BACKEND(
    mat: *mut las_mat_BACKEND,
    slots: *const las_slots_BACKEND,
    first: i32,
    count: i32,
    values: *const f64,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let (mat, slots) = (&mut exclusive(mat, "mat")?.0, &shared(slots, "slots")?.0);
        let slots = part(slots, first, count)?;
        MatrixOps::<B>::add_at(mat, slots, scalars(values, slots.len(), "values")?).map_err(fault)
    })
}

/// Completes pending writes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_finish_mat_BACKEND(mat: *mut las_mat_BACKEND) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe { MatrixOps::<B>::finish(&mut exclusive(mat, "mat")?.0).map_err(fault) })
}

/// y = A x; x and y must not be the same vector.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_mul_BACKEND(
    mat: *const las_mat_BACKEND,
    x: *const las_vec_BACKEND,
    y: *mut las_vec_BACKEND,
) -> i32 {
    // SAFETY: as above; the two differ.
    guarded(|| unsafe {
        apart(x, y, "x and y")?;
        let y = &mut exclusive(y, "y")?.0;
        MatVec::<B>::mul(&shared(mat, "mat")?.0, &shared(x, "x")?.0, y).map_err(unsolved)
    })
}

/// y = A^T x; x and y must not be the same vector.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_mul_transpose_BACKEND(
    mat: *const las_mat_BACKEND,
    x: *const las_vec_BACKEND,
    y: *mut las_vec_BACKEND,
) -> i32 {
    // SAFETY: as above; the two differ.
    guarded(|| unsafe {
        apart(x, y, "x and y")?;
        let y = &mut exclusive(y, "y")?.0;
        MatVec::<B>::mul_transpose(&shared(mat, "mat")?.0, &shared(x, "x")?.0, y).map_err(unsolved)
    })
}

/// d[i] = A[i, i].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_diagonal_BACKEND(mat: *const las_mat_BACKEND, d: *mut las_vec_BACKEND) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        MatVec::<B>::diagonal(&shared(mat, "mat")?.0, &mut exclusive(d, "d")?.0).map_err(unsolved)
    })
}

/// d[i] = 1 / A[i, i].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_inverse_diagonal_BACKEND(mat: *const las_mat_BACKEND, d: *mut las_vec_BACKEND) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        MatVec::<B>::inverse_diagonal(&shared(mat, "mat")?.0, &mut exclusive(d, "d")?.0).map_err(unsolved)
    })
}

/// A *= factor.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_scale_BACKEND(mat: *mut las_mat_BACKEND, factor: f64) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe { MatMat::<B>::scale(&mut exclusive(mat, "mat")?.0, splat(factor)).map_err(fault) })
}

/// Makes the matrix a A + b B.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_sum_BACKEND(
    a: f64,
    first: *const las_mat_BACKEND,
    b: f64,
    second: *const las_mat_BACKEND,
    sum: *mut *mut las_mat_BACKEND,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        give(sum, "sum", || {
            let (first, second) = (&shared(first, "first")?.0, &shared(second, "second")?.0);
            Ok(las_mat_BACKEND(MatMat::<B>::sum(first, splat(a), second, splat(b)).map_err(unsolved)?))
        })
    })
}

/// Makes the matrix A B.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_product_BACKEND(
    first: *const las_mat_BACKEND,
    second: *const las_mat_BACKEND,
    product: *mut *mut las_mat_BACKEND,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        give(product, "product", || {
            let (first, second) = (&shared(first, "first")?.0, &shared(second, "second")?.0);
            Ok(las_mat_BACKEND(MatMat::<B>::product(first, second).map_err(unsolved)?))
        })
    })
}

/// Makes the matrix A^T.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_transpose_BACKEND(
    mat: *const las_mat_BACKEND,
    transpose: *mut *mut las_mat_BACKEND,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        give(transpose, "transpose", || {
            Ok(las_mat_BACKEND(MatMat::<B>::transpose(&shared(mat, "mat")?.0).map_err(unsolved)?))
        })
    })
}

/// Reads a matrix from a Matrix Market file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_read_mat_BACKEND(
    las: *const las_BACKEND,
    file: *const c_char,
    mat: *mut *mut las_mat_BACKEND,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        give(mat, "mat", || {
            let (las, file) = (shared(las, "las")?, Path::new(text(file, "file")?));
            Ok(las_mat_BACKEND(<B as Exported>::read(file, &las.0)?))
        })
    })
}

/// Writes a matrix as a Matrix Market file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_write_mat_BACKEND(mat: *const las_mat_BACKEND, file: *const c_char) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe { <B as Exported>::write(Path::new(text(file, "file")?), &shared(mat, "mat")?.0) })
}

/// Makes a solver for matrices of a pattern, which may be freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_create_solver_BACKEND(
    las: *const las_BACKEND,
    pattern: *const las_pattern,
    params: *const las_params,
    solver: *mut *mut las_solver_BACKEND,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        give(solver, "solver", || {
            let (las, pattern) = (shared(las, "las")?, shared(pattern, "pattern")?);
            let params = shared(params, "params")?.checked()?;
            let symbolic = <B as Backend>::analyze(&las.0, &pattern.0, &params).map_err(unsolved)?;
            Ok(las_solver_BACKEND(<B as Backend>::solver(&symbolic).map_err(unsolved)?))
        })
    })
}

/// Frees a solver. Null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_destroy_solver_BACKEND(solver: *mut las_solver_BACKEND) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe { free(solver) })
}

/// Factors a matrix of the solver's pattern, or makes what an iterative method needs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_factor_BACKEND(solver: *mut las_solver_BACKEND, mat: *const las_mat_BACKEND) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let solver = &mut exclusive(solver, "solver")?.0;
        las::Solver::<B>::factor(solver, &shared(mat, "mat")?.0).map(drop).map_err(unsolved)
    })
}

/// Factors a matrix of the solver's pattern if it is positive definite; LAS_SINGULAR if it is not.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_factor_definite_BACKEND(
    solver: *mut las_solver_BACKEND,
    mat: *const las_mat_BACKEND,
) -> i32 {
    // SAFETY: as above.
    guarded(|| unsafe {
        let solver = &mut exclusive(solver, "solver")?.0;
        las::Solver::<B>::factor_definite(solver, &shared(mat, "mat")?.0).map(drop).map_err(unsolved)
    })
}

/// A x = b, with the matrix factored last; b and x must not be the same vector. Tells the iterations of an iterative method
/// (0 for a direct one); a null pointer there is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_solve_BACKEND(
    solver: *mut las_solver_BACKEND,
    b: *const las_vec_BACKEND,
    x: *mut las_vec_BACKEND,
    iterations: *mut i32,
) -> i32 {
    // SAFETY: as above; the two differ.
    guarded(|| unsafe {
        apart(b, x, "b and x")?;
        let (solver, x) = (&mut exclusive(solver, "solver")?.0, &mut exclusive(x, "x")?.0);
        let report = las::Solver::<B>::solve(solver, &shared(b, "b")?.0, x).map_err(unsolved)?;
        if let Some(iterations) = iterations.as_mut() {
            *iterations = report.iterations as i32;
        }
        Ok(())
    })
}

/// A x[k] = b[k] for several right-hand sides at once; no vector may stand twice among x, or in both.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_solve_many_BACKEND(
    solver: *mut las_solver_BACKEND,
    count_of_sides: i32,
    b: *const *const las_vec_BACKEND,
    x: *const *mut las_vec_BACKEND,
) -> i32 {
    // SAFETY: as above; no two of x are the same, and none is one of b.
    guarded(|| unsafe {
        let solver = &mut exclusive(solver, "solver")?.0;
        let count = count(count_of_sides, "count_of_sides")?;
        let (b, x) = (array(b, count, "b")?, array(x, count, "x")?);
        all_apart(b, x)?;
        let b = Borrowed::new(b.iter().map(|&vec| Ok(&raw const shared(vec, "b[k]")?.0)))?;
        let mut x = Lent::new(x.iter().map(|&vec| Ok(&raw mut exclusive(vec, "x[k]")?.0)))?;
        las::Solver::<B>::solve_many(solver, b.as_slice(), x.as_mut_slice()).map(drop).map_err(unsolved)
    })
}
