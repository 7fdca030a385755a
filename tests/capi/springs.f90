! Assembles and solves a chain of springs with two backends in one program. The exit code is 0 if all checks pass.
! examples/fortran/first.f90 is a simpler program.
program springs
  use biotissue_las
  implicit none
  integer, parameter :: n = 50
  real(c_double) :: on_sparse(n), on_dense(n)
  integer :: i

  call solve_sparse(on_sparse)
  call solve_dense(on_dense)
  do i = 1, n
    call expect(abs(on_sparse(i) - i) < 1d-10, "the displacements are 1, 2, 3, ...")
    call expect(abs(on_sparse(i) - on_dense(i)) < 1d-10, "the backends agree")
  end do
  call errors()
  print "(a)", "all checks passed"

contains

  subroutine expect(condition, what)
    logical, intent(in) :: condition
    character(len=*), intent(in) :: what
    if (condition) return
    print "(4a)", "failed: ", what, "; last message: ", las_text()
    error stop 1
  end subroutine

  subroutine ok(code)
    integer(c_int), intent(in) :: code
    call expect(code == LAS_OK, "a call succeeds")
  end subroutine

  !> Returns the pattern of a chain of n unknowns and springs, fixed at the left.
  function chain() result(pattern)
    type(c_ptr) :: pattern
    integer(c_int) :: start(n + 1), unknowns(2 * n)
    integer :: k
    start = [(2 * k, k = 0, n)]
    do k = 1, n
      unknowns(2 * k - 1) = k - 2
      unknowns(2 * k) = k - 1
    end do
    call ok(las_create_pattern_of_elements(n, n, start, unknowns, pattern))
  end function

  subroutine solve_sparse(u)
    real(c_double), intent(out) :: u(n)
    type(c_ptr) :: backend, pattern, k, f, x, solver
    type(las_params) :: params
    integer(c_int) :: iterations, spring
    real(c_double) :: residual
    integer :: i
    pattern = chain()
    call ok(las_create_sparse(backend))
    call ok(las_create_mat_sparse(backend, pattern, k))
    call ok(las_create_vec_sparse(backend, n, f))
    call ok(las_create_vec_sparse(backend, n, x))
    do spring = 0, n - 1
      call ok(las_add_mat_sparse(k, 2, [spring - 1, spring], 2, [spring - 1, spring], [1d0, -1d0, -1d0, 1d0]))
    end do
    call ok(las_finish_mat_sparse(k))
    call ok(las_add_vec_sparse(f, 1, [n - 1], [1d0]))
    call ok(las_default_params(params))
    params%method = LAS_BICGSTAB
    params%drop_tolerance = 0d0
    call ok(las_create_solver_sparse(backend, pattern, params, solver))
    call ok(las_factor_sparse(solver, k))
    call ok(las_solve_sparse(solver, f, x, iterations, residual))
    call expect(residual < 1d-10, "the residual is small")
    call expect(iterations == 1, "a complete factorization needs one iteration")
    u = 0
    call ok(las_get_vec_sparse(x, n, [(i - 1, i = 1, n)], u))
    call ok(las_destroy_solver_sparse(solver))
    call ok(las_destroy_vec_sparse(x))
    call ok(las_destroy_vec_sparse(f))
    call ok(las_destroy_mat_sparse(k))
    call ok(las_destroy_pattern(pattern))
    call ok(las_destroy_sparse(backend))
  end subroutine

  subroutine solve_dense(u)
    real(c_double), intent(out) :: u(n)
    type(c_ptr) :: backend, pattern, k, f, x, solver
    type(las_params) :: params
    integer(c_int) :: spring
    integer :: i
    real(c_double) :: norm
    pattern = chain()
    call ok(las_create_dense(backend))
    call ok(las_create_mat_dense(backend, pattern, k))
    call ok(las_create_vec_dense(backend, n, f))
    call ok(las_create_vec_dense(backend, n, x))
    do spring = 0, n - 1
      call ok(las_add_mat_dense(k, 2, [spring - 1, spring], 2, [spring - 1, spring], [1d0, -1d0, -1d0, 1d0]))
    end do
    call ok(las_add_vec_dense(f, 1, [n - 1], [1d0]))
    call ok(las_norm_dense(f, norm))
    call expect(norm == 1d0, "the load is one")
    call ok(las_default_params(params))
    call ok(las_create_solver_dense(backend, pattern, params, solver))
    call ok(las_factor_dense(solver, k))
    call ok(las_solve_dense(solver, f, x))
    u = 0
    call ok(las_get_vec_dense(x, n, [(i - 1, i = 1, n)], u))
    call ok(las_destroy_solver_dense(solver))
    call ok(las_destroy_vec_dense(x))
    call ok(las_destroy_vec_dense(f))
    call ok(las_destroy_mat_dense(k))
    call ok(las_destroy_pattern(pattern))
    call ok(las_destroy_dense(backend))
  end subroutine

  subroutine errors()
    type(c_ptr) :: backend, x
    call ok(las_create_sparse(backend))
    call expect(las_create_vec_sparse(backend, -1, x) == LAS_SIZE, "a negative length is rejected")
    call expect(las_text() == "`len` is -1; it must not be negative", "the message names the argument")
    call expect(.not. c_associated(x), "no vector was created")
    call expect(las_zero_vec_sparse(c_null_ptr) == LAS_NULL, "null is rejected")
    call ok(las_destroy_sparse(backend))
  end subroutine
end program
