// Matrices and their operations: a part of the template of one backend; see `vector.rs`.

/// Creates a zero matrix with a pattern, which may be freed afterward.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_create_mat_BACKEND(
    las: *const las_BACKEND,
    pattern: *const las_pattern,
    mat: *mut *mut las_mat_BACKEND,
) -> i32 {
    create(mat, "mat", || {
        let (las, pattern) = (shared(las, "las")?, shared(pattern, "pattern")?);
        Ok(las_mat_BACKEND(<B as Backend>::matrix(&las.0, &pattern.0).map_err(backend_error)?))
    })
}

/// Frees a matrix. Null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_destroy_mat_BACKEND(mat: *mut las_mat_BACKEND) -> i32 {
    guarded(|| free(mat))
}

/// Returns the numbers of rows and columns of a matrix.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_shape_mat_BACKEND(mat: *const las_mat_BACKEND, rows: *mut i32, cols: *mut i32) -> i32 {
    guarded(|| {
        let shape = shape(&shared(mat, "mat")?.0);
        *exclusive(rows, "rows")? = shape.0 as i32;
        *exclusive(cols, "cols")? = shape.1 as i32;
        Ok(())
    })
}

/// A = 0; the pattern does not change.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_zero_mat_BACKEND(mat: *mut las_mat_BACKEND) -> i32 {
    guarded(|| MatrixOps::<B>::zero(&mut exclusive(mat, "mat")?.0).map_err(backend_error))
}

/// Sets whole rows to zero; the pattern does not change.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_zero_rows_BACKEND(mat: *mut las_mat_BACKEND, count: i32, rows: *const i32) -> i32 {
    guarded(|| {
        let mat = &mut exclusive(mat, "mat")?.0;
        let rows = indices(rows, count, shape(mat).0, "rows")?;
        MatrixOps::<B>::zero_rows(mat, rows).map_err(backend_error)
    })
}

/// A[rows[i], cols[j]] += block[i * cols_count + j]; negative rows and columns are ignored, and so are entries outside
/// the pattern (a library built with PROFILE=checked returns LAS_INDEX for the latter).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_add_mat_BACKEND(
    mat: *mut las_mat_BACKEND,
    rows_count: i32,
    rows: *const i32,
    cols_count: i32,
    cols: *const i32,
    block: *const f64,
) -> i32 {
    guarded(|| {
        let mat = &mut exclusive(mat, "mat")?.0;
        let rows = indices(rows, rows_count, shape(mat).0, "rows")?;
        let cols = indices(cols, cols_count, shape(mat).1, "cols")?;
        check_in_pattern(mat, rows, cols)?;
        MatrixOps::<B>::add(mat, rows, cols, scalars(block, rows.len() * cols.len(), "block")?).map_err(backend_error)
    })
}

/// A[rows[i], cols[j]] = block[i * cols_count + j]; negative rows and columns are ignored, and so are entries outside
/// the pattern (a library built with PROFILE=checked returns LAS_INDEX for the latter).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_set_mat_BACKEND(
    mat: *mut las_mat_BACKEND,
    rows_count: i32,
    rows: *const i32,
    cols_count: i32,
    cols: *const i32,
    block: *const f64,
) -> i32 {
    guarded(|| {
        let mat = &mut exclusive(mat, "mat")?.0;
        let rows = indices(rows, rows_count, shape(mat).0, "rows")?;
        let cols = indices(cols, cols_count, shape(mat).1, "cols")?;
        check_in_pattern(mat, rows, cols)?;
        MatrixOps::<B>::set(mat, rows, cols, scalars(block, rows.len() * cols.len(), "block")?).map_err(backend_error)
    })
}

/// block[i * cols_count + j] = A[rows[i], cols[j]], zero outside the pattern; if a row or column is negative, the value
/// does not change.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_get_mat_BACKEND(
    mat: *const las_mat_BACKEND,
    rows_count: i32,
    rows: *const i32,
    cols_count: i32,
    cols: *const i32,
    block: *mut f64,
) -> i32 {
    guarded(|| {
        let mat = &shared(mat, "mat")?.0;
        let rows = indices(rows, rows_count, shape(mat).0, "rows")?;
        let cols = indices(cols, cols_count, shape(mat).1, "cols")?;
        let block = scalars_mut(block, rows.len() * cols.len(), "block")?;
        MatrixOps::<B>::get(mat, rows, cols, block).map_err(backend_error)
    })
}

/// Creates an empty list of positions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_create_slots_BACKEND(slots: *mut *mut las_slots_BACKEND) -> i32 {
    create(slots, "slots", || Ok(las_slots_BACKEND(Vec::new())))
}

/// Frees a list of positions. Null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_destroy_slots_BACKEND(slots: *mut las_slots_BACKEND) -> i32 {
    guarded(|| free(slots))
}

/// Appends the positions of a block, row by row, to a list; a negative index or an entry outside the pattern gets a
/// position at which contributions are dropped (a library built with PROFILE=checked returns LAS_INDEX for the
/// latter).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_locate_BACKEND(
    mat: *const las_mat_BACKEND,
    rows_count: i32,
    rows: *const i32,
    cols_count: i32,
    cols: *const i32,
    slots: *mut las_slots_BACKEND,
) -> i32 {
    guarded(|| {
        let mat = &shared(mat, "mat")?.0;
        let rows = indices(rows, rows_count, shape(mat).0, "rows")?;
        let cols = indices(cols, cols_count, shape(mat).1, "cols")?;
        check_in_pattern(mat, rows, cols)?;
        MatrixOps::<B>::locate(mat, rows, cols, &mut exclusive(slots, "slots")?.0).map_err(backend_error)
    })
}

/// A[slots[first + k]] += values[k] for k < count; the positions come from a matrix with the same pattern.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_add_at_BACKEND(
    mat: *mut las_mat_BACKEND,
    slots: *const las_slots_BACKEND,
    first: i32,
    count: i32,
    values: *const f64,
) -> i32 {
    guarded(|| {
        let (mat, slots) = (&mut exclusive(mat, "mat")?.0, &shared(slots, "slots")?.0);
        let slots = slot_range(slots, first, count)?;
        MatrixOps::<B>::add_at(mat, slots, scalars(values, slots.len(), "values")?).map_err(backend_error)
    })
}

/// Completes pending writes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn las_finish_mat_BACKEND(mat: *mut las_mat_BACKEND) -> i32 {
    guarded(|| MatrixOps::<B>::finish(&mut exclusive(mat, "mat")?.0).map_err(backend_error))
}
