/* Solves a chain of springs with PETSc on all MPI ranks and with the sparse backend. If there is an argument, the
 * library initializes MPI, otherwise the program does. The exit code is 0 if all checks pass. */
#include <math.h>
#include <mpi.h>
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

/* The library initializes and finalizes MPI and PETSc. */
static void library_initializes_mpi(void) {
    struct las_petsc *petsc = NULL, *again = NULL;
    CHECK(las_create_on_petsc(0, &petsc) == LAS_UNSUPPORTED && petsc == NULL);
    CHECK(strcmp(las_message(), "there is no communicator before MPI_Init") == 0);
    OK(las_create_petsc(&petsc));
    OK(las_create_petsc(&again)); /* shares the PETSc session */
    OK(las_destroy_petsc(petsc));
    compare(again, 0);
    OK(las_destroy_petsc(again));
}

/* The program initializes MPI and gives the library a communicator. */
static void program_initializes_mpi(void) {
    int rank = 0;
    MPI_Comm half = MPI_COMM_NULL;
    struct las_petsc *world = NULL, *part = NULL;
    MPI_Init(NULL, NULL);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_split(MPI_COMM_WORLD, rank % 2, rank, &half);
    OK(las_create_petsc(&world));
    OK(las_create_on_petsc(MPI_Comm_c2f(half), &part));
    CHECK(las_set_option_petsc(part, NULL, "cg") == LAS_NULL);
    /* Options of the database override the parameters, but only with this prefix. */
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
    MPI_Comm_free(&half); /* the library has not freed it */
    MPI_Finalize();
}

int main(int argc, char **argv) {
    (void)argv;
    if (argc > 1) {
        library_initializes_mpi();
    } else {
        program_initializes_mpi();
    }
    printf("%d checks failed\n", failures);
    return failures != 0;
}
