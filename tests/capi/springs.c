/* Assembles and solves a chain of springs with two backends in one program, then calls the other functions and provokes
 * errors. The exit code is 0 if all checks pass. LIBRARY_HAS_CHECKS must be defined for a library built with
 * PROFILE=checked. examples/c/first.c is a simpler program. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "las.h"

#define N 50

static int failures = 0;

static void check(int passed, const char *what, int line) {
    if (!passed) {
        printf("line %d: %s (last message: %s)\n", line, what, las_message());
        failures += 1;
    }
}

#define CHECK(condition) check((condition), #condition, __LINE__)
#define OK(call) CHECK((call) == LAS_OK)

/* A chain of N unknowns and springs of stiffness 1, fixed at the left and pulled at the right: u[i] = i + 1. */
static struct las_pattern *chain(void) {
    int start[N + 1], unknowns[2 * N];
    for (int k = 0; k < N; ++k) {
        start[k] = 2 * k;
        unknowns[2 * k] = k - 1; /* -1 at the left: fixed */
        unknowns[2 * k + 1] = k;
    }
    start[N] = 2 * N;
    struct las_pattern *pattern = NULL;
    OK(las_create_pattern_of_elements(N, N, start, unknowns, &pattern));
    return pattern;
}

static const double SPRING[4] = {1, -1, -1, 1};

/* The names of the functions differ only in the name of the backend. */
#define SOLVE(BACKEND)                                                                                                 \
    static void solve_##BACKEND(double u[N]) {                                                                         \
        struct las_##BACKEND *las = NULL;                                                                              \
        struct las_mat_##BACKEND *k = NULL;                                                                            \
        struct las_vec_##BACKEND *f = NULL, *x = NULL;                                                                 \
        struct las_slots_##BACKEND *slots = NULL;                                                                      \
        struct las_solver_##BACKEND *solver = NULL;                                                                    \
        struct las_pattern *pattern = chain();                                                                         \
        struct las_params params;                                                                                      \
        OK(las_create_##BACKEND(&las));                                                                                \
        OK(las_create_mat_##BACKEND(las, pattern, &k));                                                                \
        OK(las_create_vec_##BACKEND(las, N, &f));                                                                      \
        OK(las_create_vec_##BACKEND(las, N, &x));                                                                      \
        OK(las_create_slots_##BACKEND(&slots));                                                                        \
        for (int spring = 0; spring < N; ++spring) {                                                                   \
            int ends[2] = {spring - 1, spring};                                                                        \
            if (spring % 2) {                                                                                          \
                OK(las_add_mat_##BACKEND(k, 2, ends, 2, ends, SPRING));                                                \
            } else {                                                                                                   \
                OK(las_locate_##BACKEND(k, 2, ends, 2, ends, slots));                                                  \
                OK(las_add_at_##BACKEND(k, slots, 4 * (spring / 2), 4, SPRING));                                       \
            }                                                                                                          \
        }                                                                                                              \
        OK(las_finish_mat_##BACKEND(k));                                                                               \
        int last[2] = {N - 1, -1};                                                                                     \
        double pull[2] = {1, 1000};                                                                                    \
        OK(las_add_vec_##BACKEND(f, 2, last, pull));                                                                   \
        OK(las_finish_vec_##BACKEND(f));                                                                               \
        OK(las_default_params(&params));                                                                               \
        OK(las_create_solver_##BACKEND(las, pattern, &params, &solver));                                               \
        CHECK(las_solve_##BACKEND(solver, f, x, NULL, NULL) == LAS_NOT_FACTORED);                                      \
        OK(las_factor_##BACKEND(solver, k));                                                                           \
        int iterations = -1;                                                                                           \
        OK(las_solve_##BACKEND(solver, f, x, &iterations, NULL));                                                      \
        CHECK(iterations == 0);                                                                                        \
        int all[N];                                                                                                    \
        for (int i = 0; i < N; ++i) all[i] = i;                                                                        \
        OK(las_get_vec_##BACKEND(x, N, all, u));                                                                       \
        /* The residual, and the solution by CG. */                                                                    \
        struct las_vec_##BACKEND *y = NULL;                                                                            \
        double norm = 0, dot = 0;                                                                                      \
        OK(las_create_vec_##BACKEND(las, N, &y));                                                                      \
        OK(las_mul_##BACKEND(k, x, y));                                                                                \
        OK(las_axpy_##BACKEND(-1, f, y));                                                                              \
        OK(las_norm_##BACKEND(y, &norm));                                                                              \
        CHECK(norm < 1e-12);                                                                                           \
        OK(las_dot_##BACKEND(f, x, &dot));                                                                             \
        CHECK(fabs(dot - N) < 1e-10);                                                                                  \
        OK(las_destroy_solver_##BACKEND(solver));                                                                      \
        params.method = LAS_CG;                                                                                        \
        double residual = 1;                                                                                           \
        OK(las_create_solver_##BACKEND(las, pattern, &params, &solver));                                               \
        OK(las_factor_##BACKEND(solver, k));                                                                           \
        OK(las_solve_##BACKEND(solver, f, y, &iterations, &residual));                                                 \
        CHECK(iterations > 0 && residual < 1e-10);                                                                     \
        OK(las_axpy_##BACKEND(-1, x, y));                                                                              \
        OK(las_norm_##BACKEND(y, &norm));                                                                              \
        CHECK(norm < 1e-6);                                                                                            \
        OK(las_destroy_solver_##BACKEND(solver));                                                                      \
        /* Two right-hand sides at once. */                                                                            \
        struct las_vec_##BACKEND *z = NULL;                                                                            \
        OK(las_create_vec_##BACKEND(las, N, &z));                                                                      \
        OK(las_default_params(&params));                                                                               \
        OK(las_create_solver_##BACKEND(las, pattern, &params, &solver));                                               \
        OK(las_factor_definite_##BACKEND(solver, k));                                                                  \
        const struct las_vec_##BACKEND *sides[2] = {f, x};                                                             \
        struct las_vec_##BACKEND *both[2] = {y, z}, *twice[2] = {y, y};                                                \
        CHECK(las_solve_many_##BACKEND(solver, 2, sides, twice) == LAS_SIZE);                                          \
        OK(las_solve_many_##BACKEND(solver, 2, sides, both));                                                          \
        OK(las_axpy_##BACKEND(-1, x, y));                                                                              \
        OK(las_norm_##BACKEND(y, &norm));                                                                              \
        CHECK(norm < 1e-10);                                                                                           \
        OK(las_mul_##BACKEND(k, z, y));                                                                                \
        OK(las_axpy_##BACKEND(-1, x, y));                                                                              \
        OK(las_norm_##BACKEND(y, &norm));                                                                              \
        CHECK(norm < 1e-8);                                                                                            \
        OK(las_destroy_vec_##BACKEND(z));                                                                              \
        OK(las_destroy_solver_##BACKEND(solver));                                                                      \
        OK(las_destroy_slots_##BACKEND(slots));                                                                        \
        OK(las_destroy_vec_##BACKEND(y));                                                                              \
        OK(las_destroy_vec_##BACKEND(x));                                                                              \
        OK(las_destroy_vec_##BACKEND(f));                                                                              \
        OK(las_destroy_mat_##BACKEND(k));                                                                              \
        OK(las_destroy_pattern(pattern));                                                                              \
        OK(las_destroy_##BACKEND(las));                                                                                \
    }

SOLVE(sparse)
SOLVE(dense)

/* Products, sums and files of the matrix [[1, 2, 0], [0, 0, 3]]. */
static void products(void) {
    int start[3] = {0, 2, 3}, columns[3] = {0, 1, 2}, rows = 0, cols = 0, len = 0;
    double values[9];
    struct las_pattern *pattern = NULL;
    struct las_sparse *las = NULL;
    struct las_mat_sparse *a = NULL, *t = NULL, *p = NULL, *s = NULL, *back = NULL;
    struct las_vec_sparse *x = NULL, *y = NULL, *d = NULL;
    OK(las_create_pattern(2, 3, start, columns, &pattern));
    OK(las_create_sparse(&las));
    OK(las_create_mat_sparse(las, pattern, &a));
    OK(las_destroy_pattern(pattern)); /* the matrix does not need it anymore */
    int both[2] = {0, 1}, three[3] = {0, 1, 2}, second[1] = {1}, third[1] = {2};
    double first_row[2] = {1, 2}, last[1] = {3};
    OK(las_set_mat_sparse(a, 1, both, 2, both, first_row));
    OK(las_set_mat_sparse(a, 1, second, 1, third, last));
    OK(las_shape_mat_sparse(a, &rows, &cols));
    CHECK(rows == 2 && cols == 3);
    OK(las_transpose_sparse(a, &t));
    OK(las_product_sparse(a, t, &p)); /* [[5, 0], [0, 9]] */
    OK(las_get_mat_sparse(p, 2, both, 2, both, values));
    CHECK(values[0] == 5 && values[1] == 0 && values[2] == 0 && values[3] == 9);
    OK(las_sum_sparse(2, a, -1, a, &s));
    OK(las_scale_sparse(s, 10));
    OK(las_get_mat_sparse(s, 2, both, 3, three, values));
    CHECK(values[0] == 10 && values[1] == 20 && values[2] == 0 && values[5] == 30);
    OK(las_create_vec_sparse(las, 3, &x));
    OK(las_create_vec_sparse(las, 2, &y));
    OK(las_create_vec_sparse(las, 2, &d));
    OK(las_len_vec_sparse(x, &len));
    CHECK(len == 3);
    double *local = NULL;
    OK(las_local_vec_sparse(x, &local));
    local[0] = 1, local[1] = 2, local[2] = 3;
    OK(las_mul_sparse(a, x, y));
    OK(las_get_vec_sparse(y, 2, both, values));
    CHECK(values[0] == 5 && values[1] == 9);
    OK(las_mul_transpose_sparse(a, y, x));
    OK(las_get_vec_sparse(x, 3, three, values));
    CHECK(values[0] == 5 && values[1] == 10 && values[2] == 27);
    OK(las_diagonal_sparse(p, d));
    OK(las_get_vec_sparse(d, 2, both, values));
    CHECK(values[0] == 5 && values[1] == 9);
    OK(las_inverse_diagonal_sparse(p, d));
    OK(las_get_vec_sparse(d, 2, both, values));
    CHECK(values[0] == 0.2);
    OK(las_zero_vec_sparse(d));
    CHECK(las_inverse_diagonal_sparse(a, d) == LAS_SINGULAR); /* a[1, 1] is not in the pattern */
    OK(las_write_mat_sparse(a, "springs.mtx"));
    OK(las_read_mat_sparse(las, "springs.mtx", &back));
    OK(las_get_mat_sparse(back, 2, both, 3, three, values));
    CHECK(values[0] == 1 && values[1] == 2 && values[5] == 3);
    OK(las_zero_rows_sparse(back, 1, second));
    OK(las_zero_mat_sparse(a));
    remove("springs.mtx");
    OK(las_destroy_vec_sparse(d));
    OK(las_destroy_vec_sparse(y));
    OK(las_destroy_vec_sparse(x));
    OK(las_destroy_mat_sparse(back));
    OK(las_destroy_mat_sparse(s));
    OK(las_destroy_mat_sparse(p));
    OK(las_destroy_mat_sparse(t));
    OK(las_destroy_mat_sparse(a));
    OK(las_destroy_sparse(las));
}

/* Multigrid with the one motion on which a chain that is hardly held has almost no force. */
static void multigrid(void) {
    struct las_sparse *las = NULL;
    struct las_mat_sparse *k = NULL;
    struct las_vec_sparse *f = NULL, *x = NULL, *motion = NULL, *other = NULL;
    struct las_solver_sparse *solver = NULL;
    struct las_pattern *pattern = chain();
    struct las_params params;
    OK(las_create_sparse(&las));
    OK(las_create_mat_sparse(las, pattern, &k));
    OK(las_create_vec_sparse(las, N, &f));
    OK(las_create_vec_sparse(las, N, &x));
    OK(las_create_vec_sparse(las, N, &motion));
    OK(las_create_vec_sparse(las, N + 1, &other));
    for (int spring = 0; spring < N; ++spring) {
        int ends[2] = {spring - 1, spring}, row[1] = {spring};
        double one[1] = {1};
        OK(las_add_mat_sparse(k, 2, ends, 2, ends, SPRING));
        OK(las_set_vec_sparse(motion, 1, row, one));
        OK(las_set_vec_sparse(f, 1, row, one));
    }
    OK(las_finish_mat_sparse(k));
    OK(las_default_params(&params));
    params.method = LAS_CG;
    params.preconditioner = LAS_MULTIGRID;
    OK(las_create_solver_sparse(las, pattern, &params, &solver));
    const struct las_vec_sparse *motions[1] = {motion}, *others[1] = {other};
    CHECK(las_set_near_null_space_sparse(solver, 1, others) == LAS_SIZE);
    CHECK(las_set_near_null_space_sparse(solver, 1, NULL) == LAS_NULL);
    OK(las_set_near_null_space_sparse(solver, 1, motions));
    OK(las_destroy_vec_sparse(motion));
    OK(las_factor_sparse(solver, k));
    double residual = 1;
    OK(las_solve_sparse(solver, f, x, NULL, &residual));
    CHECK(residual <= 1e-10);
    OK(las_update_sparse(solver, k));
    OK(las_set_tolerance_sparse(solver, 2));
    CHECK(las_solve_sparse(solver, f, x, NULL, NULL) == LAS_ARGUMENT);
    OK(las_set_tolerance_sparse(solver, 1e-4));
    OK(las_solve_sparse(solver, f, x, NULL, &residual));
    CHECK(residual <= 1e-4);
    OK(las_destroy_solver_sparse(solver));
    OK(las_destroy_vec_sparse(other));
    OK(las_destroy_vec_sparse(x));
    OK(las_destroy_vec_sparse(f));
    OK(las_destroy_mat_sparse(k));
    OK(las_destroy_pattern(pattern));
    OK(las_destroy_sparse(las));
}

static void errors(void) {
    struct las_sparse *las = NULL;
    struct las_vec_sparse *x = NULL, *y = NULL;
    struct las_mat_sparse *k = NULL, *none = NULL;
    struct las_solver_sparse *solver = NULL;
    struct las_pattern *pattern = NULL;
    struct las_params params;
    int beyond[1] = {7}, row[1] = {0}, start[3] = {0, 1, 2}, columns[2] = {0, 5};
    double one[1] = {1}, value = 0;
    CHECK(las_create_sparse(NULL) == LAS_NULL);
    CHECK(strcmp(las_message(), "`las` is a null pointer") == 0);
    OK(las_create_sparse(&las));
    CHECK(las_create_vec_sparse(NULL, 3, &x) == LAS_NULL);
    CHECK(las_create_vec_sparse(las, -3, &x) == LAS_SIZE && x == NULL);
    CHECK(strcmp(las_message(), "`len` is -3; it must not be negative") == 0);
    OK(las_create_vec_sparse(las, 3, &x));
    OK(las_create_vec_sparse(las, 4, &y));
    CHECK(las_add_vec_sparse(x, 1, beyond, one) == LAS_INDEX);
    CHECK(strcmp(las_message(), "`rows[0]` is 7; there are 3") == 0);
    CHECK(las_add_vec_sparse(x, 1, NULL, one) == LAS_NULL);
    CHECK(las_add_vec_sparse(x, -1, row, one) == LAS_SIZE);
    CHECK(las_add_vec_sparse(NULL, 1, row, one) == LAS_NULL);
    CHECK(las_dot_sparse(x, y, &value) == LAS_SIZE);
    CHECK(las_axpy_sparse(1, x, x) == LAS_SIZE);
    CHECK(las_norm_sparse(x, NULL) == LAS_NULL);
    CHECK(las_create_pattern(2, 3, start, columns, &pattern) == LAS_INDEX && pattern == NULL);
    columns[1] = 1;
    OK(las_create_pattern(2, 2, start, columns, &pattern));
    OK(las_create_mat_sparse(las, pattern, &k));
    CHECK(las_mul_sparse(k, x, y) == LAS_SIZE);
    OK(las_default_params(&params));
    params.symmetry = 17;
    CHECK(las_create_solver_sparse(las, pattern, &params, &solver) == LAS_ARGUMENT && solver == NULL);
    CHECK(strcmp(las_message(), "`symmetry` is 17; it must be LAS_DEFINITE, LAS_SYMMETRIC or LAS_UNSYMMETRIC") == 0);
    params.symmetry = LAS_DEFINITE;
    params.method = LAS_CG;
    params.tolerance = 0;
    CHECK(las_create_solver_sparse(las, pattern, &params, &solver) == LAS_ARGUMENT && solver == NULL);
    CHECK(strcmp(las_message(), "`tolerance` is 0; it must be above 0 and below 1") == 0);
    OK(las_default_params(&params));
    CHECK(strchr(las_version(), '.') != NULL);
    OK(las_create_solver_sparse(las, pattern, &params, &solver));
    CHECK(las_factor_sparse(solver, k) == LAS_SINGULAR); /* a zero matrix */
    int left[1] = {0}, right[1] = {1};
#ifdef LIBRARY_HAS_CHECKS
    CHECK(las_add_mat_sparse(k, 1, left, 1, right, one) == LAS_INDEX);
    CHECK(strcmp(las_message(), "(0, 1) is not in the pattern of the matrix") == 0);
#else
    OK(las_add_mat_sparse(k, 1, left, 1, right, one)); /* ignored: not in the pattern */
#endif
    struct las_vec_sparse *nothing[2] = {NULL, NULL};
    const struct las_vec_sparse *sides[2] = {x, x};
    CHECK(las_solve_many_sparse(solver, 2, sides, nothing) == LAS_NULL);
    /* A symmetric matrix of which only one triangle is stored. */
    struct las_pattern *triangle = NULL;
    struct las_solver_sparse *refused = NULL;
    int lower_start[3] = {0, 1, 3}, lower[3] = {0, 0, 1};
    OK(las_create_pattern(2, 2, lower_start, lower, &triangle));
    CHECK(las_create_solver_sparse(las, triangle, &params, &refused) == LAS_SIZE && refused == NULL);
    CHECK(strstr(las_message(), "store both triangles") != NULL);
    OK(las_destroy_pattern(triangle));
    CHECK(las_read_mat_sparse(las, "no/such.mtx", &none) == LAS_FILE && none == NULL);
    CHECK(strstr(las_message(), "no/such.mtx") != NULL);
    OK(las_destroy_solver_sparse(solver));
    OK(las_destroy_mat_sparse(k));
    OK(las_destroy_pattern(pattern));
    OK(las_destroy_vec_sparse(y));
    OK(las_destroy_vec_sparse(x));
    OK(las_destroy_vec_sparse(NULL));
    OK(las_destroy_sparse(las));
}

int main(void) {
    double sparse[N], dense[N];
    solve_sparse(sparse);
    solve_dense(dense);
    for (int i = 0; i < N; ++i) {
        CHECK(fabs(sparse[i] - (i + 1)) < 1e-10);
        CHECK(fabs(sparse[i] - dense[i]) < 1e-10);
    }
    products();
    multigrid();
    errors();
    printf("%d checks failed\n", failures);
    return failures != 0;
}
