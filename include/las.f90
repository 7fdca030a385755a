! The linear-algebra abstraction LAS of the crate biotissue, for Fortran 2018. Made by tools/headers.
!
! A function returns LAS_OK or what was wrong; las_text() says it in words. Indices count from 0, as in C; the
    ! header las.h says what a caller promises.
! Which backends there are, the features of the build decide. On `batched` an entry is four numbers, one a lane.
module biotissue_las
  use, intrinsic :: iso_c_binding
  implicit none
  public

  integer(c_int), parameter :: LAS_OK = 0
  integer(c_int), parameter :: LAS_NULL = 1
  integer(c_int), parameter :: LAS_SIZE = 2
  integer(c_int), parameter :: LAS_INDEX = 3
  integer(c_int), parameter :: LAS_SINGULAR = 4
  integer(c_int), parameter :: LAS_NOT_CONVERGED = 5
  integer(c_int), parameter :: LAS_NOT_FACTORED = 6
  integer(c_int), parameter :: LAS_UNSUPPORTED = 7
  integer(c_int), parameter :: LAS_FILE = 8
  integer(c_int), parameter :: LAS_FAULT = 9
  integer(c_int), parameter :: LAS_PANIC = 10
  integer(c_int), parameter :: LAS_ARGUMENT = 11
  integer(c_int), parameter :: LAS_DEFINITE = 0
  integer(c_int), parameter :: LAS_SYMMETRIC = 1
  integer(c_int), parameter :: LAS_UNSYMMETRIC = 2
  integer(c_int), parameter :: LAS_DIRECT = 0
  integer(c_int), parameter :: LAS_CG = 1
  integer(c_int), parameter :: LAS_BICGSTAB = 2
  integer(c_int), parameter :: LAS_GMRES = 3
  integer(c_int), parameter :: LAS_NONE = 0
  integer(c_int), parameter :: LAS_DIAGONAL = 1
  integer(c_int), parameter :: LAS_ILUT = 2
  integer(c_int), parameter :: LAS_MULTIGRID = 3

  !> How a system is to be solved.
  type, bind(c) :: las_params
    integer(c_int) :: symmetry
    integer(c_int) :: method
    integer(c_int) :: preconditioner
    integer(c_int) :: restart
    integer(c_int) :: fill
    integer(c_int) :: max_iterations
    real(c_double) :: drop_tolerance
    real(c_double) :: tolerance
  end type

  interface
    function las_message() bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr) :: outcome
    end function
    function las_version() bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr) :: outcome
    end function
    function las_default_params(params) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(las_params), intent(out) :: params
      integer(c_int) :: outcome
    end function
    function las_create_pattern(rows, &
        cols, &
        row_offsets, &
        columns, &
        pattern) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      integer(c_int), value :: rows
      integer(c_int), value :: cols
      integer(c_int), intent(in) :: row_offsets(*)
      integer(c_int), intent(in) :: columns(*)
      type(c_ptr), intent(out) :: pattern
      integer(c_int) :: outcome
    end function
    function las_create_pattern_of_elements(size_of_system, &
        elements, &
        element_start, &
        unknowns, &
        pattern) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      integer(c_int), value :: size_of_system
      integer(c_int), value :: elements
      integer(c_int), intent(in) :: element_start(*)
      integer(c_int), intent(in) :: unknowns(*)
      type(c_ptr), intent(out) :: pattern
      integer(c_int) :: outcome
    end function
    function las_destroy_pattern(pattern) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: pattern
      integer(c_int) :: outcome
    end function

    ! sparse
    function las_create_sparse(las) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), intent(out) :: las
      integer(c_int) :: outcome
    end function
    function las_destroy_sparse(las) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      integer(c_int) :: outcome
    end function
    function las_create_vec_sparse(las, &
        len, &
        vec) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      integer(c_int), value :: len
      type(c_ptr), intent(out) :: vec
      integer(c_int) :: outcome
    end function
    function las_destroy_vec_sparse(vec) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int) :: outcome
    end function
    function las_len_vec_sparse(vec, &
        len) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int), intent(out) :: len
      integer(c_int) :: outcome
    end function
    function las_zero_vec_sparse(vec) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int) :: outcome
    end function
    function las_add_vec_sparse(vec, &
        count, &
        rows, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int), value :: count
      integer(c_int), intent(in) :: rows(*)
      real(c_double), intent(in) :: values(*)
      integer(c_int) :: outcome
    end function
    function las_set_vec_sparse(vec, &
        count, &
        rows, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int), value :: count
      integer(c_int), intent(in) :: rows(*)
      real(c_double), intent(in) :: values(*)
      integer(c_int) :: outcome
    end function
    function las_get_vec_sparse(vec, &
        count, &
        rows, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int), value :: count
      integer(c_int), intent(in) :: rows(*)
      real(c_double), intent(inout) :: values(*)
      integer(c_int) :: outcome
    end function
    function las_local_vec_sparse(vec, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      type(c_ptr), intent(out) :: values
      integer(c_int) :: outcome
    end function
    function las_norm_sparse(vec, &
        norm) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      real(c_double), intent(out) :: norm
      integer(c_int) :: outcome
    end function
    function las_dot_sparse(x, &
        y, &
        dot) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: x
      type(c_ptr), value :: y
      real(c_double), intent(out) :: dot
      integer(c_int) :: outcome
    end function
    function las_axpy_sparse(a, &
        x, &
        y) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      real(c_double), value :: a
      type(c_ptr), value :: x
      type(c_ptr), value :: y
      integer(c_int) :: outcome
    end function
    function las_finish_vec_sparse(vec) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int) :: outcome
    end function
    function las_create_mat_sparse(las, &
        pattern, &
        mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      type(c_ptr), value :: pattern
      type(c_ptr), intent(out) :: mat
      integer(c_int) :: outcome
    end function
    function las_destroy_mat_sparse(mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_shape_mat_sparse(mat, &
        rows, &
        cols) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), intent(out) :: rows
      integer(c_int), intent(out) :: cols
      integer(c_int) :: outcome
    end function
    function las_zero_mat_sparse(mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_zero_rows_sparse(mat, &
        count, &
        rows) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int) :: outcome
    end function
    function las_add_mat_sparse(mat, &
        rows_count, &
        rows, &
        cols_count, &
        cols, &
        block) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: rows_count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int), value :: cols_count
      integer(c_int), intent(in) :: cols(*)
      real(c_double), intent(in) :: block(*)
      integer(c_int) :: outcome
    end function
    function las_set_mat_sparse(mat, &
        rows_count, &
        rows, &
        cols_count, &
        cols, &
        block) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: rows_count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int), value :: cols_count
      integer(c_int), intent(in) :: cols(*)
      real(c_double), intent(in) :: block(*)
      integer(c_int) :: outcome
    end function
    function las_get_mat_sparse(mat, &
        rows_count, &
        rows, &
        cols_count, &
        cols, &
        block) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: rows_count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int), value :: cols_count
      integer(c_int), intent(in) :: cols(*)
      real(c_double), intent(inout) :: block(*)
      integer(c_int) :: outcome
    end function
    function las_create_slots_sparse(slots) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), intent(out) :: slots
      integer(c_int) :: outcome
    end function
    function las_destroy_slots_sparse(slots) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: slots
      integer(c_int) :: outcome
    end function
    function las_locate_sparse(mat, &
        rows_count, &
        rows, &
        cols_count, &
        cols, &
        slots) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: rows_count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int), value :: cols_count
      integer(c_int), intent(in) :: cols(*)
      type(c_ptr), value :: slots
      integer(c_int) :: outcome
    end function
    function las_add_at_sparse(mat, &
        slots, &
        first, &
        count, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: slots
      integer(c_int), value :: first
      integer(c_int), value :: count
      real(c_double), intent(in) :: values(*)
      integer(c_int) :: outcome
    end function
    function las_finish_mat_sparse(mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_mul_sparse(mat, &
        x, &
        y) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: x
      type(c_ptr), value :: y
      integer(c_int) :: outcome
    end function
    function las_mul_transpose_sparse(mat, &
        x, &
        y) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: x
      type(c_ptr), value :: y
      integer(c_int) :: outcome
    end function
    function las_diagonal_sparse(mat, &
        d) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: d
      integer(c_int) :: outcome
    end function
    function las_inverse_diagonal_sparse(mat, &
        d) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: d
      integer(c_int) :: outcome
    end function
    function las_scale_sparse(mat, &
        factor) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      real(c_double), value :: factor
      integer(c_int) :: outcome
    end function
    function las_sum_sparse(a, &
        first, &
        b, &
        second, &
        sum) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      real(c_double), value :: a
      type(c_ptr), value :: first
      real(c_double), value :: b
      type(c_ptr), value :: second
      type(c_ptr), intent(out) :: sum
      integer(c_int) :: outcome
    end function
    function las_product_sparse(first, &
        second, &
        product) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: first
      type(c_ptr), value :: second
      type(c_ptr), intent(out) :: product
      integer(c_int) :: outcome
    end function
    function las_transpose_sparse(mat, &
        transpose) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), intent(out) :: transpose
      integer(c_int) :: outcome
    end function
    function las_read_mat_sparse(las, &
        file, &
        mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      character(kind=c_char), intent(in) :: file(*)
      type(c_ptr), intent(out) :: mat
      integer(c_int) :: outcome
    end function
    function las_write_mat_sparse(mat, &
        file) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      character(kind=c_char), intent(in) :: file(*)
      integer(c_int) :: outcome
    end function
    function las_create_solver_sparse(las, &
        pattern, &
        params, &
        solver) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      type(c_ptr), value :: pattern
      type(las_params), intent(in) :: params
      type(c_ptr), intent(out) :: solver
      integer(c_int) :: outcome
    end function
    function las_destroy_solver_sparse(solver) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      integer(c_int) :: outcome
    end function
    function las_factor_sparse(solver, &
        mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_factor_definite_sparse(solver, &
        mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_solve_sparse(solver, &
        b, &
        x, &
        iterations, &
        residual) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      type(c_ptr), value :: b
      type(c_ptr), value :: x
      integer(c_int), intent(out), optional :: iterations
      real(c_double), intent(out), optional :: residual
      integer(c_int) :: outcome
    end function
    function las_solve_many_sparse(solver, &
        count_of_sides, &
        b, &
        x) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      integer(c_int), value :: count_of_sides
      type(c_ptr), intent(in) :: b(*)
      type(c_ptr), intent(in) :: x(*)
      integer(c_int) :: outcome
    end function

    ! dense
    function las_create_dense(las) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), intent(out) :: las
      integer(c_int) :: outcome
    end function
    function las_destroy_dense(las) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      integer(c_int) :: outcome
    end function
    function las_create_vec_dense(las, &
        len, &
        vec) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      integer(c_int), value :: len
      type(c_ptr), intent(out) :: vec
      integer(c_int) :: outcome
    end function
    function las_destroy_vec_dense(vec) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int) :: outcome
    end function
    function las_len_vec_dense(vec, &
        len) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int), intent(out) :: len
      integer(c_int) :: outcome
    end function
    function las_zero_vec_dense(vec) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int) :: outcome
    end function
    function las_add_vec_dense(vec, &
        count, &
        rows, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int), value :: count
      integer(c_int), intent(in) :: rows(*)
      real(c_double), intent(in) :: values(*)
      integer(c_int) :: outcome
    end function
    function las_set_vec_dense(vec, &
        count, &
        rows, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int), value :: count
      integer(c_int), intent(in) :: rows(*)
      real(c_double), intent(in) :: values(*)
      integer(c_int) :: outcome
    end function
    function las_get_vec_dense(vec, &
        count, &
        rows, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int), value :: count
      integer(c_int), intent(in) :: rows(*)
      real(c_double), intent(inout) :: values(*)
      integer(c_int) :: outcome
    end function
    function las_local_vec_dense(vec, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      type(c_ptr), intent(out) :: values
      integer(c_int) :: outcome
    end function
    function las_norm_dense(vec, &
        norm) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      real(c_double), intent(out) :: norm
      integer(c_int) :: outcome
    end function
    function las_dot_dense(x, &
        y, &
        dot) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: x
      type(c_ptr), value :: y
      real(c_double), intent(out) :: dot
      integer(c_int) :: outcome
    end function
    function las_axpy_dense(a, &
        x, &
        y) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      real(c_double), value :: a
      type(c_ptr), value :: x
      type(c_ptr), value :: y
      integer(c_int) :: outcome
    end function
    function las_finish_vec_dense(vec) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int) :: outcome
    end function
    function las_create_mat_dense(las, &
        pattern, &
        mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      type(c_ptr), value :: pattern
      type(c_ptr), intent(out) :: mat
      integer(c_int) :: outcome
    end function
    function las_destroy_mat_dense(mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_shape_mat_dense(mat, &
        rows, &
        cols) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), intent(out) :: rows
      integer(c_int), intent(out) :: cols
      integer(c_int) :: outcome
    end function
    function las_zero_mat_dense(mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_zero_rows_dense(mat, &
        count, &
        rows) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int) :: outcome
    end function
    function las_add_mat_dense(mat, &
        rows_count, &
        rows, &
        cols_count, &
        cols, &
        block) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: rows_count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int), value :: cols_count
      integer(c_int), intent(in) :: cols(*)
      real(c_double), intent(in) :: block(*)
      integer(c_int) :: outcome
    end function
    function las_set_mat_dense(mat, &
        rows_count, &
        rows, &
        cols_count, &
        cols, &
        block) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: rows_count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int), value :: cols_count
      integer(c_int), intent(in) :: cols(*)
      real(c_double), intent(in) :: block(*)
      integer(c_int) :: outcome
    end function
    function las_get_mat_dense(mat, &
        rows_count, &
        rows, &
        cols_count, &
        cols, &
        block) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: rows_count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int), value :: cols_count
      integer(c_int), intent(in) :: cols(*)
      real(c_double), intent(inout) :: block(*)
      integer(c_int) :: outcome
    end function
    function las_create_slots_dense(slots) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), intent(out) :: slots
      integer(c_int) :: outcome
    end function
    function las_destroy_slots_dense(slots) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: slots
      integer(c_int) :: outcome
    end function
    function las_locate_dense(mat, &
        rows_count, &
        rows, &
        cols_count, &
        cols, &
        slots) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: rows_count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int), value :: cols_count
      integer(c_int), intent(in) :: cols(*)
      type(c_ptr), value :: slots
      integer(c_int) :: outcome
    end function
    function las_add_at_dense(mat, &
        slots, &
        first, &
        count, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: slots
      integer(c_int), value :: first
      integer(c_int), value :: count
      real(c_double), intent(in) :: values(*)
      integer(c_int) :: outcome
    end function
    function las_finish_mat_dense(mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_mul_dense(mat, &
        x, &
        y) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: x
      type(c_ptr), value :: y
      integer(c_int) :: outcome
    end function
    function las_mul_transpose_dense(mat, &
        x, &
        y) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: x
      type(c_ptr), value :: y
      integer(c_int) :: outcome
    end function
    function las_diagonal_dense(mat, &
        d) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: d
      integer(c_int) :: outcome
    end function
    function las_inverse_diagonal_dense(mat, &
        d) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: d
      integer(c_int) :: outcome
    end function
    function las_scale_dense(mat, &
        factor) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      real(c_double), value :: factor
      integer(c_int) :: outcome
    end function
    function las_sum_dense(a, &
        first, &
        b, &
        second, &
        sum) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      real(c_double), value :: a
      type(c_ptr), value :: first
      real(c_double), value :: b
      type(c_ptr), value :: second
      type(c_ptr), intent(out) :: sum
      integer(c_int) :: outcome
    end function
    function las_product_dense(first, &
        second, &
        product) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: first
      type(c_ptr), value :: second
      type(c_ptr), intent(out) :: product
      integer(c_int) :: outcome
    end function
    function las_transpose_dense(mat, &
        transpose) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), intent(out) :: transpose
      integer(c_int) :: outcome
    end function
    function las_read_mat_dense(las, &
        file, &
        mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      character(kind=c_char), intent(in) :: file(*)
      type(c_ptr), intent(out) :: mat
      integer(c_int) :: outcome
    end function
    function las_write_mat_dense(mat, &
        file) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      character(kind=c_char), intent(in) :: file(*)
      integer(c_int) :: outcome
    end function
    function las_create_solver_dense(las, &
        pattern, &
        params, &
        solver) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      type(c_ptr), value :: pattern
      type(las_params), intent(in) :: params
      type(c_ptr), intent(out) :: solver
      integer(c_int) :: outcome
    end function
    function las_destroy_solver_dense(solver) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      integer(c_int) :: outcome
    end function
    function las_factor_dense(solver, &
        mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_factor_definite_dense(solver, &
        mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_solve_dense(solver, &
        b, &
        x, &
        iterations, &
        residual) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      type(c_ptr), value :: b
      type(c_ptr), value :: x
      integer(c_int), intent(out), optional :: iterations
      real(c_double), intent(out), optional :: residual
      integer(c_int) :: outcome
    end function
    function las_solve_many_dense(solver, &
        count_of_sides, &
        b, &
        x) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      integer(c_int), value :: count_of_sides
      type(c_ptr), intent(in) :: b(*)
      type(c_ptr), intent(in) :: x(*)
      integer(c_int) :: outcome
    end function

    ! batched
    function las_create_batched(las) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), intent(out) :: las
      integer(c_int) :: outcome
    end function
    function las_destroy_batched(las) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      integer(c_int) :: outcome
    end function
    function las_create_vec_batched(las, &
        len, &
        vec) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      integer(c_int), value :: len
      type(c_ptr), intent(out) :: vec
      integer(c_int) :: outcome
    end function
    function las_destroy_vec_batched(vec) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int) :: outcome
    end function
    function las_len_vec_batched(vec, &
        len) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int), intent(out) :: len
      integer(c_int) :: outcome
    end function
    function las_zero_vec_batched(vec) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int) :: outcome
    end function
    function las_add_vec_batched(vec, &
        count, &
        rows, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int), value :: count
      integer(c_int), intent(in) :: rows(*)
      real(c_double), intent(in) :: values(*)
      integer(c_int) :: outcome
    end function
    function las_set_vec_batched(vec, &
        count, &
        rows, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int), value :: count
      integer(c_int), intent(in) :: rows(*)
      real(c_double), intent(in) :: values(*)
      integer(c_int) :: outcome
    end function
    function las_get_vec_batched(vec, &
        count, &
        rows, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int), value :: count
      integer(c_int), intent(in) :: rows(*)
      real(c_double), intent(inout) :: values(*)
      integer(c_int) :: outcome
    end function
    function las_local_vec_batched(vec, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      type(c_ptr), intent(out) :: values
      integer(c_int) :: outcome
    end function
    function las_norm_batched(vec, &
        norm) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      real(c_double), intent(inout) :: norm(*)
      integer(c_int) :: outcome
    end function
    function las_dot_batched(x, &
        y, &
        dot) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: x
      type(c_ptr), value :: y
      real(c_double), intent(inout) :: dot(*)
      integer(c_int) :: outcome
    end function
    function las_axpy_batched(a, &
        x, &
        y) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      real(c_double), value :: a
      type(c_ptr), value :: x
      type(c_ptr), value :: y
      integer(c_int) :: outcome
    end function
    function las_finish_vec_batched(vec) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int) :: outcome
    end function
    function las_create_mat_batched(las, &
        pattern, &
        mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      type(c_ptr), value :: pattern
      type(c_ptr), intent(out) :: mat
      integer(c_int) :: outcome
    end function
    function las_destroy_mat_batched(mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_shape_mat_batched(mat, &
        rows, &
        cols) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), intent(out) :: rows
      integer(c_int), intent(out) :: cols
      integer(c_int) :: outcome
    end function
    function las_zero_mat_batched(mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_zero_rows_batched(mat, &
        count, &
        rows) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int) :: outcome
    end function
    function las_add_mat_batched(mat, &
        rows_count, &
        rows, &
        cols_count, &
        cols, &
        block) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: rows_count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int), value :: cols_count
      integer(c_int), intent(in) :: cols(*)
      real(c_double), intent(in) :: block(*)
      integer(c_int) :: outcome
    end function
    function las_set_mat_batched(mat, &
        rows_count, &
        rows, &
        cols_count, &
        cols, &
        block) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: rows_count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int), value :: cols_count
      integer(c_int), intent(in) :: cols(*)
      real(c_double), intent(in) :: block(*)
      integer(c_int) :: outcome
    end function
    function las_get_mat_batched(mat, &
        rows_count, &
        rows, &
        cols_count, &
        cols, &
        block) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: rows_count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int), value :: cols_count
      integer(c_int), intent(in) :: cols(*)
      real(c_double), intent(inout) :: block(*)
      integer(c_int) :: outcome
    end function
    function las_create_slots_batched(slots) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), intent(out) :: slots
      integer(c_int) :: outcome
    end function
    function las_destroy_slots_batched(slots) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: slots
      integer(c_int) :: outcome
    end function
    function las_locate_batched(mat, &
        rows_count, &
        rows, &
        cols_count, &
        cols, &
        slots) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: rows_count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int), value :: cols_count
      integer(c_int), intent(in) :: cols(*)
      type(c_ptr), value :: slots
      integer(c_int) :: outcome
    end function
    function las_add_at_batched(mat, &
        slots, &
        first, &
        count, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: slots
      integer(c_int), value :: first
      integer(c_int), value :: count
      real(c_double), intent(in) :: values(*)
      integer(c_int) :: outcome
    end function
    function las_finish_mat_batched(mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_mul_batched(mat, &
        x, &
        y) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: x
      type(c_ptr), value :: y
      integer(c_int) :: outcome
    end function
    function las_mul_transpose_batched(mat, &
        x, &
        y) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: x
      type(c_ptr), value :: y
      integer(c_int) :: outcome
    end function
    function las_diagonal_batched(mat, &
        d) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: d
      integer(c_int) :: outcome
    end function
    function las_inverse_diagonal_batched(mat, &
        d) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: d
      integer(c_int) :: outcome
    end function
    function las_scale_batched(mat, &
        factor) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      real(c_double), value :: factor
      integer(c_int) :: outcome
    end function
    function las_sum_batched(a, &
        first, &
        b, &
        second, &
        sum) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      real(c_double), value :: a
      type(c_ptr), value :: first
      real(c_double), value :: b
      type(c_ptr), value :: second
      type(c_ptr), intent(out) :: sum
      integer(c_int) :: outcome
    end function
    function las_product_batched(first, &
        second, &
        product) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: first
      type(c_ptr), value :: second
      type(c_ptr), intent(out) :: product
      integer(c_int) :: outcome
    end function
    function las_transpose_batched(mat, &
        transpose) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), intent(out) :: transpose
      integer(c_int) :: outcome
    end function
    function las_read_mat_batched(las, &
        file, &
        mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      character(kind=c_char), intent(in) :: file(*)
      type(c_ptr), intent(out) :: mat
      integer(c_int) :: outcome
    end function
    function las_write_mat_batched(mat, &
        file) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      character(kind=c_char), intent(in) :: file(*)
      integer(c_int) :: outcome
    end function
    function las_create_solver_batched(las, &
        pattern, &
        params, &
        solver) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      type(c_ptr), value :: pattern
      type(las_params), intent(in) :: params
      type(c_ptr), intent(out) :: solver
      integer(c_int) :: outcome
    end function
    function las_destroy_solver_batched(solver) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      integer(c_int) :: outcome
    end function
    function las_factor_batched(solver, &
        mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_factor_definite_batched(solver, &
        mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_solve_batched(solver, &
        b, &
        x, &
        iterations, &
        residual) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      type(c_ptr), value :: b
      type(c_ptr), value :: x
      integer(c_int), intent(out), optional :: iterations
      real(c_double), intent(out), optional :: residual
      integer(c_int) :: outcome
    end function
    function las_solve_many_batched(solver, &
        count_of_sides, &
        b, &
        x) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      integer(c_int), value :: count_of_sides
      type(c_ptr), intent(in) :: b(*)
      type(c_ptr), intent(in) :: x(*)
      integer(c_int) :: outcome
    end function

    ! petsc
    function las_create_petsc(las) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), intent(out) :: las
      integer(c_int) :: outcome
    end function
    function las_destroy_petsc(las) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      integer(c_int) :: outcome
    end function
    function las_create_vec_petsc(las, &
        len, &
        vec) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      integer(c_int), value :: len
      type(c_ptr), intent(out) :: vec
      integer(c_int) :: outcome
    end function
    function las_destroy_vec_petsc(vec) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int) :: outcome
    end function
    function las_len_vec_petsc(vec, &
        len) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int), intent(out) :: len
      integer(c_int) :: outcome
    end function
    function las_zero_vec_petsc(vec) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int) :: outcome
    end function
    function las_add_vec_petsc(vec, &
        count, &
        rows, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int), value :: count
      integer(c_int), intent(in) :: rows(*)
      real(c_double), intent(in) :: values(*)
      integer(c_int) :: outcome
    end function
    function las_set_vec_petsc(vec, &
        count, &
        rows, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int), value :: count
      integer(c_int), intent(in) :: rows(*)
      real(c_double), intent(in) :: values(*)
      integer(c_int) :: outcome
    end function
    function las_get_vec_petsc(vec, &
        count, &
        rows, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int), value :: count
      integer(c_int), intent(in) :: rows(*)
      real(c_double), intent(inout) :: values(*)
      integer(c_int) :: outcome
    end function
    function las_local_vec_petsc(vec, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      type(c_ptr), intent(out) :: values
      integer(c_int) :: outcome
    end function
    function las_norm_petsc(vec, &
        norm) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      real(c_double), intent(out) :: norm
      integer(c_int) :: outcome
    end function
    function las_dot_petsc(x, &
        y, &
        dot) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: x
      type(c_ptr), value :: y
      real(c_double), intent(out) :: dot
      integer(c_int) :: outcome
    end function
    function las_axpy_petsc(a, &
        x, &
        y) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      real(c_double), value :: a
      type(c_ptr), value :: x
      type(c_ptr), value :: y
      integer(c_int) :: outcome
    end function
    function las_finish_vec_petsc(vec) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: vec
      integer(c_int) :: outcome
    end function
    function las_create_mat_petsc(las, &
        pattern, &
        mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      type(c_ptr), value :: pattern
      type(c_ptr), intent(out) :: mat
      integer(c_int) :: outcome
    end function
    function las_destroy_mat_petsc(mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_shape_mat_petsc(mat, &
        rows, &
        cols) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), intent(out) :: rows
      integer(c_int), intent(out) :: cols
      integer(c_int) :: outcome
    end function
    function las_zero_mat_petsc(mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_zero_rows_petsc(mat, &
        count, &
        rows) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int) :: outcome
    end function
    function las_add_mat_petsc(mat, &
        rows_count, &
        rows, &
        cols_count, &
        cols, &
        block) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: rows_count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int), value :: cols_count
      integer(c_int), intent(in) :: cols(*)
      real(c_double), intent(in) :: block(*)
      integer(c_int) :: outcome
    end function
    function las_set_mat_petsc(mat, &
        rows_count, &
        rows, &
        cols_count, &
        cols, &
        block) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: rows_count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int), value :: cols_count
      integer(c_int), intent(in) :: cols(*)
      real(c_double), intent(in) :: block(*)
      integer(c_int) :: outcome
    end function
    function las_get_mat_petsc(mat, &
        rows_count, &
        rows, &
        cols_count, &
        cols, &
        block) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: rows_count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int), value :: cols_count
      integer(c_int), intent(in) :: cols(*)
      real(c_double), intent(inout) :: block(*)
      integer(c_int) :: outcome
    end function
    function las_create_slots_petsc(slots) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), intent(out) :: slots
      integer(c_int) :: outcome
    end function
    function las_destroy_slots_petsc(slots) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: slots
      integer(c_int) :: outcome
    end function
    function las_locate_petsc(mat, &
        rows_count, &
        rows, &
        cols_count, &
        cols, &
        slots) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int), value :: rows_count
      integer(c_int), intent(in) :: rows(*)
      integer(c_int), value :: cols_count
      integer(c_int), intent(in) :: cols(*)
      type(c_ptr), value :: slots
      integer(c_int) :: outcome
    end function
    function las_add_at_petsc(mat, &
        slots, &
        first, &
        count, &
        values) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: slots
      integer(c_int), value :: first
      integer(c_int), value :: count
      real(c_double), intent(in) :: values(*)
      integer(c_int) :: outcome
    end function
    function las_finish_mat_petsc(mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_mul_petsc(mat, &
        x, &
        y) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: x
      type(c_ptr), value :: y
      integer(c_int) :: outcome
    end function
    function las_mul_transpose_petsc(mat, &
        x, &
        y) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: x
      type(c_ptr), value :: y
      integer(c_int) :: outcome
    end function
    function las_diagonal_petsc(mat, &
        d) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: d
      integer(c_int) :: outcome
    end function
    function las_inverse_diagonal_petsc(mat, &
        d) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), value :: d
      integer(c_int) :: outcome
    end function
    function las_scale_petsc(mat, &
        factor) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      real(c_double), value :: factor
      integer(c_int) :: outcome
    end function
    function las_sum_petsc(a, &
        first, &
        b, &
        second, &
        sum) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      real(c_double), value :: a
      type(c_ptr), value :: first
      real(c_double), value :: b
      type(c_ptr), value :: second
      type(c_ptr), intent(out) :: sum
      integer(c_int) :: outcome
    end function
    function las_product_petsc(first, &
        second, &
        product) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: first
      type(c_ptr), value :: second
      type(c_ptr), intent(out) :: product
      integer(c_int) :: outcome
    end function
    function las_transpose_petsc(mat, &
        transpose) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      type(c_ptr), intent(out) :: transpose
      integer(c_int) :: outcome
    end function
    function las_read_mat_petsc(las, &
        file, &
        mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      character(kind=c_char), intent(in) :: file(*)
      type(c_ptr), intent(out) :: mat
      integer(c_int) :: outcome
    end function
    function las_write_mat_petsc(mat, &
        file) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: mat
      character(kind=c_char), intent(in) :: file(*)
      integer(c_int) :: outcome
    end function
    function las_create_solver_petsc(las, &
        pattern, &
        params, &
        solver) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      type(c_ptr), value :: pattern
      type(las_params), intent(in) :: params
      type(c_ptr), intent(out) :: solver
      integer(c_int) :: outcome
    end function
    function las_destroy_solver_petsc(solver) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      integer(c_int) :: outcome
    end function
    function las_factor_petsc(solver, &
        mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_factor_definite_petsc(solver, &
        mat) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      type(c_ptr), value :: mat
      integer(c_int) :: outcome
    end function
    function las_solve_petsc(solver, &
        b, &
        x, &
        iterations, &
        residual) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      type(c_ptr), value :: b
      type(c_ptr), value :: x
      integer(c_int), intent(out), optional :: iterations
      real(c_double), intent(out), optional :: residual
      integer(c_int) :: outcome
    end function
    function las_solve_many_petsc(solver, &
        count_of_sides, &
        b, &
        x) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: solver
      integer(c_int), value :: count_of_sides
      type(c_ptr), intent(in) :: b(*)
      type(c_ptr), intent(in) :: x(*)
      integer(c_int) :: outcome
    end function
    function las_create_on_petsc(comm, &
        las) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      integer(c_int), value :: comm
      type(c_ptr), intent(out) :: las
      integer(c_int) :: outcome
    end function
    function las_set_option_petsc(las, &
        name, &
        value) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      character(kind=c_char), intent(in) :: name(*)
      character(kind=c_char), intent(in) :: value(*)
      integer(c_int) :: outcome
    end function
    function las_set_prefix_petsc(las, &
        prefix) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      character(kind=c_char), intent(in) :: prefix(*)
      integer(c_int) :: outcome
    end function
    function las_set_block_size_petsc(las, &
        size) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      integer(c_int), value :: size
      integer(c_int) :: outcome
    end function
    function las_set_blocked_petsc(las, &
        blocked) bind(c) &
        result(outcome)
      import :: c_int, c_double, c_ptr, c_char, las_params
      type(c_ptr), value :: las
      integer(c_int), value :: blocked
      integer(c_int) :: outcome
    end function
  end interface

  interface
    function las_strlen(text) bind(c, name="strlen") result(length)
      import :: c_ptr, c_size_t
      type(c_ptr), value :: text
      integer(c_size_t) :: length
    end function
  end interface

contains

  !> What went wrong in the last call that did not return LAS_OK.
  function las_text() result(text)
    character(len=:), allocatable :: text
    character(kind=c_char), pointer :: chars(:)
    type(c_ptr) :: message
    integer :: k
    message = las_message()
    call c_f_pointer(message, chars, [las_strlen(message)])
    allocate (character(len=size(chars)) :: text)
    do k = 1, size(chars)
      text(k:k) = chars(k)
    end do
  end function
end module
