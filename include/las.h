/* The linear-algebra abstraction LAS of the crate biotissue, for C and C++. Made by tools/headers.

   A function returns LAS_OK or what was wrong; las_message() says it in words. Which backends there are, the
   features of the build decide: link errors name the others. On `batched` an entry is four numbers, one a lane.

   What a caller promises: a pointer is null, which is an error unless the function allows it, or points to as many
   values as the function says; a handle came from its las_create_... and is not used after its las_destroy_...;
   the thread that uses a handle is the only one that does so at that time. Different handles may be used by
   different threads, and a message belongs to the thread whose call failed. On `petsc`, all calls come from the
   thread that made the first, and all ranks of a handle make the same calls in the same order. When memory runs
   out, the program ends. */

#ifndef LAS_H
#define LAS_H

#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

/**
 * All went well.
 */
#define LAS_OK 0

/**
 * A pointer is null.
 */
#define LAS_NULL 1

/**
 * A size is negative, or sizes do not fit each other.
 */
#define LAS_SIZE 2

/**
 * An index is beyond the end.
 */
#define LAS_INDEX 3

/**
 * The matrix is singular.
 */
#define LAS_SINGULAR 4

/**
 * Iterations did not converge, or the matrix holds values that are not finite.
 */
#define LAS_NOT_CONVERGED 5

/**
 * There is nothing to solve with yet.
 */
#define LAS_NOT_FACTORED 6

/**
 * The backend cannot do that.
 */
#define LAS_UNSUPPORTED 7

/**
 * A file is wrong, or cannot be read or written.
 */
#define LAS_FILE 8

/**
 * The backend or its library failed.
 */
#define LAS_FAULT 9

/**
 * A fault of this library.
 */
#define LAS_PANIC 10

/**
 * A parameter is none of those allowed.
 */
#define LAS_ARGUMENT 11

/**
 * The matrix is symmetric, both of its triangles are stored, and it is positive definite in ordinary states.
 */
#define LAS_DEFINITE 0

/**
 * The matrix is symmetric, and both of its triangles are stored.
 */
#define LAS_SYMMETRIC 1

/**
 * The matrix is not symmetric.
 */
#define LAS_UNSYMMETRIC 2

/**
 * Solve by a factorization.
 */
#define LAS_DIRECT 0

/**
 * Solve by conjugate gradients.
 */
#define LAS_CG 1

/**
 * Solve by stabilized biconjugate gradients.
 */
#define LAS_BICGSTAB 2

/**
 * Solve by generalized minimal residuals.
 */
#define LAS_GMRES 3

/**
 * Iterate with what suits the method: the diagonal for LAS_CG and for all methods of PETSc, LAS_ILUT for the others.
 */
#define LAS_AUTO -1

/**
 * Iterate without a preconditioner.
 */
#define LAS_NONE 0

/**
 * Iterate with the inverse of the diagonal.
 */
#define LAS_DIAGONAL 1

/**
 * Iterate with an incomplete factorization.
 */
#define LAS_ILUT 2

/**
 * Iterate with algebraic multigrid.
 */
#define LAS_MULTIGRID 3

/**
 * The backend: what vectors, matrices and solvers are made with.
 */
typedef struct las_batched las_batched;

/**
 * The backend: what vectors, matrices and solvers are made with.
 */
typedef struct las_dense las_dense;

/**
 * A matrix with a fixed pattern.
 */
typedef struct las_mat_batched las_mat_batched;

/**
 * A matrix with a fixed pattern.
 */
typedef struct las_mat_dense las_mat_dense;

/**
 * A matrix with a fixed pattern.
 */
typedef struct las_mat_petsc las_mat_petsc;

/**
 * A matrix with a fixed pattern.
 */
typedef struct las_mat_sparse las_mat_sparse;

/**
 * Which entries of a matrix can be other than zero; shared by all backends.
 */
typedef struct las_pattern las_pattern;

/**
 * The backend: what vectors, matrices and solvers are made with.
 */
typedef struct las_petsc las_petsc;

/**
 * Positions in matrices of one pattern, located once.
 */
typedef struct las_slots_batched las_slots_batched;

/**
 * Positions in matrices of one pattern, located once.
 */
typedef struct las_slots_dense las_slots_dense;

/**
 * Positions in matrices of one pattern, located once.
 */
typedef struct las_slots_petsc las_slots_petsc;

/**
 * Positions in matrices of one pattern, located once.
 */
typedef struct las_slots_sparse las_slots_sparse;

/**
 * A solver for matrices of one pattern.
 */
typedef struct las_solver_batched las_solver_batched;

/**
 * A solver for matrices of one pattern.
 */
typedef struct las_solver_dense las_solver_dense;

/**
 * A solver for matrices of one pattern.
 */
typedef struct las_solver_petsc las_solver_petsc;

/**
 * A solver for matrices of one pattern.
 */
typedef struct las_solver_sparse las_solver_sparse;

/**
 * The backend: what vectors, matrices and solvers are made with.
 */
typedef struct las_sparse las_sparse;

/**
 * A vector.
 */
typedef struct las_vec_batched las_vec_batched;

/**
 * A vector.
 */
typedef struct las_vec_dense las_vec_dense;

/**
 * A vector.
 */
typedef struct las_vec_petsc las_vec_petsc;

/**
 * A vector.
 */
typedef struct las_vec_sparse las_vec_sparse;

/**
 * How a system is to be solved; las_default_params fills it in.
 */
typedef struct las_params {
  /**
   * LAS_DEFINITE, LAS_SYMMETRIC or LAS_UNSYMMETRIC.
   */
  int32_t symmetry;
  /**
   * LAS_DIRECT, LAS_CG, LAS_BICGSTAB or LAS_GMRES.
   */
  int32_t method;
  /**
   * LAS_AUTO, LAS_NONE, LAS_DIAGONAL, LAS_ILUT or LAS_MULTIGRID.
   */
  int32_t preconditioner;
  /**
   * Steps of GMRES between restarts.
   */
  int32_t restart;
  /**
   * Entries that a row of an incomplete factor keeps.
   */
  int32_t fill;
  /**
   * Iterations after which to give up.
   */
  int32_t max_iterations;
  /**
   * Entries below this part of their row are dropped from an incomplete factor.
   */
  double drop_tolerance;
  /**
   * Residual over right-hand side at which to stop.
   */
  double tolerance;
} las_params;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * What went wrong in the last call of this thread that did not return LAS_OK. The text lives until the next such call.
 */
const char *las_message(void);

/**
 * The version of this library, such as "0.1.0".
 */
const char *las_version(void);

/**
 * Fills in the defaults: a definite matrix, solved directly; iterations to 1e-10 with what suits the method, ILUT(1e-3, 20)
 * where it is that.
 */
int32_t las_default_params(struct las_params *params);

/**
 * Makes a pattern from compressed rows: row_start has rows + 1 entries, the last of which is the number of entries; the
 * columns of a row ascend. All count from 0.
 */
int32_t las_create_pattern(int32_t rows,
                           int32_t cols,
                           const int32_t *row_start,
                           const int32_t *columns,
                           struct las_pattern **pattern);

/**
 * Makes the square pattern of elements that each couple all of their unknowns: element k has the unknowns
 * unknowns[element_start[k]] to unknowns[element_start[k + 1] - 1]; negative ones are constrained.
 */
int32_t las_create_pattern_of_elements(int32_t size_of_system,
                                       int32_t elements,
                                       const int32_t *element_start,
                                       const int32_t *unknowns,
                                       struct las_pattern **pattern);

/**
 * Frees a pattern. Null is allowed.
 */
int32_t las_destroy_pattern(struct las_pattern *pattern);

/**
 * Makes the backend. Free it after all that was made with it.
 */
int32_t las_create_sparse(struct las_sparse **las);

/**
 * Frees the backend. Null is allowed.
 */
int32_t las_destroy_sparse(struct las_sparse *las);

/**
 * Makes a vector of `len` zeros.
 */
int32_t las_create_vec_sparse(const struct las_sparse *las,
                              int32_t len,
                              struct las_vec_sparse **vec);

/**
 * Frees a vector. Null is allowed.
 */
int32_t las_destroy_vec_sparse(struct las_vec_sparse *vec);

/**
 * Tells the number of entries of a vector.
 */
int32_t las_len_vec_sparse(const struct las_vec_sparse *vec, int32_t *len);

/**
 * y = 0.
 */
int32_t las_zero_vec_sparse(struct las_vec_sparse *vec);

/**
 * y[rows[i]] += values[i]; a negative row is dropped.
 */
int32_t las_add_vec_sparse(struct las_vec_sparse *vec,
                           int32_t count,
                           const int32_t *rows,
                           const double *values);

/**
 * y[rows[i]] = values[i]; a negative row is dropped.
 */
int32_t las_set_vec_sparse(struct las_vec_sparse *vec,
                           int32_t count,
                           const int32_t *rows,
                           const double *values);

/**
 * values[i] = y[rows[i]]; where a row is negative, the value stays what it was.
 */
int32_t las_get_vec_sparse(const struct las_vec_sparse *vec,
                           int32_t count,
                           const int32_t *rows,
                           double *values);

/**
 * Lends the array of the entries, until the vector is next used.
 */
int32_t las_local_vec_sparse(struct las_vec_sparse *vec, double **values);

/**
 * The Euclidean norm: one number, on `batched` one for each of the four lanes.
 */
int32_t las_norm_sparse(const struct las_vec_sparse *vec, double *norm);

/**
 * The sum of x[i] y[i]: one number, on `batched` one for each of the four lanes.
 */
int32_t las_dot_sparse(const struct las_vec_sparse *x, const struct las_vec_sparse *y, double *dot);

/**
 * y += a x; x and y must not be the same vector.
 */
int32_t las_axpy_sparse(double a, const struct las_vec_sparse *x, struct las_vec_sparse *y);

/**
 * Completes pending writes.
 */
int32_t las_finish_vec_sparse(struct las_vec_sparse *vec);

/**
 * Makes a matrix of zeros with a pattern, which may be freed.
 */
int32_t las_create_mat_sparse(const struct las_sparse *las,
                              const struct las_pattern *pattern,
                              struct las_mat_sparse **mat);

/**
 * Frees a matrix. Null is allowed.
 */
int32_t las_destroy_mat_sparse(struct las_mat_sparse *mat);

/**
 * Tells the numbers of rows and columns of a matrix.
 */
int32_t las_shape_mat_sparse(const struct las_mat_sparse *mat, int32_t *rows, int32_t *cols);

/**
 * A = 0; the pattern stays.
 */
int32_t las_zero_mat_sparse(struct las_mat_sparse *mat);

/**
 * Zeroes whole rows; the pattern stays.
 */
int32_t las_zero_rows_sparse(struct las_mat_sparse *mat, int32_t count, const int32_t *rows);

/**
 * A[rows[i], cols[j]] += block[i * cols_count + j]; negative rows and columns are dropped, and so is what is not in the
 * pattern (a library that is built with checks says LAS_INDEX).
 */
int32_t las_add_mat_sparse(struct las_mat_sparse *mat,
                           int32_t rows_count,
                           const int32_t *rows,
                           int32_t cols_count,
                           const int32_t *cols,
                           const double *block);

/**
 * A[rows[i], cols[j]] = block[i * cols_count + j]; negative rows and columns are dropped, and so is what is not in the
 * pattern (a library that is built with checks says LAS_INDEX).
 */
int32_t las_set_mat_sparse(struct las_mat_sparse *mat,
                           int32_t rows_count,
                           const int32_t *rows,
                           int32_t cols_count,
                           const int32_t *cols,
                           const double *block);

/**
 * block[i * cols_count + j] = A[rows[i], cols[j]], zero outside the pattern; where a row or column is negative, the value
 * stays what it was.
 */
int32_t las_get_mat_sparse(const struct las_mat_sparse *mat,
                           int32_t rows_count,
                           const int32_t *rows,
                           int32_t cols_count,
                           const int32_t *cols,
                           double *block);

/**
 * Makes an empty list of positions.
 */
int32_t las_create_slots_sparse(struct las_slots_sparse **slots);

/**
 * Frees a list of positions. Null is allowed.
 */
int32_t las_destroy_slots_sparse(struct las_slots_sparse *slots);

/**
 * Appends the positions of a block, row by row, to a list; for what is negative or not in the pattern, a position of
 * nothing (a library that is built with checks says LAS_INDEX for the latter).
 */
int32_t las_locate_sparse(const struct las_mat_sparse *mat,
                          int32_t rows_count,
                          const int32_t *rows,
                          int32_t cols_count,
                          const int32_t *cols,
                          struct las_slots_sparse *slots);

/**
 * A[slots[first + k]] += values[k] for as many values as there are; the positions come from a matrix of the same pattern.
 */
int32_t las_add_at_sparse(struct las_mat_sparse *mat,
                          const struct las_slots_sparse *slots,
                          int32_t first,
                          int32_t count,
                          const double *values);

/**
 * Completes pending writes.
 */
int32_t las_finish_mat_sparse(struct las_mat_sparse *mat);

/**
 * y = A x; x and y must not be the same vector.
 */
int32_t las_mul_sparse(const struct las_mat_sparse *mat,
                       const struct las_vec_sparse *x,
                       struct las_vec_sparse *y);

/**
 * y = A^T x; x and y must not be the same vector.
 */
int32_t las_mul_transpose_sparse(const struct las_mat_sparse *mat,
                                 const struct las_vec_sparse *x,
                                 struct las_vec_sparse *y);

/**
 * d[i] = A[i, i].
 */
int32_t las_diagonal_sparse(const struct las_mat_sparse *mat, struct las_vec_sparse *d);

/**
 * d[i] = 1 / A[i, i].
 */
int32_t las_inverse_diagonal_sparse(const struct las_mat_sparse *mat, struct las_vec_sparse *d);

/**
 * A *= factor.
 */
int32_t las_scale_sparse(struct las_mat_sparse *mat, double factor);

/**
 * Makes the matrix a A + b B.
 */
int32_t las_sum_sparse(double a,
                       const struct las_mat_sparse *first,
                       double b,
                       const struct las_mat_sparse *second,
                       struct las_mat_sparse **sum);

/**
 * Makes the matrix A B.
 */
int32_t las_product_sparse(const struct las_mat_sparse *first,
                           const struct las_mat_sparse *second,
                           struct las_mat_sparse **product);

/**
 * Makes the matrix A^T.
 */
int32_t las_transpose_sparse(const struct las_mat_sparse *mat, struct las_mat_sparse **transpose);

/**
 * Reads a matrix from a Matrix Market file.
 */
int32_t las_read_mat_sparse(const struct las_sparse *las,
                            const char *file,
                            struct las_mat_sparse **mat);

/**
 * Writes a matrix as a Matrix Market file.
 */
int32_t las_write_mat_sparse(const struct las_mat_sparse *mat, const char *file);

/**
 * Makes a solver for matrices of a pattern, which may be freed.
 */
int32_t las_create_solver_sparse(const struct las_sparse *las,
                                 const struct las_pattern *pattern,
                                 const struct las_params *params,
                                 struct las_solver_sparse **solver);

/**
 * Frees a solver. Null is allowed.
 */
int32_t las_destroy_solver_sparse(struct las_solver_sparse *solver);

/**
 * Factors a matrix of the solver's pattern, or makes what an iterative method needs.
 */
int32_t las_factor_sparse(struct las_solver_sparse *solver, const struct las_mat_sparse *mat);

/**
 * Factors a matrix of the solver's pattern if it is positive definite; LAS_SINGULAR if it is not, LAS_UNSUPPORTED if it is
 * stated to be LAS_UNSYMMETRIC.
 */
int32_t las_factor_definite_sparse(struct las_solver_sparse *solver,
                                   const struct las_mat_sparse *mat);

/**
 * A x = b, with the matrix factored last; b and x must not be the same vector. Tells the iterations of an iterative method
 * and the residual that it left, over the right-hand side (0 both for a direct one, which does not look); null pointers there
 * are allowed.
 */
int32_t las_solve_sparse(struct las_solver_sparse *solver,
                         const struct las_vec_sparse *b,
                         struct las_vec_sparse *x,
                         int32_t *iterations,
                         double *residual);

/**
 * A x[k] = b[k] for several right-hand sides at once; those before one that fails are solved. No vector may stand twice among x, or in both.
 */
int32_t las_solve_many_sparse(struct las_solver_sparse *solver,
                              int32_t count_of_sides,
                              const struct las_vec_sparse *const *b,
                              struct las_vec_sparse *const *x);

/**
 * Makes the backend. Free it after all that was made with it.
 */
int32_t las_create_dense(struct las_dense **las);

/**
 * Frees the backend. Null is allowed.
 */
int32_t las_destroy_dense(struct las_dense *las);

/**
 * Makes a vector of `len` zeros.
 */
int32_t las_create_vec_dense(const struct las_dense *las, int32_t len, struct las_vec_dense **vec);

/**
 * Frees a vector. Null is allowed.
 */
int32_t las_destroy_vec_dense(struct las_vec_dense *vec);

/**
 * Tells the number of entries of a vector.
 */
int32_t las_len_vec_dense(const struct las_vec_dense *vec, int32_t *len);

/**
 * y = 0.
 */
int32_t las_zero_vec_dense(struct las_vec_dense *vec);

/**
 * y[rows[i]] += values[i]; a negative row is dropped.
 */
int32_t las_add_vec_dense(struct las_vec_dense *vec,
                          int32_t count,
                          const int32_t *rows,
                          const double *values);

/**
 * y[rows[i]] = values[i]; a negative row is dropped.
 */
int32_t las_set_vec_dense(struct las_vec_dense *vec,
                          int32_t count,
                          const int32_t *rows,
                          const double *values);

/**
 * values[i] = y[rows[i]]; where a row is negative, the value stays what it was.
 */
int32_t las_get_vec_dense(const struct las_vec_dense *vec,
                          int32_t count,
                          const int32_t *rows,
                          double *values);

/**
 * Lends the array of the entries, until the vector is next used.
 */
int32_t las_local_vec_dense(struct las_vec_dense *vec, double **values);

/**
 * The Euclidean norm: one number, on `batched` one for each of the four lanes.
 */
int32_t las_norm_dense(const struct las_vec_dense *vec, double *norm);

/**
 * The sum of x[i] y[i]: one number, on `batched` one for each of the four lanes.
 */
int32_t las_dot_dense(const struct las_vec_dense *x, const struct las_vec_dense *y, double *dot);

/**
 * y += a x; x and y must not be the same vector.
 */
int32_t las_axpy_dense(double a, const struct las_vec_dense *x, struct las_vec_dense *y);

/**
 * Completes pending writes.
 */
int32_t las_finish_vec_dense(struct las_vec_dense *vec);

/**
 * Makes a matrix of zeros with a pattern, which may be freed.
 */
int32_t las_create_mat_dense(const struct las_dense *las,
                             const struct las_pattern *pattern,
                             struct las_mat_dense **mat);

/**
 * Frees a matrix. Null is allowed.
 */
int32_t las_destroy_mat_dense(struct las_mat_dense *mat);

/**
 * Tells the numbers of rows and columns of a matrix.
 */
int32_t las_shape_mat_dense(const struct las_mat_dense *mat, int32_t *rows, int32_t *cols);

/**
 * A = 0; the pattern stays.
 */
int32_t las_zero_mat_dense(struct las_mat_dense *mat);

/**
 * Zeroes whole rows; the pattern stays.
 */
int32_t las_zero_rows_dense(struct las_mat_dense *mat, int32_t count, const int32_t *rows);

/**
 * A[rows[i], cols[j]] += block[i * cols_count + j]; negative rows and columns are dropped, and so is what is not in the
 * pattern (a library that is built with checks says LAS_INDEX).
 */
int32_t las_add_mat_dense(struct las_mat_dense *mat,
                          int32_t rows_count,
                          const int32_t *rows,
                          int32_t cols_count,
                          const int32_t *cols,
                          const double *block);

/**
 * A[rows[i], cols[j]] = block[i * cols_count + j]; negative rows and columns are dropped, and so is what is not in the
 * pattern (a library that is built with checks says LAS_INDEX).
 */
int32_t las_set_mat_dense(struct las_mat_dense *mat,
                          int32_t rows_count,
                          const int32_t *rows,
                          int32_t cols_count,
                          const int32_t *cols,
                          const double *block);

/**
 * block[i * cols_count + j] = A[rows[i], cols[j]], zero outside the pattern; where a row or column is negative, the value
 * stays what it was.
 */
int32_t las_get_mat_dense(const struct las_mat_dense *mat,
                          int32_t rows_count,
                          const int32_t *rows,
                          int32_t cols_count,
                          const int32_t *cols,
                          double *block);

/**
 * Makes an empty list of positions.
 */
int32_t las_create_slots_dense(struct las_slots_dense **slots);

/**
 * Frees a list of positions. Null is allowed.
 */
int32_t las_destroy_slots_dense(struct las_slots_dense *slots);

/**
 * Appends the positions of a block, row by row, to a list; for what is negative or not in the pattern, a position of
 * nothing (a library that is built with checks says LAS_INDEX for the latter).
 */
int32_t las_locate_dense(const struct las_mat_dense *mat,
                         int32_t rows_count,
                         const int32_t *rows,
                         int32_t cols_count,
                         const int32_t *cols,
                         struct las_slots_dense *slots);

/**
 * A[slots[first + k]] += values[k] for as many values as there are; the positions come from a matrix of the same pattern.
 */
int32_t las_add_at_dense(struct las_mat_dense *mat,
                         const struct las_slots_dense *slots,
                         int32_t first,
                         int32_t count,
                         const double *values);

/**
 * Completes pending writes.
 */
int32_t las_finish_mat_dense(struct las_mat_dense *mat);

/**
 * y = A x; x and y must not be the same vector.
 */
int32_t las_mul_dense(const struct las_mat_dense *mat,
                      const struct las_vec_dense *x,
                      struct las_vec_dense *y);

/**
 * y = A^T x; x and y must not be the same vector.
 */
int32_t las_mul_transpose_dense(const struct las_mat_dense *mat,
                                const struct las_vec_dense *x,
                                struct las_vec_dense *y);

/**
 * d[i] = A[i, i].
 */
int32_t las_diagonal_dense(const struct las_mat_dense *mat, struct las_vec_dense *d);

/**
 * d[i] = 1 / A[i, i].
 */
int32_t las_inverse_diagonal_dense(const struct las_mat_dense *mat, struct las_vec_dense *d);

/**
 * A *= factor.
 */
int32_t las_scale_dense(struct las_mat_dense *mat, double factor);

/**
 * Makes the matrix a A + b B.
 */
int32_t las_sum_dense(double a,
                      const struct las_mat_dense *first,
                      double b,
                      const struct las_mat_dense *second,
                      struct las_mat_dense **sum);

/**
 * Makes the matrix A B.
 */
int32_t las_product_dense(const struct las_mat_dense *first,
                          const struct las_mat_dense *second,
                          struct las_mat_dense **product);

/**
 * Makes the matrix A^T.
 */
int32_t las_transpose_dense(const struct las_mat_dense *mat, struct las_mat_dense **transpose);

/**
 * Reads a matrix from a Matrix Market file.
 */
int32_t las_read_mat_dense(const struct las_dense *las,
                           const char *file,
                           struct las_mat_dense **mat);

/**
 * Writes a matrix as a Matrix Market file.
 */
int32_t las_write_mat_dense(const struct las_mat_dense *mat, const char *file);

/**
 * Makes a solver for matrices of a pattern, which may be freed.
 */
int32_t las_create_solver_dense(const struct las_dense *las,
                                const struct las_pattern *pattern,
                                const struct las_params *params,
                                struct las_solver_dense **solver);

/**
 * Frees a solver. Null is allowed.
 */
int32_t las_destroy_solver_dense(struct las_solver_dense *solver);

/**
 * Factors a matrix of the solver's pattern, or makes what an iterative method needs.
 */
int32_t las_factor_dense(struct las_solver_dense *solver, const struct las_mat_dense *mat);

/**
 * Factors a matrix of the solver's pattern if it is positive definite; LAS_SINGULAR if it is not, LAS_UNSUPPORTED if it is
 * stated to be LAS_UNSYMMETRIC.
 */
int32_t las_factor_definite_dense(struct las_solver_dense *solver,
                                  const struct las_mat_dense *mat);

/**
 * A x = b, with the matrix factored last; b and x must not be the same vector. Tells the iterations of an iterative method
 * and the residual that it left, over the right-hand side (0 both for a direct one, which does not look); null pointers there
 * are allowed.
 */
int32_t las_solve_dense(struct las_solver_dense *solver,
                        const struct las_vec_dense *b,
                        struct las_vec_dense *x,
                        int32_t *iterations,
                        double *residual);

/**
 * A x[k] = b[k] for several right-hand sides at once; those before one that fails are solved. No vector may stand twice among x, or in both.
 */
int32_t las_solve_many_dense(struct las_solver_dense *solver,
                             int32_t count_of_sides,
                             const struct las_vec_dense *const *b,
                             struct las_vec_dense *const *x);

/**
 * Makes the backend. Free it after all that was made with it.
 */
int32_t las_create_batched(struct las_batched **las);

/**
 * Frees the backend. Null is allowed.
 */
int32_t las_destroy_batched(struct las_batched *las);

/**
 * Makes a vector of `len` zeros.
 */
int32_t las_create_vec_batched(const struct las_batched *las,
                               int32_t len,
                               struct las_vec_batched **vec);

/**
 * Frees a vector. Null is allowed.
 */
int32_t las_destroy_vec_batched(struct las_vec_batched *vec);

/**
 * Tells the number of entries of a vector.
 */
int32_t las_len_vec_batched(const struct las_vec_batched *vec, int32_t *len);

/**
 * y = 0.
 */
int32_t las_zero_vec_batched(struct las_vec_batched *vec);

/**
 * y[rows[i]] += values[i]; a negative row is dropped.
 */
int32_t las_add_vec_batched(struct las_vec_batched *vec,
                            int32_t count,
                            const int32_t *rows,
                            const double *values);

/**
 * y[rows[i]] = values[i]; a negative row is dropped.
 */
int32_t las_set_vec_batched(struct las_vec_batched *vec,
                            int32_t count,
                            const int32_t *rows,
                            const double *values);

/**
 * values[i] = y[rows[i]]; where a row is negative, the value stays what it was.
 */
int32_t las_get_vec_batched(const struct las_vec_batched *vec,
                            int32_t count,
                            const int32_t *rows,
                            double *values);

/**
 * Lends the array of the entries, until the vector is next used.
 */
int32_t las_local_vec_batched(struct las_vec_batched *vec, double **values);

/**
 * The Euclidean norm: one number, on `batched` one for each of the four lanes.
 */
int32_t las_norm_batched(const struct las_vec_batched *vec, double *norm);

/**
 * The sum of x[i] y[i]: one number, on `batched` one for each of the four lanes.
 */
int32_t las_dot_batched(const struct las_vec_batched *x,
                        const struct las_vec_batched *y,
                        double *dot);

/**
 * y += a x; x and y must not be the same vector.
 */
int32_t las_axpy_batched(double a, const struct las_vec_batched *x, struct las_vec_batched *y);

/**
 * Completes pending writes.
 */
int32_t las_finish_vec_batched(struct las_vec_batched *vec);

/**
 * Makes a matrix of zeros with a pattern, which may be freed.
 */
int32_t las_create_mat_batched(const struct las_batched *las,
                               const struct las_pattern *pattern,
                               struct las_mat_batched **mat);

/**
 * Frees a matrix. Null is allowed.
 */
int32_t las_destroy_mat_batched(struct las_mat_batched *mat);

/**
 * Tells the numbers of rows and columns of a matrix.
 */
int32_t las_shape_mat_batched(const struct las_mat_batched *mat, int32_t *rows, int32_t *cols);

/**
 * A = 0; the pattern stays.
 */
int32_t las_zero_mat_batched(struct las_mat_batched *mat);

/**
 * Zeroes whole rows; the pattern stays.
 */
int32_t las_zero_rows_batched(struct las_mat_batched *mat, int32_t count, const int32_t *rows);

/**
 * A[rows[i], cols[j]] += block[i * cols_count + j]; negative rows and columns are dropped, and so is what is not in the
 * pattern (a library that is built with checks says LAS_INDEX).
 */
int32_t las_add_mat_batched(struct las_mat_batched *mat,
                            int32_t rows_count,
                            const int32_t *rows,
                            int32_t cols_count,
                            const int32_t *cols,
                            const double *block);

/**
 * A[rows[i], cols[j]] = block[i * cols_count + j]; negative rows and columns are dropped, and so is what is not in the
 * pattern (a library that is built with checks says LAS_INDEX).
 */
int32_t las_set_mat_batched(struct las_mat_batched *mat,
                            int32_t rows_count,
                            const int32_t *rows,
                            int32_t cols_count,
                            const int32_t *cols,
                            const double *block);

/**
 * block[i * cols_count + j] = A[rows[i], cols[j]], zero outside the pattern; where a row or column is negative, the value
 * stays what it was.
 */
int32_t las_get_mat_batched(const struct las_mat_batched *mat,
                            int32_t rows_count,
                            const int32_t *rows,
                            int32_t cols_count,
                            const int32_t *cols,
                            double *block);

/**
 * Makes an empty list of positions.
 */
int32_t las_create_slots_batched(struct las_slots_batched **slots);

/**
 * Frees a list of positions. Null is allowed.
 */
int32_t las_destroy_slots_batched(struct las_slots_batched *slots);

/**
 * Appends the positions of a block, row by row, to a list; for what is negative or not in the pattern, a position of
 * nothing (a library that is built with checks says LAS_INDEX for the latter).
 */
int32_t las_locate_batched(const struct las_mat_batched *mat,
                           int32_t rows_count,
                           const int32_t *rows,
                           int32_t cols_count,
                           const int32_t *cols,
                           struct las_slots_batched *slots);

/**
 * A[slots[first + k]] += values[k] for as many values as there are; the positions come from a matrix of the same pattern.
 */
int32_t las_add_at_batched(struct las_mat_batched *mat,
                           const struct las_slots_batched *slots,
                           int32_t first,
                           int32_t count,
                           const double *values);

/**
 * Completes pending writes.
 */
int32_t las_finish_mat_batched(struct las_mat_batched *mat);

/**
 * y = A x; x and y must not be the same vector.
 */
int32_t las_mul_batched(const struct las_mat_batched *mat,
                        const struct las_vec_batched *x,
                        struct las_vec_batched *y);

/**
 * y = A^T x; x and y must not be the same vector.
 */
int32_t las_mul_transpose_batched(const struct las_mat_batched *mat,
                                  const struct las_vec_batched *x,
                                  struct las_vec_batched *y);

/**
 * d[i] = A[i, i].
 */
int32_t las_diagonal_batched(const struct las_mat_batched *mat, struct las_vec_batched *d);

/**
 * d[i] = 1 / A[i, i].
 */
int32_t las_inverse_diagonal_batched(const struct las_mat_batched *mat, struct las_vec_batched *d);

/**
 * A *= factor.
 */
int32_t las_scale_batched(struct las_mat_batched *mat, double factor);

/**
 * Makes the matrix a A + b B.
 */
int32_t las_sum_batched(double a,
                        const struct las_mat_batched *first,
                        double b,
                        const struct las_mat_batched *second,
                        struct las_mat_batched **sum);

/**
 * Makes the matrix A B.
 */
int32_t las_product_batched(const struct las_mat_batched *first,
                            const struct las_mat_batched *second,
                            struct las_mat_batched **product);

/**
 * Makes the matrix A^T.
 */
int32_t las_transpose_batched(const struct las_mat_batched *mat,
                              struct las_mat_batched **transpose);

/**
 * Reads a matrix from a Matrix Market file.
 */
int32_t las_read_mat_batched(const struct las_batched *las,
                             const char *file,
                             struct las_mat_batched **mat);

/**
 * Writes a matrix as a Matrix Market file.
 */
int32_t las_write_mat_batched(const struct las_mat_batched *mat, const char *file);

/**
 * Makes a solver for matrices of a pattern, which may be freed.
 */
int32_t las_create_solver_batched(const struct las_batched *las,
                                  const struct las_pattern *pattern,
                                  const struct las_params *params,
                                  struct las_solver_batched **solver);

/**
 * Frees a solver. Null is allowed.
 */
int32_t las_destroy_solver_batched(struct las_solver_batched *solver);

/**
 * Factors a matrix of the solver's pattern, or makes what an iterative method needs.
 */
int32_t las_factor_batched(struct las_solver_batched *solver, const struct las_mat_batched *mat);

/**
 * Factors a matrix of the solver's pattern if it is positive definite; LAS_SINGULAR if it is not, LAS_UNSUPPORTED if it is
 * stated to be LAS_UNSYMMETRIC.
 */
int32_t las_factor_definite_batched(struct las_solver_batched *solver,
                                    const struct las_mat_batched *mat);

/**
 * A x = b, with the matrix factored last; b and x must not be the same vector. Tells the iterations of an iterative method
 * and the residual that it left, over the right-hand side (0 both for a direct one, which does not look); null pointers there
 * are allowed.
 */
int32_t las_solve_batched(struct las_solver_batched *solver,
                          const struct las_vec_batched *b,
                          struct las_vec_batched *x,
                          int32_t *iterations,
                          double *residual);

/**
 * A x[k] = b[k] for several right-hand sides at once; those before one that fails are solved. No vector may stand twice among x, or in both.
 */
int32_t las_solve_many_batched(struct las_solver_batched *solver,
                               int32_t count_of_sides,
                               const struct las_vec_batched *const *b,
                               struct las_vec_batched *const *x);

/**
 * Makes the backend. Free it after all that was made with it.
 */
int32_t las_create_petsc(struct las_petsc **las);

/**
 * Frees the backend. Null is allowed.
 */
int32_t las_destroy_petsc(struct las_petsc *las);

/**
 * Makes a vector of `len` zeros.
 */
int32_t las_create_vec_petsc(const struct las_petsc *las, int32_t len, struct las_vec_petsc **vec);

/**
 * Frees a vector. Null is allowed.
 */
int32_t las_destroy_vec_petsc(struct las_vec_petsc *vec);

/**
 * Tells the number of entries of a vector.
 */
int32_t las_len_vec_petsc(const struct las_vec_petsc *vec, int32_t *len);

/**
 * y = 0.
 */
int32_t las_zero_vec_petsc(struct las_vec_petsc *vec);

/**
 * y[rows[i]] += values[i]; a negative row is dropped.
 */
int32_t las_add_vec_petsc(struct las_vec_petsc *vec,
                          int32_t count,
                          const int32_t *rows,
                          const double *values);

/**
 * y[rows[i]] = values[i]; a negative row is dropped.
 */
int32_t las_set_vec_petsc(struct las_vec_petsc *vec,
                          int32_t count,
                          const int32_t *rows,
                          const double *values);

/**
 * values[i] = y[rows[i]]; where a row is negative, the value stays what it was.
 */
int32_t las_get_vec_petsc(const struct las_vec_petsc *vec,
                          int32_t count,
                          const int32_t *rows,
                          double *values);

/**
 * Lends the array of the entries, until the vector is next used.
 */
int32_t las_local_vec_petsc(struct las_vec_petsc *vec, double **values);

/**
 * The Euclidean norm: one number, on `batched` one for each of the four lanes.
 */
int32_t las_norm_petsc(const struct las_vec_petsc *vec, double *norm);

/**
 * The sum of x[i] y[i]: one number, on `batched` one for each of the four lanes.
 */
int32_t las_dot_petsc(const struct las_vec_petsc *x, const struct las_vec_petsc *y, double *dot);

/**
 * y += a x; x and y must not be the same vector.
 */
int32_t las_axpy_petsc(double a, const struct las_vec_petsc *x, struct las_vec_petsc *y);

/**
 * Completes pending writes.
 */
int32_t las_finish_vec_petsc(struct las_vec_petsc *vec);

/**
 * Makes a matrix of zeros with a pattern, which may be freed.
 */
int32_t las_create_mat_petsc(const struct las_petsc *las,
                             const struct las_pattern *pattern,
                             struct las_mat_petsc **mat);

/**
 * Frees a matrix. Null is allowed.
 */
int32_t las_destroy_mat_petsc(struct las_mat_petsc *mat);

/**
 * Tells the numbers of rows and columns of a matrix.
 */
int32_t las_shape_mat_petsc(const struct las_mat_petsc *mat, int32_t *rows, int32_t *cols);

/**
 * A = 0; the pattern stays.
 */
int32_t las_zero_mat_petsc(struct las_mat_petsc *mat);

/**
 * Zeroes whole rows; the pattern stays.
 */
int32_t las_zero_rows_petsc(struct las_mat_petsc *mat, int32_t count, const int32_t *rows);

/**
 * A[rows[i], cols[j]] += block[i * cols_count + j]; negative rows and columns are dropped, and so is what is not in the
 * pattern (a library that is built with checks says LAS_INDEX).
 */
int32_t las_add_mat_petsc(struct las_mat_petsc *mat,
                          int32_t rows_count,
                          const int32_t *rows,
                          int32_t cols_count,
                          const int32_t *cols,
                          const double *block);

/**
 * A[rows[i], cols[j]] = block[i * cols_count + j]; negative rows and columns are dropped, and so is what is not in the
 * pattern (a library that is built with checks says LAS_INDEX).
 */
int32_t las_set_mat_petsc(struct las_mat_petsc *mat,
                          int32_t rows_count,
                          const int32_t *rows,
                          int32_t cols_count,
                          const int32_t *cols,
                          const double *block);

/**
 * block[i * cols_count + j] = A[rows[i], cols[j]], zero outside the pattern; where a row or column is negative, the value
 * stays what it was.
 */
int32_t las_get_mat_petsc(const struct las_mat_petsc *mat,
                          int32_t rows_count,
                          const int32_t *rows,
                          int32_t cols_count,
                          const int32_t *cols,
                          double *block);

/**
 * Makes an empty list of positions.
 */
int32_t las_create_slots_petsc(struct las_slots_petsc **slots);

/**
 * Frees a list of positions. Null is allowed.
 */
int32_t las_destroy_slots_petsc(struct las_slots_petsc *slots);

/**
 * Appends the positions of a block, row by row, to a list; for what is negative or not in the pattern, a position of
 * nothing (a library that is built with checks says LAS_INDEX for the latter).
 */
int32_t las_locate_petsc(const struct las_mat_petsc *mat,
                         int32_t rows_count,
                         const int32_t *rows,
                         int32_t cols_count,
                         const int32_t *cols,
                         struct las_slots_petsc *slots);

/**
 * A[slots[first + k]] += values[k] for as many values as there are; the positions come from a matrix of the same pattern.
 */
int32_t las_add_at_petsc(struct las_mat_petsc *mat,
                         const struct las_slots_petsc *slots,
                         int32_t first,
                         int32_t count,
                         const double *values);

/**
 * Completes pending writes.
 */
int32_t las_finish_mat_petsc(struct las_mat_petsc *mat);

/**
 * y = A x; x and y must not be the same vector.
 */
int32_t las_mul_petsc(const struct las_mat_petsc *mat,
                      const struct las_vec_petsc *x,
                      struct las_vec_petsc *y);

/**
 * y = A^T x; x and y must not be the same vector.
 */
int32_t las_mul_transpose_petsc(const struct las_mat_petsc *mat,
                                const struct las_vec_petsc *x,
                                struct las_vec_petsc *y);

/**
 * d[i] = A[i, i].
 */
int32_t las_diagonal_petsc(const struct las_mat_petsc *mat, struct las_vec_petsc *d);

/**
 * d[i] = 1 / A[i, i].
 */
int32_t las_inverse_diagonal_petsc(const struct las_mat_petsc *mat, struct las_vec_petsc *d);

/**
 * A *= factor.
 */
int32_t las_scale_petsc(struct las_mat_petsc *mat, double factor);

/**
 * Makes the matrix a A + b B.
 */
int32_t las_sum_petsc(double a,
                      const struct las_mat_petsc *first,
                      double b,
                      const struct las_mat_petsc *second,
                      struct las_mat_petsc **sum);

/**
 * Makes the matrix A B.
 */
int32_t las_product_petsc(const struct las_mat_petsc *first,
                          const struct las_mat_petsc *second,
                          struct las_mat_petsc **product);

/**
 * Makes the matrix A^T.
 */
int32_t las_transpose_petsc(const struct las_mat_petsc *mat, struct las_mat_petsc **transpose);

/**
 * Reads a matrix from a Matrix Market file.
 */
int32_t las_read_mat_petsc(const struct las_petsc *las,
                           const char *file,
                           struct las_mat_petsc **mat);

/**
 * Writes a matrix as a Matrix Market file.
 */
int32_t las_write_mat_petsc(const struct las_mat_petsc *mat, const char *file);

/**
 * Makes a solver for matrices of a pattern, which may be freed.
 */
int32_t las_create_solver_petsc(const struct las_petsc *las,
                                const struct las_pattern *pattern,
                                const struct las_params *params,
                                struct las_solver_petsc **solver);

/**
 * Frees a solver. Null is allowed.
 */
int32_t las_destroy_solver_petsc(struct las_solver_petsc *solver);

/**
 * Factors a matrix of the solver's pattern, or makes what an iterative method needs.
 */
int32_t las_factor_petsc(struct las_solver_petsc *solver, const struct las_mat_petsc *mat);

/**
 * Factors a matrix of the solver's pattern if it is positive definite; LAS_SINGULAR if it is not, LAS_UNSUPPORTED if it is
 * stated to be LAS_UNSYMMETRIC.
 */
int32_t las_factor_definite_petsc(struct las_solver_petsc *solver,
                                  const struct las_mat_petsc *mat);

/**
 * A x = b, with the matrix factored last; b and x must not be the same vector. Tells the iterations of an iterative method
 * and the residual that it left, over the right-hand side (0 both for a direct one, which does not look); null pointers there
 * are allowed.
 */
int32_t las_solve_petsc(struct las_solver_petsc *solver,
                        const struct las_vec_petsc *b,
                        struct las_vec_petsc *x,
                        int32_t *iterations,
                        double *residual);

/**
 * A x[k] = b[k] for several right-hand sides at once; those before one that fails are solved. No vector may stand twice among x, or in both.
 */
int32_t las_solve_many_petsc(struct las_solver_petsc *solver,
                             int32_t count_of_sides,
                             const struct las_vec_petsc *const *b,
                             struct las_vec_petsc *const *x);

/**
 * Makes the backend on the ranks of a communicator, given by its Fortran handle: MPI_Comm_c2f(comm) in C, comm%MPI_VAL in
 * Fortran. MPI must be initialized; all ranks of the communicator call this together.
 *
 * On several ranks (las_create_petsc makes the backend on all of them) every rank runs the same program on the same data:
 * each assembles the whole matrix, and keeps the rows that it owns of it; vectors lie whole on each. Reading a matrix,
 * multiplying and solving are done by all ranks together. Who assembles only his own elements gets another matrix.
 */
int32_t las_create_on_petsc(int32_t comm,
                            struct las_petsc **las);

/**
 * Writes an option into PETSc's database: las_set_option_petsc(las, "ksp_type", "gmres"). It counts for solvers that factor
 * for the first time from then on.
 */
int32_t las_set_option_petsc(const struct las_petsc *las,
                             const char *name,
                             const char *value);

/**
 * Puts a prefix before the names of all options: with "body_", solvers of what is made from then on listen to
 * -body_ksp_type in place of -ksp_type, and las_set_option_petsc writes such names.
 */
int32_t las_set_prefix_petsc(struct las_petsc *las,
                             const char *prefix);

/**
 * Sets the unknowns of a block (3 at first): ranks own whole blocks, and a matrix of full blocks is known to be one.
 */
int32_t las_set_block_size_petsc(struct las_petsc *las,
                                 int32_t size);

/**
 * Lets matrices that are made from then on be stored in blocks (BAIJ) where they consist of full ones; 0 ends that.
 */
int32_t las_set_blocked_petsc(struct las_petsc *las,
                              int32_t blocked);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* LAS_H */
