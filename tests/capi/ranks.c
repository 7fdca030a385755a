/* A chain of springs on PETSc, on the ranks of MPI, and on the sparse backend, in one program. With an argument MPI is left
 * to the library. Ends with 0 where all of it is right. */
#include <math.h>
#include <mpi.h>
#include <stdio.h>
#include <string.h>

#include "las.h"

#define N 50

static int failures = 0;

static void check(int right, const char *what, int line) {
    if (!right) {
        printf("line %d: %s (last message: %s)\n", line, what, las_message());
        failures += 1;
    }
}

#define CHECK(condition) check((condition), #condition, __LINE__)
#define OK(call) CHECK((call) == LAS_OK)

/* Springs of stiffness 1 between N unknowns in a row, fixed at the left, pulled at the right: u[i] = i + 1. */
#define SOLVE(BACKEND)                                                                                                 \
    static int solve_##BACKEND(const struct las_##BACKEND *las, int method, double u[N]) {                              \
        int start[N + 1], unknowns[2 * N], all[N], last[1] = {N - 1}, iterations = -1;                                  \
        const double spring[4] = {1, -1, -1, 1}, pull[1] = {1};                                                        \
        struct las_pattern *pattern = NULL;                                                                            \
        struct las_mat_##BACKEND *k = NULL;                                                                            \
        struct las_vec_##BACKEND *f = NULL, *x = NULL;                                                                 \
        struct las_solver_##BACKEND *solver = NULL;                                                                    \
        struct las_params params;                                                                                      \
        for (int e = 0; e < N; ++e) {                                                                                  \
            start[e] = 2 * e, unknowns[2 * e] = e - 1, unknowns[2 * e + 1] = e, all[e] = e;                            \
        }                                                                                                              \
        start[N] = 2 * N;                                                                                              \
        OK(las_create_pattern_of_elements(N, N, start, unknowns, &pattern));                                           \
        OK(las_create_mat_##BACKEND(las, pattern, &k));                                                                \
        OK(las_create_vec_##BACKEND(las, N, &f));                                                                      \
        OK(las_create_vec_##BACKEND(las, N, &x));                                                                      \
        for (int e = 0; e < N; ++e) {                                                                                  \
            OK(las_add_mat_##BACKEND(k, 2, unknowns + 2 * e, 2, unknowns + 2 * e, spring));                            \
        }                                                                                                              \
        OK(las_finish_mat_##BACKEND(k));                                                                               \
        OK(las_add_vec_##BACKEND(f, 1, last, pull));                                                                   \
        OK(las_finish_vec_##BACKEND(f));                                                                               \
        OK(las_default_params(&params));                                                                               \
        params.method = method;                                                                                        \
        OK(las_create_solver_##BACKEND(las, pattern, &params, &solver));                                               \
        OK(las_factor_##BACKEND(solver, k));                                                                           \
        OK(las_solve_##BACKEND(solver, f, x, &iterations, NULL));                                                      \
        OK(las_get_vec_##BACKEND(x, N, all, u));                                                                       \
        OK(las_destroy_solver_##BACKEND(solver));                                                                      \
        OK(las_destroy_vec_##BACKEND(x));                                                                              \
        OK(las_destroy_vec_##BACKEND(f));                                                                              \
        OK(las_destroy_mat_##BACKEND(k));                                                                              \
        OK(las_destroy_pattern(pattern));                                                                              \
        return iterations;                                                                                             \
    }

SOLVE(sparse)
SOLVE(petsc)

static void compare(const struct las_petsc *petsc, int iterates) {
    double on_sparse[N], on_petsc[N];
    struct las_sparse *sparse = NULL;
    OK(las_create_sparse(&sparse));
    solve_sparse(sparse, LAS_DIRECT, on_sparse);
    for (int method = LAS_DIRECT; method <= LAS_CG; ++method) {
        int iterations = solve_petsc(petsc, method, on_petsc);
        CHECK((iterations == 0) == (method == LAS_DIRECT && !iterates));
        for (int i = 0; i < N; ++i) {
            CHECK(fabs(on_sparse[i] - (i + 1)) < 1e-10);
            CHECK(fabs(on_petsc[i] - (i + 1)) < 1e-6);
        }
    }
    OK(las_destroy_sparse(sparse));
}

/* The library starts MPI and PETSc, and ends them. */
static void of_the_library(void) {
    struct las_petsc *petsc = NULL, *again = NULL;
    CHECK(las_create_on_petsc(0, &petsc) == LAS_UNSUPPORTED && petsc == NULL);
    CHECK(strcmp(las_message(), "there is no communicator before MPI_Init") == 0);
    OK(las_create_petsc(&petsc));
    OK(las_create_petsc(&again)); /* in the same session */
    OK(las_destroy_petsc(petsc));
    compare(again, 0);
    OK(las_destroy_petsc(again));
}

/* The program starts MPI, and lets the library use a communicator of its own. */
static void of_the_program(void) {
    int rank = 0;
    MPI_Comm half = MPI_COMM_NULL;
    struct las_petsc *world = NULL, *part = NULL;
    MPI_Init(NULL, NULL);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_split(MPI_COMM_WORLD, rank % 2, rank, &half);
    OK(las_create_petsc(&world));
    OK(las_create_on_petsc(MPI_Comm_c2f(half), &part));
    CHECK(las_set_option_petsc(part, NULL, "cg") == LAS_NULL);
    /* The database has the last word, but only under this prefix. */
    OK(las_set_prefix_petsc(part, "part_"));
    OK(las_set_option_petsc(part, "ksp_type", "cg"));
    OK(las_set_option_petsc(part, "ksp_rtol", "1e-12"));
    OK(las_set_option_petsc(part, "pc_type", "jacobi"));
    OK(las_set_block_size_petsc(part, 2));
    OK(las_set_blocked_petsc(part, 1));
    compare(part, 1);
    OK(las_destroy_petsc(part));
    compare(world, 0);
    OK(las_destroy_petsc(world));
    MPI_Comm_free(&half); /* still the program's */
    MPI_Finalize();
}

int main(int argc, char **argv) {
    (void)argv;
    if (argc > 1) {
        of_the_library();
    } else {
        of_the_program();
    }
    printf(failures ? "%d things are wrong\n" : "all is right\n", failures);
    return failures != 0;
}
