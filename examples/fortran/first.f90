! Displacements of a chain of three springs of stiffness 1: the left end is fixed, a force of 1 pulls the right end.
program first
  use, intrinsic :: iso_fortran_env, only: error_unit
  use biotissue_las
  implicit none
  ! Spring e joins the unknowns ends(:, e), which count from 0; -1 is the fixed end.
  integer(c_int), parameter :: ends(2, 3) = reshape([-1, 0, 0, 1, 1, 2], [2, 3])
  real(c_double), parameter :: stiffness(4) = [1d0, -1d0, -1d0, 1d0]
  type(c_ptr) :: las, pattern, k, f, u, solver
  type(las_params) :: params
  real(c_double) :: values(3)
  integer :: e

  ! Assemble K and f.
  call check(las_create_sparse(las))
  call check(las_create_pattern_of_elements(3, 3, [0, 2, 4, 6], [ends], pattern))
  call check(las_create_mat_sparse(las, pattern, k))
  call check(las_create_vec_sparse(las, 3, f))
  call check(las_create_vec_sparse(las, 3, u))
  do e = 1, 3
    call check(las_add_mat_sparse(k, 2, ends(:, e), 2, ends(:, e), stiffness))
  end do
  call check(las_finish_mat_sparse(k))
  call check(las_add_vec_sparse(f, 1, [2], [1d0]))
  call check(las_finish_vec_sparse(f))

  ! Solve K u = f.
  call check(las_default_params(params))
  call check(las_create_solver_sparse(las, pattern, params, solver))
  call check(las_factor_sparse(solver, k))
  call check(las_solve_sparse(solver, f, u))
  call check(las_get_vec_sparse(u, 3, [0, 1, 2], values))
  print "(a, 3(1x, f0.1))", "u =", values

  call check(las_destroy_solver_sparse(solver))
  call check(las_destroy_vec_sparse(u))
  call check(las_destroy_vec_sparse(f))
  call check(las_destroy_mat_sparse(k))
  call check(las_destroy_pattern(pattern))
  call check(las_destroy_sparse(las))

contains

  !> Ends the program with the message of the library if a call failed.
  subroutine check(code)
    integer(c_int), intent(in) :: code
    if (code == LAS_OK) return
    write (error_unit, "(a, i0, 2a)") "error ", code, ": ", las_text()
    error stop 1
  end subroutine
end program
