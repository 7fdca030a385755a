// Products, sums and files of matrices: a part of the template of one backend; see `vector.rs`.

/// Computes y = A x; x and y must not be the same vector.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_mul_BACKEND(
    mat: *const las_mat_BACKEND,
    x: *const las_vec_BACKEND,
    y: *mut las_vec_BACKEND,
) -> i32 {
    guarded(|| {
        check_distinct(x, y, "x and y")?;
        let y = &mut exclusive(y, "y")?.0;
        MatVec::<B>::mul(&shared(mat, "mat")?.0, &shared(x, "x")?.0, y).map_err(solve_error)
    })
}

/// Computes y = A^T x; x and y must not be the same vector.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_mul_transpose_BACKEND(
    mat: *const las_mat_BACKEND,
    x: *const las_vec_BACKEND,
    y: *mut las_vec_BACKEND,
) -> i32 {
    guarded(|| {
        check_distinct(x, y, "x and y")?;
        let y = &mut exclusive(y, "y")?.0;
        MatVec::<B>::mul_transpose(&shared(mat, "mat")?.0, &shared(x, "x")?.0, y).map_err(solve_error)
    })
}

/// Copies the diagonal: d[i] = A[i, i].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_diagonal_BACKEND(mat: *const las_mat_BACKEND, d: *mut las_vec_BACKEND) -> i32 {
    guarded(|| {
        MatVec::<B>::diagonal(&shared(mat, "mat")?.0, &mut exclusive(d, "d")?.0).map_err(solve_error)
    })
}

/// Inverts the diagonal: d[i] = 1 / A[i, i].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_inverse_diagonal_BACKEND(mat: *const las_mat_BACKEND, d: *mut las_vec_BACKEND) -> i32 {
    guarded(|| {
        MatVec::<B>::inverse_diagonal(&shared(mat, "mat")?.0, &mut exclusive(d, "d")?.0).map_err(solve_error)
    })
}

/// Scales the matrix: A *= factor.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_scale_BACKEND(mat: *mut las_mat_BACKEND, factor: f64) -> i32 {
    guarded(|| MatMat::<B>::scale(&mut exclusive(mat, "mat")?.0, splat(factor)).map_err(backend_error))
}

/// Creates the matrix a A + b B.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_sum_BACKEND(
    a: f64,
    first: *const las_mat_BACKEND,
    b: f64,
    second: *const las_mat_BACKEND,
    sum: *mut *mut las_mat_BACKEND,
) -> i32 {
    create(sum, "sum", || {
        let (first, second) = (&shared(first, "first")?.0, &shared(second, "second")?.0);
        Ok(las_mat_BACKEND(MatMat::<B>::sum(first, splat(a), second, splat(b)).map_err(solve_error)?))
    })
}

/// Creates the matrix A B.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_product_BACKEND(
    first: *const las_mat_BACKEND,
    second: *const las_mat_BACKEND,
    product: *mut *mut las_mat_BACKEND,
) -> i32 {
    create(product, "product", || {
        let (first, second) = (&shared(first, "first")?.0, &shared(second, "second")?.0);
        Ok(las_mat_BACKEND(MatMat::<B>::product(first, second).map_err(solve_error)?))
    })
}

/// Creates the matrix A^T.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_transpose_BACKEND(
    mat: *const las_mat_BACKEND,
    transpose: *mut *mut las_mat_BACKEND,
) -> i32 {
    create(transpose, "transpose", || {
        Ok(las_mat_BACKEND(MatMat::<B>::transpose(&shared(mat, "mat")?.0).map_err(solve_error)?))
    })
}

/// Creates a matrix from a Matrix Market file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_read_mat_BACKEND(
    las: *const las_BACKEND,
    file: *const c_char,
    mat: *mut *mut las_mat_BACKEND,
) -> i32 {
    create(mat, "mat", || {
        let (las, file) = (shared(las, "las")?, Path::new(text(file, "file")?));
        Ok(las_mat_BACKEND(<B as Exported>::read(file, &las.0)?))
    })
}

/// Writes a matrix to a Matrix Market file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_write_mat_BACKEND(mat: *const las_mat_BACKEND, file: *const c_char) -> i32 {
    guarded(|| <B as Exported>::write(Path::new(text(file, "file")?), &shared(mat, "mat")?.0))
}
