// The C interface of one backend: its types and its vectors. The word BACKEND stands for the name of the backend.
// `build.rs` makes one copy of the files of this folder for each backend (`ranks.rs` is only for PETSc);
// `tools/headers` generates the C header and the Fortran module from them.

/// The backend, with which vectors, matrices and solvers are created.
pub struct las_BACKEND(Context);

/// A vector.
pub struct las_vec_BACKEND(Vector);

/// A matrix with a fixed pattern.
pub struct las_mat_BACKEND(Matrix);

/// Positions of entries in matrices of one pattern, located once.
pub struct las_slots_BACKEND(Vec<Slot>);

/// A solver for matrices of one pattern.
pub struct las_solver_BACKEND(Solver);

/// Creates the backend. Free it after all objects created with it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_create_BACKEND(las: *mut *mut las_BACKEND) -> i32 {
    create(las, "las", || Ok(las_BACKEND(<B as Exported>::context()?)))
}

/// Frees the backend. Null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_destroy_BACKEND(las: *mut las_BACKEND) -> i32 {
    guarded(|| free(las))
}

/// Creates a vector of `len` zeros.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_create_vec_BACKEND(
    las: *const las_BACKEND,
    len: i32,
    vec: *mut *mut las_vec_BACKEND,
) -> i32 {
    create(vec, "vec", || {
        let (las, len) = (shared(las, "las")?, count(len, "len")?);
        Ok(las_vec_BACKEND(<B as Backend>::vector(&las.0, len).map_err(backend_error)?))
    })
}

/// Frees a vector. Null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_destroy_vec_BACKEND(vec: *mut las_vec_BACKEND) -> i32 {
    guarded(|| free(vec))
}

/// Returns the number of entries of a vector.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_len_vec_BACKEND(vec: *const las_vec_BACKEND, len: *mut i32) -> i32 {
    guarded(|| {
        *exclusive(len, "len")? = length(&shared(vec, "vec")?.0) as i32;
        Ok(())
    })
}

/// y = 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_zero_vec_BACKEND(vec: *mut las_vec_BACKEND) -> i32 {
    guarded(|| VectorOps::<B>::zero(&mut exclusive(vec, "vec")?.0).map_err(backend_error))
}

/// y[rows[i]] += values[i]; negative rows are ignored.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_add_vec_BACKEND(
    vec: *mut las_vec_BACKEND,
    count: i32,
    rows: *const i32,
    values: *const f64,
) -> i32 {
    guarded(|| {
        let vec = &mut exclusive(vec, "vec")?.0;
        let rows = indices(rows, count, length(vec), "rows")?;
        VectorOps::<B>::add(vec, rows, scalars(values, rows.len(), "values")?).map_err(backend_error)
    })
}

/// y[rows[i]] = values[i]; negative rows are ignored.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_set_vec_BACKEND(
    vec: *mut las_vec_BACKEND,
    count: i32,
    rows: *const i32,
    values: *const f64,
) -> i32 {
    guarded(|| {
        let vec = &mut exclusive(vec, "vec")?.0;
        let rows = indices(rows, count, length(vec), "rows")?;
        VectorOps::<B>::set(vec, rows, scalars(values, rows.len(), "values")?).map_err(backend_error)
    })
}

/// values[i] = y[rows[i]]; if a row is negative, the value does not change.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_get_vec_BACKEND(
    vec: *const las_vec_BACKEND,
    count: i32,
    rows: *const i32,
    values: *mut f64,
) -> i32 {
    guarded(|| {
        let vec = &shared(vec, "vec")?.0;
        let rows = indices(rows, count, length(vec), "rows")?;
        VectorOps::<B>::get(vec, rows, scalars_mut(values, rows.len(), "values")?).map_err(backend_error)
    })
}

/// Returns the array of the entries; it is valid until the next use of the vector.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_local_vec_BACKEND(vec: *mut las_vec_BACKEND, values: *mut *mut f64) -> i32 {
    guarded(|| {
        let vec = &mut exclusive(vec, "vec")?.0;
        *exclusive(values, "values")? =
            VectorOps::<B>::with_local_mut(vec, |local| local.as_mut_ptr().cast()).map_err(backend_error)?;
        Ok(())
    })
}

/// Returns the Euclidean norm: one number, or with `batched` one for each of the four lanes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_norm_BACKEND(vec: *const las_vec_BACKEND, norm: *mut f64) -> i32 {
    guarded(|| {
        let value = VectorOps::<B>::norm(&shared(vec, "vec")?.0).map_err(backend_error)?;
        store_lanes(norm, value, "norm")
    })
}

/// Returns the sum of x[i] y[i]: one number, or with `batched` one for each of the four lanes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_dot_BACKEND(
    x: *const las_vec_BACKEND,
    y: *const las_vec_BACKEND,
    dot: *mut f64,
) -> i32 {
    guarded(|| {
        let (x, y) = (&shared(x, "x")?.0, &shared(y, "y")?.0);
        check_equal_sizes("the vectors", length(x), length(y))?;
        store_lanes(dot, VectorOps::<B>::dot(x, y).map_err(backend_error)?, "dot")
    })
}

/// y += a x; x and y must not be the same vector.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_axpy_BACKEND(a: f64, x: *const las_vec_BACKEND, y: *mut las_vec_BACKEND) -> i32 {
    guarded(|| {
        check_distinct(x, y, "x and y")?;
        let (x, y) = (&shared(x, "x")?.0, &mut exclusive(y, "y")?.0);
        check_equal_sizes("the vectors", length(x), length(y))?;
        VectorOps::<B>::axpy(y, splat(a), x).map_err(backend_error)
    })
}

/// Completes pending writes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_finish_vec_BACKEND(vec: *mut las_vec_BACKEND) -> i32 {
    guarded(|| VectorOps::<B>::finish(&mut exclusive(vec, "vec")?.0).map_err(backend_error))
}
