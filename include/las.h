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
 * Success.
 */
#define LAS_OK 0

/**
 * A pointer is null.
 */
#define LAS_NULL 1

/**
 * A size is negative, or sizes are inconsistent.
 */
#define LAS_SIZE 2

/**
 * An index is out of range.
 */
#define LAS_INDEX 3

/**
 * The matrix is singular, or not positive definite where that is required.
 */
#define LAS_SINGULAR 4

/**
 * An iterative method did not converge, the matrix is too ill-conditioned, or the matrix or right-hand side contains
 * values that are not finite.
 */
#define LAS_NOT_CONVERGED 5

/**
 * The solver has not factored a matrix yet.
 */
#define LAS_NOT_FACTORED 6

/**
 * The backend does not support the operation.
 */
#define LAS_UNSUPPORTED 7

/**
 * A file is invalid, or cannot be read or written.
 */
#define LAS_FILE 8

/**
 * The backend or its library failed.
 */
#define LAS_FAULT 9

/**
 * An internal error of this library.
 */
#define LAS_PANIC 10

/**
 * A parameter has none of the allowed values.
 */
#define LAS_ARGUMENT 11

/**
 * The matrix is symmetric, both of its triangles are stored, and it is normally positive definite.
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
 * Solve directly, by a factorization.
 */
#define LAS_DIRECT 0

/**
 * Solve by the conjugate gradient method (CG).
 */
#define LAS_CG 1

/**
 * Solve by the stabilized biconjugate gradient method (BiCGSTAB).
 */
#define LAS_BICGSTAB 2

/**
 * Solve by the generalized minimal residual method (GMRES).
 */
#define LAS_GMRES 3

/**
 * Precondition by the default of the method: the diagonal for LAS_CG and for all methods of PETSc, LAS_ILUT for the
 * others.
 */
#define LAS_AUTO -1

/**
 * Use no preconditioner.
 */
#define LAS_NONE 0

/**
 * Precondition by the inverse of the diagonal.
 */
#define LAS_DIAGONAL 1

/**
 * Precondition by an incomplete factorization.
 */
#define LAS_ILUT 2

/**
 * Precondition by algebraic multigrid.
 */
#define LAS_MULTIGRID 3

/**
 * The backend, with which vectors, matrices and solvers are created.
 */
typedef struct las_batched las_batched;

/**
 * The backend, with which vectors, matrices and solvers are created.
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
 * A sparsity pattern, shared by all backends.
 */
typedef struct las_pattern las_pattern;

/**
 * The backend, with which vectors, matrices and solvers are created.
 */
typedef struct las_petsc las_petsc;

/**
 * Positions of entries in matrices of one pattern, located once.
 */
typedef struct las_slots_batched las_slots_batched;

/**
 * Positions of entries in matrices of one pattern, located once.
 */
typedef struct las_slots_dense las_slots_dense;

/**
 * Positions of entries in matrices of one pattern, located once.
 */
typedef struct las_slots_petsc las_slots_petsc;

/**
 * Positions of entries in matrices of one pattern, located once.
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
 * The backend, with which vectors, matrices and solvers are created.
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
 * The solver parameters; las_default_params sets the defaults.
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
   * Number of GMRES steps between restarts.
   */
  int32_t restart;
  /**
   * Number of entries that a row of an incomplete factor keeps.
   */
  int32_t fill;
  /**
   * Largest number of iterations.
   */
  int32_t max_iterations;
  /**
   * Entries below this fraction of their row are dropped from an incomplete factor.
   */
  double drop_tolerance;
  /**
   * Norm of the residual over that of the right-hand side at which the iteration stops.
   */
  double tolerance;
} las_params;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Returns the message of the last call of this thread that did not return LAS_OK. The text is valid until the next
 * such call.
 */
const char *las_message(void);

/**
 * Returns the version of this library, such as "0.1.0".
 */
const char *las_version(void);

/**
 * Sets the defaults: a definite matrix, solved directly. For iterative methods: tolerance 1e-10, the default
 * preconditioner of the method, and ILUT(1e-3, 20) if that is ILUT.
 */
int32_t las_default_params(struct las_params *params);

/**
 * Creates a pattern from compressed rows: row_offsets has rows + 1 entries, the last of which is the number of
 * entries; the columns of a row ascend. All indices count from 0.
 */
int32_t las_create_pattern(int32_t rows,
                           int32_t cols,
                           const int32_t *row_offsets,
                           const int32_t *columns,
                           struct las_pattern **pattern);

/**
 * Creates the square pattern of elements, each of which couples all of its unknowns: element k has the unknowns
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
 * Creates the backend. Free it after all objects created with it.
 */
int32_t las_create_sparse(struct las_sparse **las);

/**
 * Frees the backend. Null is allowed.
 */
int32_t las_destroy_sparse(struct las_sparse *las);

/**
 * Creates a vector of `len` zeros.
 */
int32_t las_create_vec_sparse(const struct las_sparse *las,
                              int32_t len,
                              struct las_vec_sparse **vec);

/**
 * Frees a vector. Null is allowed.
 */
int32_t las_destroy_vec_sparse(struct las_vec_sparse *vec);

/**
 * Returns the number of entries of a vector.
 */
int32_t las_len_vec_sparse(const struct las_vec_sparse *vec, int32_t *len);

/**
 * y = 0.
 */
int32_t las_zero_vec_sparse(struct las_vec_sparse *vec);

/**
 * y[rows[i]] += values[i]; negative rows are ignored.
 */
int32_t las_add_vec_sparse(struct las_vec_sparse *vec,
                           int32_t count,
                           const int32_t *rows,
                           const double *values);

/**
 * y[rows[i]] = values[i]; negative rows are ignored.
 */
int32_t las_set_vec_sparse(struct las_vec_sparse *vec,
                           int32_t count,
                           const int32_t *rows,
                           const double *values);

/**
 * values[i] = y[rows[i]]; if a row is negative, the value does not change.
 */
int32_t las_get_vec_sparse(const struct las_vec_sparse *vec,
                           int32_t count,
                           const int32_t *rows,
                           double *values);

/**
 * Returns the array of the entries; it is valid until the next use of the vector.
 */
int32_t las_local_vec_sparse(struct las_vec_sparse *vec, double **values);

/**
 * Returns the Euclidean norm: one number, or with `batched` one for each of the four lanes.
 */
int32_t las_norm_sparse(const struct las_vec_sparse *vec, double *norm);

/**
 * Returns the sum of x[i] y[i]: one number, or with `batched` one for each of the four lanes.
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
 * Creates a zero matrix with a pattern, which may be freed afterward.
 */
int32_t las_create_mat_sparse(const struct las_sparse *las,
                              const struct las_pattern *pattern,
                              struct las_mat_sparse **mat);

/**
 * Frees a matrix. Null is allowed.
 */
int32_t las_destroy_mat_sparse(struct las_mat_sparse *mat);

/**
 * Returns the numbers of rows and columns of a matrix.
 */
int32_t las_shape_mat_sparse(const struct las_mat_sparse *mat, int32_t *rows, int32_t *cols);

/**
 * A = 0; the pattern does not change.
 */
int32_t las_zero_mat_sparse(struct las_mat_sparse *mat);

/**
 * Sets whole rows to zero; the pattern does not change.
 */
int32_t las_zero_rows_sparse(struct las_mat_sparse *mat, int32_t count, const int32_t *rows);

/**
 * A[rows[i], cols[j]] += block[i * cols_count + j]; negative rows and columns are ignored, and so are entries outside
 * the pattern (a library built with debug assertions returns LAS_INDEX for the latter).
 */
int32_t las_add_mat_sparse(struct las_mat_sparse *mat,
                           int32_t rows_count,
                           const int32_t *rows,
                           int32_t cols_count,
                           const int32_t *cols,
                           const double *block);

/**
 * A[rows[i], cols[j]] = block[i * cols_count + j]; negative rows and columns are ignored, and so are entries outside
 * the pattern (a library built with debug assertions returns LAS_INDEX for the latter).
 */
int32_t las_set_mat_sparse(struct las_mat_sparse *mat,
                           int32_t rows_count,
                           const int32_t *rows,
                           int32_t cols_count,
                           const int32_t *cols,
                           const double *block);

/**
 * block[i * cols_count + j] = A[rows[i], cols[j]], zero outside the pattern; if a row or column is negative, the value
 * does not change.
 */
int32_t las_get_mat_sparse(const struct las_mat_sparse *mat,
                           int32_t rows_count,
                           const int32_t *rows,
                           int32_t cols_count,
                           const int32_t *cols,
                           double *block);

/**
 * Creates an empty list of positions.
 */
int32_t las_create_slots_sparse(struct las_slots_sparse **slots);

/**
 * Frees a list of positions. Null is allowed.
 */
int32_t las_destroy_slots_sparse(struct las_slots_sparse *slots);

/**
 * Appends the positions of a block, row by row, to a list; a negative index or an entry outside the pattern gets a
 * position at which contributions are dropped (a library built with debug assertions returns LAS_INDEX for the
 * latter).
 */
int32_t las_locate_sparse(const struct las_mat_sparse *mat,
                          int32_t rows_count,
                          const int32_t *rows,
                          int32_t cols_count,
                          const int32_t *cols,
                          struct las_slots_sparse *slots);

/**
 * A[slots[first + k]] += values[k] for k < count; the positions come from a matrix with the same pattern.
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
 * Computes y = A x; x and y must not be the same vector.
 */
int32_t las_mul_sparse(const struct las_mat_sparse *mat,
                       const struct las_vec_sparse *x,
                       struct las_vec_sparse *y);

/**
 * Computes y = A^T x; x and y must not be the same vector.
 */
int32_t las_mul_transpose_sparse(const struct las_mat_sparse *mat,
                                 const struct las_vec_sparse *x,
                                 struct las_vec_sparse *y);

/**
 * Copies the diagonal: d[i] = A[i, i].
 */
int32_t las_diagonal_sparse(const struct las_mat_sparse *mat, struct las_vec_sparse *d);

/**
 * Inverts the diagonal: d[i] = 1 / A[i, i].
 */
int32_t las_inverse_diagonal_sparse(const struct las_mat_sparse *mat, struct las_vec_sparse *d);

/**
 * Scales the matrix: A *= factor.
 */
int32_t las_scale_sparse(struct las_mat_sparse *mat, double factor);

/**
 * Creates the matrix a A + b B.
 */
int32_t las_sum_sparse(double a,
                       const struct las_mat_sparse *first,
                       double b,
                       const struct las_mat_sparse *second,
                       struct las_mat_sparse **sum);

/**
 * Creates the matrix A B.
 */
int32_t las_product_sparse(const struct las_mat_sparse *first,
                           const struct las_mat_sparse *second,
                           struct las_mat_sparse **product);

/**
 * Creates the matrix A^T.
 */
int32_t las_transpose_sparse(const struct las_mat_sparse *mat, struct las_mat_sparse **transpose);

/**
 * Creates a matrix from a Matrix Market file.
 */
int32_t las_read_mat_sparse(const struct las_sparse *las,
                            const char *file,
                            struct las_mat_sparse **mat);

/**
 * Writes a matrix to a Matrix Market file.
 */
int32_t las_write_mat_sparse(const struct las_mat_sparse *mat, const char *file);

/**
 * Creates a solver for matrices with a pattern, which may be freed afterward.
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
 * Factors a matrix with the solver's pattern, or computes the preconditioner of an iterative method.
 */
int32_t las_factor_sparse(struct las_solver_sparse *solver,
                          const struct las_mat_sparse *mat);

/**
 * Factors a matrix with the solver's pattern if it is positive definite. Returns LAS_SINGULAR if it is not,
 * LAS_UNSUPPORTED if it is declared LAS_UNSYMMETRIC.
 */
int32_t las_factor_definite_sparse(struct las_solver_sparse *solver,
                                   const struct las_mat_sparse *mat);

/**
 * Solves A x = b with the matrix factored last; b and x must not be the same vector. Returns the number of iterations
 * of an iterative method and the norm of its final residual over that of the right-hand side (both 0 for a direct
 * method, which does not compute the residual); these two pointers may be null.
 */
int32_t las_solve_sparse(struct las_solver_sparse *solver,
                         const struct las_vec_sparse *b,
                         struct las_vec_sparse *x,
                         int32_t *iterations,
                         double *residual);

/**
 * Solves A x[k] = b[k] for several right-hand sides at once; if one fails, those before it are solved. No vector may
 * occur twice in x, or in both b and x.
 */
int32_t las_solve_many_sparse(struct las_solver_sparse *solver,
                              int32_t count_of_sides,
                              const struct las_vec_sparse *const *b,
                              struct las_vec_sparse *const *x);

/**
 * Creates the backend. Free it after all objects created with it.
 */
int32_t las_create_dense(struct las_dense **las);

/**
 * Frees the backend. Null is allowed.
 */
int32_t las_destroy_dense(struct las_dense *las);

/**
 * Creates a vector of `len` zeros.
 */
int32_t las_create_vec_dense(const struct las_dense *las, int32_t len, struct las_vec_dense **vec);

/**
 * Frees a vector. Null is allowed.
 */
int32_t las_destroy_vec_dense(struct las_vec_dense *vec);

/**
 * Returns the number of entries of a vector.
 */
int32_t las_len_vec_dense(const struct las_vec_dense *vec, int32_t *len);

/**
 * y = 0.
 */
int32_t las_zero_vec_dense(struct las_vec_dense *vec);

/**
 * y[rows[i]] += values[i]; negative rows are ignored.
 */
int32_t las_add_vec_dense(struct las_vec_dense *vec,
                          int32_t count,
                          const int32_t *rows,
                          const double *values);

/**
 * y[rows[i]] = values[i]; negative rows are ignored.
 */
int32_t las_set_vec_dense(struct las_vec_dense *vec,
                          int32_t count,
                          const int32_t *rows,
                          const double *values);

/**
 * values[i] = y[rows[i]]; if a row is negative, the value does not change.
 */
int32_t las_get_vec_dense(const struct las_vec_dense *vec,
                          int32_t count,
                          const int32_t *rows,
                          double *values);

/**
 * Returns the array of the entries; it is valid until the next use of the vector.
 */
int32_t las_local_vec_dense(struct las_vec_dense *vec, double **values);

/**
 * Returns the Euclidean norm: one number, or with `batched` one for each of the four lanes.
 */
int32_t las_norm_dense(const struct las_vec_dense *vec, double *norm);

/**
 * Returns the sum of x[i] y[i]: one number, or with `batched` one for each of the four lanes.
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
 * Creates a zero matrix with a pattern, which may be freed afterward.
 */
int32_t las_create_mat_dense(const struct las_dense *las,
                             const struct las_pattern *pattern,
                             struct las_mat_dense **mat);

/**
 * Frees a matrix. Null is allowed.
 */
int32_t las_destroy_mat_dense(struct las_mat_dense *mat);

/**
 * Returns the numbers of rows and columns of a matrix.
 */
int32_t las_shape_mat_dense(const struct las_mat_dense *mat, int32_t *rows, int32_t *cols);

/**
 * A = 0; the pattern does not change.
 */
int32_t las_zero_mat_dense(struct las_mat_dense *mat);

/**
 * Sets whole rows to zero; the pattern does not change.
 */
int32_t las_zero_rows_dense(struct las_mat_dense *mat, int32_t count, const int32_t *rows);

/**
 * A[rows[i], cols[j]] += block[i * cols_count + j]; negative rows and columns are ignored, and so are entries outside
 * the pattern (a library built with debug assertions returns LAS_INDEX for the latter).
 */
int32_t las_add_mat_dense(struct las_mat_dense *mat,
                          int32_t rows_count,
                          const int32_t *rows,
                          int32_t cols_count,
                          const int32_t *cols,
                          const double *block);

/**
 * A[rows[i], cols[j]] = block[i * cols_count + j]; negative rows and columns are ignored, and so are entries outside
 * the pattern (a library built with debug assertions returns LAS_INDEX for the latter).
 */
int32_t las_set_mat_dense(struct las_mat_dense *mat,
                          int32_t rows_count,
                          const int32_t *rows,
                          int32_t cols_count,
                          const int32_t *cols,
                          const double *block);

/**
 * block[i * cols_count + j] = A[rows[i], cols[j]], zero outside the pattern; if a row or column is negative, the value
 * does not change.
 */
int32_t las_get_mat_dense(const struct las_mat_dense *mat,
                          int32_t rows_count,
                          const int32_t *rows,
                          int32_t cols_count,
                          const int32_t *cols,
                          double *block);

/**
 * Creates an empty list of positions.
 */
int32_t las_create_slots_dense(struct las_slots_dense **slots);

/**
 * Frees a list of positions. Null is allowed.
 */
int32_t las_destroy_slots_dense(struct las_slots_dense *slots);

/**
 * Appends the positions of a block, row by row, to a list; a negative index or an entry outside the pattern gets a
 * position at which contributions are dropped (a library built with debug assertions returns LAS_INDEX for the
 * latter).
 */
int32_t las_locate_dense(const struct las_mat_dense *mat,
                         int32_t rows_count,
                         const int32_t *rows,
                         int32_t cols_count,
                         const int32_t *cols,
                         struct las_slots_dense *slots);

/**
 * A[slots[first + k]] += values[k] for k < count; the positions come from a matrix with the same pattern.
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
 * Computes y = A x; x and y must not be the same vector.
 */
int32_t las_mul_dense(const struct las_mat_dense *mat,
                      const struct las_vec_dense *x,
                      struct las_vec_dense *y);

/**
 * Computes y = A^T x; x and y must not be the same vector.
 */
int32_t las_mul_transpose_dense(const struct las_mat_dense *mat,
                                const struct las_vec_dense *x,
                                struct las_vec_dense *y);

/**
 * Copies the diagonal: d[i] = A[i, i].
 */
int32_t las_diagonal_dense(const struct las_mat_dense *mat, struct las_vec_dense *d);

/**
 * Inverts the diagonal: d[i] = 1 / A[i, i].
 */
int32_t las_inverse_diagonal_dense(const struct las_mat_dense *mat, struct las_vec_dense *d);

/**
 * Scales the matrix: A *= factor.
 */
int32_t las_scale_dense(struct las_mat_dense *mat, double factor);

/**
 * Creates the matrix a A + b B.
 */
int32_t las_sum_dense(double a,
                      const struct las_mat_dense *first,
                      double b,
                      const struct las_mat_dense *second,
                      struct las_mat_dense **sum);

/**
 * Creates the matrix A B.
 */
int32_t las_product_dense(const struct las_mat_dense *first,
                          const struct las_mat_dense *second,
                          struct las_mat_dense **product);

/**
 * Creates the matrix A^T.
 */
int32_t las_transpose_dense(const struct las_mat_dense *mat, struct las_mat_dense **transpose);

/**
 * Creates a matrix from a Matrix Market file.
 */
int32_t las_read_mat_dense(const struct las_dense *las,
                           const char *file,
                           struct las_mat_dense **mat);

/**
 * Writes a matrix to a Matrix Market file.
 */
int32_t las_write_mat_dense(const struct las_mat_dense *mat, const char *file);

/**
 * Creates a solver for matrices with a pattern, which may be freed afterward.
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
 * Factors a matrix with the solver's pattern, or computes the preconditioner of an iterative method.
 */
int32_t las_factor_dense(struct las_solver_dense *solver,
                         const struct las_mat_dense *mat);

/**
 * Factors a matrix with the solver's pattern if it is positive definite. Returns LAS_SINGULAR if it is not,
 * LAS_UNSUPPORTED if it is declared LAS_UNSYMMETRIC.
 */
int32_t las_factor_definite_dense(struct las_solver_dense *solver,
                                  const struct las_mat_dense *mat);

/**
 * Solves A x = b with the matrix factored last; b and x must not be the same vector. Returns the number of iterations
 * of an iterative method and the norm of its final residual over that of the right-hand side (both 0 for a direct
 * method, which does not compute the residual); these two pointers may be null.
 */
int32_t las_solve_dense(struct las_solver_dense *solver,
                        const struct las_vec_dense *b,
                        struct las_vec_dense *x,
                        int32_t *iterations,
                        double *residual);

/**
 * Solves A x[k] = b[k] for several right-hand sides at once; if one fails, those before it are solved. No vector may
 * occur twice in x, or in both b and x.
 */
int32_t las_solve_many_dense(struct las_solver_dense *solver,
                             int32_t count_of_sides,
                             const struct las_vec_dense *const *b,
                             struct las_vec_dense *const *x);

/**
 * Creates the backend. Free it after all objects created with it.
 */
int32_t las_create_batched(struct las_batched **las);

/**
 * Frees the backend. Null is allowed.
 */
int32_t las_destroy_batched(struct las_batched *las);

/**
 * Creates a vector of `len` zeros.
 */
int32_t las_create_vec_batched(const struct las_batched *las,
                               int32_t len,
                               struct las_vec_batched **vec);

/**
 * Frees a vector. Null is allowed.
 */
int32_t las_destroy_vec_batched(struct las_vec_batched *vec);

/**
 * Returns the number of entries of a vector.
 */
int32_t las_len_vec_batched(const struct las_vec_batched *vec, int32_t *len);

/**
 * y = 0.
 */
int32_t las_zero_vec_batched(struct las_vec_batched *vec);

/**
 * y[rows[i]] += values[i]; negative rows are ignored.
 */
int32_t las_add_vec_batched(struct las_vec_batched *vec,
                            int32_t count,
                            const int32_t *rows,
                            const double *values);

/**
 * y[rows[i]] = values[i]; negative rows are ignored.
 */
int32_t las_set_vec_batched(struct las_vec_batched *vec,
                            int32_t count,
                            const int32_t *rows,
                            const double *values);

/**
 * values[i] = y[rows[i]]; if a row is negative, the value does not change.
 */
int32_t las_get_vec_batched(const struct las_vec_batched *vec,
                            int32_t count,
                            const int32_t *rows,
                            double *values);

/**
 * Returns the array of the entries; it is valid until the next use of the vector.
 */
int32_t las_local_vec_batched(struct las_vec_batched *vec, double **values);

/**
 * Returns the Euclidean norm: one number, or with `batched` one for each of the four lanes.
 */
int32_t las_norm_batched(const struct las_vec_batched *vec, double *norm);

/**
 * Returns the sum of x[i] y[i]: one number, or with `batched` one for each of the four lanes.
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
 * Creates a zero matrix with a pattern, which may be freed afterward.
 */
int32_t las_create_mat_batched(const struct las_batched *las,
                               const struct las_pattern *pattern,
                               struct las_mat_batched **mat);

/**
 * Frees a matrix. Null is allowed.
 */
int32_t las_destroy_mat_batched(struct las_mat_batched *mat);

/**
 * Returns the numbers of rows and columns of a matrix.
 */
int32_t las_shape_mat_batched(const struct las_mat_batched *mat, int32_t *rows, int32_t *cols);

/**
 * A = 0; the pattern does not change.
 */
int32_t las_zero_mat_batched(struct las_mat_batched *mat);

/**
 * Sets whole rows to zero; the pattern does not change.
 */
int32_t las_zero_rows_batched(struct las_mat_batched *mat, int32_t count, const int32_t *rows);

/**
 * A[rows[i], cols[j]] += block[i * cols_count + j]; negative rows and columns are ignored, and so are entries outside
 * the pattern (a library built with debug assertions returns LAS_INDEX for the latter).
 */
int32_t las_add_mat_batched(struct las_mat_batched *mat,
                            int32_t rows_count,
                            const int32_t *rows,
                            int32_t cols_count,
                            const int32_t *cols,
                            const double *block);

/**
 * A[rows[i], cols[j]] = block[i * cols_count + j]; negative rows and columns are ignored, and so are entries outside
 * the pattern (a library built with debug assertions returns LAS_INDEX for the latter).
 */
int32_t las_set_mat_batched(struct las_mat_batched *mat,
                            int32_t rows_count,
                            const int32_t *rows,
                            int32_t cols_count,
                            const int32_t *cols,
                            const double *block);

/**
 * block[i * cols_count + j] = A[rows[i], cols[j]], zero outside the pattern; if a row or column is negative, the value
 * does not change.
 */
int32_t las_get_mat_batched(const struct las_mat_batched *mat,
                            int32_t rows_count,
                            const int32_t *rows,
                            int32_t cols_count,
                            const int32_t *cols,
                            double *block);

/**
 * Creates an empty list of positions.
 */
int32_t las_create_slots_batched(struct las_slots_batched **slots);

/**
 * Frees a list of positions. Null is allowed.
 */
int32_t las_destroy_slots_batched(struct las_slots_batched *slots);

/**
 * Appends the positions of a block, row by row, to a list; a negative index or an entry outside the pattern gets a
 * position at which contributions are dropped (a library built with debug assertions returns LAS_INDEX for the
 * latter).
 */
int32_t las_locate_batched(const struct las_mat_batched *mat,
                           int32_t rows_count,
                           const int32_t *rows,
                           int32_t cols_count,
                           const int32_t *cols,
                           struct las_slots_batched *slots);

/**
 * A[slots[first + k]] += values[k] for k < count; the positions come from a matrix with the same pattern.
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
 * Computes y = A x; x and y must not be the same vector.
 */
int32_t las_mul_batched(const struct las_mat_batched *mat,
                        const struct las_vec_batched *x,
                        struct las_vec_batched *y);

/**
 * Computes y = A^T x; x and y must not be the same vector.
 */
int32_t las_mul_transpose_batched(const struct las_mat_batched *mat,
                                  const struct las_vec_batched *x,
                                  struct las_vec_batched *y);

/**
 * Copies the diagonal: d[i] = A[i, i].
 */
int32_t las_diagonal_batched(const struct las_mat_batched *mat, struct las_vec_batched *d);

/**
 * Inverts the diagonal: d[i] = 1 / A[i, i].
 */
int32_t las_inverse_diagonal_batched(const struct las_mat_batched *mat, struct las_vec_batched *d);

/**
 * Scales the matrix: A *= factor.
 */
int32_t las_scale_batched(struct las_mat_batched *mat, double factor);

/**
 * Creates the matrix a A + b B.
 */
int32_t las_sum_batched(double a,
                        const struct las_mat_batched *first,
                        double b,
                        const struct las_mat_batched *second,
                        struct las_mat_batched **sum);

/**
 * Creates the matrix A B.
 */
int32_t las_product_batched(const struct las_mat_batched *first,
                            const struct las_mat_batched *second,
                            struct las_mat_batched **product);

/**
 * Creates the matrix A^T.
 */
int32_t las_transpose_batched(const struct las_mat_batched *mat,
                              struct las_mat_batched **transpose);

/**
 * Creates a matrix from a Matrix Market file.
 */
int32_t las_read_mat_batched(const struct las_batched *las,
                             const char *file,
                             struct las_mat_batched **mat);

/**
 * Writes a matrix to a Matrix Market file.
 */
int32_t las_write_mat_batched(const struct las_mat_batched *mat, const char *file);

/**
 * Creates a solver for matrices with a pattern, which may be freed afterward.
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
 * Factors a matrix with the solver's pattern, or computes the preconditioner of an iterative method.
 */
int32_t las_factor_batched(struct las_solver_batched *solver,
                           const struct las_mat_batched *mat);

/**
 * Factors a matrix with the solver's pattern if it is positive definite. Returns LAS_SINGULAR if it is not,
 * LAS_UNSUPPORTED if it is declared LAS_UNSYMMETRIC.
 */
int32_t las_factor_definite_batched(struct las_solver_batched *solver,
                                    const struct las_mat_batched *mat);

/**
 * Solves A x = b with the matrix factored last; b and x must not be the same vector. Returns the number of iterations
 * of an iterative method and the norm of its final residual over that of the right-hand side (both 0 for a direct
 * method, which does not compute the residual); these two pointers may be null.
 */
int32_t las_solve_batched(struct las_solver_batched *solver,
                          const struct las_vec_batched *b,
                          struct las_vec_batched *x,
                          int32_t *iterations,
                          double *residual);

/**
 * Solves A x[k] = b[k] for several right-hand sides at once; if one fails, those before it are solved. No vector may
 * occur twice in x, or in both b and x.
 */
int32_t las_solve_many_batched(struct las_solver_batched *solver,
                               int32_t count_of_sides,
                               const struct las_vec_batched *const *b,
                               struct las_vec_batched *const *x);

/**
 * Creates the backend. Free it after all objects created with it.
 */
int32_t las_create_petsc(struct las_petsc **las);

/**
 * Frees the backend. Null is allowed.
 */
int32_t las_destroy_petsc(struct las_petsc *las);

/**
 * Creates a vector of `len` zeros.
 */
int32_t las_create_vec_petsc(const struct las_petsc *las, int32_t len, struct las_vec_petsc **vec);

/**
 * Frees a vector. Null is allowed.
 */
int32_t las_destroy_vec_petsc(struct las_vec_petsc *vec);

/**
 * Returns the number of entries of a vector.
 */
int32_t las_len_vec_petsc(const struct las_vec_petsc *vec, int32_t *len);

/**
 * y = 0.
 */
int32_t las_zero_vec_petsc(struct las_vec_petsc *vec);

/**
 * y[rows[i]] += values[i]; negative rows are ignored.
 */
int32_t las_add_vec_petsc(struct las_vec_petsc *vec,
                          int32_t count,
                          const int32_t *rows,
                          const double *values);

/**
 * y[rows[i]] = values[i]; negative rows are ignored.
 */
int32_t las_set_vec_petsc(struct las_vec_petsc *vec,
                          int32_t count,
                          const int32_t *rows,
                          const double *values);

/**
 * values[i] = y[rows[i]]; if a row is negative, the value does not change.
 */
int32_t las_get_vec_petsc(const struct las_vec_petsc *vec,
                          int32_t count,
                          const int32_t *rows,
                          double *values);

/**
 * Returns the array of the entries; it is valid until the next use of the vector.
 */
int32_t las_local_vec_petsc(struct las_vec_petsc *vec, double **values);

/**
 * Returns the Euclidean norm: one number, or with `batched` one for each of the four lanes.
 */
int32_t las_norm_petsc(const struct las_vec_petsc *vec, double *norm);

/**
 * Returns the sum of x[i] y[i]: one number, or with `batched` one for each of the four lanes.
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
 * Creates a zero matrix with a pattern, which may be freed afterward.
 */
int32_t las_create_mat_petsc(const struct las_petsc *las,
                             const struct las_pattern *pattern,
                             struct las_mat_petsc **mat);

/**
 * Frees a matrix. Null is allowed.
 */
int32_t las_destroy_mat_petsc(struct las_mat_petsc *mat);

/**
 * Returns the numbers of rows and columns of a matrix.
 */
int32_t las_shape_mat_petsc(const struct las_mat_petsc *mat, int32_t *rows, int32_t *cols);

/**
 * A = 0; the pattern does not change.
 */
int32_t las_zero_mat_petsc(struct las_mat_petsc *mat);

/**
 * Sets whole rows to zero; the pattern does not change.
 */
int32_t las_zero_rows_petsc(struct las_mat_petsc *mat, int32_t count, const int32_t *rows);

/**
 * A[rows[i], cols[j]] += block[i * cols_count + j]; negative rows and columns are ignored, and so are entries outside
 * the pattern (a library built with debug assertions returns LAS_INDEX for the latter).
 */
int32_t las_add_mat_petsc(struct las_mat_petsc *mat,
                          int32_t rows_count,
                          const int32_t *rows,
                          int32_t cols_count,
                          const int32_t *cols,
                          const double *block);

/**
 * A[rows[i], cols[j]] = block[i * cols_count + j]; negative rows and columns are ignored, and so are entries outside
 * the pattern (a library built with debug assertions returns LAS_INDEX for the latter).
 */
int32_t las_set_mat_petsc(struct las_mat_petsc *mat,
                          int32_t rows_count,
                          const int32_t *rows,
                          int32_t cols_count,
                          const int32_t *cols,
                          const double *block);

/**
 * block[i * cols_count + j] = A[rows[i], cols[j]], zero outside the pattern; if a row or column is negative, the value
 * does not change.
 */
int32_t las_get_mat_petsc(const struct las_mat_petsc *mat,
                          int32_t rows_count,
                          const int32_t *rows,
                          int32_t cols_count,
                          const int32_t *cols,
                          double *block);

/**
 * Creates an empty list of positions.
 */
int32_t las_create_slots_petsc(struct las_slots_petsc **slots);

/**
 * Frees a list of positions. Null is allowed.
 */
int32_t las_destroy_slots_petsc(struct las_slots_petsc *slots);

/**
 * Appends the positions of a block, row by row, to a list; a negative index or an entry outside the pattern gets a
 * position at which contributions are dropped (a library built with debug assertions returns LAS_INDEX for the
 * latter).
 */
int32_t las_locate_petsc(const struct las_mat_petsc *mat,
                         int32_t rows_count,
                         const int32_t *rows,
                         int32_t cols_count,
                         const int32_t *cols,
                         struct las_slots_petsc *slots);

/**
 * A[slots[first + k]] += values[k] for k < count; the positions come from a matrix with the same pattern.
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
 * Computes y = A x; x and y must not be the same vector.
 */
int32_t las_mul_petsc(const struct las_mat_petsc *mat,
                      const struct las_vec_petsc *x,
                      struct las_vec_petsc *y);

/**
 * Computes y = A^T x; x and y must not be the same vector.
 */
int32_t las_mul_transpose_petsc(const struct las_mat_petsc *mat,
                                const struct las_vec_petsc *x,
                                struct las_vec_petsc *y);

/**
 * Copies the diagonal: d[i] = A[i, i].
 */
int32_t las_diagonal_petsc(const struct las_mat_petsc *mat, struct las_vec_petsc *d);

/**
 * Inverts the diagonal: d[i] = 1 / A[i, i].
 */
int32_t las_inverse_diagonal_petsc(const struct las_mat_petsc *mat, struct las_vec_petsc *d);

/**
 * Scales the matrix: A *= factor.
 */
int32_t las_scale_petsc(struct las_mat_petsc *mat, double factor);

/**
 * Creates the matrix a A + b B.
 */
int32_t las_sum_petsc(double a,
                      const struct las_mat_petsc *first,
                      double b,
                      const struct las_mat_petsc *second,
                      struct las_mat_petsc **sum);

/**
 * Creates the matrix A B.
 */
int32_t las_product_petsc(const struct las_mat_petsc *first,
                          const struct las_mat_petsc *second,
                          struct las_mat_petsc **product);

/**
 * Creates the matrix A^T.
 */
int32_t las_transpose_petsc(const struct las_mat_petsc *mat, struct las_mat_petsc **transpose);

/**
 * Creates a matrix from a Matrix Market file.
 */
int32_t las_read_mat_petsc(const struct las_petsc *las,
                           const char *file,
                           struct las_mat_petsc **mat);

/**
 * Writes a matrix to a Matrix Market file.
 */
int32_t las_write_mat_petsc(const struct las_mat_petsc *mat, const char *file);

/**
 * Creates a solver for matrices with a pattern, which may be freed afterward.
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
 * Factors a matrix with the solver's pattern, or computes the preconditioner of an iterative method.
 */
int32_t las_factor_petsc(struct las_solver_petsc *solver,
                         const struct las_mat_petsc *mat);

/**
 * Factors a matrix with the solver's pattern if it is positive definite. Returns LAS_SINGULAR if it is not,
 * LAS_UNSUPPORTED if it is declared LAS_UNSYMMETRIC.
 */
int32_t las_factor_definite_petsc(struct las_solver_petsc *solver,
                                  const struct las_mat_petsc *mat);

/**
 * Solves A x = b with the matrix factored last; b and x must not be the same vector. Returns the number of iterations
 * of an iterative method and the norm of its final residual over that of the right-hand side (both 0 for a direct
 * method, which does not compute the residual); these two pointers may be null.
 */
int32_t las_solve_petsc(struct las_solver_petsc *solver,
                        const struct las_vec_petsc *b,
                        struct las_vec_petsc *x,
                        int32_t *iterations,
                        double *residual);

/**
 * Solves A x[k] = b[k] for several right-hand sides at once; if one fails, those before it are solved. No vector may
 * occur twice in x, or in both b and x.
 */
int32_t las_solve_many_petsc(struct las_solver_petsc *solver,
                             int32_t count_of_sides,
                             const struct las_vec_petsc *const *b,
                             struct las_vec_petsc *const *x);

/**
 * Creates the backend on the ranks of a communicator, given by its Fortran handle: MPI_Comm_c2f(comm) in C,
 * comm%MPI_VAL in Fortran. MPI must be initialized; the call is collective.
 *
 * On several ranks (las_create_petsc creates the backend on all MPI ranks), every rank runs the same program on the
 * same data: each rank assembles the whole matrix but stores only the rows that it owns, and stores whole vectors.
 * Reading a matrix, multiplying and solving are collective. A program whose ranks assemble only their own elements
 * gets a wrong matrix.
 */
int32_t las_create_on_petsc(int32_t comm,
                            struct las_petsc **las);

/**
 * Writes an option into PETSc's options database: las_set_option_petsc(las, "ksp_type", "gmres"). It affects solvers
 * whose first factorization comes later.
 */
int32_t las_set_option_petsc(const struct las_petsc *las,
                             const char *name,
                             const char *value);

/**
 * Sets a prefix of all option names: with "body_", solvers of objects created later read -body_ksp_type instead of
 * -ksp_type, and las_set_option_petsc writes such names.
 */
int32_t las_set_prefix_petsc(struct las_petsc *las,
                             const char *prefix);

/**
 * Sets the block size (3 by default): ranks own whole blocks, and PETSc is told the block size of a matrix of full
 * blocks.
 */
int32_t las_set_block_size_petsc(struct las_petsc *las,
                                 int32_t size);

/**
 * Sets whether matrices created later are stored by blocks (BAIJ) if they consist of full blocks; 0 disables this.
 */
int32_t las_set_blocked_petsc(struct las_petsc *las,
                              int32_t blocked);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* LAS_H */
